#include "calib/judge/epipolar.h"

#include <Eigen/Dense>
#include <cmath>

namespace limn::calib {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int k_steps = 8;             // lenses bend the curve little: three steps are usual
constexpr double k_settled_px = 1e-4;  // length of a step along the curve

// Length along `ray` of its point nearest to `other`.
double nearest_length(const Ray& ray, const Ray& other) {
  const Vector3d between = other.p_origin - ray.p_origin;
  const double cosine = ray.d.dot(other.d);
  return (between.dot(ray.d) - between.dot(other.d) * cosine) / std::max(1 - cosine * cosine, 1e-12);
}

struct Image {
  Vector2d px;
  Vector2d per_metre;  // derivative by the ray's length
};

std::optional<Image> seen_by(const Imager& projector, const Ray& ray, double length) {
  const Vector3d p = projector.imager_from_world * (ray.p_origin + length * ray.d);
  Image seen;
  Eigen::Matrix<double, 2, 3, Eigen::RowMajor> px_by_p;
  if (!projector.lens.model.project(projector.lens.values, p, &seen.px, px_by_p.data())) return std::nullopt;
  seen.per_metre = px_by_p * (projector.imager_from_world.rotation * ray.d);
  return seen;
}

// Adds a distance; until all are added, rms_px holds the sum of squares.
void add(const std::optional<double>& distance, EpipolarScore* score) {
  ++score->pixels;
  if (distance && std::abs(*distance) <= k_epipolar_outlier_px) {
    score->rms_px += *distance * *distance;
  } else {
    ++score->outliers;
  }
}

}  // namespace

std::optional<double> epipolar_distance(const Imager& camera,
                                        const Imager& projector,
                                        const Vector2d& px_camera,
                                        const Vector2d& px_projector) {
  const auto ray = camera.ray(px_camera), light = projector.ray(px_projector);
  if (!ray || !light) return std::nullopt;
  double length = nearest_length(*ray, *light);
  for (int i = 0; i < k_steps; ++i) {
    if (!(length > 0)) return std::nullopt;
    const auto seen = seen_by(projector, *ray, length);
    if (!seen) return std::nullopt;
    const double speed = seen->per_metre.norm();
    if (!(speed > 0)) return (px_projector - seen->px).norm();  // along the baseline the line is a point
    const Vector2d along = seen->per_metre / speed, miss = px_projector - seen->px;
    const double step = along.dot(miss);
    if (std::abs(step) < k_settled_px) return along.x() * miss.y() - along.y() * miss.x();
    length += step / speed;
  }
  return std::nullopt;
}

std::vector<EpipolarResidual> epipolar_residuals(const Rig& rig, const std::vector<DensePixel>& dense) {
  const size_t projectors = rig.projectors.size();
  std::vector<EpipolarResidual> pairs(rig.cameras.size() * projectors);
  for (const DensePixel& pixel : dense) {
    const auto camera = static_cast<size_t>(pixel.camera), projector = static_cast<size_t>(pixel.projector);
    EpipolarResidual& pair = pairs[camera * projectors + projector];
    add(epipolar_distance(rig.cameras[camera], rig.projectors[projector], pixel.px_camera.cast<double>(),
                          pixel.px_projector.cast<double>()),
        pixel.on_board ? &pair.board : &pair.room);
  }
  for (size_t i = 0; i < pairs.size(); ++i) {
    pairs[i].camera = static_cast<int>(i / projectors);
    pairs[i].projector = static_cast<int>(i % projectors);
    for (EpipolarScore* score : {&pairs[i].board, &pairs[i].room}) {
      const int inliers = score->pixels - score->outliers;
      score->rms_px = inliers > 0 ? std::sqrt(score->rms_px / inliers) : 0;
    }
  }
  std::erase_if(pairs,
                [](const EpipolarResidual& pair) { return pair.board.pixels + pair.room.pixels == 0; });
  return pairs;
}

}  // namespace limn::calib
