#include "tracker/fork_join.h"

#include <thread>
#include <utility>

namespace limn::tracker {

// Spins; yields the processor only in waits that are longer than some microseconds.
void WorkerTeam::pause(int times) {
  constexpr int k_patience = 500;
  if (times % k_patience == 0) std::this_thread::yield();
#ifdef __x86_64__
  __builtin_ia32_pause();
#endif
}

void WorkerTeam::help() {
  wait_until([&] {
    while (run_next()) {
    }
    return has_ended_.load();
  });
}

bool WorkerTeam::run_next() {
  std::uint64_t shares = distributed_;
  do
    if ((shares & 0xFFFF) >= (shares >> 16 & 0xFFFF)) return false;
  while (!distributed_.compare_exchange_weak(shares, shares + 1));
  try {
    call_(work_, static_cast<int>(shares & 0xFFFF));
  } catch (...) {
    if (!has_failed_.exchange(true)) failure_ = std::current_exception();
  }
  --left_;
  return true;
}

void WorkerTeam::distribute(int count, const void* work, Call call) {
  work_ = work;
  call_ = call;
  left_ = count;
  distributed_ = ((distributed_ >> 32) + 1) << 32 | static_cast<std::uint64_t>(count) << 16;
  while (run_next()) {
  }
  wait_until([&] { return left_ == 0; });
  if (has_failed_.exchange(false)) std::rethrow_exception(std::exchange(failure_, nullptr));
}

}  // namespace limn::tracker
