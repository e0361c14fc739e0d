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
#include "remote/api/shown_images.h"
#include "remote/glasses/glasses_registration.h"
#include "remote/http/http_handler.h"

namespace limn::remote {

/// Answers that may wait for a client that does not read; with one more the connection ends.
constexpr std::size_t k_max_answers = 512;
/// Messages that a client may send, per second on average and at once.
constexpr double k_messages_per_s = 120, k_messages_at_once = 240;

/// What waits to be sent to a client. Of states and images only the newest is kept, so that a slow reader
/// costs no memory and gets nothing outdated.
class Outbox {
 public:
  void add_answer(std::string text);
  void set_state(std::shared_ptr<const std::string> text) { state_ = std::move(text); }
  void set_image(ImageKind kind, std::shared_ptr<const std::string> bytes);
  /// For glasses: their place in the room, and the parts' poses.
  void set_glasses(std::shared_ptr<const std::string> text) { glasses_ = std::move(text); }
  void set_parts(std::shared_ptr<const std::string> text) { parts_ = std::move(text); }
  /// Sends `bye` with a reason and then ends the connection. A second call does nothing.
  void end(const std::string& why);

  /// The message to send next; nullopt: there is none now, or never again when is_over().
  std::optional<Outgoing> next_message();
  bool is_over() const { return is_ending_ && !bye_; }

 private:
  std::deque<std::string> answers_;
  std::shared_ptr<const std::string> state_, room_, window_, glasses_, parts_;
  std::shared_ptr<const std::string> bye_;
  bool is_ending_ = false;
};

/// Limits how often something happens: a number of times per second, and a number of times at once.
class RateLimit {
 public:
  using Time = std::chrono::steady_clock::time_point;
  RateLimit(double per_second, double at_once) : per_second_(per_second), at_once_(at_once), left_(at_once) {}
  /// Whether it may happen once more, now. If so, it is counted.
  bool allows(Time now);

 private:
  double per_second_, at_once_, left_;
  std::optional<Time> last_;
};

/// A client: one WebSocket of a paired guest. A guest can have several. Belongs to the network's thread.
struct WsClient {
  /// Images of the room (RoomImagePublisher).
  struct Room {
    bool is_wanted = false;
    std::optional<std::uint32_t> in_flight;  ///< The image that was sent and that the page has not shown yet.
    std::optional<std::uint32_t> last_sent;
  };
  struct Frame {
    std::uint32_t number = 0;
    std::vector<std::uint8_t> jpeg;
  };
  /// The window through a tablet's camera (TabletWindows).
  struct Window {
    std::string device;  ///< Empty: the window is closed.
    TabletViewMode parts = TabletViewMode::as_screen;
    std::optional<std::uint32_t> frame_in_flight;  ///< The frame that is being drawn into.
    std::chrono::steady_clock::time_point frame_since;
    std::optional<Frame> next_frame;  ///< The newest frame that came meanwhile.
    ShownImages shown;                ///< By the frames' numbers.

    bool is_open() const { return !device.empty(); }
  };

  /// Glasses that draw the parts themselves (GlassesClients).
  struct Glasses {
    explicit Glasses(const std::string& marker_name)
        : marker(marker_name),
          registration(marker_name, marker_name == k_by_camera ? camera_options() : GlassesOptions{}) {}
    std::string marker;                           ///< The name of the marker on them, or k_by_camera.
    bool has_camera = false;                      ///< The browser gives pictures of their camera.
    std::optional<GlassesViewMessage> announced;  ///< The next binary message is this picture.
    /// When the picture was given to the locator whose answer is awaited.
    std::optional<std::chrono::steady_clock::time_point> locating_since;
    GlassesRegistration registration;
    GlassesState state = GlassesState::waiting;  ///< As all guests know it.
    std::string sent;                            ///< The last message.
    std::chrono::steady_clock::time_point sent_at, viewpoint_at;
  };

  AuthSessions::Guest guest;
  Outbox outbox;
  std::function<void()> wake;  ///< Tells the connection that the outbox has something new.
  RateLimit rate_limit{k_messages_per_s, k_messages_at_once};
  Room room;
  Window window;
  std::optional<Glasses> glasses;  ///< nullopt: it has none on.
  std::chrono::steady_clock::time_point glasses_refused_at;
  std::uint64_t number = 0;  ///< Another one for each client.

  /// The longest message that it may send now, bytes.
  std::size_t longest_message() const {
    return window.is_open() || (glasses && glasses->announced) ? k_longest_frame : k_longest_message;
  }
};

using WsClients = std::vector<std::shared_ptr<WsClient>>;

}  // namespace limn::remote
