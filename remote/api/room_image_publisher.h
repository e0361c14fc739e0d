#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include "core/result.h"
#include "remote/api/auth_sessions.h"
#include "remote/api/shown_images.h"
#include "remote/api/ws_client.h"
#include "remote/http/http.h"
#include "remote/http/http_handler.h"
#include "remote/tablet/image_providers.h"

namespace limn::remote {

/// The shortest time between two images of the room.
constexpr std::chrono::milliseconds k_room_interval{66};
/// After an image of the room no other one is drawn for this multiple of the drawing time, so that projectors
/// are drawn first, even where one processor draws everything. That time is the shorter one of the last two:
/// a single long one, for which a program was linked or projectors showed patterns, says nothing about the
/// next.
constexpr int k_room_rest_factor = 8;
/// During that rest a new client gets the last image, if it is at most this old; otherwise one is drawn at
/// once.
constexpr std::chrono::seconds k_room_image_lasts{3};

/// Sends images of the room to clients that want them: one in flight for each client, and none that a client
/// has already. It decides when an image is drawn and who may see it. Belongs to the network's thread.
class RoomImagePublisher {
 public:
  using Clock = std::chrono::steady_clock;

  /// `clients` and `providers` must outlive this object.
  RoomImagePublisher(const WsClients* clients, const ImageProviders* providers, NetworkPost post)
      : clients_(clients), providers_(providers), post_(std::move(post)) {}

  /// Answers a request for one image as JPEG, drawn now. Status 503: there are no such images, or the guest
  /// must not see the room.
  void send_image(const AuthSessions::Guest& guest, ResponseCallback respond);

  /// Begins or ends the images for a client. Error: this session has no images of the room.
  Status subscribe(const std::shared_ptr<WsClient>& client, bool is_wanted);
  /// The client has shown an image and can get the next one.
  void mark_shown(const std::shared_ptr<WsClient>& client, std::uint32_t image);
  /// Sends the last image to clients that do not have it, and has another one drawn if it is time.
  void update_at(Clock::time_point now);

  /// The camera of an image of the room, in the prototype's frame, if the guest may see the room; else null.
  const Imager* shown_image(const AuthSessions::Guest& guest, std::uint32_t image) const {
    return may_see_room(guest) ? shown_.find(image) : nullptr;
  }

  /// Until then, only guests of this role or a higher one see images of the room.
  void hide(Role role, Clock::time_point until);

 private:
  bool may_see_room(const AuthSessions::Guest& guest) const;
  void draw_image(Clock::time_point now);
  void receive_image(CompositeImage image);
  void send_last_image(const std::shared_ptr<WsClient>& client);

  const WsClients* clients_;
  const ImageProviders* providers_;
  NetworkPost post_;

  bool is_drawing_ = false;
  Clock::time_point drawing_since_, image_came_at_, next_image_at_;
  // For the last image. Before the first one: such that no first image rests longer than images last.
  Clock::duration last_took_ = Clock::duration(k_room_image_lasts) / k_room_rest_factor;
  CompositeImage image_;                        // the last one
  std::uint32_t number_ = 0;                    // its number
  ShownImages shown_;                           // by their numbers
  std::shared_ptr<const std::string> message_;  // its message
  Role image_role_ = Role::look;  // the least role that may see it, even when the room is shown again
  std::pair<Role, Clock::time_point> hidden_{Role::look, Clock::time_point::min()};
};

}  // namespace limn::remote
