#include "wizard/pose_instructions.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "calib/observations.h"
#include "calib/seed.h"
#include "core/result.h"

namespace limn::wizard {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double k_frontal_deg = 5;     // a smaller tilt is described as facing the camera
constexpr double k_turned_deg = 10;     // a smaller turn in the image is not mentioned
constexpr double k_little_depth = 0.1;  // share of the least distance; below it, no pose is near or far
constexpr double k_both = 0.4;          // ratio of the two components; below it, the smaller is not mentioned

double degrees(double radians) { return radians * 180 / std::numbers::pi; }

Vector3d p_centre(const calib::Board& board) { return {board.width_m() / 2, board.height_m() / 2, 0}; }

// The word for the first or last third of 0..1; "" for the middle third.
std::string third(double share, const char* first, const char* last) {
  return share < 1.0 / 3 ? first : share > 2.0 / 3 ? last : "";
}

// A direction in the image as text: "up", "left", "up and left".
std::string direction(const Vector2d& d) {
  const std::string vertical = d.y() < 0 ? "up" : "down", horizontal = d.x() < 0 ? "left" : "right";
  const double x = std::abs(d.x()), y = std::abs(d.y());
  if (x < k_both * y) return vertical;
  if (y < k_both * x) return horizontal;
  return vertical + " and " + horizontal;
}

std::string tilt(const Pose& camera_from_board, const Vector3d& p_camera) {
  const Vector3d d_face = camera_from_board.rotation * -Vector3d::UnitZ(), d_camera = -p_camera.normalized();
  const double angle = degrees(std::acos(std::clamp(d_face.dot(d_camera), -1.0, 1.0)));
  if (angle < k_frontal_deg) return "facing the camera";
  return fmt::format("tilted {:.0f} degrees {}", angle, direction((d_face - d_camera).head<2>()));
}

std::string turn(const Pose& camera_from_board) {
  const Vector3d d_right = camera_from_board.rotation * Vector3d::UnitX();
  const double angle = degrees(std::atan2(d_right.y(), d_right.x()));
  if (std::abs(angle) < k_turned_deg) return "";
  return fmt::format(", turned {:.0f} degrees {}", std::abs(angle),
                     angle > 0 ? "clockwise" : "anticlockwise");
}

std::string place(const Imager& camera, const Vector3d& p_world) {
  const auto px = camera.project(p_world);
  if (!px || !camera.contains(*px)) return "outside its image";
  const std::string across = third((px->x() + 0.5) / camera.width, "left", "right"),
                    down = third((px->y() + 0.5) / camera.height, "high", "low");
  if (across.empty() && down.empty()) return "middle";
  return across + (across.empty() || down.empty() ? "" : ", ") + down;
}

}  // namespace

std::vector<std::string> pose_instructions(const Imager& camera,
                                           const calib::Board& board,
                                           const std::vector<Pose>& world_from_board) {
  std::vector<double> distances;
  for (const Pose& pose : world_from_board)
    distances.push_back((camera.imager_from_world * (pose * p_centre(board))).norm());
  if (distances.empty()) return {};
  const auto [nearest, farthest] = std::minmax_element(distances.begin(), distances.end());
  const double span = *farthest - *nearest;
  std::vector<std::string> words;
  for (std::size_t i = 0; i < world_from_board.size(); ++i) {
    const Pose camera_from_board = camera.imager_from_world * world_from_board[i];
    const std::string depth =
        span < k_little_depth * *nearest ? "" : third((distances[i] - *nearest) / span, "near", "far");
    words.push_back(fmt::format("{}{} ({:.2f} m), {}{}", place(camera, world_from_board[i] * p_centre(board)),
                                depth.empty() ? "" : ", " + depth, distances[i],
                                tilt(camera_from_board, camera_from_board * p_centre(board)),
                                turn(camera_from_board)));
  }
  return words;
}

std::vector<std::vector<std::vector<Eigen::Vector2d>>> outlines(const calib::Board& board,
                                                                const std::vector<Pose>& world_from_board,
                                                                const std::vector<Imager>& cameras) {
  const double width = board.width_m(), height = board.height_m();
  const Eigen::Vector3d corners[] = {{0, 0, 0}, {width, 0, 0}, {width, height, 0}, {0, height, 0}};
  std::vector<std::vector<std::vector<Eigen::Vector2d>>> all;
  for (const Pose& place : world_from_board) {
    auto& outlines = all.emplace_back();
    for (const Imager& camera : cameras) {
      auto& outline = outlines.emplace_back();
      for (const Eigen::Vector3d& p_board : corners)
        if (const auto px = camera.project(place * p_board)) outline.push_back(*px);
      if (outline.size() < std::size(corners)) outline.clear();
    }
  }
  return all;
}

std::vector<Pose> placed_alike(const std::vector<Pose>& world_from_board,
                               const calib::Board& board,
                               const Imager& assumed,
                               const Rig& rig) {
  std::vector<Pose> places;
  for (const Pose& place : world_from_board) {
    calib::Observations seen;
    seen.board = board;
    for (int i = 0; i < board.corner_count(); ++i)
      if (const auto px = assumed.project(place * board.p_corner(i)))
        seen.corners.push_back({.camera = 0, .corner = i, .px = *px});
    const Result<Pose> found = calib::board_pose_seed(seen, rig);
    places.push_back(found ? *found : place);
  }
  return places;
}

}  // namespace limn::wizard
