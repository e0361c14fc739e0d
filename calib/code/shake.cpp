#include "calib/code/shake.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "core/median.h"

namespace limn::calib {
namespace {

using Eigen::Vector2d;

constexpr int k_tap_half = 3;                // half of the window of the Gaussian, pixels
constexpr float k_tap_sigma = 1;             // pixels
constexpr float k_least_place_gradient = 6;  // levels per pixel, in the sum of two images
constexpr int k_full_level = 250;
constexpr size_t k_most_places = 6000;
constexpr size_t k_least_shake_places = 300;
constexpr float k_even_gradient = 4;      // levels per pixel, at most
constexpr int k_lit_levels = 20;          // white minus black, at least
constexpr float k_least_scatter = 0.05F;  // levels: rounding
// Shift (2), difference of the two images' shifts (2), gain, gain difference, gain of black.
constexpr int k_shake_values = 7;
// Along an edge the smoothed noise of this many neighbouring places is common.
constexpr double k_common_places = 8;
constexpr double k_shake_outlier = 4;  // standard deviations
constexpr double k_least_shift_px = 0.03, k_most_shift_px = 1;
constexpr double k_least_flicker = 0.003;
// Mean squared step from pair to pair over the mean square: 2 for displacements that are independent, with a
// standard deviation of 0.3 for 40 pairs and axes.
constexpr double k_drift = 1;
constexpr double k_shake_significant = 4;  // standard deviations

using Taps = std::array<float, 2 * k_tap_half + 1>;

Taps gaussian_taps() {
  Taps weights{};
  float sum = 0;
  for (int i = -k_tap_half; i <= k_tap_half; ++i) {
    const auto d = static_cast<float>(i);
    sum += weights[static_cast<size_t>(i + k_tap_half)] = std::exp(-d * d / (2 * k_tap_sigma * k_tap_sigma));
  }
  for (float& weight : weights) weight /= sum;
  return weights;
}

// Weights whose correlation with an image is the derivative of the smoothed image.
Taps derivative_taps() {
  Taps weights = gaussian_taps();
  for (int i = -k_tap_half; i <= k_tap_half; ++i)
    weights[static_cast<size_t>(i + k_tap_half)] *= static_cast<float>(i) / (k_tap_sigma * k_tap_sigma);
  float slope = 0;  // a ramp's derivative is 1
  for (int i = -k_tap_half; i <= k_tap_half; ++i)
    slope += weights[static_cast<size_t>(i + k_tap_half)] * static_cast<float>(i);
  for (float& weight : weights) weight /= slope;
  return weights;
}

// An image's smoothed value and derivatives at one pixel.
struct SmoothedPixel {
  float value = 0, along_x = 0, along_y = 0;
};

template <class Value>
SmoothedPixel smoothed_pixel(Value&& value_at, int x, int y) {
  static const Taps smooth = gaussian_taps(), derive = derivative_taps();
  SmoothedPixel local;
  for (int v = -k_tap_half; v <= k_tap_half; ++v) {
    float sum = 0, slope = 0;
    for (int u = -k_tap_half; u <= k_tap_half; ++u) {
      const auto value = static_cast<float>(value_at(x + u, y + v));
      sum += smooth[static_cast<size_t>(u + k_tap_half)] * value;
      slope += derive[static_cast<size_t>(u + k_tap_half)] * value;
    }
    local.value += smooth[static_cast<size_t>(v + k_tap_half)] * sum;
    local.along_x += smooth[static_cast<size_t>(v + k_tap_half)] * slope;
    local.along_y += derive[static_cast<size_t>(v + k_tap_half)] * sum;
  }
  return local;
}

using ShakeRows = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// Least squares without the places that occlusions or reflections disturb.
struct ShakeFit {
  Eigen::VectorXd values;
  Eigen::MatrixXd covariance;
};

std::optional<ShakeFit> shake_fit(const ShakeRows& rows, const Eigen::VectorXf& right) {
  ShakeFit fit{Eigen::VectorXd::Zero(rows.cols()), {}};
  double limit = std::numeric_limits<double>::infinity();
  for (int pass = 0; pass < 3; ++pass) {
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(rows.cols(), rows.cols());
    Eigen::VectorXd product = Eigen::VectorXd::Zero(rows.cols());
    const Eigen::VectorXf before = right - rows * fit.values.cast<float>();
    double squared = 0;
    size_t used = 0;
    for (Eigen::Index i = 0; i < rows.rows(); ++i) {
      if (std::abs(before[i]) > limit) continue;
      const Eigen::VectorXd row = rows.row(i).transpose().cast<double>();
      normal += row * row.transpose();
      product += static_cast<double>(right[i]) * row;
      squared += static_cast<double>(before[i]) * before[i];
      ++used;
    }
    // Without stripes in view, the two images' differences are not determined, and do not matter.
    normal.diagonal().array() += 1e-9 * normal.trace();
    const Eigen::LDLT<Eigen::MatrixXd> solver(normal);
    if (used < k_least_shake_places || solver.info() != Eigen::Success) return std::nullopt;
    fit.values = solver.solve(product);
    fit.covariance = solver.solve(Eigen::MatrixXd::Identity(rows.cols(), rows.cols())) *
                     (squared / static_cast<double>(used));
    const Eigen::VectorXf after = right - rows * fit.values.cast<float>();
    std::vector<float> sizes(after.data(), after.data() + after.size());
    for (float& size : sizes) size = std::abs(size);
    limit = k_shake_outlier * 1.4826 * std::max(k_least_scatter, median(std::move(sizes)));
  }
  if (!fit.values.allFinite() || !fit.covariance.allFinite()) return std::nullopt;
  return fit;
}

double root_mean_square(const std::vector<double>& values) {
  double squared = 0;
  for (const double value : values) squared += value * value;
  return values.empty() ? 0 : std::sqrt(squared / static_cast<double>(values.size()));
}

// The scatter of measured values about their median, without that of the measurement: robust, because a pair
// whose stripes the camera does not resolve, or of which it sees one, is measured badly.
double robust_scatter(const std::vector<double>& values, const std::vector<double>& stddevs) {
  const double middle = median(values), own = median(stddevs);
  std::vector<double> sizes;
  for (const double value : values) sizes.push_back(std::abs(value - middle));
  const double all = 1.4826 * median(std::move(sizes));
  return std::sqrt(std::max(0.0, all * all - own * own));
}

}  // namespace

ShakeReference::ShakeReference(const cv::Mat& white, const cv::Mat& black) {
  cv::add(white, black, sum_, cv::noArray(), CV_16S);
  cv::Mat whole, along_x, along_y, smooth, dark_smooth;
  sum_.convertTo(whole, CV_32F);
  const Taps g = gaussian_taps(), d = derivative_taps();
  const cv::Mat kernel_g(1, 2 * k_tap_half + 1, CV_32F, const_cast<float*>(g.data())),
      kernel_d(1, 2 * k_tap_half + 1, CV_32F, const_cast<float*>(d.data()));
  cv::sepFilter2D(whole, along_x, CV_32F, kernel_d, kernel_g);
  cv::sepFilter2D(whole, along_y, CV_32F, kernel_g, kernel_d);
  cv::sepFilter2D(whole, smooth, CV_32F, kernel_g, kernel_g);
  cv::sepFilter2D(black, dark_smooth, CV_32F, kernel_g, kernel_g);
  std::vector<Place> edges, even;
  for (int y = k_tap_half; y + k_tap_half < white.rows; ++y) {
    const float *gx = along_x.ptr<float>(y), *gy = along_y.ptr<float>(y);
    for (int x = k_tap_half; x + k_tap_half < white.cols; ++x) {
      const float squared = gx[x] * gx[x] + gy[x] * gy[x];
      const int bright = white.ptr<uchar>(y)[x], dark = black.ptr<uchar>(y)[x];
      if (bright >= k_full_level) continue;
      if (squared > k_least_place_gradient * k_least_place_gradient)
        edges.push_back({x, y, dark_smooth.ptr<float>(y)[x], smooth.ptr<float>(y)[x], gx[x], gy[x]});
      else if (squared < k_even_gradient * k_even_gradient && bright - dark > k_lit_levels)
        even.push_back({x, y, static_cast<float>(dark), static_cast<float>(bright + dark)});
    }
  }
  const auto thinned = [](const std::vector<Place>& all) {
    std::vector<Place> some;
    for (size_t i = 0; i < all.size(); i += 1 + all.size() / k_most_places) some.push_back(all[i]);
    return some;
  };
  places_ = thinned(edges);
  even_ = thinned(even);
  const size_t step = 1 + edges.size() / k_most_places;
  correlation_ = std::max(1.0, k_common_places / static_cast<double>(step));
}

PairShake ShakeReference::measure(const cv::Mat& image, const cv::Mat& inverse) const {
  constexpr double k_unknown = std::numeric_limits<double>::infinity();
  PairShake shake;
  shake.shift_stddev_px = shake.gain_stddev = k_unknown;
  const auto difference_at = [&](int x, int y) -> int {
    return image.ptr<uchar>(y)[x] - inverse.ptr<uchar>(y)[x];
  };
  const auto change_at = [&](int x, int y) -> int {
    return image.ptr<uchar>(y)[x] + inverse.ptr<uchar>(y)[x] - sum_.ptr<short>(y)[x];
  };
  ShakeRows rows(static_cast<Eigen::Index>(places_.size()), k_shake_values);
  Eigen::VectorXf right(rows.rows());
  for (Eigen::Index i = 0; i < rows.rows(); ++i) {
    const Place& place = places_[static_cast<size_t>(i)];
    const SmoothedPixel difference = smoothed_pixel(difference_at, place.x, place.y);
    rows.row(i) << -place.along_x, -place.along_y, -difference.along_x, -difference.along_y, place.sum,
        difference.value, place.black;
    right[i] = smoothed_pixel(change_at, place.x, place.y).value;
  }
  if (const auto fit = shake_fit(rows, right)) {
    shake.shift_px = fit->values.head<2>();
    shake.shift_stddev_px = std::sqrt(correlation_ * std::max(fit->covariance(0, 0), fit->covariance(1, 1)));
  }
  rows.resize(static_cast<Eigen::Index>(even_.size()), 3);
  right.resize(rows.rows());
  for (Eigen::Index i = 0; i < rows.rows(); ++i) {
    const Place& place = even_[static_cast<size_t>(i)];
    rows.row(i) << place.sum, static_cast<float>(difference_at(place.x, place.y)), place.black;
    right[i] = static_cast<float>(change_at(place.x, place.y));
  }
  if (const auto fit = shake_fit(rows, right)) {
    shake.gain_difference = 2 * fit->values[1];
    shake.gain_stddev = 2 * std::sqrt(fit->covariance(1, 1));
  }
  return shake;
}

Shake shake_of(const std::array<std::vector<PairShake>, 2>& pairs) {
  Shake shake;
  std::vector<double> shift_stddevs, gain_stddevs, shifts, gains;
  Vector2d mean = Vector2d::Zero();
  double most = 0, images = 1;  // white is at 0
  double steps = 0, squares = 0;
  for (const auto& axis : pairs) {
    for (const PairShake& pair : axis) {
      shift_stddevs.push_back(pair.shift_stddev_px);
      gain_stddevs.push_back(pair.gain_stddev);
      mean += 2 * pair.shift_px;
      images += 2;
    }
  }
  if (shift_stddevs.empty()) return shake;
  mean /= images;
  std::optional<Vector2d> before;
  for (const auto& axis : pairs) {
    for (const PairShake& pair : axis) {
      const Vector2d shift = pair.shift_px - mean;
      most = std::max(most, shift.norm());
      squares += shift.squaredNorm();
      if (before) steps += (shift - *before).squaredNorm();
      before = shift;
      for (const double d : {shift.x(), shift.y()}) shifts.push_back(d);
      gains.push_back(pair.gain_difference);
    }
  }
  shake.axes = pairs;
  shake.drifts = steps < k_drift * squares;
  shake.white_shift_px = -mean;
  // Two independent images scatter by the square root of two more than their mean, and less than their
  // difference.
  shake.shift_rms_px = std::sqrt(2.0) * root_mean_square(shifts);
  shake.gain_rms = robust_scatter(gains, gain_stddevs) / std::sqrt(2.0);
  shake.shift_stddev_px = *std::max_element(shift_stddevs.begin(), shift_stddevs.end());
  shake.gain_stddev = median(gain_stddevs);
  shake.shakes =
      shake.shift_rms_px > std::max(k_least_shift_px, k_shake_significant * shake.shift_stddev_px) &&
      most < k_most_shift_px;
  shake.flickers = shake.gain_rms > std::max(k_least_flicker, k_shake_significant * shake.gain_stddev);
  for (auto& axis : shake.axes) {
    for (PairShake& pair : axis) {
      pair.shift_px = shake.shakes ? Vector2d(pair.shift_px - mean) : Vector2d::Zero();
      if (!shake.flickers) pair.gain_difference = 0;
      // The difference of two gains has twice their variance.
      const double expected = 2 * shake.gain_rms * shake.gain_rms;
      pair.gain_difference *= expected / std::max(1e-12, expected + pair.gain_stddev * pair.gain_stddev);
    }
  }
  if (!shake.shakes) shake.white_shift_px.setZero();
  return shake;
}

}  // namespace limn::calib
