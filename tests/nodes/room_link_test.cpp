// Programs on one machine that meet in a room over its loopback.

#include "nodes/room_link.h"

#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <set>
#include <thread>

#include "core/file.h"
#include "nodes/room_keys.h"
#include "tests/nodes/a_room.h"
#include "tests/nodes/random_messages.h"

namespace limn::nodes {
namespace {

using namespace std::chrono_literals;
using test::ARoom;
using test::Peer;
using test::wait_for;

bool has_engine() {
  const auto maps = read_file("/proc/self/maps");
  return maps && maps->find("libddsc") != std::string::npos;
}

std::string version_of(const std::optional<Received>& received) {
  return received ? std::get<Offer>(received->message).version : "none came";
}

TEST(RoomLink, LoadsTheEngineOnlyForARoom) {
  const ARoom room;
  EXPECT_FALSE(has_engine());
  const auto link = room.open_link("alpha", RoomRole::host);
  EXPECT_TRUE(has_engine());
}

TEST(RoomLink, GivesALateComerTheLastOfferAndSetup) {
  const ARoom room;
  const auto host = room.open_link("alpha", RoomRole::host);
  for (const char* version : {"1", "2", "3"}) {
    Offer offer;
    offer.is_host = true;
    offer.version = version;
    ASSERT_TRUE(host->send(offer));
  }
  ASSERT_TRUE(host->send(test::random_message(test::kind_of<nodes::Setup>(), 5, "beta")));
  std::this_thread::sleep_for(200ms);
  // The late comer here is the other process, so it reports what it got by its answers.
  const Peer peer(room.folder(), "beta", "node", "report");
  const auto answer = wait_for<Answer>(*host, "beta");
  ASSERT_TRUE(answer);
  EXPECT_EQ(std::get<Answer>(answer->message).error, "3");
  EXPECT_EQ(std::get<Answer>(answer->message).image,
            test::to_text(test::random_message(test::kind_of<nodes::Setup>(), 5, "beta")));
}

// Asks the peer for a message until it comes: what is best effort is lost while the two are not yet
// connected.
std::optional<Received> requested(RoomLink& host, std::size_t kind, std::uint64_t i) {
  Order order;
  order.to = "beta";
  order.number = kind + 16 * i;
  std::optional<Received> got;
  for (int attempt = 0; attempt < 10 && !got; ++attempt) {
    EXPECT_TRUE(host.send(order));
    got = wait_for(
        host, [kind](const Received& one) { return one.message.index() == kind; }, 1s);
  }
  return got;
}

TEST(RoomLink, DeliversEveryMessageToTheBit) {
  constexpr std::uint64_t k_seed = 20;
  const ARoom room;
  const auto host = room.open_link("alpha", RoomRole::host);
  const Peer peer(room.folder(), "beta", "node", "replies", k_seed);
  ASSERT_TRUE(wait_for<Offer>(*host, "beta"));
  for (const std::size_t kind :
       {test::kind_of<Offer>(), test::kind_of<ClockRequest>(), test::kind_of<ClockAnswer>(),
        test::kind_of<Answer>(), test::kind_of<Health>(),
        test::kind_of<Detections>()}) {  // those that a node may send
    for (std::uint64_t i = 0; i < 20; ++i) {
      const auto got = requested(*host, kind, i);
      ASSERT_TRUE(got) << "kind " << kind;
      EXPECT_EQ(test::to_text(got->message), test::to_text(test::random_message(kind, k_seed + i, "alpha")))
          << "kind " << kind << ", " << i;
    }
  }
}

TEST(RoomLink, DeliversWhatAHostSendsToTheBit) {
  constexpr std::uint64_t k_seed = 60;
  const ARoom room;
  const auto node = room.open_link("alpha", RoomRole::node);
  ASSERT_TRUE(node->send(Offer{}));
  const Peer host(room.folder(), "beta", "host", "all", k_seed);
  std::set<std::string> expected, got;
  const std::set<std::size_t> kinds = {test::kind_of<nodes::Setup>(), test::kind_of<Moment>(),
                                       test::kind_of<ScreenImage>(), test::kind_of<Order>()};
  for (const std::size_t kind : kinds)
    for (std::uint64_t i = 0; i < 20; ++i)
      expected.insert(test::to_text(test::random_message(kind, k_seed + i, "alpha")));
  wait_for(*node, [&](const Received& one) {
    if (kinds.contains(one.message.index())) got.insert(test::to_text(one.message));
    return got.size() == expected.size();
  });
  EXPECT_EQ(got, expected);
}

TEST(RoomLink, TheNewestMomentWins) {
  const ARoom room;
  const auto node = room.open_link("alpha", RoomRole::node);
  const Peer host(room.folder(), "beta", "host", "moments", 4000);
  ASSERT_TRUE(wait_for<Moment>(*node, "beta"));
  std::this_thread::sleep_for(300ms);  // 18 frames
  int moments = 0;
  for (const Received& received : node->take_messages(0ns)) {
    const auto* moment = std::get_if<Moment>(&received.message);
    if (!moment) continue;
    ++moments;
    EXPECT_LT(seconds_between(moment->frame.painted_at, now()), 0.1);
  }
  EXPECT_EQ(moments, 1);
}

// Two screens at one node: neither loses its image to the other, and what is sent meanwhile comes in time.
TEST(RoomLink, TheNewestImageOfEachScreenWins) {
  const ARoom room;
  const auto node = room.open_link("alpha", RoomRole::node);
  const Peer host(room.folder(), "beta", "host", "screens", 100'000);
  ASSERT_TRUE(wait_for<ScreenImage>(*node, "beta"));
  std::this_thread::sleep_for(400ms);
  std::map<std::string, int> images;
  for (const Received& received : node->take_messages(0ns)) {
    const auto* image = std::get_if<ScreenImage>(&received.message);
    if (!image) continue;
    ++images[image->screen];
    EXPECT_EQ(image->left, std::string(100'000, static_cast<char>(image->number)));
  }
  EXPECT_EQ(images, (std::map<std::string, int>{{"left wall", 1}, {"right wall", 1}}));
}

TEST(RoomLink, SaysWhoWasKilledAndWhoIsBack) {
  const ARoom room;
  const auto host = room.open_link("alpha", RoomRole::host);
  auto peer = std::make_unique<Peer>(room.folder(), "beta", "node", "offer", 1);
  const auto first = wait_for<Offer>(*host, "beta");
  EXPECT_EQ(version_of(first), "1");
  peer->send_signal(SIGKILL);
  const Stamp killed = now();
  const auto gone = wait_for<Departure>(*host, "beta");
  ASSERT_TRUE(gone);
  EXPECT_LT(seconds_between(killed, now()), 1.5);
  EXPECT_EQ(gone->from, first->from);
  peer = std::make_unique<Peer>(room.folder(), "beta", "node", "offer", 2);
  const auto back = wait_for<Offer>(*host, "beta", 3s);
  EXPECT_EQ(version_of(back), "2");
  EXPECT_NE(back->from.run, first->from.run);
}

TEST(RoomLink, SaysWhoLeaves) {
  const ARoom room;
  const auto host = room.open_link("alpha", RoomRole::host);
  Peer peer(room.folder(), "beta", "node", "offer", 1);
  ASSERT_TRUE(wait_for<Offer>(*host, "beta"));
  std::jthread leaving([&] { EXPECT_EQ(peer.leave(), 0); });
  EXPECT_TRUE(wait_for<Departure>(*host, "beta", 3s));
}

// As a laptop that sleeps, or a cable that is pulled for a moment.
TEST(RoomLink, SaysWhoIsSilentAndWhoIsBackWithoutARestart) {
  const ARoom room;
  const auto host = room.open_link("alpha", RoomRole::host);
  const Peer peer(room.folder(), "beta", "node", "offer", 1);
  const auto first = wait_for<Offer>(*host, "beta");
  ASSERT_TRUE(first);
  for (const auto silence : {1500ms, 5000ms}) {  // shorter and longer than the participant's lease
    peer.send_signal(SIGSTOP);
    const Stamp stopped = now();
    EXPECT_TRUE(wait_for<Departure>(*host, "beta", silence)) << silence.count();
    std::this_thread::sleep_until(stopped + silence);
    peer.send_signal(SIGCONT);
    const Stamp woken = now();
    const auto back = wait_for<Offer>(*host, "beta", 5s);
    ASSERT_TRUE(back) << silence.count();
    EXPECT_LT(seconds_between(woken, now()), 3);
    EXPECT_EQ(back->from, first->from);
  }
}

TEST(RoomLink, TwoRunsOfOneNameAreBothThere) {
  const ARoom room;
  const auto host = room.open_link("alpha", RoomRole::host);
  const Peer one(room.folder(), "beta", "node", "offer", 1), other(room.folder(), "beta", "node", "offer", 2);
  std::set<std::string> versions;
  std::set<std::uint64_t> runs;
  wait_for(*host, [&](const Received& received) {
    if (!std::holds_alternative<Offer>(received.message)) return false;
    versions.insert(std::get<Offer>(received.message).version);
    runs.insert(received.from.run);
    return versions.size() == 2;
  });
  EXPECT_EQ(versions, (std::set<std::string>{"1", "2"}));
  EXPECT_EQ(runs.size(), 2u);
}

TEST(RoomLink, ALargeOrderArrivesWholeAndIsAnswered) {
  const ARoom room;
  const auto host = room.open_link("alpha", RoomRole::host);
  const Peer peer(room.folder(), "beta", "node", "offer");
  ASSERT_TRUE(wait_for<Offer>(*host, "beta"));
  Order order;
  order.to = "beta";
  order.image.resize(5 << 20);
  for (std::size_t i = 0; i < order.image.size(); ++i) order.image[i] = static_cast<char>(i * i >> 7);
  for (order.number = 1; order.number <= 3; ++order.number) {
    const Stamp begin = now();
    ASSERT_TRUE(host->send(order));
    const auto answer = wait_for<Answer>(*host, "beta");
    ASSERT_TRUE(answer);
    EXPECT_EQ(std::get<Answer>(answer->message).number, order.number);
    EXPECT_TRUE(std::get<Answer>(answer->message).image == order.image);
    RecordProperty("seconds_there_and_back", std::to_string(seconds_between(begin, now())));
    std::printf("5 MB there and back: %.3f s\n", seconds_between(begin, now()));
  }
}

TEST(RoomLink, ManyOrdersArriveInTheirOrder) {
  const ARoom room;
  const auto host = room.open_link("alpha", RoomRole::host);
  const Peer peer(room.folder(), "beta", "node", "offer");
  ASSERT_TRUE(wait_for<Offer>(*host, "beta"));
  constexpr std::uint64_t k_orders = 200;
  std::jthread sending([&] {
    Order order;
    order.to = "beta";
    order.image.resize(20000);
    for (order.number = 1; order.number <= k_orders; ++order.number) EXPECT_TRUE(host->send(order));
  });
  std::uint64_t next = 1;
  wait_for(*host, [&](const Received& received) {
    const auto* answer = std::get_if<Answer>(&received.message);
    if (!answer) return false;
    EXPECT_EQ(answer->number, next);
    ++next;
    return next > k_orders;
  });
  EXPECT_EQ(next, k_orders + 1);
}

TEST(RoomLink, AnOrderToAMachineThatIsNotThereIsAnError) {
  const ARoom room;
  const auto host = room.open_link("alpha", RoomRole::host);
  Order order;
  order.to = "beta";
  const Status sent = host->send(order);
  ASSERT_FALSE(sent);
  EXPECT_NE(sent.message().find("machine 'beta'"), std::string::npos) << sent.message();
}

// As where a switch blocks multicast.
TEST(RoomLink, FindsAPeerByItsAddress) {
  for (const char* address : {"127.0.0.1", "::1"}) {
    const ARoom room;
    const auto host = room.open_link("alpha", RoomRole::host, {address});
    const Peer peer(room.folder(), "beta", "node", "offer", 3, address);
    EXPECT_EQ(version_of(wait_for<Offer>(*host, "beta", 5s)), "3") << address;
    Order order;
    order.to = "beta";
    EXPECT_TRUE(host->send(order));
    EXPECT_TRUE(wait_for<Answer>(*host, "beta", 5s)) << address;
  }
}

TEST(RoomLink, ANodeCannotSendWhatOnlyAHostMay) {
  const ARoom room;
  const auto node = room.open_link("alpha", RoomRole::node);
  EXPECT_FALSE(node->send(nodes::Setup{}));
  EXPECT_FALSE(node->send(Moment{}));
  EXPECT_FALSE(node->send(ScreenImage{.to = "alpha"}));
  EXPECT_TRUE(node->send(Health{}));
}

TEST(RoomLink, InvalidContentIsNotSent) {
  const ARoom room;
  const auto host = room.open_link("alpha", RoomRole::host);
  Moment moment = test::moment_of_size(1000, 1);
  moment.frame.tracks[0].rms_px = std::numeric_limits<double>::quiet_NaN();
  const Status sent = host->send(moment);
  ASSERT_FALSE(sent);
  EXPECT_NE(sent.message().find("track.rms_px"), std::string::npos) << sent.message();
  EXPECT_FALSE(host->send(Departure{}));
}

// On a loaded machine the slowest moments say little, so the limits are wide; the numbers are printed.
TEST(RoomLink, MomentsOf20KilobytesArriveSoon) {
  const ARoom room;
  const auto node = room.open_link("alpha", RoomRole::node);
  const Peer host(room.folder(), "beta", "host", "moments", 20000);
  ASSERT_TRUE(wait_for<Moment>(*node, "beta"));
  std::vector<double> delays_ms;
  std::set<std::uint64_t> numbers;
  wait_for(*node, [&](const Received& received) {
    const auto* moment = std::get_if<Moment>(&received.message);
    if (!moment) return false;
    delays_ms.push_back(1e3 * seconds_between(moment->frame.painted_at, received.arrived_at));
    numbers.insert(moment->frame.number);
    return delays_ms.size() == 300;
  });
  ASSERT_EQ(delays_ms.size(), 300u);
  std::sort(delays_ms.begin(), delays_ms.end());
  const auto frames = static_cast<double>(*numbers.rbegin() - *numbers.begin() + 1);
  std::printf("20 kB moment, one way: %.3f ms (median), %.3f ms (99 %%), %.1f %% lost\n", delays_ms[150],
              delays_ms[297], 100 - 100 * static_cast<double>(numbers.size()) / frames);
  EXPECT_LT(delays_ms[150], 20);
  EXPECT_GT(static_cast<double>(numbers.size()), 0.9 * frames);
}

}  // namespace
}  // namespace limn::nodes
