#include "calib/surface/range_view.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "calib/surface/range_smoothing.h"
#include "calib/surface/triangulate.h"
#include "core/median.h"

namespace limn::calib {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr float k_no_range = std::numeric_limits<float>::quiet_NaN();
constexpr double k_rad_per_deg = std::numbers::pi / 180;
// Standard deviations of the epipolar residual that the code's noise may explain.
constexpr double k_code_sigmas = 4;
// Standard deviations; projectors that differ by more: one of them is wrong.
constexpr double k_conflict_sigmas = 5;
constexpr double k_conflict_m = 0.5e-3;  // if they also differ by more than in a good rig
// Standard deviations of a step between neighbours that noise may explain.
constexpr double k_step_sigmas = 4;
constexpr double k_unknown_row_px = 1e3;  // standard deviation of a row that the code does not show
constexpr int k_least_piece = 30;         // pixels; smaller islands are wrong codes or useless
// Directions of a projector's pixels from a coarse map; accurate enough to start a triangulation.
class CoarseRays {
 public:
  explicit CoarseRays(const Imager& imager)
      : columns_((imager.width + k_step - 1) / k_step),
        rows_((imager.height + k_step - 1) / k_step),
        d_(direction_map(imager.lens, imager.width, imager.height, k_step)),
        world_from_imager_(imager.imager_from_world.inverse()) {}

  Ray at(const Vector2d& px) const {
    const int c = std::clamp(static_cast<int>(px.x() / k_step), 0, std::max(0, columns_ - 2));
    const int r = std::clamp(static_cast<int>(px.y() / k_step), 0, std::max(0, rows_ - 2));
    const double u = px.x() / k_step - c, v = px.y() / k_step - r;
    const auto d = [&](int dc, int dr) {
      const int column = std::min(c + dc, columns_ - 1), row = std::min(r + dr, rows_ - 1);
      return d_[static_cast<size_t>(row * columns_ + column)].cast<double>().eval();
    };
    const Vector3d sum = (1 - v) * ((1 - u) * d(0, 0) + u * d(1, 0)) + v * ((1 - u) * d(0, 1) + u * d(1, 1));
    return {world_from_imager_.translation, world_from_imager_.rotation * sum.normalized()};
  }

 private:
  static constexpr int k_step = 8;
  int columns_, rows_;
  std::vector<Vector3f> d_;
  Pose world_from_imager_;
};

enum class Verdict : std::uint8_t { nothing, kept, epipolar, angle, unsure };

struct Reading {
  Verdict verdict = Verdict::nothing;
  double range = 0, variance = 0;
  float epipolar_px = k_no_range;
  double epipolar_residual = 0;  // standard deviations; NaN: unknown
};

// The row of a projector's column on the camera ray's image in the projector: between two depths at which the
// ray's pixels lie on both sides of the column, by bisection over the inverse depth. nullopt where the ray
// does not reach the column within the distances.
std::optional<double> row_on_ray(const Imager& projector,
                                 const Ray& camera_ray,
                                 double column,
                                 const RangeOptions& options) {
  constexpr double k_nearest_m = 0.05;
  constexpr int k_steps = 24, k_bisections = 40;
  const double most = 1 / std::max(k_nearest_m, options.nearest_m), least = 1 / options.farthest_m;
  const auto seen = [&](double inverse) {
    return projector.project(camera_ray.p_origin + camera_ray.d / inverse);
  };
  double before = 0;
  std::optional<Vector2d> px_before;
  for (int i = 0; i <= k_steps; ++i) {
    double far = before, near = least + (most - least) * i / k_steps;
    const auto px = seen(near);
    const bool crosses = px && px_before && (px->x() > column) != (px_before->x() > column);
    before = near;
    if (!crosses) {
      px_before = px;
      continue;
    }
    const bool rises = px->x() > column;
    for (int k = 0; k < k_bisections; ++k) {
      const double middle = (far + near) / 2;
      const auto at = seen(middle);
      if (!at) return std::nullopt;
      ((at->x() > column) == rises ? near : far) = middle;
    }
    const auto found = seen(near);
    if (!found || found->y() < -0.5 || found->y() > projector.height - 0.5) return std::nullopt;
    return found->y();
  }
  return std::nullopt;
}

Reading read_pixel(const Imager& camera,
                   const Imager& projector,
                   const CoarseRays& projector_rays,
                   const Ray& camera_ray,
                   const Vector2d& px,
                   const MeasuredPixel& shown,
                   const RangeOptions& options) {
  const Ray projector_ray = projector_rays.at(shown.px);
  if (!projector_ray.d.allFinite()) return {};
  const auto start = midpoint(camera_ray, projector_ray);
  if (!start) return {Verdict::angle};
  const MeasuredPixel own{px, Vector2d::Constant(options.camera_px * options.camera_px)};
  const auto found = triangulate(camera, projector, own, shown, *start);
  if (!found) return {Verdict::angle};
  Reading reading{Verdict::kept, (found->p_world - camera_ray.p_origin).norm(),
                  camera_ray.d.dot(found->covariance * camera_ray.d), static_cast<float>(found->epipolar_px),
                  found->epipolar_residual};
  const double sigma_px = found->epipolar_px / std::max(found->epipolar_sigmas, 1e-9);
  if (found->epipolar_px > options.max_epipolar_px + k_code_sigmas * sigma_px)
    reading.verdict = Verdict::epipolar;
  else if (found->angle < options.min_angle_deg * k_rad_per_deg)
    reading.verdict = Verdict::angle;
  else if (reading.variance > options.max_stddev_m * options.max_stddev_m)
    reading.verdict = Verdict::unsure;
  else if (reading.range < options.nearest_m || reading.range > options.farthest_m)
    reading.verdict = Verdict::unsure;
  return reading;
}

void count(const std::vector<Reading>& readings, RangeCounts* counts, std::vector<float>* epipolar) {
  for (const Reading& reading : readings) {
    counts->decoded += reading.verdict != Verdict::nothing;
    counts->epipolar += reading.verdict == Verdict::epipolar;
    counts->angle += reading.verdict == Verdict::angle;
    counts->unsure += reading.verdict == Verdict::unsure;
    if (!std::isnan(reading.epipolar_px)) epipolar->push_back(reading.epipolar_px);
    if (reading.verdict == Verdict::kept)
      counts->epipolar_rms_px += static_cast<double>(reading.epipolar_px) * reading.epipolar_px;
  }
}

std::vector<Reading> read_all(const RangeView& view, const DecodedBy& seen, const RangeOptions& options) {
  const cv::Mat& px = seen.decoded->px_projector;
  const CoarseRays projector_rays(*seen.projector);
  const Pose world_from_camera = view.camera.imager_from_world.inverse();
  std::vector<Reading> readings(px.total());
  cv::parallel_for_(cv::Range(0, px.rows), [&](const cv::Range& rows) {
    for (int y = rows.start; y < rows.end; ++y) {
      for (int x = 0; x < px.cols; ++x) {
        const auto& label = px.at<cv::Vec2f>(y, x);
        const auto& variance = seen.decoded->variance.at<cv::Vec2f>(y, x);
        const Vector3f& d = view.d_camera[flat(px.size(), x, y)];
        if (std::isnan(label[0]) || !d.allFinite()) continue;
        const Ray ray{world_from_camera.translation,
                      world_from_camera.rotation * d.cast<double>().normalized()};
        MeasuredPixel shown{{label[0], label[1]}, {variance[0], variance[1]}};
        if (std::isnan(label[1])) {
          const auto row = row_on_ray(*seen.projector, ray, label[0], options);
          if (!row) continue;
          shown = {{label[0], *row}, {variance[0], k_unknown_row_px * k_unknown_row_px}};
        }
        Reading& reading = readings[flat(px.size(), x, y)];
        reading = read_pixel(view.camera, *seen.projector, projector_rays, ray, {x, y}, shown, options);
        if (std::isnan(label[1])) reading.epipolar_residual = k_no_range;
      }
    }
  });
  return readings;
}

// The results of all projectors, weighted; none where two contradict each other.
Ranges combined(const RangeView& view,
                std::span<const DecodedBy> seen,
                const RangeOptions& options,
                RangeCounts* counts) {
  const cv::Size size(view.camera.width, view.camera.height);
  Ranges all(size);
  cv::Mat conflict(size, CV_8U, cv::Scalar(0));
  std::vector<float> epipolar;
  for (const DecodedBy& one : seen) {
    const std::vector<Reading> readings = read_all(view, one, options);
    count(readings, counts, &epipolar);
    for (size_t i = 0; i < readings.size(); ++i) {
      if (readings[i].verdict != Verdict::kept) continue;
      double& range = all.range.ptr<double>()[i];
      double& variance = all.variance.ptr<double>()[i];
      double& epipolar = all.epipolar.ptr<double>()[i];
      if (std::isnan(range)) {
        range = readings[i].range;
        variance = readings[i].variance;
        epipolar = readings[i].epipolar_residual;
        continue;
      }
      const double apart = std::abs(range - readings[i].range);
      const double sigma = std::sqrt(variance + readings[i].variance);
      if (apart > k_conflict_m + k_conflict_sigmas * sigma) conflict.ptr()[i] = 1;
      const double weight = 1 / variance, other = 1 / readings[i].variance;
      range = (weight * range + other * readings[i].range) / (weight + other);
      epipolar = (std::sqrt(weight) * epipolar + std::sqrt(other) * readings[i].epipolar_residual) /
                 std::sqrt(weight + other);
      variance = 1 / (weight + other);
    }
  }
  all.range.setTo(k_no_range, conflict);
  counts->conflicts = cv::countNonZero(conflict);
  const int met = static_cast<int>(epipolar.size()) - counts->epipolar - counts->angle - counts->unsure;
  counts->epipolar_rms_px = met > 0 ? std::sqrt(counts->epipolar_rms_px / met) : 0;
  if (!epipolar.empty()) counts->epipolar_median_px = median(std::move(epipolar));
  return all;
}

// Whether two neighbours can be one surface: an oblique surface and noise explain the step between them.
bool joined(const RangeView& view, const Ranges& ranges, cv::Point a, cv::Point b, double steepest) {
  const double range_a = ranges.range.at<double>(a), range_b = ranges.range.at<double>(b);
  if (std::isnan(range_a) || std::isnan(range_b)) return false;
  const cv::Size size = ranges.range.size();
  const double apart = (view.d_camera[flat(size, a.x, a.y)] - view.d_camera[flat(size, b.x, b.y)]).norm();
  const double noise = std::sqrt(ranges.variance.at<double>(a) + ranges.variance.at<double>(b));
  return std::abs(range_a - range_b) <= std::min(range_a, range_b) * apart * steepest + k_step_sigmas * noise;
}

cv::Mat links_of(const RangeView& view, const Ranges& ranges, double max_incidence_deg) {
  const double steepest = std::tan(max_incidence_deg * k_rad_per_deg);
  cv::Mat links(ranges.range.size(), CV_8U, cv::Scalar(0));
  cv::parallel_for_(cv::Range(0, links.rows), [&](const cv::Range& rows) {
    for (int y = rows.start; y < rows.end; ++y) {
      for (int x = 0; x < links.cols; ++x) {
        std::uint8_t& link = links.at<std::uint8_t>(y, x);
        if (x + 1 < links.cols && joined(view, ranges, {x, y}, {x + 1, y}, steepest)) link |= k_right;
        if (y + 1 < links.rows && joined(view, ranges, {x, y}, {x, y + 1}, steepest)) link |= k_down;
      }
    }
  });
  return links;
}

// Removes pixels beside a step in depth, which see both sides: their code is of one, the other, or neither.
int drop_edges(const cv::Mat& links, Ranges* ranges) {
  cv::Mat edge(links.size(), CV_8U, cv::Scalar(0));
  const auto mark_step = [&](cv::Point a, cv::Point b) {
    const bool step = !std::isnan(ranges->range.at<double>(a)) && !std::isnan(ranges->range.at<double>(b)) &&
                      !linked(links, a, b);
    if (step) edge.at<std::uint8_t>(a) = edge.at<std::uint8_t>(b) = 1;
  };
  for (int y = 0; y < links.rows; ++y) {
    for (int x = 0; x < links.cols; ++x) {
      if (x + 1 < links.cols) mark_step({x, y}, {x + 1, y});
      if (y + 1 < links.rows) mark_step({x, y}, {x, y + 1});
    }
  }
  ranges->range.setTo(k_no_range, edge);
  return cv::countNonZero(edge);
}

cv::Mat valid_in(const cv::Mat& numbers) { return numbers == numbers; }  // NaN differs from itself

// Removes pixels at the rim of a larger gap (3x3 pixels and more), which see the surface with only a part of
// their area.
int drop_rims(Ranges* ranges) {
  const cv::Mat square = cv::Mat::ones(3, 3, CV_8U);
  const cv::Mat valid = valid_in(ranges->range);
  cv::Mat gap = ~valid;
  cv::erode(gap, gap, square);  // small gaps vanish
  cv::dilate(gap, gap, cv::Mat::ones(5, 5, CV_8U));
  const cv::Mat rim = gap & valid;
  ranges->range.setTo(k_no_range, rim);
  return cv::countNonZero(rim);
}

// Gives connected pixels one number, from 1; 0 where `valid` is 0.
cv::Mat labelled(const cv::Mat& links, const cv::Mat& valid, std::vector<int>* pixels) {
  cv::Mat label(links.size(), CV_32S, cv::Scalar(0));
  std::vector<cv::Point> stack;
  for (int y = 0; y < links.rows; ++y) {
    for (int x = 0; x < links.cols; ++x) {
      if (!valid.at<std::uint8_t>(y, x) || label.at<int>(y, x) != 0) continue;
      pixels->push_back(0);
      const int number = static_cast<int>(pixels->size());
      stack.push_back({x, y});
      label.at<int>(y, x) = number;
      while (!stack.empty()) {
        const cv::Point at = stack.back();
        stack.pop_back();
        ++pixels->back();
        for (const cv::Point step : {cv::Point(1, 0), cv::Point(-1, 0), cv::Point(0, 1), cv::Point(0, -1)}) {
          const cv::Point next = at + step;
          if (!cv::Rect({}, links.size()).contains(next) || label.at<int>(next) != 0) continue;
          if (!valid.at<std::uint8_t>(next) || !linked(links, at, next)) continue;
          label.at<int>(next) = number;
          stack.push_back(next);
        }
      }
    }
  }
  return label;
}

void drop_islands(const cv::Mat& links, Ranges* ranges) {
  std::vector<int> pixels;
  const cv::Mat label = labelled(links, valid_in(ranges->range), &pixels);
  for (int i = 0; i < static_cast<int>(label.total()); ++i) {
    const int number = label.ptr<int>()[i];
    if (number > 0 && pixels[static_cast<size_t>(number - 1)] < k_least_piece)
      ranges->range.ptr<double>()[i] = k_no_range;
  }
}

}  // namespace

bool RangeView::has(int x, int y) const { return !std::isnan(range.at<float>(y, x)); }

Vector3d RangeView::p_world(int x, int y) const {
  const Vector3d d = d_camera[flat(range.size(), x, y)].cast<double>();
  return camera.imager_from_world.inverse() * (d * static_cast<double>(range.at<float>(y, x)));
}

RangeView range_view(const Imager& camera, std::span<const DecodedBy> seen, const RangeOptions& options) {
  RangeView view;
  view.camera = camera;
  view.d_camera = direction_map(camera.lens, camera.width, camera.height);
  const cv::Size size(camera.width, camera.height);
  view.range = cv::Mat(size, CV_32F, cv::Scalar(k_no_range));
  view.stddev = view.range.clone();
  view.d_normal = cv::Mat(size, CV_32FC3, cv::Scalar::all(0));
  Ranges ranges = combined(view, seen, options, &view.counts);
  view.links = links_of(view, ranges, options.max_incidence_deg);
  view.counts.edges = drop_edges(view.links, &ranges) + drop_rims(&ranges);
  view.links = links_of(view, ranges, options.max_incidence_deg);
  drop_islands(view.links, &ranges);
  smooth(ranges, view.links, options, &view);
  restrict_to(valid_in(view.range), &view);
  return view;
}

void restrict_to(const cv::Mat& keep, RangeView* view) {
  const auto kept = [&](int x, int y) { return keep.at<std::uint8_t>(y, x) != 0 && view->has(x, y); };
  for (int y = 0; y < keep.rows; ++y) {
    for (int x = 0; x < keep.cols; ++x) {
      std::uint8_t& link = view->links.at<std::uint8_t>(y, x);
      if (!kept(x, y)) link = 0;
      if ((link & k_right) && !kept(x + 1, y)) link &= static_cast<std::uint8_t>(~k_right);
      if ((link & k_down) && !kept(x, y + 1)) link &= static_cast<std::uint8_t>(~k_down);
    }
  }
  view->range.setTo(k_no_range, keep == 0);
  view->counts.kept = cv::countNonZero(valid_in(view->range));
}

std::optional<SurfaceSample> surface_sample(const RangeView& view, const Vector3d& p_world) {
  const auto px = view.camera.project(p_world);
  if (!px) return std::nullopt;
  const int x = static_cast<int>(std::floor(px->x())), y = static_cast<int>(std::floor(px->y()));
  if (x < 0 || y < 0 || x + 1 >= view.range.cols || y + 1 >= view.range.rows) return std::nullopt;
  if ((view.links.at<std::uint8_t>(y, x) & (k_right | k_down)) != (k_right | k_down)) return std::nullopt;
  if (!(view.links.at<std::uint8_t>(y, x + 1) & k_down) || !(view.links.at<std::uint8_t>(y + 1, x) & k_right))
    return std::nullopt;
  const double u = px->x() - x, v = px->y() - y;
  const double shares[4] = {(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v};
  double inverse = 0, stddev = 0;
  Vector3d normal = Vector3d::Zero();
  for (int i = 0; i < 4; ++i) {
    const int column = x + i % 2, row = y + i / 2;
    inverse += shares[i] / static_cast<double>(view.range.at<float>(row, column));
    stddev += shares[i] * static_cast<double>(view.stddev.at<float>(row, column));
    const auto& n = view.d_normal.at<cv::Vec3f>(row, column);
    normal += shares[i] * Vector3d(n[0], n[1], n[2]);
  }
  const Vector3d p_eye = view.camera.imager_from_world.inverse().translation;
  const double distance = (p_world - p_eye).norm();
  const Vector3d d = (p_world - p_eye) / distance;
  normal.normalize();
  const double cosine = -normal.dot(d);
  return SurfaceSample{-(1 / inverse - distance) * cosine, stddev * cosine, normal};
}

scene::ScanSurface surface_of(const RangeView& view) {
  scene::ScanSurface surface;
  cv::Mat number(view.range.size(), CV_32S, cv::Scalar(-1));
  for (int y = 0; y < number.rows; ++y) {
    for (int x = 0; x < number.cols; ++x) {
      if (!view.has(x, y)) continue;
      number.at<int>(y, x) = static_cast<int>(surface.positions.size());
      const Vector3d p = view.p_world(x, y);
      const auto& n = view.d_normal.at<cv::Vec3f>(y, x);
      const Vector3d d = (p - view.camera.imager_from_world.inverse().translation).normalized();
      surface.positions.push_back(p.cast<float>());
      surface.normals.emplace_back(n[0], n[1], n[2]);
      surface.stddevs.push_back(view.stddev.at<float>(y, x) *
                                static_cast<float>(-d.dot(surface.normals.back().cast<double>())));
    }
  }
  for (int y = 0; y + 1 < number.rows; ++y) {
    for (int x = 0; x + 1 < number.cols; ++x) {
      const std::uint8_t link = view.links.at<std::uint8_t>(y, x);
      const bool quad = (link & k_right) && (link & k_down) &&
                        (view.links.at<std::uint8_t>(y, x + 1) & k_down) &&
                        (view.links.at<std::uint8_t>(y + 1, x) & k_right);
      if (!quad) continue;
      const auto corner = [&](int u, int v) { return static_cast<std::uint32_t>(number.at<int>(v, u)); };
      surface.triangles.push_back({corner(x, y), corner(x, y + 1), corner(x + 1, y)});
      surface.triangles.push_back({corner(x + 1, y), corner(x, y + 1), corner(x + 1, y + 1)});
    }
  }
  return surface;
}

cv::Mat connected_components(const RangeView& view, std::vector<double>* areas) {
  std::vector<int> pixels;
  cv::Mat label = labelled(view.links, valid_in(view.range), &pixels);
  std::vector<double> sums(pixels.size(), 0);
  for (int y = 1; y < label.rows; ++y) {
    for (int x = 1; x < label.cols; ++x) {
      if (label.at<int>(y, x) == 0) continue;
      const Vector3f &d = view.d_camera[flat(label.size(), x, y)],
                     &left = view.d_camera[flat(label.size(), x - 1, y)],
                     &up = view.d_camera[flat(label.size(), x, y - 1)];
      const double range = view.range.at<float>(y, x);
      const auto& n = view.d_normal.at<cv::Vec3f>(y, x);
      const Vector3d d_world = view.camera.imager_from_world.rotation.conjugate() * d.cast<double>();
      const double cosine = std::max(0.05, -d_world.dot(Vector3d(n[0], n[1], n[2])));
      sums[static_cast<size_t>(label.at<int>(y, x) - 1)] +=
          range * range * (d - left).norm() * (d - up).norm() / cosine;
    }
  }
  std::vector<int> order(pixels.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return sums[static_cast<size_t>(a)] > sums[static_cast<size_t>(b)]; });
  std::vector<int> rank(pixels.size());
  areas->clear();
  for (const int piece : order) {
    areas->push_back(sums[static_cast<size_t>(piece)]);
    rank[static_cast<size_t>(piece)] = static_cast<int>(areas->size());
  }
  for (int i = 0; i < static_cast<int>(label.total()); ++i) {
    int& number = label.ptr<int>()[i];
    if (number > 0) number = rank[static_cast<size_t>(number - 1)];
  }
  return label;
}

}  // namespace limn::calib
