#include "remote/api/room_image_publisher.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "core/json_text.h"
#include "remote/api/responses.h"

namespace limn::remote {
namespace {

const std::string k_room_hidden = "A code for other guests is in the light. The room comes back in a minute.";

}  // namespace

void RoomImagePublisher::hide(Role role, Clock::time_point until) {
  const bool is_hidden = Clock::now() < hidden_.second;
  hidden_ = {is_hidden ? std::max(role, hidden_.first) : role, std::max(until, hidden_.second)};
}

bool RoomImagePublisher::may_see_room(const AuthSessions::Guest& guest) const {
  return guest.role >= hidden_.first || Clock::now() >= hidden_.second;
}

void RoomImagePublisher::send_image(const AuthSessions::Guest& guest, ResponseCallback respond) {
  if (!may_see_room(guest)) return respond(error_response(k_http_unavailable, k_room_hidden));
  if (!providers_->draw_room)
    return respond(error_response(k_http_unavailable, "this session has no live composite."));
  providers_->draw_room([respond = std::move(respond)](const CompositeImage& image) {
    respond(image.jpeg.empty() ? error_response(k_http_not_found, "no camera's picture has come yet.")
                               : uncached_response("image/jpeg", {image.jpeg.begin(), image.jpeg.end()}));
  });
}

Status RoomImagePublisher::subscribe(const std::shared_ptr<WsClient>& client, bool is_wanted) {
  if (is_wanted && !providers_->draw_room) return error("this session has no live composite.");
  if (!client->room.is_wanted) client->room.last_sent.reset();
  client->room.is_wanted = is_wanted;
  client->room.in_flight.reset();
  update_at(Clock::now());
  return {};
}

void RoomImagePublisher::mark_shown(const std::shared_ptr<WsClient>& client, std::uint32_t image) {
  if (client->room.in_flight == image) client->room.in_flight.reset();
  update_at(Clock::now());
}

void RoomImagePublisher::update_at(Clock::time_point now) {
  const bool is_resting = now < next_image_at_, is_recent = now - image_came_at_ < k_room_image_lasts;
  bool is_wanted = false;
  for (const auto& client : *clients_) {
    if (!client->room.is_wanted || client->room.in_flight) continue;
    if (is_resting && client->room.last_sent == number_) continue;
    if (is_resting && is_recent)
      send_last_image(client);
    else
      is_wanted = true;
  }
  if (is_wanted && !is_drawing_) draw_image(now);
}

void RoomImagePublisher::draw_image(Clock::time_point now) {
  is_drawing_ = true;
  drawing_since_ = now;
  providers_->draw_room([this, post = post_](CompositeImage image) {
    post([this, image = std::move(image)] { receive_image(image); });
  });
}

void RoomImagePublisher::receive_image(CompositeImage image) {
  is_drawing_ = false;
  image_came_at_ = Clock::now();
  const Clock::duration took = image_came_at_ - drawing_since_,
                        lasting = std::min(took, std::exchange(last_took_, took));
  next_image_at_ = drawing_since_ + std::max<Clock::duration>(k_room_interval, k_room_rest_factor * lasting);
  if (!message_ || image.jpeg != image_.jpeg || image.json != image_.json) {
    message_ = std::make_shared<const std::string>(
        image_message(ImageKind::room, ++number_, image.json, image.jpeg));
    shown_.add(number_, image.over_prototype);
    image_ = std::move(image);
    image_role_ = drawing_since_ < hidden_.second ? hidden_.first : Role::look;
  }
  for (const auto& client : *clients_)
    if (client->room.is_wanted && !client->room.in_flight && client->room.last_sent != number_)
      send_last_image(client);
}

void RoomImagePublisher::send_last_image(const std::shared_ptr<WsClient>& client) {
  client->room.in_flight = client->room.last_sent = number_;
  const bool may_see = may_see_room(client->guest) && client->guest.role >= image_role_;
  client->outbox.set_image(ImageKind::room,
                           may_see ? message_
                                   : std::make_shared<const std::string>(image_message(
                                         ImageKind::room, number_, json_text({{"why", k_room_hidden}}), {})));
  client->wake();
}

}  // namespace limn::remote
