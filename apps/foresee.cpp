#include "apps/foresee.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>

#include "apps/plan_page.h"
#include "calib/judge/assess.h"
#include "calib/judge/propagate.h"
#include "calib/predict.h"
#include "calib/solve.h"
#include "core/config.h"
#include "core/file.h"
#include "core/log.h"
#include "tracker/pose_fit.h"

namespace limn::apps {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double k_degree = std::numbers::pi / 180;
constexpr double k_board_tilt = 25 * k_degree;  // of placements, largest: as config/README.md advises
constexpr double k_least_facing = 0.26;         // cosine of 75 degrees: beyond it boards are not read
constexpr int k_least_corners = 12;             // of a board that a camera reads
constexpr int k_grid = 9;                       // points along each side of the volume
constexpr std::uint64_t k_noise_seed = 20261122;
constexpr double k_two_sided_95 = 1.96;  // standard deviations
const std::array<Vector2d, 4> k_corners = {
    Vector2d(-1, -1), {1, -1}, {1, 1}, {-1, 1}};  // of a marker, halves of its side

// What is asked of a rig; past these there is advice. Error: calib's `good`.
constexpr double k_least_angle_deg = 15, k_most_angle_deg = 60, k_least_coverage = 0.9, k_most_pixel_mm = 1.5;
constexpr double k_most_steep_deg = 60;   // there a pixel is twice as long as wide
constexpr double k_least_marker_px = 32;  // below, poses flip (measured: 6 % at 24 px, none at 48)
constexpr double k_least_contrast = 5;    // projected white over the room's light: black looks black enough

Vector3d eye(const Imager& imager) { return imager.imager_from_world.inverse().translation; }

// World z up in the picture; straight down or up, what is away from the front.
Pose upright_looking_at(const Vector3d& p_eye, const Vector3d& p_target) {
  const bool is_plumb = std::abs((p_target - p_eye).normalized().z()) > 0.999;
  return looking_at(p_eye, p_target, is_plumb ? Vector3d::UnitY() : Vector3d::UnitZ());
}

bool reaches(const Imager& imager, const Vector3d& p_world) {
  const auto px = imager.project(p_world);
  return px && imager.contains(*px);
}

// ---- the file ----

// Of somebody in front (at -y of what is looked at) who goes to the right and up by these angles.
Vector3d direction_of(const ConfigNode& node) {
  const double right = k_degree * node.at("right_deg").number(), up = k_degree * node.at("up_deg").number();
  return {std::sin(right) * std::cos(up), -std::cos(right) * std::cos(up), std::sin(up)};
}

// The place that it is seen from: eye_m, or around the middle of the volume.
Vector3d place_of(const ConfigNode& node, const Vector3d& p_centre) {
  const auto from = node.find("from");
  if (!from) return node.at("eye_m").vector3();
  if (node.find("eye_m")) from->problem("expected eye_m or from, found both.");
  from->only({"distance_m", "right_deg", "up_deg"});
  return p_centre + from->at("distance_m").positive() * direction_of(*from);
}

Imager imager_of(const ConfigNode& node, const Vector3d& p_centre) {
  Imager imager;
  imager.name = node.at("name").text();
  const auto size = node.at("size").numbers(2);
  imager.width = static_cast<int>(size[0]);
  imager.height = static_cast<int>(size[1]);
  if (imager.width < 16 || imager.height < 16 || imager.width > 20000 || imager.height > 20000)
    node.at("size").problem(
        fmt::format("expected 16 to 20000 pixels each way, found {} x {}.", size[0], size[1]));
  double focal = 1;
  const auto fov = node.find("fov_deg"), throw_ratio = node.find("throw");
  if (fov.has_value() == throw_ratio.has_value()) {
    node.problem(
        "expected either fov_deg (horizontal) or throw (distance / picture width), found both or none.");
  } else if (fov) {
    const double degrees = fov->positive();
    if (degrees >= 150) fov->problem(fmt::format("expected less than 150 degrees, found {}.", degrees));
    focal = imager.width / (2 * std::tan(degrees * k_degree / 2));
  } else {
    focal = throw_ratio->positive() * imager.width;
  }
  const auto shift = node.find("shift");
  const double cy = (imager.height - 1) / 2.0 + (shift ? shift->number() : 0) * imager.height;
  imager.lens =
      Lens::create("LENSMODEL_OPENCV4", {focal, focal, (imager.width - 1) / 2.0, cy, 0, 0, 0, 0}).value();
  const Vector3d p_eye = place_of(node, p_centre);
  const auto target = node.find("target_m");
  const Vector3d p_target = target ? target->vector3() : p_centre;
  if ((p_target - p_eye).norm() < 0.01) {
    node.problem("expected a target away from the eye, found both in one place.");
  } else {
    imager.imager_from_world = upright_looking_at(p_eye, p_target);
  }
  return imager;
}

void read_noise(const ConfigNode& root, Described* described) {
  const auto noise = root.find("noise");
  if (!noise) return;
  noise->only({"corner_px", "match_px", "marker_px"});
  if (const auto px = noise->find("corner_px")) described->corner_px = px->positive();
  if (const auto px = noise->find("match_px")) described->match_px = px->positive();
  if (const auto px = noise->find("marker_px")) described->marker_px = px->positive();
}

// ---- the calibration, played ----

// Share i of a sequence that fills [-1, 1] evenly (van der Corput's).
double spread(int i, int base) {
  double share = 0, step = 1;
  for (int n = i + 1; n > 0; n /= base) {
    step /= base;
    share += step * (n % base);
  }
  return 2 * share - 1;
}

// The board all over the volume, facing the middle of all devices, tilted in turn to all sides.
std::vector<Pose> board_places(const Described& described) {
  Vector3d p_devices = Vector3d::Zero();
  for (const Imager& camera : described.rig.cameras) p_devices += eye(camera);
  for (const Imager& projector : described.rig.projectors) p_devices += eye(projector);
  p_devices /= static_cast<double>(described.rig.cameras.size() + described.rig.projectors.size());
  const Pose middle(Eigen::Quaterniond::Identity(),
                    {-described.board.width_m() / 2, -described.board.height_m() / 2, 0});
  std::vector<Pose> places;
  for (int i = 0; i < described.poses; ++i) {
    const Vector3d p =
        described.p_centre +
        0.5 * Vector3d(spread(i, 2), spread(i, 3), spread(i, 5)).cwiseProduct(described.size_m);
    const Pose facing = upright_looking_at(p_devices, p);
    const double around = 2.4 * i, tilt = k_board_tilt * (i % 3 == 2 ? 0.5 : 1);
    const Pose tilted(exp_rotation({tilt * std::cos(around), tilt * std::sin(around), 0.3 * std::sin(i)}),
                      Vector3d::Zero());
    places.push_back(Pose(facing.inverse().rotation, p) * tilted * middle);
  }
  return places;
}

bool faces(const Imager& imager, const Pose& world_from_board, const Vector3d& p_world) {
  const Vector3d d = (p_world - eye(imager)).normalized();
  return d.dot(world_from_board.rotation * Vector3d::UnitZ()) > k_least_facing;
}

calib::ImagerView view(const Imager& imager) {
  return {imager.lens.model, imager.lens.values, imager.imager_from_world};
}

// What one camera and the projectors would find on the board in one place.
void observe_place(const Described& described,
                   int pose,
                   int camera_index,
                   const Pose& world_from_board,
                   std::mt19937_64* rng,
                   calib::Observations* seen) {
  const calib::Board& board = described.board;
  const Imager& camera = described.rig.cameras[static_cast<std::size_t>(camera_index)];
  const calib::BoardShape shape{board.width_m(), board.height_m()};
  std::normal_distribution<double> scatter(0, 1);
  const auto noise = [&](double px) { return Vector2d(px * scatter(*rng), px * scatter(*rng)); };
  const auto picture_of = [&](const Vector3d& p_board) -> std::optional<Vector2d> {
    const Vector3d p_world = world_from_board * p_board;
    if (!faces(camera, world_from_board, p_world) || !reaches(camera, p_world)) return std::nullopt;
    return camera.project(p_world);
  };
  std::vector<calib::CornerSeen> corners;
  for (int id = 0; id < board.corner_count(); ++id) {
    if (const auto px = picture_of(board.p_corner(id)))
      corners.push_back({camera_index, pose, id, *px + noise(described.corner_px), described.corner_px});
  }
  if (corners.size() < k_least_corners) return;
  seen->corners.insert(seen->corners.end(), corners.begin(), corners.end());
  for (std::size_t p = 0; p < described.rig.projectors.size(); ++p) {
    const Imager& projector = described.rig.projectors[p];
    for (int cell = 0; cell < 4 * board.columns * board.rows; ++cell) {  // half squares
      const Vector3d p_board((cell % (2 * board.columns) + 0.5) * board.square_m / 2,
                             (cell / (2 * board.columns) + 0.5) * board.square_m / 2, 0);
      const auto px = picture_of(p_board);
      if (!px || !faces(projector, world_from_board, world_from_board * p_board)) continue;
      Vector2d px_projector;
      if (calib::predict_match(view(camera), view(projector), world_from_board, shape, Vector2d::Zero(), *px,
                               &px_projector) &&
          projector.contains(px_projector))
        seen->matches.push_back({camera_index, static_cast<int>(p), pose, *px,
                                 px_projector + noise(described.match_px), described.match_px, 100});
    }
  }
}

calib::Observations observations_of(const Described& described) {
  calib::Observations seen;
  seen.board = described.board;
  for (const Imager& camera : described.rig.cameras)
    seen.cameras.push_back({camera.name, camera.width, camera.height});
  for (const Imager& projector : described.rig.projectors)
    seen.projectors.push_back({projector.name, projector.width, projector.height});
  std::mt19937_64 rng(k_noise_seed);
  for (const Pose& world_from_board : board_places(described)) {
    const int pose = static_cast<int>(seen.poses.size());
    seen.poses.push_back(fmt::format("pose{:02}", pose));
    for (std::size_t camera = 0; camera < described.rig.cameras.size(); ++camera)
      observe_place(described, pose, static_cast<int>(camera), world_from_board, &rng, &seen);
  }
  return seen;
}

// ---- what follows from the places alone ----

std::vector<Vector3d> points_of(const Described& described) {
  std::vector<Vector3d> points;
  for (int i = 0; i < k_grid * k_grid * k_grid; ++i) {
    const Vector3d share(i % k_grid, i / k_grid % k_grid, i / (k_grid * k_grid));
    points.push_back(described.p_centre +
                     (share / (k_grid - 1) - Vector3d::Constant(0.5)).cwiseProduct(described.size_m));
  }
  return points;
}

template <class Reached>
double share_of(const std::vector<Vector3d>& points, const Reached& reached) {
  return static_cast<double>(std::count_if(points.begin(), points.end(), reached)) /
         static_cast<double>(points.size());
}

// The cosine between an imager's ray to a point and the lit side's normal; 0 when it looks away.
double facing(const Described& described, const Imager& imager, const Vector3d& p_world) {
  return std::max(0.0, described.d_front.dot((eye(imager) - p_world).normalized()));
}

ForeseenImager imager_foreseen(const Described& described,
                               const Imager& imager,
                               double lumens,
                               const std::vector<Vector3d>& points) {
  ForeseenImager out{.name = imager.name};
  const Vector3d p_imager = imager.imager_from_world * described.p_centre;
  const double cosine = facing(described, imager, described.p_centre);
  out.distance_m = p_imager.norm();
  out.pixel_mm = 1000 * p_imager.z() / imager.lens.fx();
  out.surface_mm = cosine > 0 ? out.pixel_mm / cosine : std::numeric_limits<double>::infinity();
  out.steep_deg = std::acos(cosine) / k_degree;
  out.coverage = share_of(points, [&](const Vector3d& p) { return reaches(imager, p); });
  const double picture_m2 = 1e-6 * out.pixel_mm * out.pixel_mm * imager.width * imager.height;
  out.lux = lumens / picture_m2 * cosine;
  return out;
}

std::vector<ForeseenPair> pairs_of(const Described& described, const std::vector<Vector3d>& points) {
  std::vector<ForeseenPair> pairs;
  for (const Imager& camera : described.rig.cameras) {
    for (const Imager& projector : described.rig.projectors) {
      const Vector3d to_camera = (eye(camera) - described.p_centre).normalized();
      const Vector3d to_projector = (eye(projector) - described.p_centre).normalized();
      pairs.push_back(
          {camera.name, projector.name,
           std::acos(std::clamp(to_camera.dot(to_projector), -1.0, 1.0)) / k_degree,
           share_of(points, [&](const Vector3d& p) { return reaches(camera, p) && reaches(projector, p); })});
    }
  }
  return pairs;
}

// Where a marker's corners come to lie in the picture: on the lit side, upright.
std::optional<std::array<Vector2d, 4>> corners_of(const Described& described,
                                                  const Imager& camera,
                                                  const Pose& world_from_marker) {
  const double half = described.marker_m / 2;
  std::array<Vector2d, 4> corners;
  for (std::size_t i = 0; i < 4; ++i) {
    const auto px =
        camera.project(world_from_marker * Vector3d(k_corners[i].x() * half, k_corners[i].y() * half, 0));
    if (!px) return std::nullopt;
    corners[i] = *px;
  }
  return corners;
}

Pose marker_at(const Described& described, const Vector3d& p_world) {
  const Pose facing = upright_looking_at(p_world + described.d_front, p_world);
  return Pose(facing.inverse().rotation, p_world);
}

// The shortest side.
double side_px(const std::array<Vector2d, 4>& corners) {
  double shortest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < 4; ++i)
    shortest = std::min(shortest, (corners[(i + 1) % 4] - corners[i]).norm());
  return shortest;
}

// By the covariance that the tracker itself gives a marker's pose. nullopt: the camera does not see it.
std::optional<ForeseenMarker> marker_of(const Described& described,
                                        const Imager& camera,
                                        const std::vector<Vector3d>& points) {
  const Pose world_from_marker = marker_at(described, described.p_centre);
  const auto corners = corners_of(described, camera, world_from_marker);
  if (!corners || !reaches(camera, described.p_centre) || facing(described, camera, described.p_centre) <= 0)
    return std::nullopt;
  const double half = described.marker_m / 2;
  std::vector<tracker::PointSight> sights;
  for (std::size_t i = 0; i < 4; ++i)
    sights.push_back({&camera.lens, camera.imager_from_world,
                      Vector3d(k_corners[i].x() * half, k_corners[i].y() * half, 0), (*corners)[i],
                      Eigen::Matrix2d::Identity() / (described.marker_px * described.marker_px)});
  const auto fit = tracker::fit_pose(sights, world_from_marker);
  if (!fit) return std::nullopt;
  const Eigen::Matrix3d camera_from_world =
      upright_looking_at(eye(camera), described.p_centre).rotation_matrix();
  const Eigen::Matrix3d place =
      camera_from_world * fit->covariance.bottomRightCorner<3, 3>() * camera_from_world.transpose();
  const std::vector<Eigen::Matrix2d> across = {place.topLeftCorner<2, 2>()};
  const Vector3d p_farthest =
      *std::max_element(points.begin(), points.end(), [&](const Vector3d& a, const Vector3d& b) {
        return (a - eye(camera)).squaredNorm() < (b - eye(camera)).squaredNorm();
      });
  const auto farthest = corners_of(described, camera, marker_at(described, p_farthest));
  return ForeseenMarker{.camera = camera.name,
                        .side_px = side_px(*corners),
                        .farthest_px = farthest ? side_px(*farthest) : 0,
                        .across_mm = 1000 * calib::p95_of({&across, 1}),
                        .along_mm = 1000 * k_two_sided_95 * std::sqrt(place(2, 2))};
}

// ---- advice ----

void advise_on_error(const Foreseen& foreseen, const Described& described, std::vector<std::string>* advice) {
  for (std::size_t i = 0; i < foreseen.error_mm.size(); ++i) {
    if (foreseen.error_mm[i] <= calib::k_good_mm) continue;
    const std::string& name = described.rig.projectors[i].name;
    advice->push_back(
        foreseen.measuring_mm[i] > foreseen.calibration_mm[i]
            ? fmt::format("{}: {:.2f} mm, most of it from measuring where the prototype stands: give {} more "
                          "pixels on it (narrower lens, nearer).",
                          name, foreseen.error_mm[i], described.rig.cameras.front().name)
            : fmt::format(
                  "{}: {:.2f} mm, most of it from the calibration: more board poses, a larger board, a "
                  "wider angle to {}.",
                  name, foreseen.error_mm[i], described.rig.cameras.front().name));
  }
}

void advise_on_pairs(const Foreseen& foreseen, const Described& described, std::vector<std::string>* advice) {
  for (const ForeseenPair& pair : foreseen.pairs) {
    if (pair.camera != described.rig.cameras.front().name) continue;
    if (pair.angle_deg < k_least_angle_deg)
      advice->push_back(
          fmt::format("{} and {} look from almost the same place ({:.0f} degrees): move them apart "
                      "to {:g} degrees or more, depth is read from that angle.",
                      pair.camera, pair.projector, pair.angle_deg, k_least_angle_deg));
    if (pair.angle_deg > k_most_angle_deg)
      advice->push_back(
          fmt::format("{} and {} stand {:.0f} degrees apart: below {:g} degrees both see the board, "
                      "and the prototype, well.",
                      pair.camera, pair.projector, pair.angle_deg, k_most_angle_deg));
  }
}

void advise_on_imagers(const Foreseen& foreseen,
                       const Described& described,
                       std::vector<std::string>* advice) {
  for (const auto* imagers : {&foreseen.cameras, &foreseen.projectors}) {
    for (const ForeseenImager& imager : *imagers)
      if (imager.steep_deg > k_most_steep_deg)
        advice->push_back(
            fmt::format("{}: too steep, {:.0f} degrees from the lit side's normal: below {:g}; more to the "
                        "front, or another "
                        "one that faces this side.",
                        imager.name, imager.steep_deg, k_most_steep_deg));
  }
  for (const ForeseenImager& projector : foreseen.projectors) {
    if (projector.pixel_mm > k_most_pixel_mm)
      advice->push_back(fmt::format(
          "{}: too far, a pixel is {:.1f} mm on the surface (at most {:g}): nearer, a longer throw, "
          "or more pixels.",
          projector.name, projector.pixel_mm, k_most_pixel_mm));
    if (described.room_lux > 0 && projector.lux > 0 && projector.lux < k_least_contrast * described.room_lux)
      advice->push_back(fmt::format(
          "{}: too dim, {:.0f} lux on the lit side beside {:.0f} lux of the room (at least {:g} times): "
          "darken the room to {:.0f} lux, nearer, or more lumens.",
          projector.name, projector.lux, described.room_lux, k_least_contrast,
          projector.lux / k_least_contrast));
  }
}

void advise_on_markers(const Foreseen& foreseen,
                       const Described& described,
                       std::vector<std::string>* advice) {
  for (const ForeseenMarker& marker : foreseen.markers) {
    if (marker.farthest_px >= k_least_marker_px) continue;
    const double needed_mm = 1000 * described.marker_m * k_least_marker_px / marker.farthest_px;
    advice->push_back(fmt::format(
        "{}: too small, a marker of {:g} mm is {:.0f} pixels at the volume's far end (at least {:g}, "
        "below its tilt flips): markers of {:.0f} mm, a narrower lens, or more pixels.",
        marker.camera, 1000 * described.marker_m, marker.farthest_px, k_least_marker_px,
        std::ceil(needed_mm)));
  }
}

void advise_on_coverage(const Foreseen& foreseen,
                        const Described& described,
                        const std::vector<Vector3d>& points,
                        std::vector<std::string>* advice) {
  if (foreseen.coverage >= k_least_coverage) return;
  const Imager& camera = described.rig.cameras.front();
  const double seen = share_of(points, [&](const Vector3d& p) { return reaches(camera, p); });
  if (seen < k_least_coverage)
    advice->push_back(fmt::format("{} sees {:.0f} % of the volume: a wider lens, or farther away.",
                                  camera.name, 100 * seen));
  const double lit = share_of(points, [&](const Vector3d& p) {
    return std::any_of(described.rig.projectors.begin(), described.rig.projectors.end(),
                       [&](const Imager& projector) { return reaches(projector, p); });
  });
  if (lit < k_least_coverage)
    advice->push_back(
        fmt::format("the projectors reach {:.0f} % of the volume: farther away, a shorter throw, or "
                    "one more.",
                    100 * lit));
}

std::vector<std::string> advice_on(const Foreseen& foreseen,
                                   const Described& described,
                                   const std::vector<Vector3d>& points) {
  std::vector<std::string> advice;
  advise_on_error(foreseen, described, &advice);
  advise_on_coverage(foreseen, described, points, &advice);
  advise_on_pairs(foreseen, described, &advice);
  advise_on_imagers(foreseen, described, &advice);
  advise_on_markers(foreseen, described, &advice);
  return advice;
}

// ---- printing ----

nlohmann::ordered_json number(double value) {
  return std::isfinite(value) ? nlohmann::ordered_json(std::round(value * 1e4) / 1e4)
                              : nlohmann::ordered_json(nullptr);
}

nlohmann::ordered_json json_of(const ForeseenImager& imager) {
  nlohmann::ordered_json json = {{"name", imager.name},
                                 {"distance_m", number(imager.distance_m)},
                                 {"pixel_mm", number(imager.pixel_mm)},
                                 {"pixel_on_surface_mm", number(imager.surface_mm)},
                                 {"steep_deg", number(imager.steep_deg)},
                                 {"coverage", number(imager.coverage)}};
  if (imager.lux > 0) json["lux"] = number(imager.lux);
  return json;
}

nlohmann::ordered_json json_of(const Foreseen& foreseen) {
  using Json = nlohmann::ordered_json;
  Json json = {{"coverage", number(foreseen.coverage)},
               {"cameras", Json::array()},
               {"projectors", Json::array()},
               {"pairs", Json::array()},
               {"markers", Json::array()},
               {"advice", foreseen.advice}};
  for (const ForeseenImager& camera : foreseen.cameras) json["cameras"].push_back(json_of(camera));
  for (std::size_t i = 0; i < foreseen.projectors.size(); ++i) {
    Json projector = json_of(foreseen.projectors[i]);
    projector["predicted_error_mm"] = number(foreseen.error_mm[i]);
    projector["of_calibration_mm"] = number(foreseen.calibration_mm[i]);
    projector["of_measuring_mm"] = number(foreseen.measuring_mm[i]);
    json["projectors"].push_back(std::move(projector));
  }
  for (const ForeseenPair& pair : foreseen.pairs)
    json["pairs"].push_back({{"camera", pair.camera},
                             {"projector", pair.projector},
                             {"angle_deg", number(pair.angle_deg)},
                             {"coverage", number(pair.coverage)}});
  for (const ForeseenMarker& marker : foreseen.markers)
    json["markers"].push_back({{"camera", marker.camera},
                               {"side_px", number(marker.side_px)},
                               {"farthest_px", number(marker.farthest_px)},
                               {"across_mm", number(marker.across_mm)},
                               {"along_mm", number(marker.along_mm)}});
  return json;
}

}  // namespace

Result<Described> load_described(const std::filesystem::path& path) {
  LIMN_TRY(const Config config, Config::load(path, "limn.described/1"));
  const ConfigNode root = config.root();
  root.only(
      {"schema", "volume", "board", "poses", "noise", "marker_mm", "room_lux", "cameras", "projectors"});
  Described described;
  const ConfigNode volume = root.at("volume");
  volume.only({"centre_m", "size_m", "front"});
  described.p_centre = volume.at("centre_m").vector3();
  described.size_m = volume.at("size_m").vector3();
  if (!(described.size_m.minCoeff() > 0)) volume.at("size_m").problem("expected three positive sizes.");
  if (const auto front = volume.find("front")) {
    front->only({"right_deg", "up_deg"});
    described.d_front = direction_of(*front);
  }
  const auto board = calib::Board::parse(root.at("board").text());
  if (!board) root.at("board").problem(board.message());
  if (board) described.board = *board;
  if (const auto poses = root.find("poses")) {
    described.poses = poses->integer();
    if (described.poses < 4 || described.poses > 60)
      poses->problem(fmt::format("expected 4 to 60 placements of the board, found {}.", described.poses));
  }
  if (const auto marker = root.find("marker_mm")) described.marker_m = marker->positive() / 1000;
  if (const auto lux = root.find("room_lux")) described.room_lux = lux->positive();
  read_noise(root, &described);
  for (const ConfigNode& node : root.at("cameras").items()) {
    node.only({"name", "size", "fov_deg", "throw", "eye_m", "from", "target_m"});
    described.rig.cameras.push_back(imager_of(node, described.p_centre));
  }
  for (const ConfigNode& node : root.at("projectors").items()) {
    node.only({"name", "size", "fov_deg", "throw", "shift", "eye_m", "from", "target_m", "lumens"});
    described.rig.projectors.push_back(imager_of(node, described.p_centre));
    const auto lumens = node.find("lumens");
    described.lumens.push_back(lumens ? lumens->positive() : 0);
  }
  if (described.rig.cameras.empty()) root.at("cameras").problem("expected a camera at least, found none.");
  if (described.rig.projectors.empty())
    root.at("projectors").problem("expected a projector at least, found none.");
  LIMN_TRY_STATUS(config.status());
  return described;
}

Result<Foreseen> foresee(const Described& described) {
  const std::vector<Vector3d> points = points_of(described);
  Foreseen foreseen;
  foreseen.pairs = pairs_of(described, points);
  foreseen.coverage = share_of(points, [&](const Vector3d& p) {
    return reaches(described.rig.cameras.front(), p) &&
           std::any_of(described.rig.projectors.begin(), described.rig.projectors.end(),
                       [&](const Imager& projector) { return reaches(projector, p); });
  });
  for (const Imager& camera : described.rig.cameras) {
    foreseen.cameras.push_back(imager_foreseen(described, camera, 0, points));
    if (const auto marker = marker_of(described, camera, points)) foreseen.markers.push_back(*marker);
  }
  for (std::size_t i = 0; i < described.rig.projectors.size(); ++i)
    foreseen.projectors.push_back(
        imager_foreseen(described, described.rig.projectors[i], described.lumens[i], points));
  calib::Observed observed;
  observed.observations = observations_of(described);
  LIMN_TRY(const calib::Solution solution, calib::solve(observed.observations));
  LIMN_TRY(const calib::Assessment assessment, calib::assess(observed, {}, solution));
  foreseen.error_mm = assessment.predicted_error_mm;
  calib::Uncertainty believed = calib::believed(observed.observations, solution, assessment.held_out.rigs);
  const double measured_px = believed.measured_px;
  believed.measured_px = 0;
  foreseen.calibration_mm = calib::propagated_error_mm(observed.observations, solution, believed);
  believed.covariance.setZero();
  believed.measured_px = measured_px;
  foreseen.measuring_mm = calib::propagated_error_mm(observed.observations, solution, believed);
  foreseen.advice = advice_on(foreseen, described, points);
  return foreseen;
}

std::string foreseen_table(const Foreseen& foreseen, const Described& described) {
  std::string out;
  out += fmt::format("{:<14} {:>8} {:>9} {:>14} {:>7} {:>9} {:>7}\n", "", "away, m", "pixel, mm",
                     "on surface, mm", "steep", "coverage", "lux");
  for (const auto* imagers : {&foreseen.cameras, &foreseen.projectors}) {
    for (const ForeseenImager& imager : *imagers)
      out += fmt::format("{:<14} {:>8.2f} {:>9.2f} {:>14.2f} {:>5.0f} ° {:>7.0f} %{}\n", imager.name,
                         imager.distance_m, imager.pixel_mm, imager.surface_mm, imager.steep_deg,
                         100 * imager.coverage, imager.lux > 0 ? fmt::format(" {:>7.0f}", imager.lux) : "");
  }
  for (const ForeseenPair& pair : foreseen.pairs)
    out += fmt::format("{} and {}: {:.0f} degrees apart, both reach {:.0f} % of the volume\n", pair.camera,
                       pair.projector, pair.angle_deg, 100 * pair.coverage);
  for (const ForeseenMarker& marker : foreseen.markers)
    out += fmt::format(
        "{}: a {:g} mm marker is {:.0f} px ({:.0f} at the far end), placed within {:.2f} mm across the view "
        "and "
        "{:.2f} mm along it (95 %)\n",
        marker.camera, 1000 * described.marker_m, marker.side_px, marker.farthest_px, marker.across_mm,
        marker.along_mm);
  out += fmt::format("{} and a projector at least reach {:.0f} % of the volume\n",
                     described.rig.cameras.front().name, 100 * foreseen.coverage);
  for (std::size_t i = 0; i < foreseen.error_mm.size(); ++i)
    out += fmt::format(
        "{}: light lands within {:.2f} mm (95 %; calibration {:.2f}, measuring the prototype {:.2f})\n",
        described.rig.projectors[i].name, foreseen.error_mm[i], foreseen.calibration_mm[i],
        foreseen.measuring_mm[i]);
  for (const std::string& sentence : foreseen.advice) out += fmt::format("advice: {}\n", sentence);
  if (foreseen.advice.empty())
    out += fmt::format("nothing is too small, too far, too steep or out of reach\n");
  return out;
}

Status run_foresee(const ForeseeOptions& options) {
  LIMN_TRY(const Described described, load_described(options.described));
  auto foreseen = foresee(described);
  if (!foreseen)
    return error("{}: no calibration comes of this rig: {}", options.described.string(), foreseen.message());
  if (options.json) {
    fmt::print("{}\n", json_of(*foreseen).dump(2));
  } else {
    fmt::print("{}", foreseen_table(*foreseen, described));
  }
  if (!options.out.empty()) {
    LIMN_TRY_STATUS(make_folder(options.out));
    LIMN_TRY_STATUS(write_file(options.out / "plan.json", json_of(*foreseen).dump(2) + "\n"));
    LIMN_TRY_STATUS(write_file(options.out / "plan.html", plan_page(described, *foreseen)));
  }
  return {};
}

}  // namespace limn::apps
