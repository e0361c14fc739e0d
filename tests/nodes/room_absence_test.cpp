// Programs that do not run, or that nobody hears, for longer than the engine of the others remembers them.

#include <gtest/gtest.h>
#include <signal.h>

#include <thread>

#include "nodes/engine.h"
#include "nodes/room_link.h"
#include "tests/nodes/a_room.h"

namespace limn::nodes {
namespace {

using namespace std::chrono_literals;
using test::ARoom;
using test::Peer;
using test::wait_for;

// As a laptop that slept: its own engine still knows the others, who have forgotten it.
TEST(RoomAbsence, AProgramThatSleptLongIsMetAgain) {
  const ARoom room;
  const auto host = room.open_link("alpha", RoomRole::host);
  const Peer sleeping(room.folder(), "beta", "node", "offer", 1),
      awake(room.folder(), "gamma", "node", "offer", 1);
  ASSERT_TRUE(wait_for<Offer>(*host, "beta"));
  sleeping.send_signal(SIGSTOP);
  ASSERT_TRUE(wait_for<Departure>(*host, "beta"));
  const auto sleep_s = std::chrono::duration<double>(k_memory_s + 4);
  EXPECT_FALSE(
      wait_for<Departure>(*host, "gamma", std::chrono::duration_cast<std::chrono::milliseconds>(sleep_s)));
  sleeping.send_signal(SIGCONT);
  const Stamp woken = now();
  EXPECT_TRUE(wait_for<Offer>(*host, "beta", 10s));
  std::printf("met again after %.2f s\n", seconds_between(woken, now()));
  EXPECT_LT(seconds_between(woken, now()), 3);
  Order order;
  order.to = "beta";
  EXPECT_TRUE(host->send(order));
  EXPECT_TRUE(wait_for<Answer>(*host, "beta", 5s));
  EXPECT_EQ(host->counts().entries, 1u);  // it was the other one that entered again
}

}  // namespace
}  // namespace limn::nodes
