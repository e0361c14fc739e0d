#include "wizard/design/simulated_observations.h"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "calib/measurement_model.h"
#include "wizard/design/sight_lines.h"

namespace limn::design {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double k_board_tilt = 25 * k_degree;  // largest tilt of a board pose, as config/README.md advises
constexpr double k_least_facing = 0.26;         // cosine of 75 degrees; more oblique boards are not detected
constexpr int k_least_corners = 12;             // minimum for a board that a camera detects
constexpr std::uint64_t k_noise_seed = 20261122;

// Element i of van der Corput's sequence, which fills [-1, 1] evenly.
double spread(int i, int base) {
  double share = 0, step = 1;
  for (int n = i + 1; n > 0; n /= base) {
    step /= base;
    share += step * (n % base);
  }
  return 2 * share - 1;
}

// Board poses all over the volume, facing the mean position of all devices and tilted to all sides in turn.
std::vector<Pose> board_places(const DescribedRig& described) {
  Vector3d p_devices = Vector3d::Zero();
  for (const Imager& camera : described.rig.cameras) p_devices += optical_centre(camera);
  for (const Imager& projector : described.rig.projectors) p_devices += optical_centre(projector);
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
  const Vector3d d = (p_world - optical_centre(imager)).normalized();
  return d.dot(world_from_board.rotation * Vector3d::UnitZ()) > k_least_facing;
}

calib::ImagerView view(const Imager& imager) {
  return {imager.lens.model, imager.lens.values, imager.imager_from_world};
}

// Adds what one camera and the projectors would find on the board in one pose.
void observe_place(const DescribedRig& described,
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
  const auto image_of = [&](const Vector3d& p_board) -> std::optional<Vector2d> {
    const Vector3d p_world = world_from_board * p_board;
    if (!faces(camera, world_from_board, p_world) || !reaches(camera, p_world)) return std::nullopt;
    return camera.project(p_world);
  };
  std::vector<calib::CornerObservation> corners;
  for (int id = 0; id < board.corner_count(); ++id) {
    if (const auto px = image_of(board.p_corner(id)))
      corners.push_back({camera_index, pose, id, *px + noise(described.corner_px), described.corner_px});
  }
  if (corners.size() < k_least_corners) return;
  seen->corners.insert(seen->corners.end(), corners.begin(), corners.end());
  for (std::size_t p = 0; p < described.rig.projectors.size(); ++p) {
    const Imager& projector = described.rig.projectors[p];
    for (int cell = 0; cell < 4 * board.columns * board.rows; ++cell) {  // cells of half a square
      const auto middle = [&](int half) {                                // its middle
        const double from = board.p_line(half / 2), to = board.p_line(half / 2 + 1);
        return from + (half % 2 == 0 ? 0.25 : 0.75) * (to - from);
      };
      const Vector3d p_board(middle(cell % (2 * board.columns)), middle(cell / (2 * board.columns)), 0);
      const auto px = image_of(p_board);
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

}  // namespace

calib::Observations simulated_observations(const DescribedRig& described) {
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

}  // namespace limn::design
