#include "calib/judge/recheck.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <span>

#include "calib/predict.h"
#include "calib/seed.h"

namespace limn::calib {
namespace {

using Eigen::Vector2d;

constexpr double k_huber = 3;  // in rig_px: chance pixels, reflections
constexpr double k_degrees = 180 / std::numbers::pi;
// Of the squares' sums, in independent samples of rig_px^2. A move has six degrees of freedom: chi squared
// exceeds 30 once in 25000, 15 once in 50.
constexpr double k_moved = 30;
constexpr double k_apart = 15;
constexpr double k_sound_rig_px = 4;  // RMS misfit that a sound rig may show beyond min_deg
// Without a board a device is undetermined when its place along the light is: two devices alone tell no
// scale.
constexpr double k_loose_deg = 5, k_loose_m = 0.2;  // that a moved device may well have moved
constexpr double k_undetermined_m = 0.02;           // standard deviation

ImagerView view_of(const Imager& imager) {
  return {imager.lens.model, imager.lens.values, imager.imager_from_world};
}

// Devices in the observations' order; a device is named by its place: cameras first, then projectors.
struct Places {
  std::vector<Imager> devices;
  size_t cameras = 0;
  std::vector<std::optional<Pose>> world_from_board;
  std::vector<double> inverse_depths;  // of the free points; 0: none follows
  Vector2d bend = Vector2d::Zero();

  const Imager& camera(int i) const { return devices[static_cast<size_t>(i)]; }
  const Imager& projector(int i) const { return devices[cameras + static_cast<size_t>(i)]; }
  size_t device_of(const Sighting& sighting) const {
    return static_cast<size_t>(sighting.imager) + (sighting.by_projector ? cameras : 0);
  }
};

// Calls visit(point's number, its sightings) with every free point that is sighted.
template <typename Visit>
void each_point(const Observations& observations, const Visit& visit) {
  const std::vector<Sighting>& all = observations.sightings;
  for (size_t begin = 0, end = 0; begin < all.size(); begin = end) {
    while (end < all.size() && all[end].point == all[begin].point) ++end;
    visit(static_cast<size_t>(all[begin].point), std::span(all).subspan(begin, end - begin));
  }
}

constexpr size_t k_nobody = static_cast<size_t>(-1);

// What a hypothesis leaves free: one device or nobody, and the boards that are not known to stand still.
struct Free {
  size_t device = k_nobody;
  std::vector<bool> boards;
};

struct Fitted {
  Places places;
  double misfit = std::numeric_limits<double>::infinity();  ///< chi squared of the independent samples
  Matrix6d covariance = Matrix6d::Zero();                   ///< of the free device's pose
  bool determined = false;
};

// Levenberg-Marquardt on a handful of poses.
class Fit {
 public:
  Fit(const Observations& observations, const RecheckOptions& options, Free free)
      : observations_(observations),
        options_(options),
        free_(std::move(free)),
        shape_{observations.board.width_m(), observations.board.height_m()} {
    int at = free_.device == k_nobody ? 0 : 6;
    for (const bool is_free : free_.boards) {
      board_at_.push_back(is_free ? at : -1);
      at += is_free ? 6 : 0;
    }
    bend_at_ = at;
    unknowns_ = at + 2;
    for (const CornerSeen& seen : observations.corners) ++counts_[{seen.camera, -1, seen.pose}];
    for (const Match& match : observations.matches) ++counts_[{match.camera, match.projector, match.pose}];
    for (const Sighting& sighting : observations.sightings) ++counts_[sight_of(sighting)];
  }

  Fitted run(Places places) const {
    Fitted fitted{std::move(places)};
    Normal normal = linearised(&fitted.places);
    double damping = 1e-4;
    for (int i = 0; i < k_most_steps && damping < 1e8; ++i) {
      Eigen::MatrixXd damped = normal.matrix;
      damped.diagonal() *= 1 + damping;
      const Eigen::VectorXd step = -damped.ldlt().solve(normal.right);
      if (!step.allFinite()) break;
      Places moved = stepped(fitted.places, step);
      Normal next = linearised(&moved);
      if (next.cost <= normal.cost && next.count == normal.count) {
        const bool done = normal.cost - next.cost < 1e-9 * normal.cost;
        fitted.places = std::move(moved);
        normal = std::move(next);
        damping = std::max(damping / 10, 1e-9);
        if (done) break;
      } else {
        damping *= 10;
      }
    }
    fitted.misfit = normal.cost;
    judge(normal, &fitted);
    return fitted;
  }

 private:
  static constexpr int k_most_steps = 60;

  struct Normal {
    Eigen::MatrixXd matrix;
    Eigen::VectorXd right;
    double cost = 0;  ///< robust sum of squares of the independent samples, rig_px^2
    int count = 0;    ///< observations with a prediction
  };

  // A residual with its derivatives by the unknowns.
  struct Row {
    Vector2d residual;
    Eigen::Matrix<double, 2, Eigen::Dynamic> by;
  };
  static void add(const Row& row, double stddev, double share, Normal* normal) {
    const double size = row.residual.norm() / stddev;
    const double weight = share * (size > k_huber ? k_huber / size : 1) / (stddev * stddev);
    normal->matrix.noalias() += weight * row.by.transpose() * row.by;
    normal->right.noalias() += weight * row.by.transpose() * row.residual;
    normal->cost += share * (size > k_huber ? k_huber * (2 * size - k_huber) : size * size);
    ++normal->count;
  }

  // One sight of a board: camera, projector (-1: the camera's corners), pose. Of a scene: camera, device that
  // sees its points (-2 and below: cameras), pose.
  using Sight = std::array<int, 3>;
  Sight sight_of(const Sighting& sighting) const {
    const FreePoint& point = observations_.points[static_cast<size_t>(sighting.point)];
    return {point.camera, sighting.by_projector ? sighting.imager : -2 - sighting.imager, point.pose};
  }
  // How much of one observation of a sight is independent of the others.
  double share_of(const Sight& sight) const {
    return std::min(1.0, static_cast<double>(options_.independent) / counts_.at(sight));
  }

  Row empty_row() const { return {Vector2d::Zero(), Eigen::Matrix2Xd::Zero(2, unknowns_)}; }

  void put(const Derivatives::Pose6& by_pose, int at, Row* row) const {
    if (at >= 0) row->by.middleCols<6>(at) = by_pose;
  }
  int device_at(size_t device) const { return device == free_.device ? 0 : -1; }

  // What other devices see of a free point at an inverse depth: rows with their weights.
  struct PointRow {
    Row row;
    Vector2d by_inverse_depth;
    double weight = 0, cost = 0;
  };
  std::vector<PointRow> rows_of(size_t index,
                                std::span<const Sighting> sightings,
                                const Places& places,
                                double inverse_depth) const {
    std::vector<PointRow> rows;
    const FreePoint& point = observations_.points[index];
    const auto camera = static_cast<size_t>(point.camera);
    LensRay ray;
    const Imager& from = places.devices[camera];
    if (!find_ray(from.lens.model, from.lens.values, point.px_camera, true, &ray)) return rows;
    for (const Sighting& sighting : sightings) {
      const size_t device = places.device_of(sighting);
      Vector2d px;
      SightingDerivatives by;
      if (!predict_sighting(view_of(from), view_of(places.devices[device]), ray, inverse_depth, &px, &by))
        continue;
      PointRow seen{empty_row(), by.inverse_depth};
      seen.row.residual = px - sighting.px;
      put(by.camera_pose, device_at(camera), &seen.row);
      put(by.pose, device_at(device), &seen.row);
      const double stddev = std::hypot(sighting.stddev_px, options_.rig_px);
      const double size = seen.row.residual.norm() / stddev, share = share_of(sight_of(sighting));
      seen.weight = share * (size > k_huber ? k_huber / size : 1) / (stddev * stddev);
      seen.cost = share * (size > k_huber ? k_huber * (2 * size - k_huber) : size * size);
      rows.push_back(std::move(seen));
    }
    return rows;
  }

  // Free points lie where their sightings put them best, whatever the devices' places (variable projection,
  // Golub and Pereyra 1973).
  void add_points(Places* places, Normal* normal) const {
    constexpr int k_rounds = 3;
    each_point(observations_, [&](size_t index, std::span<const Sighting> sightings) {
      double& inverse_depth = places->inverse_depths[index];
      if (inverse_depth == 0) return;
      std::vector<PointRow> rows;
      double information = 0;
      for (int round = 0; round < k_rounds; ++round) {
        rows = rows_of(index, sightings, *places, inverse_depth);
        double right = 0;
        information = 0;
        for (const PointRow& seen : rows) {
          information += seen.weight * seen.by_inverse_depth.squaredNorm();
          right += seen.weight * seen.by_inverse_depth.dot(seen.row.residual);
        }
        if (!(information > 0) || round + 1 == k_rounds) break;
        inverse_depth = std::max(1e-6, inverse_depth - right / information);
      }
      if (!(information > 0)) return;
      Eigen::RowVectorXd with_depth = Eigen::RowVectorXd::Zero(unknowns_);
      double right = 0;
      for (const PointRow& seen : rows) {
        normal->matrix.noalias() += seen.weight * seen.row.by.transpose() * seen.row.by;
        normal->right.noalias() += seen.weight * seen.row.by.transpose() * seen.row.residual;
        with_depth += seen.weight * seen.by_inverse_depth.transpose() * seen.row.by;
        right += seen.weight * seen.by_inverse_depth.dot(seen.row.residual);
        normal->cost += seen.cost;
        ++normal->count;
      }
      normal->matrix.noalias() -= with_depth.transpose() * with_depth / information;
      normal->right -= with_depth.transpose() * right / information;
    });
  }

  Normal linearised(Places* given) const {
    Normal normal{Eigen::MatrixXd::Zero(unknowns_, unknowns_), Eigen::VectorXd::Zero(unknowns_)};
    add_points(given, &normal);
    const Places& places = *given;
    Derivatives by;
    for (const CornerSeen& seen : observations_.corners) {
      const auto& board = places.world_from_board[static_cast<size_t>(seen.pose)];
      if (!board) continue;
      Row row = empty_row();
      Vector2d px;
      if (!predict_corner(view_of(places.camera(seen.camera)), *board, shape_, places.bend,
                          observations_.board.p_corner(seen.corner).head<2>(), &px, &by))
        continue;
      row.residual = px - seen.px;
      put(by.camera_pose, device_at(static_cast<size_t>(seen.camera)), &row);
      put(by.board_pose, board_at_[static_cast<size_t>(seen.pose)], &row);
      row.by.middleCols<2>(bend_at_) = by.bend;
      add(row, std::hypot(seen.stddev_px, options_.rig_px), share_of({seen.camera, -1, seen.pose}), &normal);
    }
    for (const Match& match : observations_.matches) {
      const auto& board = places.world_from_board[static_cast<size_t>(match.pose)];
      if (!board) continue;
      Row row = empty_row();
      Vector2d px;
      if (!predict_match(view_of(places.camera(match.camera)), view_of(places.projector(match.projector)),
                         *board, shape_, places.bend, match.px_camera, &px, &by))
        continue;
      row.residual = px - match.px_projector;
      put(by.camera_pose, device_at(static_cast<size_t>(match.camera)), &row);
      put(by.projector_pose, device_at(places.cameras + static_cast<size_t>(match.projector)), &row);
      put(by.board_pose, board_at_[static_cast<size_t>(match.pose)], &row);
      row.by.middleCols<2>(bend_at_) = by.bend;
      add(row, std::hypot(match.stddev_px, options_.rig_px),
          share_of({match.camera, match.projector, match.pose}), &normal);
    }
    const double weight = 1 / (options_.bend_stddev_m * options_.bend_stddev_m);
    const Vector2d off = places.bend - options_.bend_m;
    if (free_.device != k_nobody) {
      const double loose_rad = k_loose_deg / k_degrees;
      normal.matrix.diagonal().head<3>().array() += 1 / (loose_rad * loose_rad);
      normal.matrix.diagonal().segment<3>(3).array() += 1 / (k_loose_m * k_loose_m);
    }
    normal.matrix.bottomRightCorner<2, 2>().diagonal().array() += weight;
    normal.right.tail<2>() += weight * off;
    normal.cost += weight * off.squaredNorm();
    return normal;
  }

  Places stepped(Places places, const Eigen::VectorXd& step) const {
    if (free_.device != k_nobody) {
      Pose& pose = places.devices[free_.device].imager_from_world;
      pose = boxplus(pose, step.head<6>());
    }
    for (size_t i = 0; i < board_at_.size(); ++i) {
      if (board_at_[i] >= 0)
        places.world_from_board[i] = boxplus(*places.world_from_board[i], step.segment<6>(board_at_[i]));
    }
    places.bend += step.tail<2>();
    return places;
  }

  // The free device's covariance; whether it is determined at all.
  void judge(const Normal& normal, Fitted* fitted) const {
    const Eigen::VectorXd scale =
        normal.matrix.diagonal().cwiseMax(std::numeric_limits<double>::min()).cwiseSqrt().cwiseInverse();
    const Eigen::LDLT<Eigen::MatrixXd> scaled(
        Eigen::MatrixXd(scale.asDiagonal() * normal.matrix * scale.asDiagonal()));
    constexpr double k_undetermined = 1e-10;  // of a unit diagonal
    fitted->determined = scaled.vectorD().minCoeff() > k_undetermined;
    if (!fitted->determined || free_.device == k_nobody) return;
    const Eigen::MatrixXd inverse = scale.asDiagonal() *
                                    scaled.solve(Eigen::MatrixXd::Identity(unknowns_, unknowns_)) *
                                    scale.asDiagonal();
    fitted->covariance = inverse.topLeftCorner<6, 6>();
    const double stddev_m = std::sqrt(fitted->covariance.bottomRightCorner<3, 3>().diagonal().maxCoeff());
    fitted->determined = stddev_m < k_undetermined_m;
  }

  const Observations& observations_;
  const RecheckOptions& options_;
  Free free_;
  BoardShape shape_;
  std::vector<int> board_at_;  // first column of each board's pose; -1: fixed
  int bend_at_ = 0, unknowns_ = 0;
  std::map<Sight, int> counts_;  // observations of each sight
};

// The rig's devices in the observations' order.
Result<Places> places_of(const Rig& rig, const Observations& observations) {
  Places places;
  const auto take = [&](const std::vector<CapturedDevice>& captured, const std::vector<Imager>& known,
                        const char* kind) -> Status {
    for (const CapturedDevice& device : captured) {
      const auto found = std::find_if(known.begin(), known.end(),
                                      [&](const Imager& imager) { return imager.name == device.name; });
      if (found == known.end()) {
        std::string names;
        for (const Imager& imager : known) names += (names.empty() ? "" : ", ") + imager.name;
        return error("captures: expected a {} of the rig ({}), found '{}'. Are they captures of another rig?",
                     kind, names, device.name);
      }
      if (found->width != device.width || found->height != device.height)
        return error("captures: expected {} at {}x{} as the rig was calibrated, found {}x{}.", device.name,
                     found->width, found->height, device.width, device.height);
      places.devices.push_back(*found);
    }
    return {};
  };
  LIMN_TRY_STATUS(take(observations.cameras, rig.cameras, "camera"));
  places.cameras = places.devices.size();
  LIMN_TRY_STATUS(take(observations.projectors, rig.projectors, "projector"));
  return places;
}

// Whether a free point lies in the view of three devices: two of them tell its distance, whichever moved.
bool has_scale(const Observations& observations, const Places& places) {
  constexpr int k_least_shared = 20;
  int shared = 0;
  each_point(observations, [&](size_t index, std::span<const Sighting> sightings) {
    shared += places.inverse_depths[index] > 0 && sightings.size() >= 2;
  });
  return shared >= k_least_shared;
}

// The mean of what the sightings say.
void place_points(const Observations& observations, Places* places) {
  places->inverse_depths.assign(observations.points.size(), 0.0);
  each_point(observations, [&](size_t index, std::span<const Sighting> sightings) {
    const FreePoint& point = observations.points[index];
    const Imager& camera = places->camera(point.camera);
    LensRay ray;
    if (!find_ray(camera.lens.model, camera.lens.values, point.px_camera, false, &ray)) return;
    double sum = 0;
    int count = 0;
    for (const Sighting& sighting : sightings) {
      const Imager& seeing = places->devices[places->device_of(sighting)];
      const double depth = depth_by(view_of(camera), ray, view_of(seeing), sighting.px);
      if (depth > 0) sum += 1 / depth, ++count;
    }
    if (count > 0) places->inverse_depths[index] = sum / count;
  });
}

// Boards from what cameras see of their corners, where nothing else is known.
Status place_boards(const Observations& observations, const RecheckOptions& options, Places* places) {
  Rig seen_by;
  seen_by.cameras.assign(places->devices.begin(),
                         places->devices.begin() + static_cast<std::ptrdiff_t>(places->cameras));
  places->world_from_board.resize(observations.poses.size());
  bool any = false;
  for (size_t pose = 0; pose < observations.poses.size(); ++pose) {
    Observations only = observations;
    std::erase_if(only.corners, [&](const CornerSeen& c) { return static_cast<size_t>(c.pose) != pose; });
    if (only.corners.empty()) continue;
    if (pose < options.still_boards.size() && options.still_boards[pose]) {
      places->world_from_board[pose] = options.still_boards[pose];
    } else if (const auto seeded = board_pose_seed(only, seen_by)) {
      places->world_from_board[pose] = *seeded;
    }
    any = any || places->world_from_board[pose];
  }
  any = any || has_scale(observations, *places);
  if (!any)
    return error(
        "captures: expected the board ({}) in a camera's picture, or a scene that three of the rig's devices "
        "share, found neither. Put the board into view.",
        observations.board.text());
  return {};
}

class Detective {
 public:
  Detective(const Observations& observations, const RecheckOptions& options, Places nominal)
      : observations_(observations), options_(options), nominal_(std::move(nominal)) {}

  Recheck run(const Rig& rig) const {
    Recheck result;
    result.rig = rig;
    Hypotheses all = hypotheses(true);
    if (!options_.still_boards.empty()) {
      Hypotheses touched = hypotheses(false);
      result.board_moved = least(all) > least(touched) + k_moved;
      if (result.board_moved) all = std::move(touched);
    }
    const Fitted& nobody = all.nobody;
    const std::vector<Fitted>& fits = all.devices;
    double least_misfit = k_never;
    for (const Fitted& fit : fits) least_misfit = std::min(least_misfit, fit.misfit);
    const Fitted* chosen = &nobody;
    for (const size_t device : by_preference()) {
      const double misfit = fits[device].misfit;
      if (misfit > least_misfit + k_apart || misfit + k_moved > nobody.misfit) continue;
      const Move move = move_of(fits[device], device);
      if (move.degrees < options_.min_deg && move.mm < options_.min_mm) continue;
      if (result.candidates.empty()) chosen = &fits[device];
      result.candidates.push_back(move);
    }
    list_devices(nobody.places, chosen->places, &result);
    result.verdict = verdict(result, chosen->places);
    if (result.verdict == RecheckVerdict::unexplained) result.candidates.clear();
    if (!result.candidates.empty()) put_back(result.candidates.front(), &result.rig);
    result.world_from_board = chosen->places.world_from_board;
    return result;
  }

 private:
  static constexpr double k_never = std::numeric_limits<double>::infinity();

  struct Hypotheses {
    Fitted nobody;
    std::vector<Fitted> devices;  ///< each device moved alone
  };

  Hypotheses hypotheses(bool trust_boards) const {
    Hypotheses all{fitted(k_nobody, trust_boards), {}};
    for (size_t device = 0; device < nominal_.devices.size(); ++device) {
      all.devices.push_back(fitted(device, trust_boards));
      if (!all.devices[device].determined || observations_of(device) == 0)
        all.devices[device].misfit = k_never;
    }
    return all;
  }

  static double least(const Hypotheses& all) {
    double misfit = all.nobody.misfit;
    for (const Fitted& fit : all.devices) misfit = std::min(misfit, fit.misfit);
    return misfit;
  }

  // With the boards that stood still where they stood, unless they are not to be trusted.
  Fitted fitted(size_t device, bool trust_boards) const {
    Free free{device, std::vector<bool>(nominal_.world_from_board.size())};
    for (size_t pose = 0; pose < free.boards.size(); ++pose) {
      const bool still = pose < options_.still_boards.size() && options_.still_boards[pose];
      free.boards[pose] = nominal_.world_from_board[pose] && !(still && trust_boards);
    }
    return Fit(observations_, options_, free).run(nominal_);
  }

  bool is_sound(const Places& places) const {
    for (size_t device = 0; device < places.devices.size(); ++device) {
      if (misfit_px(places, device) > limit_px(device)) return false;
    }
    return true;
  }

  // Projectors first: where several fit as well, the rig's world goes with its cameras.
  std::vector<size_t> by_preference() const {
    std::vector<size_t> order;
    for (size_t i = nominal_.cameras; i < nominal_.devices.size(); ++i) order.push_back(i);
    for (size_t i = 0; i < nominal_.cameras; ++i) order.push_back(i);
    return order;
  }

  // Of a device's misfit that is still sound.
  double limit_px(size_t device) const {
    return std::max(options_.min_deg / k_degrees * nominal_.devices[device].lens.fx(),
                    k_sound_rig_px * options_.rig_px);
  }

  // visit(pixel predicted, pixel measured, point) of all observations of a device. A camera's free points lie
  // on its own rays: they are told by what the others see of them.
  template <typename Visit>
  void each(const Places& places, size_t device, Visit visit) const {
    const BoardShape shape{observations_.board.width_m(), observations_.board.height_m()};
    for (const CornerSeen& seen : observations_.corners) {
      const auto& board = places.world_from_board[static_cast<size_t>(seen.pose)];
      if (static_cast<size_t>(seen.camera) != device || !board) continue;
      Eigen::Vector3d p = observations_.board.p_corner(seen.corner);
      p.z() = shape.z(places.bend, p.x(), p.y());
      visit(places.devices[device].project(*board * p), seen.px, *board * p);
    }
    for (const Match& match : observations_.matches) {
      const auto& board = places.world_from_board[static_cast<size_t>(match.pose)];
      Eigen::Vector3d p;
      if (places.cameras + static_cast<size_t>(match.projector) != device || !board ||
          !meet_board(view_of(places.camera(match.camera)), *board, shape, places.bend, match.px_camera, &p))
        continue;
      visit(places.devices[device].project(p), match.px_projector, p);
    }
    each_point(observations_, [&](size_t index, std::span<const Sighting> sightings) {
      const auto p = world_of(places, index);
      if (!p) return;
      const auto camera = static_cast<size_t>(observations_.points[index].camera);
      for (const Sighting& sighting : sightings)
        if (camera == device || places.device_of(sighting) == device)
          visit(places.devices[places.device_of(sighting)].project(*p), sighting.px, *p);
    });
  }

  std::optional<Eigen::Vector3d> world_of(const Places& places, size_t index) const {
    const FreePoint& point = observations_.points[index];
    const auto ray = places.camera(point.camera).ray(point.px_camera);
    if (!ray || places.inverse_depths[index] == 0) return std::nullopt;
    // Depth is along z of the camera; a ray's d is of unit length there.
    const double z = (places.camera(point.camera).imager_from_world.rotation * ray->d).z();
    return Eigen::Vector3d(ray->p_origin + ray->d / (z * places.inverse_depths[index]));
  }

  int observations_of(size_t device) const {
    int count = 0;
    each(nominal_, device, [&](const auto&, const auto&, const auto&) { ++count; });
    return count;
  }

  double misfit_px(const Places& places, size_t device) const {
    double squares = 0;
    int count = 0;
    each(places, device, [&](const std::optional<Vector2d>& px, const Vector2d& measured, const auto&) {
      if (!px) return;
      squares += (*px - measured).squaredNorm();
      ++count;
    });
    return std::sqrt(squares / std::max(1, count));
  }

  Move move_of(const Fitted& fitted, size_t device) const {
    const Imager &before = nominal_.devices[device], &now = fitted.places.devices[device];
    double squares = 0, depths = 0;
    int count = 0;
    each(fitted.places, device,
         [&](const std::optional<Vector2d>&, const Vector2d&, const Eigen::Vector3d& p_world) {
           const auto px = now.project(p_world), old_px = before.project(p_world);
           if (!px || !old_px) return;
           squares += (*px - *old_px).squaredNorm();
           depths += (now.imager_from_world * p_world).norm();
           ++count;
         });
    const double depth = depths / std::max(1, count);
    Move move;
    move.device = before.name;
    move.is_projector = device >= nominal_.cameras;
    move.imager_from_world = now.imager_from_world;
    move.px = std::sqrt(squares / std::max(1, count));
    move.mm_on_board = 1e3 * move.px / before.lens.fx() * depth;
    const Pose world_from_now = now.imager_from_world.inverse();
    const Eigen::Vector3d turn =
        log_rotation(now.imager_from_world.rotation * before.imager_from_world.rotation.inverse());
    const Eigen::Vector3d way = world_from_now.translation - before.imager_from_world.inverse().translation;
    move.degrees = turn.norm() * k_degrees;
    move.mm = 1e3 * way.norm();
    // Of the turn, and of the centre -R^T t, whose change is -R^T (v + t x w).
    Eigen::Matrix<double, 3, 6> centre;
    const Eigen::Vector3d t = now.imager_from_world.translation;
    Eigen::Matrix3d cross;
    cross << 0, -t.z(), t.y(), t.z(), 0, -t.x(), -t.y(), t.x(), 0;
    centre << cross, Eigen::Matrix3d::Identity();
    centre = -world_from_now.rotation_matrix() * centre;
    const auto along = [](const Eigen::Matrix3d& covariance, const Eigen::Vector3d& direction) {
      const Eigen::Vector3d d = direction.norm() > 0 ? Eigen::Vector3d(direction.normalized())
                                                     : Eigen::Vector3d(Eigen::Vector3d::UnitX());
      return d.dot(covariance * d);
    };
    move.degrees_stddev = k_degrees * std::sqrt(along(fitted.covariance.topLeftCorner<3, 3>(), turn));
    move.mm_stddev = 1e3 * std::sqrt(along(centre * fitted.covariance * centre.transpose(), way));
    return move;
  }

  void list_devices(const Places& before, const Places& after, Recheck* result) const {
    const auto list = [&](const std::vector<Imager>& imagers) {
      for (const Imager& imager : imagers) {
        CheckedDevice checked{imager.name};
        for (size_t device = 0; device < nominal_.devices.size(); ++device) {
          if (nominal_.devices[device].name != imager.name) continue;
          checked.observations = observations_of(device);
          checked.before_px = misfit_px(before, device);
          checked.after_px = misfit_px(after, device);
        }
        result->devices.push_back(checked);
      }
    };
    list(result->rig.cameras);
    list(result->rig.projectors);
  }

  RecheckVerdict verdict(const Recheck& result, const Places& after) const {
    if (!is_sound(after)) return RecheckVerdict::unexplained;
    if (result.candidates.empty()) return RecheckVerdict::sound;
    return result.candidates.size() == 1 ? RecheckVerdict::nudged : RecheckVerdict::undecided;
  }

  static void put_back(const Move& move, Rig* rig) {
    for (auto* imagers : {&rig->cameras, &rig->projectors}) {
      for (Imager& imager : *imagers) {
        if (imager.name == move.device) imager.imager_from_world = move.imager_from_world;
      }
    }
  }

  const Observations& observations_;
  const RecheckOptions& options_;
  Places nominal_;
};

}  // namespace

std::string to_text(RecheckVerdict verdict) {
  switch (verdict) {
    case RecheckVerdict::sound:
      return "sound";
    case RecheckVerdict::nudged:
      return "nudged";
    case RecheckVerdict::undecided:
      return "undecided";
    case RecheckVerdict::unexplained:
      return "unexplained";
  }
  return "unexplained";
}

Result<Recheck> recheck(const Rig& rig, const Observations& observations, const RecheckOptions& options) {
  LIMN_TRY(Places places, places_of(rig, observations));
  places.bend = options.bend_m;
  place_points(observations, &places);
  LIMN_TRY_STATUS(place_boards(observations, options, &places));
  return Detective(observations, options, std::move(places)).run(rig);
}

}  // namespace limn::calib
