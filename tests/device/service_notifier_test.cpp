// Messages to a service manager; the test is the manager.
#include "device/service_notifier.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <thread>

#include "tests/support/service_manager.h"

namespace limn::device {
namespace {

constexpr int k_more_than_a_queue = 5000;  // net.unix.max_dgram_qlen is 10 to 512

int filled(const ServiceNotifier& notifier) {
  int sent = 0;
  while (sent < k_more_than_a_queue && notifier.send("WATCHDOG=1")) ++sent;
  return sent;
}

TEST(ServiceNotifier, ReportsWhatAFullQueueDoesNotTakeAndTriesAgainForATime) {
  const test::NotifySocket manager;
  setenv("NOTIFY_SOCKET", manager.address().c_str(), 1);
  const auto notifier = ServiceNotifier::from_environment();
  ASSERT_TRUE(notifier.is_open());
  const int sent = filled(notifier);
  ASSERT_GT(sent, 0);
  ASSERT_LT(sent, k_more_than_a_queue) << "the queue has no end";
  EXPECT_FALSE(notifier.send("STOPPING=1"));

  const Stamp begun = now();
  EXPECT_FALSE(notifier.send_within(0.05, "STOPPING=1"));
  EXPECT_GE(seconds_between(begun, now()), 0.05);

  std::thread reader([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    EXPECT_EQ(manager.next(0), "WATCHDOG=1");
  });
  EXPECT_TRUE(notifier.send_within(20, "STOPPING=1"));
  reader.join();
  EXPECT_TRUE(manager.receives("STOPPING=1", 1));
}

TEST(ServiceNotifier, SendsNothingWithoutAManagerAndKnowsItsWatchdog) {
  unsetenv("NOTIFY_SOCKET");
  const auto none = ServiceNotifier::from_environment();
  EXPECT_FALSE(none.is_open());
  EXPECT_TRUE(none.send("READY=1"));
  const test::NotifySocket manager;
  setenv("NOTIFY_SOCKET", manager.address().c_str(), 1);
  setenv("WATCHDOG_USEC", "2500000", 1);
  EXPECT_EQ(ServiceNotifier::from_environment().watchdog_s(), 2.5);
  setenv("WATCHDOG_PID", "1", 1);  // another process
  EXPECT_EQ(ServiceNotifier::from_environment().watchdog_s(), 0);
}

}  // namespace
}  // namespace limn::device
