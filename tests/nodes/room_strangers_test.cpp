// Programs on the network of a room that do not have its keys.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <set>
#include <thread>

#include "nodes/room_keys.h"
#include "nodes/room_link.h"
#include "tests/nodes/a_room.h"

namespace limn::nodes {
namespace {

using namespace std::chrono_literals;
using test::ARoom;
using test::Peer;
using test::wait_for;

struct Visit {
  int connections = -1, samples = -1;
};

// Starts room_stranger in the background; its output is read by the functions below.
class Stranger {
 public:
  Stranger(const std::string& room, const std::string& what, int seconds)
      : output_(::popen(fmt::format("{} {} {} {}", LIMN_ROOM_STRANGER, room, what, seconds).c_str(), "r")) {}
  ~Stranger() { finish(); }
  Stranger(const Stranger&) = delete;
  Stranger& operator=(const Stranger&) = delete;

  Visit visit() {
    Visit found;
    if (std::fscanf(output_, "%d connections, %d samples", &found.connections, &found.samples) != 2)
      return {};
    return found;
  }
  std::pair<long, long> flood() {
    long sent = 0, received = 0;
    if (std::fscanf(output_, "%ld sent, %ld received", &sent, &received) != 2) return {};
    return {sent, received};
  }
  void finish() {
    if (output_) ::pclose(std::exchange(output_, nullptr));
  }

 private:
  FILE* output_;
};

struct Seen {
  std::set<std::uint64_t> moments;
  std::set<std::string> senders;
  int departures = 0;
};

Seen seen_within(RoomLink& link, double seconds) {
  Seen seen;
  for (const Stamp end = shifted(now(), seconds); now() < end;)
    for (const Received& received : link.take_messages(20ms)) {
      seen.senders.insert(received.from.node);
      if (std::holds_alternative<Departure>(received.message)) ++seen.departures;
      if (const auto* moment = std::get_if<Moment>(&received.message))
        seen.moments.insert(moment->frame.number);
    }
  return seen;
}

double share_of_moments(const Seen& seen) {
  if (seen.moments.empty()) return 0;
  const auto frames = static_cast<double>(*seen.moments.rbegin() - *seen.moments.begin() + 1);
  return static_cast<double>(seen.moments.size()) / frames;
}

TEST(RoomStrangers, AProgramWithoutSecurityReadsAndChangesNothing) {
  const ARoom room;
  const auto node = room.open_link("alpha", RoomRole::node);
  const Peer host(room.folder(), "beta", "host", "moments", 4000);
  ASSERT_TRUE(wait_for<Moment>(*node, "beta"));
  Stranger stranger(room.name(), "visit", 3);
  const Seen seen = seen_within(*node, 3);
  const Visit visit = stranger.visit();
  EXPECT_EQ(visit.connections, 0);
  EXPECT_EQ(visit.samples, 0);
  EXPECT_EQ(seen.senders, std::set<std::string>{"beta"});
  EXPECT_GT(seen.moments.size(), 100u);
  EXPECT_EQ(node->counts().refused, 0u);
}

// The test above would find something if there were something to find.
TEST(RoomStrangers, TwoOfThemMeetEachOther) {
  const ARoom room;
  Stranger one(room.name(), "visit", 3), other(room.name(), "visit", 3);
  for (Stranger* stranger : {&one, &other}) {
    const Visit visit = stranger->visit();
    EXPECT_GT(visit.connections, 0);
    EXPECT_GT(visit.samples, 0);
  }
}

TEST(RoomStrangers, ARoomOfTheSameNameWithOtherKeysIsNamed) {
  const ARoom room;
  const std::filesystem::path folder = room.folder().parent_path() / "other";
  ASSERT_TRUE(create_room(folder, room.name()));
  const auto link = room.open_link("alpha", RoomRole::node);
  const Peer host(folder, "beta", "host", "moments", 4000);
  const Seen seen = seen_within(*link, 8);
  EXPECT_TRUE(seen.senders.empty());
  EXPECT_TRUE(seen.moments.empty());
  const std::vector<std::string> problems = link->problems();
  ASSERT_EQ(problems.size(), 1u);
  EXPECT_NE(problems[0].find("other keys"), std::string::npos) << problems[0];
}

TEST(RoomStrangers, AMachineOfTheRoomIsNoStranger) {
  const ARoom room;
  const auto link = room.open_link("alpha", RoomRole::node);
  const Peer host(room.folder(), "beta", "host", "moments", 4000);
  seen_within(*link, 8);
  for (const std::string& problem : link->problems()) ADD_FAILURE() << problem;
}

// "flood" repeats the room's own datagrams, changed ones and random ones; in "crowd" each datagram announces
// another participant that claims to have keys, which costs the room most.
TEST(RoomStrangers, TenThousandDatagramsASecondDelayNothing) {
  for (const char* what : {"flood", "crowd"}) {
    const ARoom room;
    const auto node = room.open_link("alpha", RoomRole::node);
    const Peer host(room.folder(), "beta", "host", "moments", 20000);
    ASSERT_TRUE(wait_for<Moment>(*node, "beta"));
    const Seen before = seen_within(*node, 3);
    Stranger stranger(room.name(), what, 5);
    const Seen during = seen_within(*node, 5);
    const auto [sent, received] = stranger.flood();
    std::printf("%s: %ld datagrams sent; share of the moments: %.4f before, %.4f during\n", what, sent,
                share_of_moments(before), share_of_moments(during));
    EXPECT_GT(sent, 20000) << what;
    EXPECT_GT(share_of_moments(during), 0.95) << what;
    EXPECT_EQ(during.departures, 0) << what;
    EXPECT_EQ(during.senders, std::set<std::string>{"beta"}) << what;
    EXPECT_EQ(node->counts().refused, 0u) << what;
  }
}

}  // namespace
}  // namespace limn::nodes
