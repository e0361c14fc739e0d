#include "remote/api/tablet_windows.h"

#include <algorithm>
#include <utility>

#include "session/frame_input.h"

namespace limn::remote {

Status TabletWindows::update_window(const std::shared_ptr<WsClient>& client, const WindowMessage& message) {
  if (message.on && !providers_->draw_window) return error("this session has no window.");
  if (!message.on) {
    close_window(client);
    return {};
  }
  std::ptrdiff_t windows = 0, own = 0;
  for (const auto& other : *clients_) {
    if (other == client || !other->window.is_open()) continue;
    ++windows;
    own += other->guest.name == client->guest.name;
  }
  if (windows >= k_max_windows) return error("{} windows are open; no more at once.", windows);
  if (own >= k_max_windows_of_guest)
    return error("{} of your windows are open; close one of them first.", own);
  if (!client->window.is_open()) tablets_[client->guest.name] = {client, Clock::now()};
  client->window.device = message.device;
  client->window.parts = message.parts;
  client->window.next_frame.reset();
  return {};
}

void TabletWindows::close_window(const std::shared_ptr<WsClient>& client) {
  const std::string& name = client->guest.name;
  const bool was_open = !std::exchange(client->window.device, "").empty();
  const auto tablet = tablets_.find(name);
  if (tablet != tablets_.end() && tablet->second.client.lock() == client) tablets_.erase(tablet);
  const bool is_last = std::none_of(clients_->begin(), clients_->end(), [&](const auto& other) {
    return other->guest.name == name && other->window.is_open();
  });
  if (was_open && is_last) set_viewpoint_(name, std::nullopt);
  client->window.next_frame.reset();
}

Status TabletWindows::receive_frame(const std::shared_ptr<WsClient>& client,
                                    std::span<const std::uint8_t> bytes) {
  WsClient::Window& window = client->window;
  if (!window.is_open()) return error("expected a message that begins the window before its pictures.");
  LIMN_TRY(const FrameMessage message, parse_frame(bytes));
  WsClient::Frame frame{message.number, {message.jpeg.begin(), message.jpeg.end()}};
  const bool is_busy = window.frame_in_flight && Clock::now() - window.frame_since < k_frame_timeout;
  if (is_busy)
    window.next_frame = std::move(frame);
  else
    draw_frame(client, std::move(frame));
  return {};
}

// Whether a guest's window is the guest's tablet, or may become it now.
bool TabletWindows::is_tablet_window(const std::shared_ptr<WsClient>& client, Clock::time_point now) const {
  const auto tablet = tablets_.find(client->guest.name);
  return tablet == tablets_.end() || tablet->second.client.lock() == client ||
         now - tablet->second.used_at > std::chrono::duration<double>(session::k_guest_place_lasts_s);
}

void TabletWindows::draw_frame(const std::shared_ptr<WsClient>& client, WsClient::Frame frame) {
  WsClient::Window& window = client->window;
  window.frame_in_flight = frame.number;
  window.frame_since = Clock::now();
  providers_->draw_window(
      {window.device, is_tablet_window(client, window.frame_since) ? client->guest.name : "", window.parts},
      std::move(frame.jpeg),
      [this, post = post_, weak = std::weak_ptr(client), number = frame.number](CompositeImage image) {
        post([this, weak, number, image = std::move(image)] {
          if (const auto client = weak.lock()) send_drawn_frame(client, number, image);
        });
      });
}

void TabletWindows::send_drawn_frame(const std::shared_ptr<WsClient>& client,
                                     std::uint32_t number,
                                     const CompositeImage& image) {
  WsClient::Window& window = client->window;
  if (window.frame_in_flight != number) return;
  window.frame_in_flight.reset();
  if (window.is_open()) {
    const auto now = Clock::now();
    if (image.p_viewpoint_world && is_tablet_window(client, now)) {
      tablets_[client->guest.name] = {client, now};
      set_viewpoint_(client->guest.name, image.p_viewpoint_world);
    }
    window.shown.add(number, image.over_prototype);
    client->outbox.set_image(ImageKind::window, std::make_shared<const std::string>(image_message(
                                                    ImageKind::window, number, image.json, image.jpeg)));
    client->wake();
  }
  if (window.next_frame) draw_frame(client, *std::exchange(window.next_frame, std::nullopt));
}

}  // namespace limn::remote
