#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "remote/api/auth_sessions.h"
#include "remote/api/messages.h"
#include "remote/http/http_handler.h"

namespace limn::remote {

/// Answers to messages that may wait for a guest who does not read; with one more the connection ends.
constexpr std::size_t k_max_answers = 512;
/// Messages of a guest: so many a second, and so many at once.
constexpr double k_messages_per_s = 120, k_messages_at_once = 240;

/// What waits to be written to a guest. Of what grows old only the newest is kept, so that a slow reader
/// costs no memory and gets no old news.
class Outbox {
 public:
  void add_answer(std::string text);
  void set_state(std::shared_ptr<const std::string> text) { state_ = std::move(text); }
  void set_image(ImageKind kind, std::shared_ptr<const std::string> bytes);
  /// The last thing that is said; then the connection ends. Only the first one counts.
  void end(const std::string& why);

  /// What is to be written next; nullopt: nothing for now, or, when is_over(), for ever.
  std::optional<Outgoing> next_message();
  bool is_over() const { return is_ending_ && !bye_; }

 private:
  std::deque<std::string> answers_;
  std::shared_ptr<const std::string> state_, room_, window_;
  std::shared_ptr<const std::string> bye_;
  bool is_ending_ = false;
};

/// So many things a second, and so many at once.
class RateLimit {
 public:
  using Time = std::chrono::steady_clock::time_point;
  RateLimit(double per_second, double at_once) : per_second_(per_second), at_once_(at_once), left_(at_once) {}
  /// Whether one more is within it.
  bool allows(Time now);

 private:
  double per_second_, at_once_, left_;
  std::optional<Time> last_;
};

/// A guest's WebSocket, as the Reception knows it.
struct WsClient {
  AuthSessions::Guest guest;
  Outbox outbox;
  std::function<void()> wake;  ///< of the connection: something was put into the outbox
  RateLimit rate_limit{k_messages_per_s, k_messages_at_once};

  bool wants_room = false;
  std::optional<std::uint32_t> room_in_flight;  ///< an image that was sent and not seen yet
  std::optional<std::uint32_t> room_sent;       ///< the last one

  std::string device;                                ///< of the window; empty: it is not on
  TabletViewMode parts = TabletViewMode::as_screen;  ///< that it shows
  struct Frame {
    std::uint32_t number = 0;
    std::vector<std::uint8_t> jpeg;
  };
  std::optional<std::uint32_t> frame_in_flight;  ///< that is being looked at
  std::chrono::steady_clock::time_point frame_since;
  std::optional<Frame> frame_waiting;  ///< the newest of those that came meanwhile

  /// The longest message that it may send, bytes.
  std::size_t longest_message() const { return device.empty() ? k_longest_message : k_longest_frame; }
};

}  // namespace limn::remote
