#include "tests/calib/true_rig.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/calib3d.hpp>

#include "calib/measurement_model.h"
#include "sim/car_door.h"
#include "sim/ray_scene.h"
#include "sim/truth.h"

namespace limn::test {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double k_away = 1.3;  // m, from the camera to the centre of the space
constexpr double k_moved_m = 0.15;
constexpr double k_turned = 40 * std::numbers::pi / 180;
constexpr size_t k_measured = 24;        // number of points that the prototype's pose is measured from
constexpr double k_edge_m = 0.003;       // light that lands this far off the point's plane missed an edge
constexpr double k_least_cosine = 0.34;  // 70 degrees: points lit at a more grazing angle are not used

calib::ImagerView view(const Imager& imager) {
  return {imager.lens.model, imager.lens.values, imager.imager_from_world};
}

Imager imager(const std::string& name, int width, int height, std::vector<double> values, const Pose& pose) {
  return {name, width, height, Lens::create("LENSMODEL_OPENCV4", std::move(values)).value(), pose};
}

// ---- prototypes ----

void add_triangle(scene::Mesh* mesh, std::uint32_t a, std::uint32_t b, std::uint32_t c) {
  mesh->triangles.push_back({a, b, c});
  mesh->triangle_materials.push_back(0);
}

// A grid of points p(s, t), s and t from 0 to 1, with a normal for each vertex.
template <class Surface>
void add_surface(scene::Mesh* mesh, int columns, int rows, const Surface& p) {
  const auto first = static_cast<std::uint32_t>(mesh->positions.size());
  for (int row = 0; row <= rows; ++row) {
    for (int column = 0; column <= columns; ++column) {
      const double s = static_cast<double>(column) / columns, t = static_cast<double>(row) / rows, h = 1e-4;
      mesh->positions.push_back(p(s, t).template cast<float>());
      mesh->normals.push_back(
          (p(s + h, t) - p(s - h, t)).cross(p(s, t + h) - p(s, t - h)).normalized().template cast<float>());
    }
  }
  const auto width = static_cast<std::uint32_t>(columns + 1);
  for (std::uint32_t row = 0; row < static_cast<std::uint32_t>(rows); ++row) {
    for (std::uint32_t column = 0; column < static_cast<std::uint32_t>(columns); ++column) {
      const std::uint32_t a = first + row * width + column;
      add_triangle(mesh, a, a + 1, a + 1 + width);
      add_triangle(mesh, a, a + 1 + width, a + width);
    }
  }
}

void add_box(scene::Mesh* mesh, const Pose& at, const Vector3d& size) {
  for (int axis = 0; axis < 3; ++axis) {
    for (const double side : {-1.0, 1.0}) {
      add_surface(mesh, 1, 1, [&](double s, double t) {
        Vector3d p;
        p[axis] = side * size[axis] / 2;
        p[(axis + 1) % 3] = side * (s - 0.5) * size[(axis + 1) % 3];
        p[(axis + 2) % 3] = (t - 0.5) * size[(axis + 2) % 3];
        return Vector3d(at * p);
      });
    }
  }
}

void add_ball(scene::Mesh* mesh, const Vector3d& p_centre, double radius) {
  add_surface(mesh, 96, 48, [&](double s, double t) {
    const double around = 2 * std::numbers::pi * s, up = std::numbers::pi * (t * 0.98 + 0.01);
    return Vector3d(p_centre + radius * Vector3d(std::cos(around) * std::sin(up),
                                                 std::sin(around) * std::sin(up), std::cos(up)));
  });
}

scene::Mesh cluster_mesh() {
  scene::Mesh mesh;
  const auto at = [](double x, double y, double z, double turn) {
    return Pose(exp_rotation({0.6 * turn, turn, 0.3 * turn}), Vector3d(x, y, z));
  };
  add_box(&mesh, at(0, 0, 0.08, 0), {0.5, 0.4, 0.02});
  add_box(&mesh, at(-0.14, -0.08, 0.0, 0.5), {0.12, 0.1, 0.1});
  add_box(&mesh, at(0.15, 0.08, 0.02, -0.4), {0.1, 0.12, 0.12});
  add_box(&mesh, at(0.12, -0.1, 0.03, 0.2), {0.1, 0.08, 0.08});
  add_ball(&mesh, {0, 0, 0}, 0.075);
  add_ball(&mesh, {-0.13, 0.1, 0.02}, 0.06);
  return mesh;
}

// A trough: open towards -z, curved across, with ends that rise.
scene::Mesh concave_mesh() {
  scene::Mesh mesh;
  add_surface(&mesh, 80, 60, [](double s, double t) {
    const double x = (s - 0.5) * 0.5, y = (t - 0.5) * 0.4;
    return Vector3d(x, y, 0.08 - 1.9 * x * x - 1.2 * y * y);
  });
  return mesh;
}

// The project's car door faces its +z; it is turned to face -z.
scene::Mesh panel_mesh() {
  scene::Mesh mesh = sim::car_door_scene().prototype->mesh;
  for (auto* list : {&mesh.positions, &mesh.normals}) {
    for (Eigen::Vector3f& v : *list) v = {v.x(), -v.y(), -v.z()};
  }
  return mesh;
}

// ---- judging ----

struct SurfacePoint {
  Vector3d p, n;  // on the prototype, its frame
};

bool faces(const Imager& imager, const Vector3d& p_world, const Vector3d& n_world) {
  const Vector3d d = (imager.imager_from_world.inverse().translation - p_world).normalized();
  return std::abs(n_world.dot(d)) > k_least_cosine;
}

bool seen(const sim::RayScene& scene, const Imager& imager, const Vector3d& p_world) {
  const auto px = imager.project(p_world);
  return px && imager.contains(*px) && scene.reached(imager.imager_from_world.inverse().translation, p_world);
}

// Points as far apart as possible: each is the farthest from those before.
std::vector<Vector3d> spread(const std::vector<Vector3d>& points, size_t count) {
  std::vector<Vector3d> chosen = {points.front()};
  std::vector<double> distance(points.size(), 1e9);
  while (chosen.size() < count) {
    size_t farthest = 0;
    for (size_t i = 0; i < points.size(); ++i) {
      distance[i] = std::min(distance[i], (points[i] - chosen.back()).norm());
      if (distance[i] > distance[farthest]) farthest = i;
    }
    chosen.push_back(points[farthest]);
  }
  return chosen;
}

// The pose of known points as a calibrated camera measures it.
Pose measured_pose(const Imager& calibrated,
                   const std::vector<Vector3d>& p_thing,
                   const std::vector<Vector2d>& pixels) {
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> directions;
  for (size_t i = 0; i < p_thing.size(); ++i) {
    const auto d = calibrated.lens.unproject(pixels[i]);
    if (!d) continue;
    points.emplace_back(p_thing[i].x(), p_thing[i].y(), p_thing[i].z());
    directions.emplace_back(d->x() / d->z(), d->y() / d->z());
  }
  cv::Mat rvec, tvec;
  cv::solvePnP(points, directions, cv::Mat::eye(3, 3, CV_64F), cv::noArray(), rvec, tvec, false,
               cv::SOLVEPNP_SQPNP);
  cv::solvePnPRefineLM(points, directions, cv::Mat::eye(3, 3, CV_64F), cv::noArray(), rvec, tvec,
                       cv::TermCriteria(cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 100, 1e-14));
  const Vector3d w(rvec.at<double>(0), rvec.at<double>(1), rvec.at<double>(2));
  const Vector3d t(tvec.at<double>(0), tvec.at<double>(1), tvec.at<double>(2));
  return calibrated.imager_from_world.inverse() * Pose(exp_rotation(w), t);
}

std::optional<double> error_mm(const sim::RayScene& scene,
                               const Imager& projector,
                               const Vector2d& px,
                               const Vector3d& p_world,
                               const Vector3d& n_world) {
  const auto ray = projector.ray(px);
  if (!ray) return std::nullopt;
  const double along = n_world.dot(p_world - ray->p_origin) / n_world.dot(ray->d);
  const Vector3d on_plane = ray->p_origin + along * ray->d;
  const sim::Hit hit = scene.first_hit(*ray);
  const Vector3d landed = ray->p_origin + hit.distance * ray->d;
  const bool same_face = hit.object >= 0 && (landed - on_plane).norm() < k_edge_m;
  return 1e3 * ((same_face ? landed : on_plane) - p_world).norm();
}

// All errors in one placement.
std::vector<double> errors_at(const TrueRig& truth,
                              const Rig& calibrated,
                              const scene::Mesh& mesh,
                              const Pose& world_from_prototype,
                              double pnp_px,
                              int count,
                              std::mt19937_64* rng) {
  const sim::MeshInstance there{&mesh, world_from_prototype};
  const sim::RayScene scene({&there, 1});
  const Imager &camera = truth.rig.cameras[0], &projector = truth.rig.projectors[0];
  std::vector<Vector3d> visible;
  std::vector<SurfacePoint> targets;
  for (const sim::SampledPoint& point : sim::surface_points(mesh, 8 * count, (*rng)())) {
    const Vector3d p_world = world_from_prototype * point.p,
                   n_world = world_from_prototype.rotation * point.n;
    if (seen(scene, camera, p_world) && faces(camera, p_world, n_world)) visible.push_back(point.p);
    if (static_cast<int>(targets.size()) < count && seen(scene, projector, p_world) &&
        faces(projector, p_world, n_world))
      targets.push_back({point.p, point.n});
  }
  if (visible.size() < 4 * k_measured) return {};
  const std::vector<Vector3d> known = spread(visible, k_measured);
  std::normal_distribution<double> noise(0, pnp_px);
  std::vector<Vector2d> pixels;
  for (const Vector3d& p : known)
    pixels.push_back(*camera.project(world_from_prototype * p) + Vector2d(noise(*rng), noise(*rng)));
  const Pose measured = measured_pose(calibrated.cameras[0], known, pixels);
  std::vector<double> errors;
  for (const SurfacePoint& target : targets) {
    const auto px = calibrated.projectors[0].project(measured * target.p);
    if (!px) continue;
    const auto error = error_mm(scene, projector, *px, world_from_prototype * target.p,
                                world_from_prototype.rotation * target.n);
    if (error) errors.push_back(*error);
  }
  return errors;
}

void append(const std::vector<double>& more, std::vector<double>* all) {
  all->insert(all->end(), more.begin(), more.end());
}

}  // namespace

TrueRig make_true_rig(const RigOptions& options) {
  TrueRig truth;
  truth.board = calib::Board::parse("charuco:11x8:30mm").value();
  truth.bow_m = {options.bow_m, 0};
  truth.rig.cameras.push_back(
      imager("camera0", 1280, 960, {1500, 1502, 647, 472, -0.1, 0.05, 0.0005, -0.0003}, Pose()));
  if (options.square_pixels) truth.rig.cameras[0].lens.values[1] = truth.rig.cameras[0].lens.values[0];
  const double cy = 299.5 + 600 * options.shift;
  const Vector3d p_eye(options.asunder, -0.15, 0.05), p_target(0, 0, k_away);
  const Pose towards = looking_at(p_eye, p_target, {0, -1, 0});
  const Pose turned(exp_rotation({std::atan2(600 * options.shift, 1330.0), 0, 0}), Vector3d::Zero());
  truth.rig.projectors.push_back(imager("projector0", 800, 600,
                                        {1330, 1332, 405, cy, options.k1, -0.2 * options.k1, 0.0003, -0.0004},
                                        turned * towards));
  std::mt19937_64 rng(options.seed);
  std::uniform_real_distribution<double> even(-1, 1);
  const Pose middle(Eigen::Quaterniond::Identity(),
                    Vector3d(-truth.board.width_m() / 2, -truth.board.height_m() / 2, 0));
  for (int pose = 0; pose < options.poses; ++pose) {
    // Tilts go around all directions, positions cover a grid with some disorder.
    const double around = 2.4 * pose, tilt = options.tilt * (0.65 + 0.35 * even(rng));
    const double column = pose % 3 - 1, row = pose / 3 % 4 / 1.5 - 1;
    const Vector3d p(options.spread * (0.15 * column + 0.04 * even(rng)),
                     options.spread * (0.10 * row + 0.03 * even(rng)),
                     k_away + options.spread * 0.14 * even(rng));
    const Pose held(exp_rotation({tilt * std::cos(around), tilt * std::sin(around), 0.3 * even(rng)}), p);
    const double turns = options.quarter_turns ? pose % 3 : 0;
    const Pose rolled(exp_rotation({0, 0, turns * std::numbers::pi / 2}), Vector3d::Zero());
    truth.world_from_board.push_back(held * rolled * middle);
  }
  // The prototype faces the bisector of camera and projector.
  truth.world_from_prototype = looking_at(p_target, 2 * p_target - p_eye / 2, Vector3d(0, -1, 0)).inverse();
  return truth;
}

calib::Observations observed_perfectly(const TrueRig& truth, int each) {
  const calib::Board& board = truth.board;
  const calib::BoardShape shape{board.width_m(), board.height_m(), truth.twist_m};
  const Imager &camera = truth.rig.cameras[0], &projector = truth.rig.projectors[0];
  calib::Observations observations;
  observations.board = board;
  observations.cameras = {{camera.name, camera.width, camera.height}};
  observations.projectors = {{projector.name, projector.width, projector.height}};
  for (int pose = 0; pose < static_cast<int>(truth.world_from_board.size()); ++pose) {
    const Pose& at = truth.world_from_board[static_cast<size_t>(pose)];
    observations.poses.push_back(fmt::format("pose{:02}", pose));
    Vector2d px, px_projector;
    for (int id = 0; id < board.corner_count(); ++id) {
      if (calib::predict_corner(view(camera), at, shape, truth.bow_m, board.p_corner(id).head<2>(), &px) &&
          camera.contains(px))
        observations.corners.push_back({0, pose, id, px, 0.01});
    }
    for (int i = pose % each; i < 4 * board.columns * board.rows; i += each) {
      const Vector2d xy((i % (2 * board.columns) + 0.5) * board.square_m / 2,
                        (i / (2 * board.columns) + 0.5) * board.square_m / 2);
      if (!calib::predict_corner(view(camera), at, shape, truth.bow_m, xy, &px) || !camera.contains(px))
        continue;
      if (calib::predict_match(view(camera), view(projector), at, shape, truth.bow_m, px, &px_projector) &&
          projector.contains(px_projector))
        observations.matches.push_back({0, 0, pose, px, px_projector, 0.01, 100});
    }
  }
  return observations;
}

void add_noise(double corner_px, double match_px, std::mt19937_64* rng, calib::Observations* observations) {
  std::normal_distribution<double> scatter(0, 1);
  for (calib::CornerObservation& seen : observations->corners)
    seen.px += corner_px * Vector2d(scatter(*rng), scatter(*rng));
  for (calib::Match& match : observations->matches)
    match.px_projector += match_px * Vector2d(scatter(*rng), scatter(*rng));
}

void add_shared_errors(double px, std::mt19937_64* rng, calib::Observations* observations) {
  constexpr double k_board_px = 200;  // half of a board in the camera's image
  std::normal_distribution<double> scatter(0, px > 0 ? px : 1);
  for (size_t pose = 0; px > 0 && pose < observations->poses.size(); ++pose) {
    Eigen::Matrix<double, 2, 3> error;
    for (int i = 0; i < error.size(); ++i) error(i) = scatter(*rng);
    Vector2d middle = Vector2d::Zero();
    double count = 0;
    for (const calib::Match& match : observations->matches) {
      if (match.pose != static_cast<int>(pose)) continue;
      middle += match.px_camera;
      ++count;
    }
    for (calib::Match& match : observations->matches) {
      if (match.pose != static_cast<int>(pose)) continue;
      const Vector2d at = (match.px_camera - middle / count) / k_board_px;
      match.px_projector += error * Vector3d(1, at.x(), at.y());
    }
  }
}

std::string to_text(Prototype prototype) {
  return prototype == Prototype::panel ? "panel" : prototype == Prototype::cluster ? "cluster" : "concave";
}

scene::Mesh prototype_mesh(Prototype prototype) {
  switch (prototype) {
    case Prototype::panel:
      return panel_mesh();
    case Prototype::cluster:
      return cluster_mesh();
    case Prototype::concave:
      break;
  }
  return concave_mesh();
}

std::vector<double> Landed::pooled_mm() const {
  std::vector<double> all = in_place_mm;
  append(moved_mm, &all);
  append(turned_mm, &all);
  return all;
}

Landed landed(const TrueRig& truth,
              const Rig& calibrated,
              const scene::Mesh& prototype,
              double pnp_px,
              int points,
              std::mt19937_64* rng) {
  const Pose& home = truth.world_from_prototype;
  const int each = points / 4;
  const auto at = [&](const Pose& place) {
    return errors_at(truth, calibrated, prototype, place, pnp_px, each, rng);
  };
  Landed all;
  for (int i = 0; i < 4; ++i) append(at(home), &all.in_place_mm);
  for (const double sign : {-1.0, 1.0}) {
    for (const int axis : {0, 2}) {
      Pose moved = home;
      moved.translation += sign * k_moved_m * Vector3d::Unit(axis);
      append(at(moved), &all.moved_mm);
    }
    for (const int axis : {0, 1})
      append(at(home * Pose(exp_rotation(sign * k_turned * Vector3d::Unit(axis)), Vector3d::Zero())),
             &all.turned_mm);
  }
  return all;
}

double rms(const std::vector<double>& values) {
  double squared = 0;
  for (const double v : values) squared += v * v;
  return std::sqrt(squared / static_cast<double>(std::max<size_t>(1, values.size())));
}

double p95(std::vector<double> values) {
  if (values.empty()) return std::nan("");
  std::sort(values.begin(), values.end());
  return values[static_cast<size_t>(0.95 * static_cast<double>(values.size() - 1))];
}

double share_within(const std::vector<double>& values, double limit) {
  const auto within = std::count_if(values.begin(), values.end(), [&](double v) { return v <= limit; });
  return static_cast<double>(within) / static_cast<double>(std::max<size_t>(1, values.size()));
}

}  // namespace limn::test
