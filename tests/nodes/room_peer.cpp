// A program that takes part in a room, for tests: room_peer FOLDER NAME host|node WHAT NUMBER [PEER…]. It
// prints "ready" when it has entered, and leaves when its input ends.
//
//   offer NUMBER     offers itself as version NUMBER; answers orders with their own image, and clock requests
//   moments BYTES    offers itself and sends a moment of that size 60 times a second
//   screens BYTES    as a host: sends images of that size for two screens of each node, 15 times a second
//   replies SEED     offers itself; answers order K + 16 I by random_message(K, SEED + I)
//   report           offers itself; answers the host's setup by the version of its offer and the setup as
//   text all SEED         as a host: sends random_message(K, SEED + I) of the kinds that a host alone may
//   send

#include <poll.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <set>
#include <string>
#include <thread>

#include "core/log.h"
#include "nodes/room_link.h"
#include "tests/nodes/random_messages.h"

namespace limn {
namespace {

using namespace nodes;

bool input_has_ended() {
  pollfd input{STDIN_FILENO, POLLIN, 0};
  return ::poll(&input, 1, 0) > 0;
}

void send_or_warn(RoomLink& link, const Message& message) {
  if (const Status sent = link.send(message); !sent) log_warning("{}", sent.message());
}

void answer_messages(RoomLink& link,
                     const std::string& what,
                     std::uint64_t number,
                     std::chrono::nanoseconds wait) {
  for (const Received& received : link.take_messages(wait)) {
    if (const auto* request = std::get_if<ClockRequest>(&received.message))
      send_or_warn(link, ClockAnswer{received.from.node, request->number, request->sent_at,
                                     received.arrived_at, now()});
    const auto* order = std::get_if<Order>(&received.message);
    if (order && what == "replies")
      send_or_warn(link,
                   test::random_message(order->number % 16, number + order->number / 16, received.from.node));
    else if (order)
      send_or_warn(link,
                   Answer{received.from.node, order->number, order->device, {}, order->image, order->at});
  }
}

// Waits for the host's offer and setup.
void report_host(RoomLink& link) {
  std::string version, setup;
  while (version.empty() || setup.empty()) {
    for (const Received& received : link.take_messages(std::chrono::milliseconds(10))) {
      if (const auto* offer = std::get_if<Offer>(&received.message)) version = offer->version;
      if (std::holds_alternative<Setup>(received.message)) setup = test::to_text(received.message);
      if (version.empty() || setup.empty()) continue;
      send_or_warn(link, Answer{received.from.node, 0, version, {}, setup, {}});
    }
  }
}

void send_all(RoomLink& link, std::uint64_t seed) {
  std::string node;
  while (node.empty())
    for (const Received& received : link.take_messages(std::chrono::milliseconds(10)))
      if (std::holds_alternative<Offer>(received.message)) node = received.from.node;
  for (std::uint64_t round = 0; !input_has_ended(); ++round)
    for (const std::size_t kind : {test::kind_of<Setup>(), test::kind_of<Moment>(),
                                   test::kind_of<ScreenImage>(), test::kind_of<Order>()}) {
      send_or_warn(link, test::random_message(kind, seed + round % 20, node));
      std::this_thread::sleep_for(std::chrono::milliseconds(20));  // so that no newer one replaces it
    }
}

void send_screen_images(RoomLink& link, std::uint64_t bytes) {
  std::set<std::string> nodes;
  for (std::uint64_t number = 1; !input_has_ended(); ++number) {
    for (const Received& received : link.take_messages(std::chrono::milliseconds(66)))
      if (std::holds_alternative<Offer>(received.message)) nodes.insert(received.from.node);
    for (const std::string& node : nodes)
      for (const char* screen : {"left wall", "right wall"})
        send_or_warn(link, ScreenImage{.to = node,
                                       .screen = screen,
                                       .number = number,
                                       .left = std::string(bytes, static_cast<char>(number))});
  }
}

int run(const RoomLinkOptions& options, const std::string& what, std::uint64_t number) {
  constexpr auto k_frame = std::chrono::nanoseconds(16'666'667);
  const auto link = open_room_link(options);
  if (!link) {
    std::fprintf(stderr, "%s\n", link.message().c_str());
    return 1;
  }
  Offer offer;
  offer.is_host = options.is_host;
  offer.version = std::to_string(number);
  send_or_warn(**link, offer);
  std::puts("ready");
  std::fflush(stdout);
  if (what == "report") report_host(**link);
  if (what == "all") send_all(**link, number);
  if (what == "screens") send_screen_images(**link, number);
  Stamp next = now();
  for (std::uint64_t frame = 1; !input_has_ended(); ++frame) {
    if (what != "moments") {
      answer_messages(**link, what, number, std::chrono::milliseconds(10));
      continue;
    }
    Moment moment = test::moment_of_size(number, frame);
    moment.frame.painted_at = now();
    send_or_warn(**link, moment);
    next += k_frame;
    while (now() < next) answer_messages(**link, what, number, next - now());
  }
  return 0;
}

}  // namespace
}  // namespace limn

int main(int count, char** words) {
  if (count < 6) return 2;
  limn::nodes::RoomLinkOptions options;
  options.room = words[1];
  options.node = words[2];
  options.is_host = std::string(words[3]) == "host";
  options.interfaces = {"lo"};
  options.peers.assign(words + 6, words + count);
  return limn::run(options, words[4], std::strtoull(words[5], nullptr, 10));
}
