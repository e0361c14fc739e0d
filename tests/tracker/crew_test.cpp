#include "tracker/crew.h"

#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>
#include <thread>
#include <vector>

namespace limn::tracker {
namespace {

// Sums in steps that all want the one before.
long summed_in_steps(int size, int steps, int count) {
  Crew crew(size);
  std::vector<long> sums(static_cast<std::size_t>(count), 1);
  crew.work([&] {
    for (int step = 0; step < steps; ++step) {
      const std::vector<long> before = sums;
      crew.at_once(count, [&](int i) {
        const auto at = static_cast<std::size_t>(i);
        sums[at] = (before[at] + before[(at + 1) % before.size()]) % 1000003;
      });
    }
  });
  long sum = 0;
  for (const long s : sums) sum = (31 * sum + s) % 1000003;
  return sum;
}

TEST(Crew, DoesEachShareOnceStepByStep) {
  for (const int count : {1, 2, 7, 64}) {
    const long alone = summed_in_steps(1, 3000, count);
    for (const int size : {2, 3, 5})
      EXPECT_EQ(summed_in_steps(size, 3000, count), alone) << size << ' ' << count;
  }
}

TEST(Crew, NeedsNobodyButTheLead) {
  const int threads = cv::getNumThreads();
  cv::setNumThreads(1);
  EXPECT_EQ(summed_in_steps(4, 10, 6), summed_in_steps(1, 10, 6));
  cv::setNumThreads(threads);
}

TEST(Crew, WorksInThreadsOfManyAtOnce) {
  const long alone = summed_in_steps(1, 200, 5);
  std::atomic<int> right = 0;
  std::vector<std::jthread> others;
  for (int i = 0; i < 4; ++i) others.emplace_back([&] { right += summed_in_steps(2, 200, 5) == alone; });
  others.clear();
  EXPECT_EQ(right, 4);
}

TEST(Crew, ThrowsWhatAShareThrowsWhenAllHaveEnded) {
  Crew crew(3);
  std::atomic<int> ended = 0;
  bool was_thrown = false;
  crew.work([&] {
    try {
      crew.at_once(20, [&](int i) {
        if (i == 3) throw std::runtime_error("the third");
        ++ended;
      });
    } catch (const std::runtime_error&) {
      was_thrown = true;
    }
    EXPECT_EQ(ended, 19);
    crew.at_once(20, [&](int) { ++ended; });
  });
  EXPECT_TRUE(was_thrown);
  EXPECT_EQ(ended, 39);
  EXPECT_THROW(crew.work([] { throw std::runtime_error("the lead"); }), std::runtime_error);
}

}  // namespace
}  // namespace limn::tracker
