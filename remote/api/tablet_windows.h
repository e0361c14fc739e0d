#pragma once

#include <Eigen/Core>
#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "core/result.h"
#include "remote/api/messages.h"
#include "remote/api/ws_client.h"
#include "remote/http/http_handler.h"
#include "remote/tablet/image_providers.h"

namespace limn::remote {

/// How long a frame of a window may take, before the next one is drawn without its answer.
constexpr std::chrono::milliseconds k_frame_timeout{10000};
/// Windows that are open at once.
constexpr std::ptrdiff_t k_max_windows = 8;
/// A guest can have so many of them that others find a place.
constexpr std::ptrdiff_t k_max_windows_of_guest = 2;

/// Tells the session the viewpoint of a guest's tablet, by each image; nullopt: the guest's last window is
/// closed.
using SetViewpoint =
    std::function<void(const std::string& guest, const std::optional<Eigen::Vector3d>& p_viewpoint_world)>;

/// The windows of guests' tablets: takes their frames, has parts drawn into them, and sends them back. A
/// guest can have several windows; one of them is the guest's tablet, whose camera is the viewpoint. Belongs
/// to the network's thread.
class TabletWindows {
 public:
  using Clock = std::chrono::steady_clock;

  /// `clients` and `providers` must outlive this object.
  TabletWindows(const WsClients* clients,
                const ImageProviders* providers,
                SetViewpoint set_viewpoint,
                NetworkPost post)
      : clients_(clients),
        providers_(providers),
        set_viewpoint_(std::move(set_viewpoint)),
        post_(std::move(post)) {}

  /// Opens, changes or closes a client's window. Errors: this session has no windows, or too many are open.
  Status update_window(const std::shared_ptr<WsClient>& client, const WindowMessage& message);
  /// Closes a client's window, if it has one.
  void close_window(const std::shared_ptr<WsClient>& client);
  /// Takes a frame. One frame of a window is drawn at a time; of those that come meanwhile the newest waits.
  /// Errors: no window is open, or the message is no frame.
  Status receive_frame(const std::shared_ptr<WsClient>& client, std::span<const std::uint8_t> bytes);

 private:
  bool is_tablet_window(const std::shared_ptr<WsClient>& client, Clock::time_point now) const;
  void draw_frame(const std::shared_ptr<WsClient>& client, WsClient::Frame frame);
  void send_drawn_frame(const std::shared_ptr<WsClient>& client,
                        std::uint32_t number,
                        const CompositeImage& image);

  // The window that is a guest's tablet: the one that was opened last. When it has given no viewpoint for
  // k_guest_place_lasts_s, the next window that gives one takes its place.
  struct GuestTablet {
    std::weak_ptr<WsClient> client;
    Clock::time_point used_at;  // when it was opened or last gave a viewpoint
  };

  const WsClients* clients_;
  const ImageProviders* providers_;
  SetViewpoint set_viewpoint_;
  NetworkPost post_;
  std::map<std::string, GuestTablet> tablets_;  // by the guest's name
};

}  // namespace limn::remote
