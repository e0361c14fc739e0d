#include "remote/api/glasses_clients.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "core/json_text.h"
#include "core/names.h"
#include "remote/glasses/glasses_messages.h"

namespace limn::remote {
namespace {

constexpr std::chrono::milliseconds k_send_interval{100};  // between two places in the room
constexpr std::chrono::seconds k_refusal_interval{1};
constexpr std::chrono::milliseconds k_viewpoint_interval{33};
constexpr std::chrono::seconds k_locating_timeout{5};
constexpr double k_view_unit_tolerance = 0.02, k_view_farthest_m = 1000;  // as for poses

// The marker's name of the viewer with this body; empty: no viewer of the scene has it.
std::string marker_of(const scene::Scene& scene, const std::string& body) {
  for (std::size_t i = 0; i < scene.viewers.size(); ++i)
    if (scene.viewers[i].marker && scene::viewer_body(i) == body) return scene.viewers[i].marker->text();
  return "";
}

const char* words_of(GlassesState state, bool by_camera) {
  switch (state) {
    case GlassesState::waiting:
      return by_camera ? "their camera sees no markers" : "no camera sees the marker";
    case GlassesState::looking_round:
      return "being registered";
    case GlassesState::registered:
      return "registered";
    case GlassesState::lost:
      return "without tracking";
    case GlassesState::asleep:
      return "asleep";
  }
  return "";
}

}  // namespace

// The markers of the scene's viewers.
std::vector<std::string> GlassesClients::markers() const {
  std::vector<std::string> out;
  if (scene_)
    for (const scene::Viewer& viewer : scene_->viewers)
      if (viewer.marker) out.push_back(viewer.marker->text());
  return out;
}

std::shared_ptr<WsClient> GlassesClients::user_of(const std::string& marker,
                                                  const std::shared_ptr<WsClient>& but) const {
  for (const auto& client : *clients_)
    if (client != but && client->glasses && client->glasses->marker == marker) return client;
  return nullptr;
}

Result<std::string> GlassesClients::marker_for(const std::shared_ptr<WsClient>& client,
                                               const GlassesMessage& message) const {
  const std::string& wish = message.marker;
  const std::vector<std::string> all = markers();
  const bool has_camera = message.camera && can_locate();
  if (has_camera && (all.empty() || wish == k_by_camera)) return std::string(k_by_camera);
  if (all.empty() || wish == k_by_camera)
    return error(
        "glasses: expected a viewer with a marker in scene.json, or pictures of the glasses' camera "
        "(camera-access), found neither. Fix a marker to the glasses and add "
        R"("viewer": {{"marker": "FAMILY:ID", "size_mm": …}}, or use the window instead.)");
  if (!wish.empty() && std::find(all.begin(), all.end(), wish) == all.end())
    return error("glasses: marker: expected one of the scene's viewers ({}), found another.",
                 joined_names(all));
  for (const std::string& marker : all)
    if ((wish.empty() || wish == marker) && !user_of(marker, client)) return marker;
  if (wish.empty() && has_camera) return std::string(k_by_camera);
  const std::string& taken = wish.empty() ? all.front() : wish;
  return error(
      "glasses: marker {} is on the glasses of {}. Each pair needs a marker of its own: add a viewer with "
      "another marker to scene.json, or take the other pair off.",
      taken, user_of(taken, client)->guest.name);
}

Status GlassesClients::update_glasses(const std::shared_ptr<WsClient>& client,
                                      const GlassesMessage& message) {
  if (!message.on) {
    take_off(client);
    return {};
  }
  LIMN_TRY(const std::string marker, marker_for(client, message));
  if (!client->glasses || client->glasses->marker != marker) client->glasses.emplace(marker);
  client->glasses->has_camera = message.camera && can_locate();
  client->glasses->sent.clear();
  if (!parts_.empty()) client->outbox.set_parts(std::make_shared<const std::string>(parts_));
  client->wake();
  return {};
}

void GlassesClients::take_off(const std::shared_ptr<WsClient>& client) {
  if (!client->glasses) return;
  client->glasses.reset();
  const bool is_last = std::none_of(clients_->begin(), clients_->end(), [&](const auto& other) {
    return other->guest.name == client->guest.name && (other->glasses || other->window.is_open());
  });
  if (is_last) set_viewpoint_(client->guest.name, std::nullopt);
}

std::vector<std::string> GlassesClients::lines() const {
  std::vector<std::string> out;
  for (const auto& client : *clients_)
    if (client->glasses)
      out.push_back(fmt::format(
          "{}'s glasses ({}): {}", client->guest.name, client->glasses->marker,
          words_of(client->glasses->registration.state(), client->glasses->marker == k_by_camera)));
  return out;
}

double GlassesClients::session_s(Clock::time_point now) const {
  return seconds_of(session_at_) + std::chrono::duration<double>(now - at_).count();
}

Status GlassesClients::receive_pose(const std::shared_ptr<WsClient>& client,
                                    const GlassesPoseMessage& message,
                                    Clock::time_point now) {
  Status received = !client->glasses
                        ? Status(error("glasses: expected a message that puts them on before "
                                       "their poses."))
                        : client->glasses->registration.add_eye(message.rotation_wxyz, message.translation_m,
                                                                message.at_s, session_s(now));
  if (received || now - client->glasses_refused_at < k_refusal_interval) return {};
  client->glasses_refused_at = now;
  return received;
}

Status GlassesClients::receive_state(const std::shared_ptr<WsClient>& client,
                                     const GlassesStateMessage& message) {
  if (!client->glasses) return error("glasses: expected a message that puts them on before their state.");
  if (message.is_asleep)
    client->glasses->registration.set_asleep();
  else
    client->glasses->registration.set_lost();
  return {};
}

Status GlassesClients::receive_view(const std::shared_ptr<WsClient>& client,
                                    const GlassesViewMessage& message) {
  if (!client->glasses || client->glasses->marker != k_by_camera)
    return error("glasses: expected a message that puts them on with a camera before its pictures.");
  const StatedLens lens{message.width,      message.height,     message.lens_px[0],
                        message.lens_px[1], message.lens_px[2], message.lens_px[3]};
  // The picture follows in any case; it is read and left out.
  client->glasses->announced = message;
  client->glasses->announced->width = 0;
  if (const Status sound = check_lens(lens); !sound) return error("glasses: {}", sound.message());
  if (!std::isfinite(message.at_s) || !message.rotation_wxyz.allFinite() ||
      std::abs(message.rotation_wxyz.norm() - 1) > k_view_unit_tolerance ||
      !(message.translation_m.norm() < k_view_farthest_m))
    return error(
        "glasses: glasses_view: expected a quaternion of length 1 and a place within {} m, found others. The "
        "picture is left out.",
        k_view_farthest_m);
  client->glasses->announced = message;
  return {};
}

Status GlassesClients::receive_view_image(const std::shared_ptr<WsClient>& client,
                                          std::span<const std::uint8_t> bytes,
                                          Clock::time_point now) {
  WsClient::Glasses& glasses = *client->glasses;
  const GlassesViewMessage view = *std::exchange(glasses.announced, std::nullopt);
  if (view.width == 0) return {};  // it was refused already
  const auto frame = parse_frame(bytes);
  if (!frame) return error("glasses: {}", frame.message());
  if (frame->number != view.image)
    return error("glasses: expected picture {}, found {}.", view.image, frame->number);
  if (glasses.locating_since && now - *glasses.locating_since < k_locating_timeout) return {};
  glasses.locating_since = now;
  const Eigen::Vector4d& lens = view.lens_px;
  providers_->locate_camera(client->number, {view.width, view.height, lens[0], lens[1], lens[2], lens[3]},
                            {frame->jpeg.begin(), frame->jpeg.end()},
                            [this, post = post_, weak = std::weak_ptr(client), view](LocatedCamera camera) {
                              post([this, weak, view, camera = std::move(camera)] {
                                if (const auto client = weak.lock()) take_located(client, view, camera);
                              });
                            });
  return {};
}

void GlassesClients::take_located(const std::shared_ptr<WsClient>& client,
                                  const GlassesViewMessage& view,
                                  const LocatedCamera& camera) {
  if (!client->glasses || client->glasses->marker != k_by_camera) return;
  client->glasses->locating_since.reset();
  GlassesRegistration& registration = client->glasses->registration;
  if (!camera.is_located) {
    registration.set_view_problem(camera.why);
    if (!camera.is_refused || at_ - client->glasses_refused_at < k_refusal_interval) return;
    client->glasses_refused_at = at_;
    client->outbox.add_answer(
        json_text({{"type", "refused"}, {"id", nullptr}, {"why", "glasses: " + camera.why}}));
    client->wake();
    return;
  }
  const Eigen::Vector4d& q = view.rotation_wxyz;
  registration.add_view({view.at_s, Pose(Eigen::Quaterniond(q[0], q[1], q[2], q[3]), view.translation_m),
                         camera.camera_from_world, camera.covariance, camera.by_lens});
}

void GlassesClients::apply_update(const SessionUpdate& update) {
  scene_ = update.scene;
  session_at_ = update.at;
  at_ = update.made_at;
  if (!scene_) return;
  for (const Track& track : update.viewer_tracks) {
    const std::string marker = marker_of(*scene_, track.body);
    for (const auto& client : *clients_)
      if (client->glasses && client->glasses->marker == marker)
        client->glasses->registration.add_marker(
            {seconds_of(track.captured_at), track.world_from_body, track.covariance});
  }
  const std::string parts = glasses_parts_message(update.posed, *scene_, update.scenes);
  if (parts == parts_) return;
  parts_ = parts;
  const auto shared = std::make_shared<const std::string>(parts);
  for (const auto& client : *clients_) {
    if (!client->glasses) continue;
    client->outbox.set_parts(shared);
    client->wake();
  }
}

void GlassesClients::send(const std::shared_ptr<WsClient>& client) {
  WsClient::Glasses& glasses = *client->glasses;
  std::vector<std::string> choices = markers();
  if (glasses.has_camera) choices.emplace_back(k_by_camera);
  std::string message = glasses_message(glasses.registration, glasses.marker, choices);
  if (message == glasses.sent) return;
  client->outbox.set_glasses(std::make_shared<const std::string>(message));
  glasses.sent = std::move(message);
  client->wake();
}

bool GlassesClients::update_at(Clock::time_point now) {
  bool has_changed = false;
  for (const auto& client : *clients_) {
    if (!client->glasses) continue;
    WsClient::Glasses& glasses = *client->glasses;
    glasses.registration.update(session_s(now));
    const GlassesState state = glasses.registration.state();
    if (state != glasses.state || now - glasses.sent_at >= k_send_interval) {
      glasses.sent_at = now;
      send(client);
    }
    has_changed |= std::exchange(glasses.state, state) != state;
    const auto world_from_eye = glasses.registration.world_from_eye();
    if (!world_from_eye || now - glasses.viewpoint_at < k_viewpoint_interval) continue;
    glasses.viewpoint_at = now;
    set_viewpoint_(client->guest.name, world_from_eye->translation);
  }
  return has_changed;
}

}  // namespace limn::remote
