#include "calib/seed.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <opencv2/calib3d.hpp>
#include <set>

#include "calib/measurement_model.h"

namespace limn::calib {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int k_least_corners = 8;  // in a view that is used to calibrate a camera
// Two do not determine a lens, and one is left out for the held-out error.
constexpr size_t k_least_poses = 3;
constexpr size_t k_least_shared = 12;  // points that an imager's pose is estimated from

Pose to_pose(const cv::Mat& rvec, const cv::Mat& tvec) {
  const Vector3d w(rvec.at<double>(0), rvec.at<double>(1), rvec.at<double>(2));
  return {exp_rotation(w), Vector3d(tvec.at<double>(0), tvec.at<double>(1), tvec.at<double>(2))};
}

// One camera's lens and the poses of the boards that it saw.
struct CameraSeed {
  Lens lens;
  std::map<int, Pose> camera_from_board;
};

struct Views {
  std::vector<int> poses;
  std::vector<std::vector<cv::Point3f>> p_board;
  std::vector<std::vector<cv::Point2f>> px;
};

Views views_of(const Observations& observations, int camera) {
  Views views;
  for (int pose = 0; pose < static_cast<int>(observations.poses.size()); ++pose) {
    std::vector<cv::Point3f> p_board;
    std::vector<cv::Point2f> px;
    for (const CornerObservation& seen : observations.corners) {
      if (seen.camera != camera || seen.pose != pose) continue;
      const Vector3d p = observations.board.p_corner(seen.corner);
      p_board.emplace_back(static_cast<float>(p.x()), static_cast<float>(p.y()), 0.F);
      px.emplace_back(static_cast<float>(seen.px.x()), static_cast<float>(seen.px.y()));
    }
    if (static_cast<int>(px.size()) < k_least_corners) continue;
    views.poses.push_back(pose);
    views.p_board.push_back(std::move(p_board));
    views.px.push_back(std::move(px));
  }
  return views;
}

Result<CameraSeed> seed_camera(const Observations& observations, int camera, const LensModel& model) {
  const CapturedDevice& device = observations.cameras[static_cast<size_t>(camera)];
  const Views views = views_of(observations, camera);
  if (views.poses.size() < k_least_poses)
    return error(
        "{}: expected the board in at least {} poses, found it in {}. Capture more poses, with the whole "
        "board in view and lit.",
        device.name, k_least_poses, views.poses.size());
  cv::Mat matrix = cv::Mat::eye(3, 3, CV_64F), distortion = cv::Mat::zeros(1, 5, CV_64F);
  std::vector<cv::Mat> rotations, translations;
  const bool distorted = model.value_count() > 4;
  const int flags = cv::CALIB_FIX_K3 | cv::CALIB_ZERO_TANGENT_DIST | cv::CALIB_FIX_PRINCIPAL_POINT |
                    (distorted ? 0 : cv::CALIB_FIX_K1 | cv::CALIB_FIX_K2);
  try {
    cv::calibrateCamera(views.p_board, views.px, {device.width, device.height}, matrix, distortion, rotations,
                        translations, flags);
  } catch (const cv::Exception& problem) {
    return error(
        "{}: its {} views of the board do not determine a lens. Tilt the board more, by 20 to 45 degrees to "
        "different sides. ({})",
        device.name, views.poses.size(), problem.err);
  }
  CameraSeed seeded;
  seeded.lens.model = model;
  seeded.lens.values.assign(static_cast<size_t>(model.value_count()), 0.0);
  seeded.lens.values[0] = matrix.at<double>(0, 0);
  seeded.lens.values[1] = matrix.at<double>(1, 1);
  seeded.lens.values[2] = matrix.at<double>(0, 2);
  seeded.lens.values[3] = matrix.at<double>(1, 2);
  if (distorted) {
    seeded.lens.values[4] = distortion.at<double>(0);
    seeded.lens.values[5] = distortion.at<double>(1);
  }
  const double f = seeded.lens.fx() / device.width;
  if (!(f > 0.1 && f < 50))
    return error(
        "{}: the views of the board do not determine its focal length (found {:.4g} widths). Tilt the board "
        "more, by 20 to 45 degrees to different sides.",
        device.name, f);
  for (size_t i = 0; i < views.poses.size(); ++i)
    seeded.camera_from_board[views.poses[i]] = to_pose(rotations[i], translations[i]);
  return seeded;
}

double disagreement(const Pose& a, const Pose& b) {
  return angle_between(a.rotation, b.rotation) + (a.translation - b.translation).norm();
}

// The candidate with the smallest sum of distances to the others, so that one wrong board pose does not
// matter.
Pose medoid(const std::vector<Pose>& candidates) {
  size_t best = 0;
  double best_sum = std::numeric_limits<double>::max();
  for (size_t i = 0; i < candidates.size(); ++i) {
    double sum = 0;
    for (const Pose& other : candidates) sum += disagreement(candidates[i], other);
    if (sum < best_sum) {
      best_sum = sum;
      best = i;
    }
  }
  return candidates[best];
}

// Places a camera, and the boards that it sees and no other has placed.
void place(size_t camera, const CameraSeed& seeded, const Pose& camera_from_world, Seed* into) {
  into->cameras[camera].imager_from_world = camera_from_world;
  for (const auto& [pose, camera_from_board] : seeded.camera_from_board) {
    auto& world_from_board = into->world_from_board[static_cast<size_t>(pose)];
    if (!world_from_board) world_from_board = camera_from_world.inverse() * camera_from_board;
  }
}

// A camera's pose, by each board that cameras already placed see, too.
std::vector<Pose> poses_by_boards(const CameraSeed& seeded, const Seed& placed) {
  std::vector<Pose> candidates;
  for (const auto& [pose, camera_from_board] : seeded.camera_from_board) {
    const auto& world_from_board = placed.world_from_board[static_cast<size_t>(pose)];
    if (world_from_board) candidates.push_back(camera_from_board * world_from_board->inverse());
  }
  return candidates;
}

// Places the boards of poses with too few corners to calibrate with.
void place_remaining(const Observations& observations, Seed* into) {
  const Rig rig{into->cameras, {}, {}, {}, {}};
  for (int pose = 0; pose < static_cast<int>(into->world_from_board.size()); ++pose) {
    auto& world_from_board = into->world_from_board[static_cast<size_t>(pose)];
    if (world_from_board) continue;
    Observations only = observations;
    std::erase_if(only.corners, [&](const CornerObservation& corner) { return corner.pose != pose; });
    if (const auto found = board_pose_seed(only, rig)) world_from_board = *found;
  }
}

// Points of the world and their pixels in one imager.
struct Points {
  std::vector<Vector3d> p_world;
  std::vector<Vector2d> px;
  std::vector<int> poses;
  size_t pose_count() const { return std::set<int>(poses.begin(), poses.end()).size(); }
};

// What the placed boards show of a projector: through all cameras, or through those that `uses` names.
Points points_of(const Observations& observations,
                 const Seed& seeded,
                 int projector,
                 const std::vector<bool>& uses) {
  const BoardShape shape{observations.board.width_m(), observations.board.height_m()};
  Points points;
  for (const Match& match : observations.matches) {
    if (match.projector != projector || !uses[static_cast<size_t>(match.camera)]) continue;
    const auto& world_from_board = seeded.world_from_board[static_cast<size_t>(match.pose)];
    if (!world_from_board) continue;
    const Imager& camera = seeded.cameras[static_cast<size_t>(match.camera)];
    Vector3d p;
    if (!intersect_board({camera.lens.model, camera.lens.values, camera.imager_from_world}, *world_from_board,
                         shape, Vector2d::Zero(), match.px_camera, &p))
      continue;
    points.p_world.push_back(p);
    points.px.push_back(match.px_projector);
    points.poses.push_back(match.pose);
  }
  return points;
}

Result<Imager> seed_projector(const Observations& observations,
                              int projector,
                              const Points& points,
                              const LensModel& model) {
  const CapturedDevice& device = observations.projectors[static_cast<size_t>(projector)];
  const size_t poses = points.pose_count();
  if (poses < 2 || points.px.size() < 20)
    return error(
        "{}: expected its light on the board in at least 3 poses, found {} poses with {} patches. Point it "
        "at the board, darken the room, check the exposure.",
        device.name, poses, points.px.size());
  const auto linear = linear_camera(points.p_world, points.px);
  if (!linear)
    return error(
        "{}: the {} board poses do not determine it. Vary tilt (20 to 45 degrees) and distance more.",
        device.name, poses);
  Imager imager{device.name, device.width, device.height, {}, linear->imager_from_world};
  imager.lens.model = model;
  imager.lens.values.assign(static_cast<size_t>(model.value_count()), 0.0);
  const double f = std::sqrt(linear->fx * linear->fy);
  imager.lens.values[0] = imager.lens.values[1] = f;
  imager.lens.values[2] = linear->cx;
  imager.lens.values[3] = linear->cy;
  return imager;
}

// The pose of an imager whose lens is known: imager_from_world. nullopt where most points disagree with it.
std::optional<Pose> pose_by_points(const Lens& lens, const Points& points) {
  constexpr float k_far = 0.02F;  // on the plane z = 1: initial lenses are right to this
  constexpr int k_tries = 200;
  std::vector<cv::Point3d> p_world;
  std::vector<cv::Point2d> flat;
  for (size_t i = 0; i < points.px.size(); ++i) {
    const auto d = lens.unproject(points.px[i]);
    if (!d || !(d->z() > 0)) continue;
    p_world.emplace_back(points.p_world[i].x(), points.p_world[i].y(), points.p_world[i].z());
    flat.emplace_back(d->x() / d->z(), d->y() / d->z());
  }
  if (p_world.size() < k_least_shared) return std::nullopt;
  cv::Mat rvec, tvec;
  std::vector<int> inliers;
  const bool found = cv::solvePnPRansac(p_world, flat, cv::Mat::eye(3, 3, CV_64F), cv::noArray(), rvec, tvec,
                                        false, k_tries, k_far, 0.999, inliers, cv::SOLVEPNP_SQPNP);
  if (!found || 2 * inliers.size() < p_world.size()) return std::nullopt;
  const Pose pose = to_pose(rvec, tvec);
  return pose.is_finite() ? std::optional(pose) : std::nullopt;
}

// Finds where cameras stand that see no board together with a placed one.
class Joiner {
 public:
  Joiner(const Observations& observations,
         const std::vector<CameraSeed>& seeds,
         const std::vector<LensModel>& projector_models,
         const Seed& placed,
         const std::vector<bool>& is_placed)
      : observations_(observations), seeds_(seeds), placed_(placed), is_placed_(is_placed) {
    for (int p = 0; p < std::ssize(observations.projectors); ++p) {
      models_.push_back(projector_models[static_cast<size_t>(p)]);
      lit_.push_back(points_of(observations, placed, p, is_placed));
      const auto projector = seed_projector(observations, p, lit_.back(), models_.back());
      projectors_.push_back(projector ? std::optional(*projector) : std::nullopt);
    }
  }

  std::optional<Pose> camera_pose(size_t camera) const {
    std::vector<Pose> candidates;
    for (size_t p = 0; p < projectors_.size(); ++p) {
      if (const auto pose = by_projector(camera, p)) candidates.push_back(*pose);
    }
    if (candidates.empty()) return pose_by_points(placed_.cameras[camera].lens, tie_points(camera));
    return medoid(candidates);
  }

 private:
  // Both sides see light of one projector on boards of their own. The side that sees more of it gives its
  // lens.
  std::optional<Pose> by_projector(size_t camera, size_t p) const {
    std::vector<bool> alone(is_placed_.size(), false);
    alone[camera] = true;
    Seed own = placed_;
    own.world_from_board.assign(observations_.poses.size(), std::nullopt);
    place(camera, seeds_[camera], Pose(), &own);  // the camera's own frame takes the place of the world
    const Points seen = points_of(observations_, own, static_cast<int>(p), alone);
    const auto projector = seed_projector(observations_, static_cast<int>(p), seen, models_[p]);
    const bool is_better_known = projectors_[p] && lit_[p].pose_count() >= seen.pose_count();
    if (is_better_known || (projectors_[p] && !projector)) {
      const auto projector_from_camera = pose_by_points(projectors_[p]->lens, seen);
      if (!projector_from_camera) return std::nullopt;
      return projector_from_camera->inverse() * projectors_[p]->imager_from_world;
    }
    if (!projector) return std::nullopt;
    const auto projector_from_world = pose_by_points(projector->lens, lit_[p]);
    if (!projector_from_world) return std::nullopt;
    return projector->imager_from_world.inverse() * *projector_from_world;
  }

  // Tie points that a placed camera and a placed projector locate, and `camera` observes.
  Points tie_points(size_t camera) const {
    struct Sight {
      std::optional<Vector2d> px, px_placed, px_projector;
      size_t placed = 0, projector = 0;
    };
    std::vector<Sight> sights(observations_.points.size());
    const auto add = [&](Sight* sight, size_t by, const Vector2d& px) {
      if (by == camera) sight->px = px;
      if (!is_placed_[by]) return;
      sight->px_placed = px;
      sight->placed = by;
    };
    for (size_t i = 0; i < sights.size(); ++i)
      add(&sights[i], static_cast<size_t>(observations_.points[i].camera), observations_.points[i].px_camera);
    for (const TiePointObservation& seen : observations_.tie_observations) {
      Sight& sight = sights[static_cast<size_t>(seen.point)];
      const auto by = static_cast<size_t>(seen.imager);
      if (!seen.by_projector) {
        add(&sight, by, seen.px);
      } else if (projectors_[by]) {
        sight.px_projector = seen.px;
        sight.projector = by;
      }
    }
    Points points;
    for (size_t i = 0; i < sights.size(); ++i) {
      const Sight& sight = sights[i];
      if (!sight.px || !sight.px_placed || !sight.px_projector) continue;
      const Imager &eye = placed_.cameras[sight.placed], &light = *projectors_[sight.projector];
      LensRay ray;
      if (!find_ray(eye.lens.model, eye.lens.values, *sight.px_placed, false, &ray)) continue;
      const double depth = triangulated_depth({eye.lens.model, eye.lens.values, eye.imager_from_world}, ray,
                                              {light.lens.model, light.lens.values, light.imager_from_world},
                                              *sight.px_projector);
      if (!(depth > 0)) continue;
      points.p_world.push_back(eye.imager_from_world.inverse() * (depth * ray.d));
      points.px.push_back(*sight.px);
      points.poses.push_back(observations_.points[i].pose);
    }
    return points;
  }

  const Observations& observations_;
  const std::vector<CameraSeed>& seeds_;
  const Seed& placed_;
  const std::vector<bool>& is_placed_;
  std::vector<LensModel> models_;
  std::vector<Points> lit_;  // for each projector, by the placed cameras
  std::vector<std::optional<Imager>> projectors_;
};

// Computes camera_from_world for every camera and the boards' poses in the world, starting from camera 0:
// first through boards that two cameras see, then through the light of a projector that both see, or through
// tie points.
Status link(const Observations& observations,
            const std::vector<CameraSeed>& seeds,
            const std::vector<LensModel>& projector_models,
            Seed* into) {
  std::vector<bool> is_placed(seeds.size(), false);
  const auto place_one = [&](const auto& pose_of) {
    for (size_t camera = 0; camera < seeds.size(); ++camera) {
      const std::optional<Pose> pose = is_placed[camera] ? std::nullopt : pose_of(camera);
      if (!pose) continue;
      is_placed[camera] = true;
      place(camera, seeds[camera], *pose, into);
      return true;
    }
    return false;
  };
  place_one([](size_t) { return std::optional(Pose()); });
  for (bool goes_on = true; goes_on;) {
    goes_on = place_one([&](size_t camera) -> std::optional<Pose> {
      const std::vector<Pose> candidates = poses_by_boards(seeds[camera], *into);
      return candidates.empty() ? std::nullopt : std::optional(medoid(candidates));
    });
    if (goes_on || std::count(is_placed.begin(), is_placed.end(), false) == 0) continue;
    const Joiner joiner(observations, seeds, projector_models, *into, is_placed);
    goes_on = place_one([&](size_t camera) { return joiner.camera_pose(camera); });
  }
  const auto apart = std::find(is_placed.begin(), is_placed.end(), false);
  if (apart == is_placed.end()) return {};
  const auto& name = observations.cameras[static_cast<size_t>(apart - is_placed.begin())].name;
  return error(
      "{}: nothing joins it with {}: no board that both see, no projector whose light both see on boards, no "
      "scene that both see. Capture some board poses in the light of a projector that both see, or the "
      "prototype without a board.",
      name, observations.cameras[0].name);
}

// Moves the points' centre to 0 and scales their mean distance to sqrt(dimension).
template <int N>
Eigen::Matrix<double, N + 1, N + 1> normaliser(const std::vector<Eigen::Matrix<double, N, 1>>& points) {
  Eigen::Matrix<double, N, 1> mean = Eigen::Matrix<double, N, 1>::Zero();
  for (const auto& p : points) mean += p / static_cast<double>(points.size());
  double distance = 0;
  for (const auto& p : points) distance += (p - mean).norm() / static_cast<double>(points.size());
  const double scale = distance > 0 ? std::sqrt(static_cast<double>(N)) / distance : 1;
  Eigen::Matrix<double, N + 1, N + 1> t = Eigen::Matrix<double, N + 1, N + 1>::Identity();
  t.topLeftCorner(N, N) *= scale;
  t.topRightCorner(N, 1) = -scale * mean;
  return t;
}

// K upper triangular with a positive diagonal, R a rotation: K R = m (m has a positive determinant).
void split_camera(const Matrix3d& m, Matrix3d* k, Matrix3d* r) {
  const Matrix3d flip = (Matrix3d() << 0, 0, 1, 0, 1, 0, 1, 0, 0).finished();
  const Eigen::HouseholderQR<Matrix3d> qr((flip * m).transpose());
  const Matrix3d q = qr.householderQ();
  const Matrix3d upper = qr.matrixQR().triangularView<Eigen::Upper>();
  *k = flip * upper.transpose() * flip;
  *r = flip * q.transpose();
  const Matrix3d signs = k->diagonal().cwiseSign().asDiagonal();
  *k = *k * signs;
  *r = signs * *r;
}

}  // namespace

std::optional<LinearCamera> linear_camera(const std::vector<Vector3d>& p_world,
                                          const std::vector<Vector2d>& px) {
  if (px.size() < 6) return std::nullopt;
  const Eigen::Matrix4d t_world = normaliser<3>(p_world);
  const Matrix3d t_px = normaliser<2>(px);
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(12, 12);
  for (size_t i = 0; i < px.size(); ++i) {
    const Eigen::Vector4d x = t_world * p_world[i].homogeneous();
    const Vector3d u = t_px * px[i].homogeneous();
    Eigen::Matrix<double, 2, 12> rows;
    rows << x.transpose(), Eigen::RowVector4d::Zero(), -u.x() * x.transpose(),  //
        Eigen::RowVector4d::Zero(), x.transpose(), -u.y() * x.transpose();
    normal += rows.transpose() * rows;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(normal);
  // On a plane two more directions are free.
  if (!(eigen.eigenvalues()[1] > 1e-9 * eigen.eigenvalues()[11])) return std::nullopt;
  const Eigen::Matrix<double, 12, 1> v = eigen.eigenvectors().col(0);
  Eigen::Matrix<double, 3, 4> p;
  p << v.segment<4>(0).transpose(), v.segment<4>(4).transpose(), v.segment<4>(8).transpose();
  p = t_px.inverse() * p * t_world;
  if (p.leftCols<3>().determinant() < 0) p = -p;
  Matrix3d k, r;
  split_camera(p.leftCols<3>(), &k, &r);
  const Vector3d t = k.inverse() * p.col(3);
  k /= k(2, 2);
  LinearCamera camera{k(0, 0), k(1, 1), k(0, 2), k(1, 2), Pose(r, t)};
  size_t in_front = 0;
  for (const Vector3d& point : p_world) in_front += (camera.imager_from_world * point).z() > 0 ? 1 : 0;
  const bool proper = camera.imager_from_world.is_finite() && camera.fx > 0 && camera.fy > 0 &&
                      camera.fx < 5 * camera.fy && camera.fy < 5 * camera.fx && in_front == p_world.size();
  if (!proper) return std::nullopt;
  return camera;
}

Result<Pose> board_pose_seed(const Observations& observations, const Rig& rig) {
  std::vector<int> counts(rig.cameras.size(), 0);
  for (const CornerObservation& seen : observations.corners) ++counts[static_cast<size_t>(seen.camera)];
  const auto best = static_cast<size_t>(std::max_element(counts.begin(), counts.end()) - counts.begin());
  const Imager& camera = rig.cameras[best];
  std::vector<cv::Point3d> p_board;
  std::vector<cv::Point2d> flat;  // on the plane z = 1
  for (const CornerObservation& seen : observations.corners) {
    const auto d = static_cast<size_t>(seen.camera) == best ? camera.lens.unproject(seen.px) : std::nullopt;
    if (!d || !(d->z() > 0)) continue;
    const Vector3d p = observations.board.p_corner(seen.corner);
    p_board.emplace_back(p.x(), p.y(), 0);
    flat.emplace_back(d->x() / d->z(), d->y() / d->z());
  }
  cv::Mat rvec, tvec;
  if (p_board.size() < 4 || !cv::solvePnP(p_board, flat, cv::Mat::eye(3, 3, CV_64F), cv::noArray(), rvec,
                                          tvec, false, cv::SOLVEPNP_IPPE))
    return error("{}: cannot estimate the board's pose from {} corners. Keep more of the board in view.",
                 camera.name, p_board.size());
  const Pose camera_from_board = to_pose(rvec, tvec);
  if (!camera_from_board.is_finite() || !(camera_from_board.translation.z() > 0))
    return error(
        "{}: {} corners of the board all lie on a line; a pose needs corners in two directions. Keep more of "
        "the board in view.",
        camera.name, p_board.size());
  return camera.imager_from_world.inverse() * camera_from_board;
}

Result<Seed> seed(const Observations& observations,
                  const std::vector<LensModel>& camera_models,
                  const std::vector<LensModel>& projector_models) {
  Seed seeded;
  seeded.world_from_board.resize(observations.poses.size());
  std::vector<CameraSeed> cameras;
  for (int i = 0; i < static_cast<int>(observations.cameras.size()); ++i) {
    LIMN_TRY(CameraSeed camera, seed_camera(observations, i, camera_models[static_cast<size_t>(i)]));
    const CapturedDevice& device = observations.cameras[static_cast<size_t>(i)];
    seeded.cameras.push_back({device.name, device.width, device.height, camera.lens, Pose(), device.sees});
    cameras.push_back(std::move(camera));
  }
  LIMN_TRY_STATUS(link(observations, cameras, projector_models, &seeded));
  place_remaining(observations, &seeded);
  for (int i = 0; i < static_cast<int>(observations.projectors.size()); ++i) {
    const Points points = points_of(observations, seeded, i, std::vector(cameras.size(), true));
    LIMN_TRY(Imager projector,
             seed_projector(observations, i, points, projector_models[static_cast<size_t>(i)]));
    seeded.projectors.push_back(std::move(projector));
  }
  return seeded;
}

}  // namespace limn::calib
