#include "remote/api/glasses_clients.h"

#include <algorithm>
#include <utility>

#include "core/names.h"
#include "remote/glasses/glasses_messages.h"

namespace limn::remote {
namespace {

constexpr std::chrono::milliseconds k_send_interval{100};  // between two places in the room
constexpr std::chrono::seconds k_refusal_interval{1};
constexpr std::chrono::milliseconds k_viewpoint_interval{33};

// The marker's name of the viewer with this body; empty: no viewer of the scene has it.
std::string marker_of(const scene::Scene& scene, const std::string& body) {
  for (std::size_t i = 0; i < scene.viewers.size(); ++i)
    if (scene.viewers[i].marker && scene::viewer_body(i) == body) return scene.viewers[i].marker->text();
  return "";
}

const char* words_of(GlassesState state) {
  switch (state) {
    case GlassesState::waiting:
      return "no camera sees the marker";
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
                                               const std::string& wish) const {
  const std::vector<std::string> all = markers();
  if (all.empty())
    return error(
        "glasses: expected a viewer with a marker in scene.json, found none. Fix a marker to the glasses and "
        R"(add "viewer": {{"marker": "FAMILY:ID", "size_mm": …}}.)");
  if (!wish.empty() && std::find(all.begin(), all.end(), wish) == all.end())
    return error("glasses: marker: expected one of the scene's viewers ({}), found another.",
                 joined_names(all));
  for (const std::string& marker : all)
    if ((wish.empty() || wish == marker) && !user_of(marker, client)) return marker;
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
  LIMN_TRY(const std::string marker, marker_for(client, message.marker));
  if (!client->glasses || client->glasses->marker != marker) client->glasses.emplace(marker);
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
      out.push_back(fmt::format("{}'s glasses ({}): {}", client->guest.name, client->glasses->marker,
                                words_of(client->glasses->registration.state())));
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
  std::string message = glasses_message(glasses.registration, glasses.marker, markers());
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
