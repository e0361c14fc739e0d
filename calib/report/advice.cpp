#include "calib/report/advice.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include "calib/board_print.h"

namespace limn::calib {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double k_edge = 0.2;    // share of an image's side that counts as near its edge
constexpr double k_bare = 0.3;    // share of the cells near an edge; with fewer covered the edge is bare
constexpr int k_edge_cells = 10;  // number of cells along an edge
constexpr double k_wide_tilt_deg = 40;   // span of tilts about an axis that determines a focal length well
constexpr double k_little_depth = 0.15;  // span of distances divided by their middle
constexpr double k_steep = 2;            // error at the volume's end divided by that in its middle
constexpr int k_enough_poses = 8;
constexpr int k_few_poses = 4;           // for each projector
constexpr double k_many_outliers = 0.1;  // share of a device's points
constexpr double k_optimistic = 1.5;     // standard deviation of the held-out normalised residuals
constexpr double k_epipolar_px = 0.5;    // twice the value of a sound calibration (0.25)

double degrees(double radians) { return radians * 180 / std::numbers::pi; }

// Names a place in an image, "upper left", "middle", …, from shares of its width and height.
std::string place_in_image(double x, double y) {
  const std::string vertical = y < 1.0 / 3 ? "upper" : y > 2.0 / 3 ? "lower" : "";
  const std::string horizontal = x < 1.0 / 3 ? "left" : x > 2.0 / 3 ? "right" : "";
  if (vertical.empty() && horizontal.empty()) return "middle";
  if (vertical.empty()) return horizontal;
  if (horizontal.empty()) return vertical + " middle";
  return vertical + " " + horizontal;
}

std::string joined(const std::vector<std::string>& parts) {
  std::string text;
  for (size_t i = 0; i < parts.size(); ++i)
    text += (i == 0 ? "" : i + 1 == parts.size() ? " and " : ", ") + parts[i];
  return text;
}

// Observed pixels of an imager.
struct SeenPixels {
  std::string name;
  int width = 0, height = 0;
  std::vector<Vector2d> px;
};

std::vector<SeenPixels> seen_pixels(const Observations& observations) {
  std::vector<SeenPixels> all;
  for (const auto* devices : {&observations.cameras, &observations.projectors}) {
    for (const CapturedDevice& device : *devices)
      all.push_back({device.name, device.width, device.height, {}});
  }
  for (const CornerObservation& corner : observations.corners)
    all[static_cast<size_t>(corner.camera)].px.push_back(corner.px);
  for (const Match& match : observations.matches)
    all[observations.cameras.size() + static_cast<size_t>(match.projector)].px.push_back(match.px_projector);
  return all;
}

// Share of the cells along each edge with observations: left, right, upper, lower.
std::array<double, 4> edge_coverage(const SeenPixels& seen) {
  std::array<std::array<bool, k_edge_cells>, 4> cells{};
  for (const Vector2d& px : seen.px) {
    const double x = (px.x() + 0.5) / seen.width, y = (px.y() + 0.5) / seen.height;
    const auto cell = [](double share) {
      return static_cast<size_t>(std::clamp(static_cast<int>(share * k_edge_cells), 0, k_edge_cells - 1));
    };
    if (x < k_edge) cells[0][cell(y)] = true;
    if (x > 1 - k_edge) cells[1][cell(y)] = true;
    if (y < k_edge) cells[2][cell(x)] = true;
    if (y > 1 - k_edge) cells[3][cell(x)] = true;
  }
  std::array<double, 4> shares{};
  for (size_t side = 0; side < 4; ++side)
    shares[side] =
        static_cast<double>(std::count(cells[side].begin(), cells[side].end(), true)) / k_edge_cells;
  return shares;
}

void advise_edges(const Observations& observations, std::vector<std::string>* advice) {
  constexpr std::array k_sides = {"left", "right", "upper", "lower"};
  for (const SeenPixels& seen : seen_pixels(observations)) {
    std::vector<std::string> bare;
    const auto shares = edge_coverage(seen);
    for (size_t side = 0; side < 4; ++side) {
      if (shares[side] < k_bare) bare.emplace_back(k_sides[side]);
    }
    if (!bare.empty())
      advice->push_back(fmt::format("{}: add poses near its {} edge{}.", seen.name, joined(bare),
                                    bare.size() > 1 ? "s" : ""));
  }
}

struct Span {
  double low = 0, high = 0;
  void add(double v, bool first) {
    low = first ? v : std::min(low, v);
    high = first ? v : std::max(high, v);
  }
  double width() const { return high - low; }
};

// How the boards stood in front of camera 0: tilt about its vertical and horizontal axis, degrees, and
// distance.
struct Stances {
  int poses = 0;
  Span about_vertical, about_horizontal, distance;
};

Stances stances(const Observations& observations, const Solution& solution) {
  Stances s;
  const Pose& camera_from_world = solution.rig.cameras.front().imager_from_world;
  for (const auto& board : solution.world_from_board) {
    if (!board) continue;
    const Pose camera_from_board = camera_from_world * *board;
    const Vector3d n = camera_from_board.rotation * Vector3d::UnitZ();
    const Vector3d middle(observations.board.width_m() / 2, observations.board.height_m() / 2, 0);
    s.about_vertical.add(degrees(std::atan2(n.x(), n.z())), s.poses == 0);
    s.about_horizontal.add(degrees(std::atan2(n.y(), n.z())), s.poses == 0);
    s.distance.add((camera_from_board * middle).z(), s.poses == 0);
    ++s.poses;
  }
  return s;
}

void advise_stances(const Stances& s, const Assessment& assessment, std::vector<std::string>* advice) {
  const auto tilt = [&](const Span& span, const char* axis) {
    if (span.width() < k_wide_tilt_deg)
      advice->push_back(
          fmt::format("Tilt the board more about the {} axis: its poses span {:.0f} degrees; {:.0f} "
                      "or more are needed to determine the focal lengths.",
                      axis, span.width(), k_wide_tilt_deg));
  };
  tilt(s.about_vertical, "vertical");
  tilt(s.about_horizontal, "horizontal");
  const double middle = (s.distance.low + s.distance.high) / 2;
  if (s.distance.width() < k_little_depth * middle)
    advice->push_back(
        fmt::format("Capture some poses nearer and some farther away: all boards stood between {:.2f} and "
                    "{:.2f} m from the camera.",
                    s.distance.low, s.distance.high));
  if (!rests_on_enough_poses(assessment, s.poses))
    advice->push_back(fmt::format("Add {} more poses: {} are too few to judge accuracy.",
                                  k_enough_poses - s.poses, s.poses));
}

double worst_of(const ErrorMap::Plane& plane) {
  double worst = 0;
  for (const double mm : plane.p95_mm) {
    if (std::isfinite(mm)) worst = std::max(worst, mm);
  }
  return worst;
}

void advise_depths(const Observations& observations,
                   const std::vector<ErrorMap>& maps,
                   std::vector<std::string>* advice) {
  for (const ErrorMap& map : maps) {
    if (map.planes.size() < 3) continue;
    const ErrorMap::Plane &near = map.planes.front(), &far = map.planes.back();
    const double middle = worst_of(map.planes[map.planes.size() / 2]);
    const bool far_is_worse = worst_of(far) >= worst_of(near);
    const ErrorMap::Plane& end = far_is_worse ? far : near;
    if (!(middle > 0) || worst_of(end) < k_steep * middle || worst_of(end) < k_good_mm) continue;
    advice->push_back(fmt::format(
        "{}: capture poses {}, at about {:.2f} m: the error may be {:.1f} mm there, {:.1f} mm in the middle.",
        observations.projectors[static_cast<size_t>(map.projector)].name,
        far_is_worse ? "farther away" : "nearer", end.depth_m, worst_of(end), middle));
  }
}

void advise_devices(const Observations& observations,
                    const Assessment& assessment,
                    std::vector<std::string>* advice) {
  for (size_t i = 0; i < observations.projectors.size(); ++i) {
    std::vector<bool> lit(observations.poses.size());
    for (const Match& match : observations.matches) {
      if (static_cast<size_t>(match.projector) == i) lit[static_cast<size_t>(match.pose)] = true;
    }
    const auto poses = std::count(lit.begin(), lit.end(), true);
    if (poses < k_few_poses)
      advice->push_back(fmt::format("{}: it reaches the board in {} poses only; add poses in its light.",
                                    observations.projectors[i].name, poses));
  }
  for (const DeviceQuality& device : assessment.devices) {
    if (device.points > 0 && device.outliers > k_many_outliers * device.points)
      advice->push_back(
          fmt::format("{}: {} of its {} points are outliers; keep board and devices still, and remove shiny "
                      "things from the view.",
                      device.name, device.outliers, device.points));
  }
}

void advise_trust(const Observations& observations,
                  const Assessment& assessment,
                  std::vector<std::string>* advice) {
  if (assessment.normalised_residuals.held_out.stddev > k_optimistic)
    advice->push_back(fmt::format(
        "Trust the held-out errors more than the stated ones: they are {:.1f} times as large as the "
        "noise explains. A lens model with more values, a flatter board or more poses may help.",
        assessment.normalised_residuals.held_out.stddev));
  for (const EpipolarResidual& pair : assessment.epipolar) {
    if (pair.board.rms_px > k_epipolar_px)
      advice->push_back(fmt::format(
          "{} and {}: the epipolar residual is {:.2f} px even on the board; fix both devices to something "
          "stiff and let the projector warm up.",
          observations.cameras[static_cast<size_t>(pair.camera)].name,
          observations.projectors[static_cast<size_t>(pair.projector)].name, pair.board.rms_px));
  }
}

// For example "1.90 mm at worst, 1.60 m from camera0, upper left of its image", or, on a map that is wider
// than the image, "…, 2.10 m right of its axis and 0.30 m above".
std::optional<std::string> worst_place(const Imager& camera, const ErrorMap& map) {
  const double worst = map.worst_mm();
  for (const ErrorMap::Plane& plane : map.planes) {
    for (size_t i = 0; i < plane.p95_mm.size() && worst > 0; ++i) {
      if (plane.p95_mm[i] != worst) continue;
      const Vector2d place = map.place_of_cell(static_cast<int>(i));
      const std::string text =
          fmt::format("{:.2f} mm at worst, {:.2f} m from {}, ", worst, plane.depth_m, camera.name);
      const auto p = map.point_at(camera, place, plane.depth_m);
      if (!map.is_wider_than_image() || !p)
        return text + place_in_image(place.x(), place.y()) + " of its image";
      return text + fmt::format("{:.2f} m {} of its axis and {:.2f} m {}", std::abs(p->x()),
                                p->x() < 0 ? "left" : "right", std::abs(p->y()),
                                p->y() < 0 ? "above" : "below");
    }
  }
  return std::nullopt;
}

// What keeps the verdict from being better.
std::string reason(const Assessment& assessment, double mm) {
  if (assessment.verdict == Verdict::good) return "";
  std::vector<std::string> reasons;
  const bool reject = assessment.verdict == Verdict::reject;
  const double px_limit = reject ? k_usable_px : k_good_px, mm_limit = reject ? k_usable_mm : k_good_mm;
  const char* better = reject ? "usable" : "good";
  if (!(assessment.held_out.rms_px <= px_limit))
    reasons.push_back(fmt::format("the held-out error is {:.2f} px (at most {} for {})",
                                  assessment.held_out.rms_px, px_limit, better));
  if (!(mm <= mm_limit) && assessment.lens_stddev_px.empty())
    reasons.push_back(fmt::format("the predicted error is above {} mm, the limit of {}", mm_limit, better));
  std::vector<std::string> names;
  for (const Fault& fault : assessment.faults) {
    const std::string name = to_text(fault.name);
    const bool is_named = std::find(names.begin(), names.end(), name) != names.end();
    if (fault.severity != Severity::note && !is_named) names.push_back(name);
  }
  if (!names.empty()) reasons.push_back("faults were found: " + joined(names));
  const auto& on_boards = assessment.held_out_error_mm;
  const double shown = on_boards.empty() ? mm : *std::max_element(on_boards.begin(), on_boards.end());
  if (mm <= mm_limit && mm > std::max(k_fine_mm, k_beyond_boards * shown))
    reasons.push_back("the boards do not determine the accuracy between and beyond them");
  return reasons.empty() ? "" : "Why not better: " + joined(reasons) + ".";
}

// Which length to measure, and how to give it.
std::string length_to_measure(const Board& board) {
  const Vector2d mm = 1e3 * nominal_lengths(board);
  return fmt::format(
      "Measure the board from its first to its last {}, across and down (its text says {:.1f} and {:.1f} "
      "mm), and "
      "give the lengths with --board-measured; everything is as much too large or too small as the board.",
      board.is_circles() ? "circle's centre" : "inner corner", mm.x(), mm.y());
}

// The verdict on cameras alone.
std::string camera_words(const Observations& observations,
                         const Assessment& assessment,
                         const std::string& condition) {
  const auto& lenses = assessment.lens_stddev_px;
  const auto worst = std::max_element(lenses.begin(), lenses.end());
  std::string text = fmt::format(
      "{}: held-out error (corners of poses that the solve has not used) {:.2f} px; the lens of {} is known "
      "to "
      "{:.2f} px (standard deviation over its image){}",
      to_text(assessment.verdict), assessment.held_out.rms_px,
      observations.cameras[static_cast<size_t>(worst - lenses.begin())].name, *worst, condition);
  if (assessment.verdict == Verdict::good) return text + ".";
  const bool reject = assessment.verdict == Verdict::reject;
  const double limit = reject ? k_usable_lens_px : k_good_lens_px;
  if (!(*worst <= limit))
    text += fmt::format("; at most {} px is {}: add tilted poses that fill the image's corners", limit,
                        reject ? "usable" : "good");
  const std::string why = reason(assessment, assessment.worst_predicted_mm());
  return text + "." + (why.empty() ? "" : " " + why);
}

std::string verdict_words(const Observations& observations,
                          const Rig& rig,
                          const Assessment& assessment,
                          bool is_scale_checked) {
  const std::string condition =
      is_scale_checked
          ? ""
          : fmt::format(", if the board is as large as its text says ({}), which nothing has checked",
                        observations.board.text());
  if (observations.projectors.empty()) return camera_words(observations, assessment, condition);
  const auto worst =
      std::max_element(assessment.predicted_error_mm.begin(), assessment.predicted_error_mm.end());
  const auto projector = static_cast<size_t>(worst - assessment.predicted_error_mm.begin());
  std::string text = to_text(assessment.verdict) + ": ";
  if (std::isfinite(*worst)) {
    text += fmt::format("predicted error {:.2f} mm on {}", *worst, observations.projectors[projector].name);
  } else {
    text += fmt::format("the error of {} is unknown", observations.projectors[projector].name);
  }
  const auto& maps = assessment.error_maps;
  const auto map = std::find_if(maps.begin(), maps.end(), [&](const ErrorMap& m) {
    return static_cast<size_t>(m.projector) == projector;
  });
  if (const auto place = map == maps.end() ? std::nullopt : worst_place(rig.cameras.front(), *map))
    text += " (" + *place + ")";
  text += condition;
  const auto& poses = assessment.held_out.poses;
  const auto pose =
      std::max_element(poses.begin(), poses.end(),
                       [](const HeldOutPose& a, const HeldOutPose& b) { return a.rms_px < b.rms_px; });
  text += fmt::format("; held-out error (poses that the solve has not used) {:.2f} px",
                      assessment.held_out.rms_px);
  if (pose != poses.end()) text += fmt::format(", the worst ({}) {:.2f} px", pose->pose, pose->rms_px);
  const std::string why = reason(assessment, *worst);
  return text + "." + (why.empty() ? "" : " " + why);
}

}  // namespace

bool rests_on_enough_poses(const Assessment& assessment, int poses) {
  const std::vector<double>& mm = assessment.predicted_error_mm;
  const bool is_fine = assessment.verdict == Verdict::good && !mm.empty() &&
                       *std::max_element(mm.begin(), mm.end()) <= k_fine_mm;
  return is_fine || poses >= k_enough_poses;
}

Explanation explain(const Observed& observed,
                    const Solution& solution,
                    const Assessment& assessment,
                    bool is_scale_checked) {
  const Observations& observations = observed.observations;
  Explanation words;
  words.verdict = verdict_words(observations, solution.rig, assessment, is_scale_checked);
  if (!is_scale_checked) words.advice.push_back(length_to_measure(observations.board));
  for (const Fault& fault : assessment.advice) words.advice.push_back(to_text(fault));
  advise_edges(observations, &words.advice);
  advise_stances(stances(observations, solution), assessment, &words.advice);
  advise_depths(observations, assessment.error_maps, &words.advice);
  advise_devices(observations, assessment, &words.advice);
  advise_trust(observations, assessment, &words.advice);
  return words;
}

}  // namespace limn::calib
