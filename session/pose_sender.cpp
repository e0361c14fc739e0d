#include "session/pose_sender.h"

#include <algorithm>

#include "exchange/poses/free_d.h"
#include "exchange/poses/pose_json.h"
#include "exchange/poses/posi_stage_net.h"

namespace limn::session {
namespace {

constexpr double k_between_names_s = 1;

// An imager looks along z with y down; a studio camera looks along y with z up.
const Eigen::Quaterniond k_imager_from_camera(0.70710678118654752, 0.70710678118654752, 0, 0);

void send_free_d(device::UdpSocket* socket, const std::vector<ForeignPose>& poses) {
  for (std::size_t i = 0; i < poses.size() && i < 256; ++i) {
    if (poses[i].is_lost) continue;  // the form has no word for it
    const auto bytes = exchange::free_d_message(static_cast<int>(i), poses[i].feed_from_sensor);
    if (bytes) socket->send(*bytes);
  }
}

void send_json(device::UdpSocket* socket, const std::vector<ForeignPose>& poses) {
  const std::string text = exchange::json_of_poses("Limn", poses);
  socket->send({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
}

}  // namespace

std::vector<ForeignPose> sent_poses(const scene::Scene& scene, const ComposedFrame& composed) {
  std::vector<ForeignPose> poses;
  const double at_s = seconds_of(composed.shown_at);
  for (const std::string& name : scene::body_names(scene)) {
    ForeignPose pose{name, {}};
    pose.time_s = at_s;
    const auto track = std::ranges::find(composed.tracks, name, &Track::body);
    pose.is_lost = track == composed.tracks.end() || track->tracking == TrackingState::lost;
    if (!pose.is_lost) pose.feed_from_sensor = track->world_from_body;
    poses.push_back(std::move(pose));
  }
  ForeignPose viewer{"viewer", composed.viewer.imager_from_world.inverse() *
                                   Pose(k_imager_from_camera, Eigen::Vector3d::Zero())};
  viewer.time_s = at_s;
  viewer.is_lost = composed.viewer.width == 0;
  poses.push_back(std::move(viewer));
  return poses;
}

Result<PoseSender> PoseSender::open(const std::vector<std::string>& targets) {
  PoseSender out;
  for (const std::string& text : targets) {
    const auto colon = text.find(':');
    const auto protocol = exchange::k_pose_protocols.find(text.substr(0, colon));
    if (colon == std::string::npos || !protocol || *protocol == exchange::PoseProtocol::osc ||
        *protocol == exchange::PoseProtocol::ros)
      return usage_error(
          "--poses-out: expected ros, psn:HOST:PORT, freed:HOST:PORT or json:HOST:PORT (OSC: --osc-to), "
          "found '{}'.",
          text);
    const auto place = device::net_place(text.substr(colon + 1), "127.0.0.1");
    if (!place) return usage_error("--poses-out: {}", place.message());
    auto socket = device::UdpSocket::sending(*place);
    if (!socket) return error("--poses-out: {}", socket.message());
    out.targets_.push_back({*protocol, std::move(*socket)});
  }
  return out;
}

void PoseSender::publish_state(const SessionMoment& moment) {
  if (!moment.shown || targets_.empty()) return;
  const std::vector<ForeignPose> poses = sent_poses(moment.session.setup().scene, moment.session.composed());
  const bool is_name_due = !named_at_ || seconds_between(*named_at_, moment.at) >= k_between_names_s;
  ++frame_;
  for (Target& target : targets_) {
    if (target.protocol == exchange::PoseProtocol::freed) send_free_d(&target.socket, poses);
    if (target.protocol == exchange::PoseProtocol::json) send_json(&target.socket, poses);
    if (target.protocol == exchange::PoseProtocol::psn)
      send_psn(&target.socket, poses, moment.at, is_name_due);
  }
  if (is_name_due) named_at_ = moment.at;
}

void PoseSender::send_psn(device::UdpSocket* socket,
                          const std::vector<ForeignPose>& poses,
                          Stamp at,
                          bool with_names) {
  std::vector<exchange::PsnTracker> trackers;
  for (std::size_t i = 0; i < poses.size(); ++i)
    trackers.push_back(
        {static_cast<std::uint16_t>(i), poses[i].sensor, poses[i].feed_from_sensor, poses[i].is_lost});
  const double at_s = seconds_of(at);
  if (with_names)
    for (const auto& packet : exchange::psn_info(trackers, at_s, frame_)) socket->send(packet);
  for (const auto& packet : exchange::psn_data(trackers, at_s, frame_)) socket->send(packet);
}

}  // namespace limn::session
