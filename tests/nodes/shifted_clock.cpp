// Gives a program clocks that drift and step, because time namespaces only shift them. To be preloaded; the
// file LIMN_TEST_CLOCK holds three doubles, which may change at any time: the drift, since when
// (CLOCK_BOOTTIME, s), and the step (s). Both apply to CLOCK_MONOTONIC and CLOCK_REALTIME, and absolute waits
// are translated.
#include <dlfcn.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

namespace {

const volatile double* g_clock = nullptr;  // the file's numbers; null: none, and the clocks are the true ones

__attribute__((constructor)) void open_clock() {
  const char* const path = getenv("LIMN_TEST_CLOCK");
  const int file = path ? open(path, O_RDONLY | O_CLOEXEC) : -1;
  void* const at = file < 0 ? MAP_FAILED : mmap(nullptr, 24, PROT_READ, MAP_SHARED, file, 0);
  if (at != MAP_FAILED) g_clock = static_cast<const double*>(at);
  if (file >= 0) close(file);
}

// Without the functions of libc, which this library replaces.
timespec true_time(clockid_t clock) {
  timespec at{};
  syscall(SYS_clock_gettime, clock, &at);
  return at;
}

long long ahead_ns() {
  if (!g_clock) return 0;
  const timespec at = true_time(CLOCK_BOOTTIME);
  const double at_s = static_cast<double>(at.tv_sec) + 1e-9 * static_cast<double>(at.tv_nsec);
  return static_cast<long long>(1e9 * (g_clock[0] * (at_s - g_clock[1]) + g_clock[2]));
}

timespec moved(const timespec& at, long long by_ns) {
  constexpr long long k_second = 1'000'000'000;
  const long long ns = at.tv_sec * k_second + at.tv_nsec + by_ns;
  return {ns / k_second, ns % k_second};
}

bool is_moved(clockid_t clock) { return clock == CLOCK_MONOTONIC || clock == CLOCK_REALTIME; }

}  // namespace

extern "C" {

int clock_gettime(clockid_t clock, timespec* at) noexcept {
  const long result = syscall(SYS_clock_gettime, clock, at);
  if (result == 0 && is_moved(clock)) *at = moved(*at, ahead_ns());
  return static_cast<int>(result);
}

int gettimeofday(timeval* at, void*) noexcept {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  *at = {now.tv_sec, now.tv_nsec / 1000};
  return 0;
}

int pthread_cond_clockwait(pthread_cond_t* condition,
                           pthread_mutex_t* mutex,
                           clockid_t clock,
                           const timespec* until) {
  static const auto next =
      reinterpret_cast<decltype(&pthread_cond_clockwait)>(dlsym(RTLD_NEXT, "pthread_cond_clockwait"));
  const timespec there = moved(*until, is_moved(clock) ? -ahead_ns() : 0);
  return next(condition, mutex, clock, &there);
}

int pthread_cond_timedwait(pthread_cond_t* condition, pthread_mutex_t* mutex, const timespec* until) {
  static const auto next = reinterpret_cast<decltype(&pthread_cond_timedwait)>(
      dlvsym(RTLD_NEXT, "pthread_cond_timedwait", "GLIBC_2.3.2"));
  const timespec there = moved(*until, -ahead_ns());
  return next(condition, mutex, &there);
}
}
