#pragma once

#include <functional>

namespace limn {

/// Calls `work` on `threads` threads at once, one of which is the caller's, and returns when all have ended.
/// If the system has no more threads, fewer do the work. The first exception is thrown again at the end.
void run_on_threads(int threads, const std::function<void()>& work);

/// Calls work(i) once for each i from 0 to count - 1, in any order, on as many threads as there are cores.
/// After an exception no further i begins; the first one is thrown again at the end.
void parallel_for(int count, const std::function<void(int)>& work);

}  // namespace limn
