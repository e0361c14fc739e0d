#include "tracker/fork_join.h"

#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>
#include <thread>
#include <vector>

namespace limn::tracker {
namespace {

// Sums in steps that each need the step before.
long summed_in_steps(int size, int steps, int count) {
  WorkerTeam team(size);
  std::vector<long> sums(static_cast<std::size_t>(count), 1);
  team.work([&] {
    for (int step = 0; step < steps; ++step) {
      const std::vector<long> before = sums;
      team.parallel_for(count, [&](int i) {
        const auto at = static_cast<std::size_t>(i);
        sums[at] = (before[at] + before[(at + 1) % before.size()]) % 1000003;
      });
    }
  });
  long sum = 0;
  for (const long s : sums) sum = (31 * sum + s) % 1000003;
  return sum;
}

TEST(WorkerTeam, DoesEachShareOnceStepByStep) {
  for (const int count : {1, 2, 7, 64}) {
    const long alone = summed_in_steps(1, 3000, count);
    for (const int size : {2, 3, 5})
      EXPECT_EQ(summed_in_steps(size, 3000, count), alone) << size << ' ' << count;
  }
}

TEST(WorkerTeam, NeedsNobodyButTheLead) {
  const int threads = cv::getNumThreads();
  cv::setNumThreads(1);
  EXPECT_EQ(summed_in_steps(4, 10, 6), summed_in_steps(1, 10, 6));
  cv::setNumThreads(threads);
}

TEST(WorkerTeam, WorksInThreadsOfManyAtOnce) {
  const long alone = summed_in_steps(1, 200, 5);
  std::atomic<int> right = 0;
  std::vector<std::jthread> others;
  for (int i = 0; i < 4; ++i) others.emplace_back([&] { right += summed_in_steps(2, 200, 5) == alone; });
  others.clear();
  EXPECT_EQ(right, 4);
}

TEST(WorkerTeam, ThrowsWhatAShareThrowsWhenAllHaveEnded) {
  WorkerTeam team(3);
  std::atomic<int> ended = 0;
  bool was_thrown = false;
  team.work([&] {
    try {
      team.parallel_for(20, [&](int i) {
        if (i == 3) throw std::runtime_error("the third");
        ++ended;
      });
    } catch (const std::runtime_error&) {
      was_thrown = true;
    }
    EXPECT_EQ(ended, 19);
    team.parallel_for(20, [&](int) { ++ended; });
  });
  EXPECT_TRUE(was_thrown);
  EXPECT_EQ(ended, 39);
  EXPECT_THROW(team.work([] { throw std::runtime_error("the lead"); }), std::runtime_error);
}

}  // namespace
}  // namespace limn::tracker
