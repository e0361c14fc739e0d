#include "calib/report/history.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>

#include "core/file.h"
#include "core/log.h"
#include "core/median.h"

namespace limn::calib {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Json = nlohmann::ordered_json;

double number_or_infinity(const Json& json) {
  return json.is_number() ? json.get<double>() : std::numeric_limits<double>::infinity();
}

std::vector<DeviceMove> moved_of(const Json& list) {
  std::vector<DeviceMove> all;
  for (const Json& one : list)
    all.push_back({one.at("name"), one.at("degrees"), one.at("mm"), number_or_infinity(one.at("px"))});
  return all;
}

PastCalibration past_of(const Json& entry) {
  return {entry.value("made_at", ""),
          entry.at("verdict"),
          number_or_infinity(entry.at("held_out_px")),
          number_or_infinity(entry.at("worst_px")),
          number_or_infinity(entry.at("predicted_mm")),
          moved_of(entry.value("moved", Json::array()))};
}

// The key numbers of a report, as later reports keep them.
PastCalibration past_of_report(const Json& report) {
  return {report.value("made_at", ""),
          report.at("verdict"),
          number_or_infinity(report.at("held_out").at("rms_px")),
          number_or_infinity(report.at("held_out").at("worst_px")),
          number_or_infinity(report.at("predicted_error_mm").at("p95")),
          moved_of(report.value("moved", Json::array()))};
}

const Imager* same_device(const std::vector<Imager>& earlier, const Imager& now) {
  const auto found = std::find_if(earlier.begin(), earlier.end(), [&](const Imager& imager) {
    return imager.name == now.name && imager.width == now.width && imager.height == now.height;
  });
  return found == earlier.end() ? nullptr : &*found;
}

// World points that this solution's device observes, in camera 0's frame.
std::vector<Vector3d> points_of(const Observations& observations,
                                const Solution& solution,
                                bool is_projector,
                                int device) {
  std::vector<Vector3d> points;
  const Pose& camera_from_world = solution.rig.cameras.front().imager_from_world;
  for (size_t i = 0; is_projector && i < observations.matches.size(); ++i) {
    const Match& match = observations.matches[i];
    const auto& board = solution.world_from_board[static_cast<size_t>(match.pose)];
    if (match.projector != device || !board || solution.match_outlier[i]) continue;
    if (const auto p = surface_point(observations, solution, *board, match))
      points.push_back(camera_from_world * *p);
  }
  for (size_t i = 0; !is_projector && i < observations.corners.size(); ++i) {
    const CornerObservation& seen = observations.corners[i];
    const auto& board = solution.world_from_board[static_cast<size_t>(seen.pose)];
    if (seen.camera == device && board)
      points.push_back(camera_from_world * (*board * observations.board.p_corner(seen.corner)));
  }
  return points;
}

double median_shift(const Imager& before, const Imager& now, const std::vector<Vector3d>& points) {
  std::vector<double> shifts;
  for (const Vector3d& p : points) {
    const auto was = before.project(p), is = now.project(p);
    if (was && is) shifts.push_back((*is - *was).norm());
  }
  return median(std::move(shifts), std::numeric_limits<double>::infinity());
}

Imager relative_to(const Imager& imager, const Imager& camera) {
  Imager made = imager;
  made.imager_from_world = imager.imager_from_world * camera.imager_from_world.inverse();
  return made;
}

}  // namespace

History read_history(const std::filesystem::path& folder) {
  const auto text = read_file(folder / "report.json");
  if (!text) return {};
  History history;
  try {
    const Json report = Json::parse(*text);
    if (report.contains("failure")) return {};  // the solve failed
    for (const Json& entry : report.value("history", Json::array())) history.past.push_back(past_of(entry));
    history.past.push_back(past_of_report(report));
  } catch (const nlohmann::json::exception&) {
    log_warning("{}: cannot be read as the report of an earlier calibration. The rig's history starts anew.",
                (folder / "report.json").string());
    return {};
  }
  const auto surplus = static_cast<std::ptrdiff_t>(history.past.size()) - k_history;
  if (surplus > 0) history.past.erase(history.past.begin(), history.past.begin() + surplus);
  if (auto rig = load_rig(folder); rig && !rig->cameras.empty()) history.rig = *rig;
  return history;
}

std::vector<DeviceMove> device_moves(const Rig& earlier,
                                     const Observations& observations,
                                     const Solution& solution) {
  std::vector<DeviceMove> all;
  const Imager& reference = solution.rig.cameras.front();
  const Imager* reference_before = same_device(earlier.cameras, reference);
  if (!reference_before) return all;
  const auto compare = [&](const Imager& device, const Imager* earlier_device, bool is_projector, size_t i) {
    if (!earlier_device) return;
    const Imager before = relative_to(*earlier_device, *reference_before),
                 now = relative_to(device, reference);
    const Pose &a = before.imager_from_world, &b = now.imager_from_world;
    all.push_back(
        {device.name, angle_between(a.rotation, b.rotation) * 180 / std::numbers::pi,
         (a.inverse().translation - b.inverse().translation).norm() * 1e3,
         median_shift(before, now, points_of(observations, solution, is_projector, static_cast<int>(i)))});
  };
  for (size_t i = 1; i < solution.rig.cameras.size(); ++i)
    compare(solution.rig.cameras[i], same_device(earlier.cameras, solution.rig.cameras[i]), false, i);
  for (size_t i = 0; i < solution.rig.projectors.size(); ++i)
    compare(solution.rig.projectors[i], same_device(earlier.projectors, solution.rig.projectors[i]), true, i);
  return all;
}

}  // namespace limn::calib
