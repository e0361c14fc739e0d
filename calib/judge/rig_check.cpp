#include "calib/judge/rig_check.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>

#include "calib/board_print.h"
#include "calib/judge/moved_device_fit.h"
#include "calib/measurement_model.h"
#include "calib/seed.h"
#include "core/names.h"

namespace limn::calib {
namespace {

using Eigen::Vector2d;

constexpr double k_degrees = 180 / std::numbers::pi;
// Significance of a sum of squares, in independent samples of rig_px^2. A move has six degrees of freedom:
// chi squared exceeds 30 once in 25000 cases, 15 once in 50.
constexpr double k_moved = 30;
constexpr double k_apart = 15;
constexpr double k_sound_rig_px = 4;  // RMS misfit that a sound rig may show beyond min_deg

// The rig's devices in the observations' order.
Result<RigCheckPlaces> places_of(const Rig& rig, const Observations& observations) {
  RigCheckPlaces places;
  const auto check_devices = [&](const std::vector<CapturedDevice>& captured,
                                 const std::vector<Imager>& known, const char* kind) -> Status {
    for (const CapturedDevice& device : captured) {
      const Imager* found = find_named(known, device.name);
      if (!found)
        return error("captures: expected a {} of the rig ({}), found '{}'. Are they captures of another rig?",
                     kind, joined_names(known), device.name);
      if (found->width != device.width || found->height != device.height)
        return error("captures: expected {} at {}x{} as the rig was calibrated, found {}x{}.", device.name,
                     found->width, found->height, device.width, device.height);
      places.devices.push_back(*found);
    }
    return {};
  };
  LIMN_TRY_STATUS(check_devices(observations.cameras, rig.cameras, "camera"));
  places.cameras = places.devices.size();
  LIMN_TRY_STATUS(check_devices(observations.projectors, rig.projectors, "projector"));
  return places;
}

// Whether a tie point is observed by three devices: two of them give its depth, whichever has moved.
bool has_scale(const Observations& observations, const RigCheckPlaces& places) {
  constexpr int k_least_shared = 20;
  int shared = 0;
  each_point(observations, [&](size_t index, std::span<const TiePointObservation> tie_observations) {
    shared += places.inverse_depths[index] > 0 && tie_observations.size() >= 2;
  });
  return shared >= k_least_shared;
}

// Sets each tie point to the mean of what its observations give.
void place_points(const Observations& observations, RigCheckPlaces* places) {
  places->inverse_depths.assign(observations.points.size(), 0.0);
  each_point(observations, [&](size_t index, std::span<const TiePointObservation> tie_observations) {
    const TiePoint& point = observations.points[index];
    const Imager& camera = places->camera(point.camera);
    LensRay ray;
    if (!find_ray(camera.lens.model, camera.lens.values, point.px_camera, false, &ray)) return;
    double sum = 0;
    int count = 0;
    for (const TiePointObservation& tie_observation : tie_observations) {
      const Imager& seeing = places->devices[places->device_of(tie_observation)];
      const double depth = triangulated_depth(view_of(camera), ray, view_of(seeing), tie_observation.px);
      if (depth > 0) sum += 1 / depth, ++count;
    }
    if (count > 0) places->inverse_depths[index] = sum / count;
  });
}

// Estimates board poses from the corners that cameras see, where nothing else is known.
Status place_boards(const Observations& observations,
                    const RigCheckOptions& options,
                    RigCheckPlaces* places) {
  Rig seen_by;
  seen_by.cameras.assign(places->devices.begin(),
                         places->devices.begin() + static_cast<std::ptrdiff_t>(places->cameras));
  places->world_from_board.resize(observations.poses.size());
  bool any = false;
  for (size_t pose = 0; pose < observations.poses.size(); ++pose) {
    Observations only = observations;
    std::erase_if(only.corners,
                  [&](const CornerObservation& c) { return static_cast<size_t>(c.pose) != pose; });
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
        "captures: expected the board ({}) in a camera's image, or a scene that three of the rig's devices "
        "share, found neither. Put the board into view.",
        observations.board.text());
  return {};
}

class RigChecker {
 public:
  RigChecker(const Observations& observations, const RigCheckOptions& options, RigCheckPlaces nominal)
      : observations_(observations), options_(options), nominal_(std::move(nominal)) {}

  RigCheck run(const Rig& rig) const {
    RigCheck result;
    result.rig = rig;
    Hypotheses all = hypotheses(true);
    if (!options_.still_boards.empty()) {
      Hypotheses touched = hypotheses(false);
      result.board_moved = least(all) > least(touched) + k_moved;
      if (result.board_moved) all = std::move(touched);
    }
    const MovedDeviceFit& nobody = all.nobody;
    const std::vector<MovedDeviceFit>& fits = all.devices;
    double least_misfit = k_never;
    for (const MovedDeviceFit& fit : fits) least_misfit = std::min(least_misfit, fit.misfit);
    const MovedDeviceFit* chosen = &nobody;
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
    if (result.verdict == RigVerdict::unexplained) result.candidates.clear();
    if (!result.candidates.empty()) put_back(result.candidates.front(), &result.rig);
    result.world_from_board = chosen->places.world_from_board;
    return result;
  }

 private:
  static constexpr double k_never = std::numeric_limits<double>::infinity();

  struct Hypotheses {
    MovedDeviceFit nobody;
    std::vector<MovedDeviceFit> devices;  ///< the fit with each device moved alone
  };

  Hypotheses hypotheses(bool trust_boards) const {
    Hypotheses all{fitted(MoveHypothesis::k_nobody, trust_boards), {}};
    for (size_t device = 0; device < nominal_.devices.size(); ++device) {
      all.devices.push_back(fitted(device, trust_boards));
      if (!all.devices[device].determined || observations_of(device) == 0)
        all.devices[device].misfit = k_never;
    }
    return all;
  }

  static double least(const Hypotheses& all) {
    double misfit = all.nobody.misfit;
    for (const MovedDeviceFit& fit : all.devices) misfit = std::min(misfit, fit.misfit);
    return misfit;
  }

  // Boards that have not been touched are kept fixed, unless they are not to be trusted.
  MovedDeviceFit fitted(size_t device, bool trust_boards) const {
    MoveHypothesis free{device, std::vector<bool>(nominal_.world_from_board.size())};
    for (size_t pose = 0; pose < free.boards.size(); ++pose) {
      const bool still = pose < options_.still_boards.size() && options_.still_boards[pose];
      free.boards[pose] = nominal_.world_from_board[pose] && !(still && trust_boards);
    }
    return calib::fit_moved_device(observations_, options_, free, nominal_);
  }

  bool is_sound(const RigCheckPlaces& places) const {
    for (size_t device = 0; device < places.devices.size(); ++device) {
      if (misfit_px(places, device) > limit_px(device)) return false;
    }
    return true;
  }

  // Projectors first: where several fit equally well, the rig's world stays with its cameras.
  std::vector<size_t> by_preference() const {
    std::vector<size_t> order;
    for (size_t i = nominal_.cameras; i < nominal_.devices.size(); ++i) order.push_back(i);
    for (size_t i = 0; i < nominal_.cameras; ++i) order.push_back(i);
    return order;
  }

  // Largest misfit of a device that still counts as sound.
  double limit_px(size_t device) const {
    return std::max(options_.min_deg / k_degrees * nominal_.devices[device].lens.fx(),
                    k_sound_rig_px * options_.rig_px);
  }

  // Calls visit(pixel predicted, pixel measured, point) for all observations of a device. A camera's tie
  // points lie on its own rays: their residuals are in the imagers that observe them.
  template <typename Visit>
  void each(const RigCheckPlaces& places, size_t device, Visit visit) const {
    const BoardShape shape{observations_.board.width_m(), observations_.board.height_m(), options_.twist_m};
    for (const CornerObservation& seen : observations_.corners) {
      const auto& board = places.world_from_board[static_cast<size_t>(seen.pose)];
      if (static_cast<size_t>(seen.camera) != device || !board) continue;
      Eigen::Vector3d p = observations_.board.p_corner(seen.corner);
      p.head<2>() = printed_corner(observations_.board, options_.print, seen.corner);
      p.z() = shape.z(places.bend, p.x(), p.y());
      visit(places.devices[device].project(*board * p), seen.px, *board * p);
    }
    for (const Match& match : observations_.matches) {
      const auto& board = places.world_from_board[static_cast<size_t>(match.pose)];
      Eigen::Vector3d p;
      if (places.cameras + static_cast<size_t>(match.projector) != device || !board ||
          !intersect_board(view_of(places.camera(match.camera)), *board, shape, places.bend, match.px_camera,
                           &p))
        continue;
      visit(places.devices[device].project(p), match.px_projector, p);
    }
    each_point(observations_, [&](size_t index, std::span<const TiePointObservation> tie_observations) {
      const auto p = world_of(places, index);
      if (!p) return;
      const auto camera = static_cast<size_t>(observations_.points[index].camera);
      for (const TiePointObservation& tie_observation : tie_observations)
        if (camera == device || places.device_of(tie_observation) == device)
          visit(places.devices[places.device_of(tie_observation)].project(*p), tie_observation.px, *p);
    });
  }

  std::optional<Eigen::Vector3d> world_of(const RigCheckPlaces& places, size_t index) const {
    const TiePoint& point = observations_.points[index];
    const auto ray = places.camera(point.camera).ray(point.px_camera);
    if (!ray || places.inverse_depths[index] == 0) return std::nullopt;
    // Depth is along z of the camera; a ray's d has unit length, so it is scaled.
    const double z = (places.camera(point.camera).imager_from_world.rotation * ray->d).z();
    return Eigen::Vector3d(ray->p_origin + ray->d / (z * places.inverse_depths[index]));
  }

  int observations_of(size_t device) const {
    int count = 0;
    each(nominal_, device, [&](const auto&, const auto&, const auto&) { ++count; });
    return count;
  }

  double misfit_px(const RigCheckPlaces& places, size_t device) const {
    double squares = 0;
    int count = 0;
    each(places, device, [&](const std::optional<Vector2d>& px, const Vector2d& measured, const auto&) {
      if (!px) return;
      squares += (*px - measured).squaredNorm();
      ++count;
    });
    return std::sqrt(squares / std::max(1, count));
  }

  Move move_of(const MovedDeviceFit& fitted, size_t device) const {
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
    // Derivatives of the rotation and of the centre -R^T t, whose change is -R^T (v + t x w).
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

  void list_devices(const RigCheckPlaces& before, const RigCheckPlaces& after, RigCheck* result) const {
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

  RigVerdict verdict(const RigCheck& result, const RigCheckPlaces& after) const {
    if (!is_sound(after)) return RigVerdict::unexplained;
    if (result.candidates.empty()) return RigVerdict::sound;
    return result.candidates.size() == 1 ? RigVerdict::moved : RigVerdict::undecided;
  }

  static void put_back(const Move& move, Rig* rig) {
    for (auto* imagers : {&rig->cameras, &rig->projectors}) {
      for (Imager& imager : *imagers) {
        if (imager.name == move.device) imager.imager_from_world = move.imager_from_world;
      }
    }
  }

  const Observations& observations_;
  const RigCheckOptions& options_;
  RigCheckPlaces nominal_;
};

}  // namespace

std::string to_text(RigVerdict verdict) {
  switch (verdict) {
    case RigVerdict::sound:
      return "sound";
    case RigVerdict::moved:
      return "nudged";
    case RigVerdict::undecided:
      return "undecided";
    case RigVerdict::unexplained:
      return "unexplained";
  }
  return "unexplained";
}

Result<RigCheck> check_rig(const Rig& rig, const Observations& observations, const RigCheckOptions& options) {
  LIMN_TRY(RigCheckPlaces places, places_of(rig, observations));
  places.bend = options.bend_m;
  place_points(observations, &places);
  LIMN_TRY_STATUS(place_boards(observations, options, &places));
  RigCheck result = RigChecker(observations, options, std::move(places)).run(rig);
  if (options.should_continue && !options.should_continue()) return error("recheck: stopped before the end.");
  return result;
}

}  // namespace limn::calib
