#include "calib/surface/range_smoothing.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <opencv2/core.hpp>
#include <optional>

#include "core/median.h"

namespace limn::calib {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr double k_nowhere = std::numeric_limits<double>::quiet_NaN();
constexpr double k_degree = std::numbers::pi / 180;
constexpr double k_outlier_sigmas = 5;  // distance of a pixel from its neighbours' fit
constexpr int k_noise_half = 12;  // window for measuring noise: wide, so that the fit absorbs little of it
constexpr int k_noise_step = 16;  // pixels between the points where noise is measured
constexpr int k_lag = 7;          // pixels over which the noise may be correlated

// A quadric of the inverse range around a pixel: q = c0 + c1 x + c2 y + c3 x² + c4 xy + c5 y². Inverse ranges
// of a plane are almost linear in the image, and the code's noise is uniform in them.
using Six = Eigen::Matrix<double, 6, 1>;
using SixSix = Eigen::Matrix<double, 6, 6>;

Six terms(double x, double y) {
  Six t;
  t << 1, x, y, x * x, x * y, y * y;
  return t;
}

struct Neighbour {
  int dx = 0, dy = 0;
  double q = 0, sigma = 0, weight = 0;
};

// The pixels of the window that are connected with its centre by a path of links that leads outwards.
class Window {
 public:
  explicit Window(int half) : half_(half), side_(2 * half + 1), reached_(static_cast<size_t>(side_ * side_)) {
    for (int dy = -half; dy <= half; ++dy)
      for (int dx = -half; dx <= half; ++dx) order_.push_back({dx, dy});
    std::stable_sort(order_.begin(), order_.end(), [](cv::Point a, cv::Point b) {
      return std::abs(a.x) + std::abs(a.y) < std::abs(b.x) + std::abs(b.y);
    });
  }

  const std::vector<Neighbour>& around(const Ranges& ranges, const cv::Mat& links, cv::Point middle) {
    found_.clear();
    std::fill(reached_.begin(), reached_.end(), false);
    const cv::Rect image({}, links.size());
    for (const cv::Point d : order_) {
      const cv::Point at = middle + d;
      if (!image.contains(at) || std::isnan(ranges.range.at<double>(at))) continue;
      const cv::Point by_x(d.x - (d.x > 0) + (d.x < 0), d.y), by_y(d.x, d.y - (d.y > 0) + (d.y < 0));
      const bool reached = (d.x == 0 && d.y == 0) ||
                           (d.x != 0 && reached_[index(by_x)] && linked(links, at, middle + by_x)) ||
                           (d.y != 0 && reached_[index(by_y)] && linked(links, at, middle + by_y));
      if (!reached) continue;
      reached_[index(d)] = true;
      const double q = 1 / ranges.range.at<double>(at);
      const double sigma = std::sqrt(ranges.variance.at<double>(at)) * q * q;
      found_.push_back({d.x, d.y, q, sigma, 1 / (sigma * sigma)});
    }
    return found_;
  }
  int area() const { return side_ * side_; }

 private:
  size_t index(cv::Point d) const { return static_cast<size_t>((d.y + half_) * side_ + d.x + half_); }
  int half_, side_;
  std::vector<cv::Point> order_;
  std::vector<bool> reached_;
  std::vector<Neighbour> found_;
};

struct QuadricFit {
  Six coefficients = Six::Zero();
  double variance = 0;  // variance of the centre, if the noise were independent and as stated
};

std::optional<QuadricFit> fitted(const std::vector<Neighbour>& around) {
  SixSix a = SixSix::Zero();
  Six b = Six::Zero();
  for (const Neighbour& n : around) {
    const Six t = terms(n.dx, n.dy);
    a.selfadjointView<Eigen::Lower>().rankUpdate(t, n.weight);
    b += n.weight * n.q * t;
  }
  const Eigen::LLT<SixSix> factored(a);
  if (factored.info() != Eigen::Success) return std::nullopt;
  QuadricFit fit;
  fit.coefficients = factored.solve(b);
  fit.variance = factored.solve(Six::Unit(0))[0];
  if (!fit.coefficients.allFinite() || !(fit.variance > 0)) return std::nullopt;
  return fit;
}

double residual(const Neighbour& n, const QuadricFit& fit) {
  return n.q - terms(n.dx, n.dy).dot(fit.coefficients);
}

// The size of the noise relative to the stated one, by position, and its correlation between neighbouring
// pixels.
struct Noise {
  cv::Mat scale;         // CV_32F, true divided by stated standard deviation, every k_noise_step pixels
  double inflation = 1;  // factor on the variance of a smoothed centre by the correlation

  double scale_at(int x, int y) const {  // linear between the nodes
    const double u = std::clamp(static_cast<double>(x) / k_noise_step - 0.5, 0.0, scale.cols - 1.0);
    const double v = std::clamp(static_cast<double>(y) / k_noise_step - 0.5, 0.0, scale.rows - 1.0);
    const int c = std::min(static_cast<int>(u), std::max(0, scale.cols - 2)),
              r = std::min(static_cast<int>(v), std::max(0, scale.rows - 2));
    const int c1 = std::min(c + 1, scale.cols - 1), r1 = std::min(r + 1, scale.rows - 1);
    const double a = u - c, b = v - r;
    return (1 - b) * ((1 - a) * scale.at<float>(r, c) + a * scale.at<float>(r, c1)) +
           b * ((1 - a) * scale.at<float>(r1, c) + a * scale.at<float>(r1, c1));
  }
};

// Ratio of the variance of a full window's smoothed centre with correlated noise to that with independent
// noise.
double inflation_of(const cv::Mat& correlation, int half) {
  SixSix a = SixSix::Zero();
  for (int y = -half; y <= half; ++y)
    for (int x = -half; x <= half; ++x) a += terms(x, y) * terms(x, y).transpose();
  const Six first = a.llt().solve(Six::Unit(0));
  const auto share = [&](int x, int y) { return first.dot(terms(x, y)); };
  double alone = 0, together = 0;
  for (int y = -half; y <= half; ++y)
    for (int x = -half; x <= half; ++x) {
      alone += share(x, y) * share(x, y);
      for (int v = -half; v <= half; ++v)
        for (int u = -half; u <= half; ++u)
          if (std::abs(u - x) <= k_lag && std::abs(v - y) <= k_lag)
            together += share(x, y) * share(u, v) * correlation.at<double>(std::abs(v - y), std::abs(u - x));
    }
  return std::max(1.0, together / alone);
}

// Sums over pairs of a window's normalised residuals, by their distance; NaN where there is none.
struct Pairs {
  cv::Mat sums = cv::Mat(k_lag + 1, k_lag + 1, CV_64F, cv::Scalar(0)), counts = sums.clone();

  void add(const cv::Mat& residuals) {
    for (int y = 0; y < residuals.rows; ++y)
      for (int x = 0; x < residuals.cols; ++x)
        for (int v = y; v < std::min(residuals.rows, y + k_lag + 1); ++v)
          for (int u = std::max(0, x - k_lag); u < std::min(residuals.cols, x + k_lag + 1); ++u) {
            const double product = residuals.at<double>(y, x) * residuals.at<double>(v, u);
            if (std::isnan(product)) continue;
            sums.at<double>(v - y, std::abs(u - x)) += product;
            counts.at<double>(v - y, std::abs(u - x)) += 1;
          }
  }
  // By |dx|, |dy|, 1 at 0; empty when there are too few.
  cv::Mat correlation() const {
    constexpr double k_least = 10000;  // residuals
    if (counts.at<double>(0, 0) < k_least || sums.at<double>(0, 0) <= 0) return {};
    cv::Mat shares;
    cv::divide(sums, cv::max(counts, 1), shares);
    return shares / shares.at<double>(0, 0);
  }
};

// A quartic, so that what is left of the ranges of a wide window is noise, not the surface's shape.
constexpr int k_quartic_order = 4, k_quartic_terms = 15;
using Fifteen = Eigen::Matrix<double, k_quartic_terms, 1>;

Fifteen quartic_terms(double x, double y) {
  Fifteen t;
  int k = 0;
  double power_x = 1;
  for (int i = 0; i <= k_quartic_order; ++i, power_x *= x) {
    double power = power_x;
    for (int j = 0; i + j <= k_quartic_order; ++j, power *= y) t[k++] = power;
  }
  return t;
}

// The noise around a pixel, as images of its window: NaN where nothing is known.
struct WindowNoise {
  cv::Mat ranges;     // residuals of a quartic through the inverse ranges, in stated standard deviations
  cv::Mat epipolar;   // the epipolar residuals; empty: the code has no rows
  cv::Mat left_over;  // what a quartic through them leaves
};

// Empty where there is too little of one surface.
WindowNoise noise_around(const Ranges& ranges, const cv::Mat& links, cv::Point at, Window* window) {
  const std::vector<Neighbour>& around = window->around(ranges, links, at);
  if (static_cast<int>(around.size()) < window->area() / 2) return {};
  using Squares = Eigen::Matrix<double, k_quartic_terms, k_quartic_terms>;
  const bool has_epipolar = !std::isnan(ranges.epipolar.at<double>(at));
  Squares a = Squares::Zero();
  Eigen::Matrix<double, k_quartic_terms, 2> b = Eigen::Matrix<double, k_quartic_terms, 2>::Zero();
  const auto terms_of = [](const Neighbour& n) {
    return quartic_terms(static_cast<double>(n.dx) / k_noise_half, static_cast<double>(n.dy) / k_noise_half);
  };
  const auto epipolar = [&](const Neighbour& n) {
    return has_epipolar ? ranges.epipolar.at<double>(at.y + n.dy, at.x + n.dx) : 0.0;
  };
  const double q0 = around.front().q;
  for (const Neighbour& n : around) {
    const Fifteen t = terms_of(n) / n.sigma;
    a.selfadjointView<Eigen::Lower>().rankUpdate(t);
    b.col(0) += (n.q - q0) / n.sigma * t;
    b.col(1) += epipolar(n) * t;
  }
  const Eigen::LLT<Squares> factored(a.selfadjointView<Eigen::Lower>());
  if (factored.info() != Eigen::Success) return {};
  const Eigen::Matrix<double, k_quartic_terms, 2> fit = factored.solve(b);
  if (!fit.allFinite()) return {};
  const int side = 2 * k_noise_half + 1;
  WindowNoise noise{cv::Mat(side, side, CV_64F, cv::Scalar(k_nowhere)), {}, {}};
  if (has_epipolar) noise.epipolar = noise.ranges.clone(), noise.left_over = noise.ranges.clone();
  for (const Neighbour& n : around) {
    const Fifteen t = terms_of(n) / n.sigma;
    const cv::Point in_window(n.dx + k_noise_half, n.dy + k_noise_half);
    noise.ranges.at<double>(in_window) = (n.q - q0) / n.sigma - t.dot(fit.col(0));
    if (!has_epipolar) continue;
    noise.epipolar.at<double>(in_window) = epipolar(n);
    noise.left_over.at<double>(in_window) = epipolar(n) - t.dot(fit.col(1));
  }
  return noise;
}

// Robust size of residuals (1.4826 median, which is the standard deviation of a normal distribution; at least
// the RMS of those within 4 of it).
double size_of(const cv::Mat& residuals) {
  std::vector<double> sizes;
  for (const double r : cv::Mat_<double>(residuals))
    if (!std::isnan(r)) sizes.push_back(std::abs(r));
  const double limit = 4 * 1.4826 * value_of_rank(&sizes, sizes.size() / 2);
  double sum = 0;
  int count = 0;
  for (const double size : sizes) {
    if (size > limit) continue;
    sum += size * size;
    ++count;
  }
  return std::sqrt(sum / count);
}

Noise measured_noise(const Ranges& ranges, const cv::Mat& links, int smooth_half) {
  constexpr int k_every = 3;  // pairs from every third position, because they cost the most time
  Window window(k_noise_half);
  Noise noise;
  noise.scale = cv::Mat((links.rows + k_noise_step - 1) / k_noise_step,
                        (links.cols + k_noise_step - 1) / k_noise_step, CV_32F, cv::Scalar(k_nowhere));
  Pairs pairs;
  std::vector<float> scales, absorbed;
  int number = 0;
  for (int r = 0; r < noise.scale.rows; ++r) {
    for (int c = 0; c < noise.scale.cols; ++c) {
      const cv::Point at(std::min(links.cols - 1, c * k_noise_step + k_noise_step / 2),
                         std::min(links.rows - 1, r * k_noise_step + k_noise_step / 2));
      if (std::isnan(ranges.range.at<double>(at))) continue;
      const WindowNoise around = noise_around(ranges, links, at, &window);
      if (around.ranges.empty()) continue;
      const double scale = size_of(around.ranges);
      noise.scale.at<float>(r, c) = static_cast<float>(scale);
      scales.push_back(static_cast<float>(scale));
      const cv::Mat& correlated = around.epipolar.empty() ? around.ranges : around.epipolar;
      const double size = size_of(correlated);
      if (!around.epipolar.empty())
        absorbed.push_back(static_cast<float>(size / std::max(1e-6, size_of(around.left_over))));
      if (size > 0 && number++ % k_every == 0) pairs.add(correlated / size);
    }
  }
  // What the fit has taken of the noise: as much as of the epipolar residuals.
  const float taken = std::max(1.0F, median(std::move(absorbed), 1.0F));
  const float common = taken * median(std::move(scales), 1.0F);
  noise.scale *= taken;
  noise.scale.setTo(common, noise.scale != noise.scale);
  noise.scale = cv::max(noise.scale, common / 2);
  const cv::Mat correlation = pairs.correlation();
  if (!correlation.empty()) noise.inflation = inflation_of(correlation, smooth_half);
  return noise;
}

// Repeats the fit with the outliers of the first one down-weighted (Cauchy).
std::optional<QuadricFit> robustly_fitted(std::vector<Neighbour> around, double scale) {
  auto fit = fitted(around);
  if (!fit) return fit;
  constexpr double k_gentle = 2.5;  // standard deviations at which a neighbour counts half
  for (Neighbour& n : around) {
    const double r = residual(n, *fit) / (k_gentle * scale * n.sigma);
    n.weight /= 1 + r * r;
  }
  return fitted(around);
}

// World normal from the fit's slope: the surface is d(x, y) / q(x, y).
std::optional<Vector3d> normal_of(const RangeView& view, cv::Point at, const Six& fit) {
  const cv::Size size = view.range.size();
  if (at.x < 1 || at.y < 1 || at.x + 1 >= size.width || at.y + 1 >= size.height) return std::nullopt;
  const auto d = [&](int dx, int dy) {
    return view.d_camera[flat(size, at.x + dx, at.y + dy)].cast<double>().eval();
  };
  const double q = fit[0];
  const Vector3d along_x = (d(1, 0) - d(-1, 0)) / 2 / q - d(0, 0) * fit[1] / (q * q);
  const Vector3d along_y = (d(0, 1) - d(0, -1)) / 2 / q - d(0, 0) * fit[2] / (q * q);
  Vector3d normal = along_x.cross(along_y).normalized();
  if (normal.dot(d(0, 0)) > 0) normal = -normal;
  if (!normal.allFinite()) return std::nullopt;
  return view.camera.imager_from_world.rotation.conjugate() * normal;
}

struct Smoothed {
  double range = k_nowhere, stddev = k_nowhere;
  Vector3d d_normal = Vector3d::Zero();
};

Smoothed smoothed_at(const RangeView& view,
                     const Ranges& ranges,
                     const cv::Mat& links,
                     const Noise& noise,
                     const RangeOptions& options,
                     cv::Point at,
                     Window* window) {
  constexpr int k_least = 12;  // twice the number of the quadric's parameters
  const std::vector<Neighbour> around = window->around(ranges, links, at);
  if (static_cast<int>(around.size()) < k_least) return {};
  const double scale = noise.scale_at(at.x, at.y);
  const auto fit = robustly_fitted(around, scale);
  if (!fit || !(fit->coefficients[0] > 0)) return {};
  const Neighbour& own = around.front();
  const bool outlier = std::abs(residual(own, *fit)) > k_outlier_sigmas * scale * own.sigma;
  if (outlier && static_cast<int>(around.size()) < window->area() / 2)
    return {};  // otherwise its neighbours represent it
  const auto normal = normal_of(view, at, fit->coefficients);
  if (!normal) return {};
  const Vector3d d = view.d_camera[flat(view.range.size(), at.x, at.y)].cast<double>();
  const double cosine = -normal->dot(view.camera.imager_from_world.rotation.conjugate() * d);
  if (cosine < std::cos(options.max_incidence_deg * k_degree)) return {};
  const double range = 1 / fit->coefficients[0];
  const double variance = fit->variance * noise.inflation * scale * scale;
  return {range, std::sqrt(variance) * range * range, *normal};
}

}  // namespace

bool linked(const cv::Mat& links, cv::Point a, cv::Point b) {
  if (a.y == b.y) return links.at<std::uint8_t>(a.y, std::min(a.x, b.x)) & k_right;
  return links.at<std::uint8_t>(std::min(a.y, b.y), a.x) & k_down;
}

void smooth(const Ranges& ranges, const cv::Mat& links, const RangeOptions& options, RangeView* view) {
  const Noise noise = measured_noise(ranges, links, options.smooth_px);
  cv::parallel_for_(cv::Range(0, links.rows), [&](const cv::Range& rows) {
    Window window(options.smooth_px);
    for (int y = rows.start; y < rows.end; ++y) {
      for (int x = 0; x < links.cols; ++x) {
        if (std::isnan(ranges.range.at<double>(y, x))) continue;
        const Smoothed s = smoothed_at(*view, ranges, links, noise, options, {x, y}, &window);
        if (!(s.stddev <= options.max_stddev_m)) continue;
        view->range.at<float>(y, x) = static_cast<float>(s.range);
        view->stddev.at<float>(y, x) = static_cast<float>(s.stddev);
        const Vector3f n = s.d_normal.cast<float>();
        view->d_normal.at<cv::Vec3f>(y, x) = {n.x(), n.y(), n.z()};
      }
    }
  });
}

}  // namespace limn::calib
