#include "core/parallel.h"

#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>
#include <vector>

namespace limn {
namespace {

TEST(Parallel, CallsOnceForEachIndex) {
  std::vector<int> calls(1000);
  parallel_for(1000, [&](int i) { ++calls[static_cast<std::size_t>(i)]; });
  EXPECT_EQ(calls, std::vector<int>(1000, 1));
  parallel_for(0, [&](int) { FAIL() << "there is nothing to do"; });
}

TEST(Parallel, RunsOnAsManyThreadsAsAsked) {
  for (const int threads : {1, 3}) {
    std::atomic<int> runs = 0;
    run_on_threads(threads, [&] { ++runs; });
    EXPECT_EQ(runs, threads);
  }
}

TEST(Parallel, ThrowsTheFirstExceptionAgainAndBeginsNothingMore) {
  std::atomic<int> calls = 0;
  const auto work = [&](int i) {
    ++calls;
    if (i == 3) throw std::runtime_error("three");
  };
  EXPECT_THROW(parallel_for(1000000, work), std::runtime_error);
  EXPECT_LT(calls, 1000000);
}

}  // namespace
}  // namespace limn
