#include "tests/web/glasses_walk.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "sim/world.h"

namespace limn::test {
namespace {

using Eigen::Vector3d;
using nlohmann::json;

constexpr double k_degree = std::numbers::pi / 180;
constexpr double k_step_s = 0.01, k_look_round_s = 12, k_station_s = 3, k_move_s = 1;
constexpr int k_stations = 3;
constexpr double k_drift_rad = 0.02 * k_degree, k_drift_m = 0.3e-3;  // in a second

Pose eye_at(const Vector3d& p_eye, const Vector3d& p_target) {
  return looking_at(p_eye, p_target, {0, 0, 1}).inverse() * turned();
}

Pose looking_round(const Vector3d& p_middle, double look, double at_s) {
  const auto wave = [&](double period_s, double phase) {
    return std::sin(2 * std::numbers::pi * at_s / period_s + phase);
  };
  const double side = 0.35 * wave(6.1, 0.3);
  const Vector3d p_eye =
      p_middle + 0.95 * Vector3d(std::sin(side), -std::cos(side), 0.25 + 0.15 * wave(4.7, 1));
  const Vector3d angles = look * Vector3d(0.4 * wave(3.1, 0), 0.55 * wave(3.7, 2), 0.15 * wave(4.1, 1));
  const Pose straight = eye_at(p_eye, p_middle);
  return {straight.rotation * exp_rotation(angles), p_eye};
}

Pose station(const Vector3d& p_middle, int index) {
  const double side = std::array{-0.55, 0.15, 0.7}[static_cast<std::size_t>(index)];
  const double height = std::array{0.1, 0.5, 0.25}[static_cast<std::size_t>(index)];
  return eye_at(p_middle + 0.8 * Vector3d(std::sin(side), -std::cos(side), height), p_middle);
}

}  // namespace

Vector6d noise(std::mt19937_64& rng, double rotation, double translation) {
  std::normal_distribution<double> normal;
  Vector6d delta;
  for (int k = 0; k < 6; ++k) delta[k] = (k < 3 ? rotation : translation) * normal(rng);
  return delta;
}

Pose Walk::eye(double at_s) const {
  const double step = std::clamp(at_s / k_step_s, 0.0, static_cast<double>(world_from_eye.size()) - 1.001);
  const auto i = static_cast<std::size_t>(step);
  return interpolated(world_from_eye[i], world_from_eye[i + 1], step - static_cast<double>(i));
}

Walk walk_through(const Vector3d& p_middle, double look, std::mt19937_64& rng) {
  Walk walk;
  Pose world_from_feed(exp_rotation({0.3, -0.8, 1.9}), {0.7, -1.4, 0.2});
  Pose before = looking_round(p_middle, look, 0);
  const int steps = static_cast<int>((k_look_round_s + k_stations * k_station_s) / k_step_s);
  for (int i = 0; i < steps; ++i) {
    const double at_s = i * k_step_s, since_s = at_s - k_look_round_s;
    Pose eye = looking_round(p_middle, look, at_s);
    if (since_s >= 0) {
      const int index = static_cast<int>(since_s / k_station_s);
      const double share = std::min(1.0, (since_s - index * k_station_s) / k_move_s);
      if (share == 0 || i == 0) before = walk.world_from_eye.back();
      if (share < k_step_s) before = walk.world_from_eye.back();
      eye = interpolated(before, station(p_middle, index), share * share * (3 - 2 * share));
    }
    const double root = std::sqrt(k_step_s);
    const Vector6d drift = noise(rng, root * k_drift_rad, root * k_drift_m);
    const Eigen::Quaterniond by = exp_rotation(drift.head<3>());
    world_from_feed =
        Pose(by * world_from_feed.rotation,
             eye.translation + by * (world_from_feed.translation - eye.translation) + drift.tail<3>());
    walk.world_from_eye.push_back(eye);
    walk.feed_from_eye.push_back(world_from_feed.inverse() * eye);
  }
  return walk;
}

json path_of(const Walk& walk) {
  json out = {{"step_s", k_step_s},
              {"look_round_s", k_look_round_s},
              {"station_s", k_station_s},
              {"stations", k_stations},
              {"poses", json::array()}};
  for (const Pose& pose : walk.feed_from_eye) {
    const Eigen::Quaterniond& q = pose.rotation;
    const Vector3d& t = pose.translation;
    out["poses"].push_back({q.w(), q.x(), q.y(), q.z(), t.x(), t.y(), t.z()});
  }
  return out;
}

}  // namespace limn::test
