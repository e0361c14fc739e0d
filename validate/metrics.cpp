#include "validate/metrics.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "core/median.h"
#include "core/result.h"
#include "sim/truth.h"

namespace limn::validate {
namespace {

constexpr double k_dot_radius_m = 0.0018;       // about 4 projector pixels across, for sub-pixel centroids
constexpr double k_dot_spacing_m = 0.0075;      // so that discs and their light do not touch
constexpr double k_floating_spacing_m = 0.012;  // the surface's slant stretches a floating disc's light
constexpr double k_free_radius_m = 0.0026;      // the disc's light with the fringe of its projector pixels
constexpr double k_floating_free_radius_m = 0.0045;
// Cosine between line of sight and normal of the surface behind a floating disc; it limits the stretching.
constexpr double k_min_view_cosine = 0.6;
constexpr double k_flat_m = 0.001;  // largest distance of the surface from a dot's plane there
constexpr int k_dot_corners = 12;
constexpr int k_tries_per_dot = 30;  // random points, to place dots as close as their spacing allows
constexpr double k_border_px = 4;    // dots stay this far from the border of a projector's image
constexpr double k_dot_lift_m = 0.0002;
// 70 degrees. At larger angles a dot is under two projector pixels wide and its centroid is not accurate.
constexpr double k_min_dot_cosine = 0.34;

// Points on the rim of a disc around a sample, in the tangent plane.
std::vector<Eigen::Vector3d> rim(const sim::SampledPoint& sample, double radius_m) {
  const Eigen::Vector3d u = sample.n.unitOrthogonal(), v = sample.n.cross(u);
  std::vector<Eigen::Vector3d> corners;
  for (int i = 0; i < k_dot_corners; ++i) {
    const double angle = 2 * std::numbers::pi * i / k_dot_corners;
    corners.push_back(sample.p + radius_m * (std::cos(angle) * u + std::sin(angle) * v));
  }
  return corners;
}

bool well_inside(const Imager& projector, const Eigen::Vector3d& p_world) {
  const auto px = projector.project(p_world);
  return px && px->x() > k_border_px && px->y() > k_border_px &&
         px->x() < projector.width - 1 - k_border_px && px->y() < projector.height - 1 - k_border_px;
}

// Whether the true projector reaches the disc from the front, with some margin.
bool reached_by(const sim::World& world,
                const sim::Truth& truth,
                const Imager& projector,
                const sim::SampledPoint& sample,
                double free_radius_m) {
  const Eigen::Vector3d p_light = projector.imager_from_world.inverse().translation;
  const Eigen::Vector3d p_world = world.world_from_prototype * sample.p;
  const Eigen::Vector3d n_world = world.world_from_prototype.rotation * sample.n;
  if (n_world.dot((p_light - p_world).normalized()) < k_min_dot_cosine) return false;
  if (!well_inside(projector, p_world)) return false;
  std::vector<Eigen::Vector3d> places = rim(sample, free_radius_m);
  places.push_back(sample.p);
  for (const Eigen::Vector3d& p : places) {
    const auto px = projector.project(world.world_from_prototype * p);
    const auto landing = px ? truth.landing(projector, *px) : std::nullopt;
    if (!landing || landing->object != "prototype") return false;
    if ((landing->p_object - p).norm() > k_flat_m) return false;
  }
  return true;
}

bool reached(const sim::World& world,
             const sim::Truth& truth,
             const sim::SampledPoint& sample,
             double free_radius_m) {
  return std::any_of(world.rig.projectors.begin(), world.rig.projectors.end(),
                     [&](const Imager& p) { return reached_by(world, truth, p, sample, free_radius_m); });
}

// A grid of cells with side `spacing`, for nearest-point queries.
class NearestPoints {
 public:
  NearestPoints(const std::vector<Eigen::Vector3d>* points, double spacing)
      : points_(points), spacing_(spacing) {}
  void add(std::size_t index) { cells_[cell_of((*points_)[index])].push_back(index); }
  // Index of the nearest point within this distance, if any.
  std::optional<std::size_t> nearest(const Eigen::Vector3d& p, double within) const {
    std::optional<std::size_t> best;
    double best_distance = within;
    const Cell centre = cell_of(p);
    for (int i = 0; i < 27; ++i) {
      const auto cell =
          cells_.find({centre[0] + i % 3 - 1, centre[1] + i / 3 % 3 - 1, centre[2] + i / 9 - 1});
      if (cell == cells_.end()) continue;
      for (const std::size_t index : cell->second) {
        const double distance = ((*points_)[index] - p).norm();
        if (distance < best_distance) best = index, best_distance = distance;
      }
    }
    return best;
  }

 private:
  using Cell = std::array<int, 3>;
  Cell cell_of(const Eigen::Vector3d& p) const {
    const Eigen::Vector3d scaled = p / spacing_;
    return {static_cast<int>(std::floor(scaled.x())), static_cast<int>(std::floor(scaled.y())),
            static_cast<int>(std::floor(scaled.z()))};
  }
  const std::vector<Eigen::Vector3d>* points_;
  double spacing_;
  std::map<Cell, std::vector<std::size_t>> cells_;
};

const scene::Mesh& prototype_mesh(const sim::World& world) {
  const sim::Object* prototype = world.find("prototype");
  LIMN_CHECK(prototype != nullptr);
  return *prototype->mesh;
}

// Linear light of each display value by the true gamma.
std::array<double, 256> light_of_values(double gamma) {
  std::array<double, 256> light{};
  for (std::size_t i = 0; i < light.size(); ++i) light[i] = std::pow(double(i) / 255, gamma);
  return light;
}

void append_disc(const sim::SampledPoint& sample, scene::Mesh* mesh) {
  const auto first = static_cast<std::uint32_t>(mesh->positions.size());
  const auto add = [&](const Eigen::Vector3d& p) {
    mesh->positions.push_back((p + k_dot_lift_m * sample.n).cast<float>());
    mesh->normals.push_back(sample.n.cast<float>());
  };
  add(sample.p);
  for (const Eigen::Vector3d& corner : rim(sample, k_dot_radius_m)) add(corner);
  for (std::uint32_t i = 0; i < k_dot_corners; ++i) {
    mesh->triangles.push_back({first, first + 1 + i, first + 1 + (i + 1) % k_dot_corners});
    mesh->triangle_materials.push_back(0);
  }
}

TargetDots no_dots(double spacing_m) {
  TargetDots dots;
  dots.mesh.materials = {scene::Material{.base_colour = {1, 1, 1}, .unlit = true, .texture = {}}};
  dots.spacing_m = spacing_m;
  return dots;
}

// The point of the prototype that the viewer sees in the direction of p (both in the prototype's frame), if
// any.
std::optional<sim::SampledPoint> surface_behind(const sim::World& world,
                                                const sim::Truth& truth,
                                                const Imager& viewer,
                                                const Eigen::Vector3d& p) {
  const auto px = viewer.project(world.world_from_prototype * p);
  const auto landing = px ? truth.landing(viewer, *px) : std::nullopt;
  if (!landing || landing->object != "prototype") return std::nullopt;
  return sim::SampledPoint{landing->p_object,
                           world.world_from_prototype.rotation.inverse() * landing->n_world};
}

// The point that counts when light of a dot lands at p: p itself, or for floating discs p as seen from the
// viewpoint in the disc's plane.
Eigen::Vector3d place_of(const TargetDots& dots, std::size_t dot, const Eigen::Vector3d& p) {
  if (dots.p_centres.empty()) return p;
  const Eigen::Vector3d n = dots.p_viewpoint - dots.p_centres[dot], d = p - dots.p_viewpoint;
  return dots.p_viewpoint - d * (n.squaredNorm() / n.dot(d));
}

cv::Mat outline(const cv::Mat& mask) {
  const cv::Mat inside = mask != 0;
  cv::Mat eroded;
  cv::erode(inside, eroded, cv::getStructuringElement(cv::MORPH_CROSS, {3, 3}), {-1, -1}, 1,
            cv::BORDER_REPLICATE);
  return inside & ~eroded;
}

// Sum of the squared distances from the pixels of one outline to the other, and their number.
std::pair<double, int> squared_distances(const cv::Mat& from, const cv::Mat& to) {
  cv::Mat distance;
  cv::distanceTransform(~to, distance, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  cv::Mat squared = distance.mul(distance);
  squared.setTo(0, ~from);
  return {cv::sum(squared)[0], cv::countNonZero(from)};
}

}  // namespace

TargetDots floating_dots(
    const sim::World& world, const Imager& viewer, double height_m, int count, std::uint64_t seed) {
  const sim::Truth truth(world);
  TargetDots dots = no_dots(k_floating_spacing_m);
  dots.p_viewpoint = world.world_from_prototype.inverse() * viewer.imager_from_world.inverse().translation;
  NearestPoints chosen(&dots.p_targets, k_floating_spacing_m);
  for (const sim::SampledPoint& sample :
       sim::surface_points(prototype_mesh(world), k_tries_per_dot * count, seed)) {
    if (static_cast<int>(dots.p_targets.size()) == count) break;
    const Eigen::Vector3d p_centre = sample.p + height_m * sample.n;
    const auto behind = surface_behind(world, truth, viewer, p_centre);
    if (!behind || (behind->p - dots.p_viewpoint).norm() < (p_centre - dots.p_viewpoint).norm()) continue;
    if (behind->n.dot((dots.p_viewpoint - behind->p).normalized()) < k_min_view_cosine) continue;
    if (chosen.nearest(behind->p, k_floating_spacing_m)) continue;
    const sim::SampledPoint disc{p_centre, (dots.p_viewpoint - p_centre).normalized()};
    const auto corners = rim(disc, k_floating_free_radius_m);
    const bool whole = std::all_of(corners.begin(), corners.end(), [&](const Eigen::Vector3d& corner) {
      const auto beside = surface_behind(world, truth, viewer, corner);
      return beside && (beside->p - behind->p).norm() < k_floating_spacing_m;
    });
    if (!whole || !reached(world, truth, *behind, k_floating_free_radius_m)) continue;
    dots.p_targets.push_back(behind->p);
    dots.p_centres.push_back(p_centre);
    chosen.add(dots.p_targets.size() - 1);
    append_disc(disc, &dots.mesh);
  }
  return dots;
}

TargetDots target_dots(const sim::World& world, int count, std::uint64_t seed) {
  const sim::Truth truth(world);
  TargetDots dots = no_dots(k_dot_spacing_m);
  NearestPoints chosen(&dots.p_targets, k_dot_spacing_m);
  for (const sim::SampledPoint& sample :
       sim::surface_points(prototype_mesh(world), k_tries_per_dot * count, seed)) {
    if (static_cast<int>(dots.p_targets.size()) == count) break;
    if (chosen.nearest(sample.p, k_dot_spacing_m)) continue;
    if (!reached(world, truth, sample, k_free_radius_m)) continue;
    dots.p_targets.push_back(sample.p);
    chosen.add(dots.p_targets.size() - 1);
    append_disc(sample, &dots.mesh);
  }
  return dots;
}

Registration judged_registration(const sim::World& world,
                                 const TargetDots& dots,
                                 std::span<const cv::Mat> projector_images) {
  const sim::Truth truth(world);
  const double reach_m = dots.spacing_m / 2;  // light nearer to a dot than this belongs to the dot
  NearestPoints targets(&dots.p_targets, dots.spacing_m);
  for (std::size_t i = 0; i < dots.p_targets.size(); ++i) targets.add(i);
  std::vector<double> energy(dots.p_targets.size(), 0);
  std::vector<Eigen::Vector3d> moment(dots.p_targets.size(), Eigen::Vector3d::Zero());
  for (std::size_t i = 0; i < projector_images.size(); ++i) {
    const auto light = light_of_values(world.projector_effects[i].gamma);
    cv::Mat grey;
    cv::extractChannel(projector_images[i], grey, 0);
    for (int row = 0; row < grey.rows; ++row) {
      for (int column = 0; column < grey.cols; ++column) {
        const std::uint8_t value = grey.at<std::uint8_t>(row, column);
        if (value == 0) continue;
        const auto landing = truth.landing(world.rig.projectors[i], {column, row});
        if (!landing || landing->object != "prototype") continue;
        const auto dot = targets.nearest(landing->p_object, reach_m);
        if (!dot) continue;
        energy[*dot] += light[value];
        moment[*dot] += light[value] * place_of(dots, *dot, landing->p_object);
      }
    }
  }
  Registration found;
  found.points = static_cast<int>(dots.p_targets.size());
  const auto& truth_places = dots.p_centres.empty() ? dots.p_targets : dots.p_centres;
  double sum = 0;
  for (std::size_t i = 0; i < dots.p_targets.size(); ++i) {
    const bool has_light = energy[i] > 0;
    if (!has_light) ++found.unlit;
    const double error_m = has_light ? (moment[i] / energy[i] - truth_places[i]).norm() : reach_m;
    found.errors_mm.push_back(error_m * 1e3);
    sum += error_m * error_m * 1e6;
  }
  if (found.errors_mm.empty()) return found;
  found.rms_mm = std::sqrt(sum / static_cast<double>(found.errors_mm.size()));
  found.p95_mm = quantile(found.errors_mm, 0.95);
  return found;
}

double outline_distance_px(const cv::Mat& found, const cv::Mat& truth) {
  const cv::Mat a = outline(found), b = outline(truth);
  if (cv::countNonZero(a) == 0 || cv::countNonZero(b) == 0) return std::numeric_limits<double>::infinity();
  const auto [sum_ab, count_ab] = squared_distances(a, b);
  const auto [sum_ba, count_ba] = squared_distances(b, a);
  return std::sqrt((sum_ab + sum_ba) / (count_ab + count_ba));
}

double label_iou(const cv::Mat& found, const cv::Mat& truth) {
  const cv::Mat both = (found == truth) & (truth != 0);
  const cv::Mat either = (found != 0) | (truth != 0);
  return static_cast<double>(cv::countNonZero(both)) / std::max(1, cv::countNonZero(either));
}

double worst_difference(std::span<const cv::Mat> a, std::span<const cv::Mat> b) {
  if (a.size() != b.size()) return std::numeric_limits<double>::infinity();
  double worst = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (a[i].size() != b[i].size() || a[i].type() != b[i].type())
      return std::numeric_limits<double>::infinity();
    worst = std::max(worst, cv::norm(a[i], b[i], cv::NORM_INF));
  }
  return worst;
}

}  // namespace limn::validate
