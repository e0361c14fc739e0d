#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "core/result.h"
#include "nodes/messages.h"

namespace limn::nodes {

struct Received {
  Message message;
  Sender from;
  Stamp arrived_at;  ///< on this machine's clock
};

struct RoomLinkOptions {
  std::filesystem::path room;  ///< the room's folder (room_keys.h)
  std::string node;            ///< this machine's name; one name is on the air once
  bool is_host = false;
  std::vector<std::string> peers;  ///< addresses of machines, for networks without multicast; IPv4 or IPv6
  std::vector<std::string> interfaces;  ///< network interfaces to use; empty: all that the engine finds
  double liveliness_s = 0.5;            ///< a machine that is silent for as long has gone
};

/// What a link has counted since it was opened.
struct LinkCounts {
  std::uint64_t received = 0;
  std::uint64_t refused = 0;   ///< messages whose content was not valid; they are left out
  std::uint64_t warnings = 0;  ///< the engine's
  std::uint64_t entries = 1;   ///< how often the room was entered: again after a long sleep
};

/// The connection to the other machines of a room. Messages have the reliability that their comments in
/// messages.h state. Safe from several threads.
class RoomLink {
 public:
  virtual ~RoomLink() = default;

  /// This program's own name and run.
  virtual const Sender& self() const = 0;
  /// Sends to all machines; ClockRequest, ClockAnswer, ScreenImage, Order and Answer are received by the
  /// machine `to` only. A program sends its Offer first, so that the others know of it, and again when it
  /// changes. Setup, Moment, ScreenImage and Order can be sent by a host only, and come to nodes only. Order
  /// and Answer wait some seconds until `to` is connected and has taken earlier ones. Error: the content is
  /// not valid (message_check.h), nobody named `to` is there, or the engine's message. Departure cannot be
  /// sent.
  virtual Status send(const Message& message) = 0;
  /// What has arrived since the last call; waits up to `wait` for something. Of best-effort messages only the
  /// newest of each sender (and camera) is kept. Own messages are not received.
  virtual std::vector<Received> take_messages(std::chrono::nanoseconds wait) = 0;
  virtual LinkCounts counts() const { return {}; }
  /// The engine's warnings of the last 10 seconds, as sentences for people: programs with other keys that
  /// want to enter, no network. Each is also printed when it comes for the first time.
  virtual std::vector<std::string> problems() const { return {}; }
};

/// Opens the connection. The engine is loaded now and only now (a shared library beside the program), so that
/// sessions without a room do not load it. Errors: the engine is not installed, wrong or expired keys, no
/// network interface; each says what to do.
Result<std::unique_ptr<RoomLink>> open_room_link(const RoomLinkOptions& options);

}  // namespace limn::nodes
