#include "calib/response/projector_response.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/core.hpp>

#include "calib/code/patterns.h"
#include "core/median.h"
#include "core/photometric_response.h"

namespace limn::calib {
namespace {

using Role = ResponseImage::Role;

// Deviation of light^(1 / 2.2) from its neighbours' prediction: half a step of the ramp.
constexpr double k_worst_jump = 0.035;
constexpr int k_tile_px = 16;
constexpr size_t k_least_tiles = 20;
constexpr double k_least_light = 0.04;  // share of full scale, white in a tile: ten levels

struct Ramp {
  std::vector<size_t> images;
  std::vector<double> values;  // display values, 0 … 1
};

Ramp ramp(int channel) {
  Ramp ramp{ramp_of(channel), {}};
  for (const size_t image : ramp.images) ramp.values.push_back(response_images()[image].bgr[channel] / 255.0);
  return ramp;
}

// Shares of full light at the ramp's values, from every `step`-th sample.
std::vector<double> shares_of(const Ramp& ramp,
                              std::span<const DecodedSamples> all,
                              size_t first = 0,
                              size_t step = 1) {
  const auto blacks = images_of(Role::black);
  std::vector<double> shares;
  const size_t full = ramp.images.back();
  for (const size_t image : ramp.images) {
    double numerator = 0, denominator = 0;
    for (const DecodedSamples& set : all) {
      const auto& light = set.decoding.light;
      for (size_t k = first; k < set.samples->count; k += step) {
        const uchar* levels = set.samples->at(k);
        double others = 0;  // the instrument: it contains no image of the ratio
        for (const size_t other : ramp.images)
          if (other != image && other != full) others += light[levels[other]] - light[levels[blacks[0]]];
        double black = 0;
        for (size_t i = 1; i < blacks.size(); ++i)
          black += light[levels[blacks[i]]] / static_cast<double>(blacks.size() - 1);
        numerator += others * (light[levels[image]] - black);
        denominator += others * (light[levels[full]] - black);
      }
    }
    shares.push_back(image == full ? 1 : numerator / denominator);
  }
  return shares;
}

// Slopes of a cubic that passes through all points and is monotone where they are (Fritsch and Butland 1984).
std::vector<double> monotone_slopes(const std::vector<double>& x, const std::vector<double>& y) {
  const size_t n = x.size();
  std::vector<double> h(n - 1), d(n - 1), slopes(n, 0);
  for (size_t i = 0; i + 1 < n; ++i) {
    h[i] = x[i + 1] - x[i];
    d[i] = (y[i + 1] - y[i]) / h[i];
  }
  for (size_t i = 1; i + 1 < n; ++i) {
    if (d[i - 1] * d[i] <= 0) continue;
    const double before = 2 * h[i] + h[i - 1], after = h[i] + 2 * h[i - 1];
    slopes[i] = (before + after) / (before / d[i - 1] + after / d[i]);
  }
  const auto end = [](double h0, double h1, double d0, double d1) {
    const double slope = ((2 * h0 + h1) * d0 - h0 * d1) / (h0 + h1);
    return std::clamp(slope, 0.0, 3 * d0);
  };
  slopes[0] = end(h[0], h[1], d[0], d[1]);
  slopes[n - 1] = end(h[n - 2], h[n - 3], d[n - 2], d[n - 3]);
  return slopes;
}

double cubic_at(const std::vector<double>& x,
                const std::vector<double>& y,
                const std::vector<double>& slopes,
                double at) {
  size_t i = 0;
  while (i + 2 < x.size() && at > x[i + 1]) ++i;
  const double h = x[i + 1] - x[i], t = (at - x[i]) / h;
  return (1 + 2 * t) * (1 - t) * (1 - t) * y[i] + t * (1 - t) * (1 - t) * h * slopes[i] +
         t * t * (3 - 2 * t) * y[i + 1] + t * t * (t - 1) * h * slopes[i + 1];
}

double root_of(double share) { return std::pow(std::max(share, 0.0), 1 / k_display_gamma); }

// The ramp with 0 in front, as points of light^(1 / 2.2).
struct Points {
  std::vector<double> x = {0}, y = {0};
};
Points points_of(const Ramp& ramp, const std::vector<double>& shares) {
  Points points;
  for (size_t i = 0; i < shares.size(); ++i) {
    points.x.push_back(ramp.values[i]);
    points.y.push_back(std::max(points.y.back(), root_of(shares[i])));
  }
  return points;
}

std::vector<double> curve_through(const Points& points) {
  const std::vector<double> slopes = monotone_slopes(points.x, points.y);
  std::vector<double> curve;
  for (int v = 0; v < 256; ++v) {
    const double root = std::max(0.0, cubic_at(points.x, points.y, slopes, v / 255.0));
    const double light = std::pow(root, k_display_gamma);
    curve.push_back(curve.empty() ? light : std::max(curve.back(), light));
  }
  curve.front() = 0;
  curve.back() = 1;
  return curve;
}

// Standard deviations of light^(1 / 2.2), from the scatter of eight parts of the samples.
std::vector<double> root_stddevs(const Ramp& ramp,
                                 const std::vector<double>& shares,
                                 std::span<const DecodedSamples> all) {
  constexpr size_t k_parts = 8;
  std::vector<double> variances(shares.size(), 0);
  for (size_t part = 0; part < k_parts; ++part) {
    const std::vector<double> found = shares_of(ramp, all, part, k_parts);
    for (size_t i = 0; i < shares.size(); ++i)
      variances[i] += (found[i] - shares[i]) * (found[i] - shares[i]) / (k_parts * (k_parts - 1));
  }
  std::vector<double> stddevs;
  for (size_t i = 0; i < shares.size(); ++i)
    stddevs.push_back(root_of(shares[i] + std::sqrt(variances[i])) - root_of(shares[i]));
  return stddevs;
}

// Distance of each of the ramp's images, without the darkest and the brightest, from the cubic through four
// neighbours, less what noise explains; the largest.
double worst_jump(const Ramp& ramp,
                  const std::vector<double>& shares,
                  const std::vector<double>& stddevs,
                  size_t* worst) {
  constexpr double k_sure = 4;  // standard deviations
  double jump = 0;
  for (size_t i = 1; i + 1 < shares.size(); ++i) {
    const size_t first = std::clamp<size_t>(i < 2 ? 0 : i - 2, 0, shares.size() - 5);
    double predicted = 0, noise = stddevs[i];  // Lagrange
    for (size_t j = first; j < first + 5; ++j) {
      if (j == i) continue;
      double weight = 1;
      for (size_t k = first; k < first + 5; ++k)
        if (k != j && k != i) weight *= (ramp.values[i] - ramp.values[k]) / (ramp.values[j] - ramp.values[k]);
      predicted += weight * root_of(shares[j]);
      noise += std::abs(weight) * stddevs[j];
    }
    const double off = std::abs(root_of(shares[i]) - predicted) - k_sure * noise;
    if (off > jump) jump = off, *worst = i;
  }
  return jump;
}

Status check_smooth(const Ramp& ramp,
                    const std::vector<double>& shares,
                    const std::vector<double>& stddevs,
                    const std::string& where) {
  size_t worst = 0;
  const double jump = worst_jump(ramp, shares, stddevs, &worst);
  const auto finite = [](const std::vector<double>& values) {
    return std::all_of(values.begin(), values.end(), [](double v) { return std::isfinite(v); });
  };
  if (finite(shares) && finite(stddevs) && jump < k_worst_jump) return {};
  const size_t image = ramp.images[worst];
  return error(
      "{}/{} or an image near it: expected light that rises smoothly along the ramp ({}), found {:.3f} of "
      "full light between {:.3f} and {:.3f}. An image is repeated, lost or out of order, or the camera sets "
      "its exposure by itself. Capture again with fixed exposure and white balance.",
      where, image_name(static_cast<int>(image)), response_images()[image].what(), shares[worst],
      shares[worst > 0 ? worst - 1 : 0], shares[std::min(worst + 1, shares.size() - 1)]);
}

// Sums over samples of the light above black in some images.
double summed_light(std::span<const DecodedSamples> all, size_t image) {
  const auto blacks = images_of(Role::black);
  double sum = 0;
  for (const DecodedSamples& set : all)
    for (size_t k = 0; k < set.samples->count; ++k) {
      const uchar* levels = set.samples->at(k);
      const auto white = images_of(Role::white);
      const bool clipped =
          std::any_of(white.begin(), white.end(), [&](size_t w) { return levels[w] >= k_clipped; });
      if (clipped) continue;
      sum += set.decoding.light[levels[image]];
      for (const size_t black : blacks)
        sum -= set.decoding.light[levels[black]] / static_cast<double>(blacks.size());
    }
  return sum;
}

void add_checks(std::span<const DecodedSamples> all, ProjectorResponse* response) {
  const auto whites = images_of(Role::white);
  double full[3];
  for (int c = 0; c < 3; ++c) full[c] = summed_light(all, ramp_of(c).back());
  const double white = summed_light(all, whites.front());
  if (!(white > 0)) return;  // white is clipped everywhere
  response->white_over_sum = white / (full[0] + full[1] + full[2]);
  response->drift = summed_light(all, whites.back()) / white - 1;
  double worst = 0;
  for (const size_t image : images_of(Role::grey)) {
    double expected = 0;
    for (int c = 0; c < 3; ++c)
      expected += full[c] * light_over_black(*response, c, response_images()[image].bgr[c]);
    worst =
        std::max(worst, std::abs(summed_light(all, image) - *response->white_over_sum * expected) / white);
  }
  response->worst_residual = worst;
}

// Decoded light, summed over channels, averaged over images; NaN where a level is clipped.
cv::Mat light_image(const ResponseShots& shots, const Decoding& decoding, std::span<const size_t> images) {
  const cv::Mat& first = shots.images[0];
  cv::Mat light(first.size(), CV_32F, cv::Scalar(0));
  const int channels = first.channels();
  for (const size_t image : images)
    for (int r = 0; r < first.rows; ++r) {
      const uchar* levels = shots.images[image].ptr(r);
      auto* out = light.ptr<float>(r);
      for (int c = 0; c < first.cols; ++c)
        for (int k = 0; k < channels; ++k) {
          const uchar level = levels[c * channels + k];
          out[c] += level >= k_clipped ? std::numeric_limits<float>::quiet_NaN()
                                       : decoding.light[level] / static_cast<float>(images.size());
        }
    }
  return light;
}

struct Share {
  double value = 0, variance = 0;
};

// One tile: black = plane + share * white.
std::optional<Share> share_in(const cv::Mat& black, const cv::Mat& white, const cv::Mat& border) {
  constexpr double k_lit = 0.5, k_unlit = 0.1;  // shares of the tile's brightest
  constexpr int k_least_pixels = k_tile_px * k_tile_px / 10;
  double brightest = 0;
  cv::minMaxLoc(white, nullptr, &brightest);
  if (!cv::checkRange(black) || !cv::checkRange(white) || brightest < k_least_light) return std::nullopt;
  int lit = 0, unlit = 0;
  Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
  Eigen::Vector4d product = Eigen::Vector4d::Zero();
  double squares = 0;
  for (int r = 0; r < black.rows; ++r)
    for (int c = 0; c < black.cols; ++c) {
      const float w = white.at<float>(r, c);
      lit += border.at<float>(r, c) > k_lit * brightest;
      unlit += w < k_unlit * brightest;
      const Eigen::Vector4d row(1, c, r, w);
      normal += row * row.transpose();
      product += row * black.at<float>(r, c);
      squares += black.at<float>(r, c) * black.at<float>(r, c);
    }
  if (lit < k_least_pixels || unlit < k_least_pixels) return std::nullopt;
  const Eigen::Matrix4d inverse = normal.inverse();
  const Eigen::Vector4d x = inverse * product;
  const double left = std::max(0.0, squares - product.dot(x)) / (black.rows * black.cols - 4);
  const double variance = left * inverse(3, 3);
  if (!x.allFinite() || !(variance > 0)) return std::nullopt;
  return Share{x[3], variance};
}

std::vector<Share> shares_at_edges(const ResponseShots& shots, const Decoding& decoding) {
  const auto blacks = images_of(Role::black), whites = images_of(Role::white),
             borders = images_of(Role::border);
  // No image is on both sides of the fit, because its noise would bias it.
  const std::span<const size_t> all(blacks);
  const cv::Mat black = light_image(shots, decoding, all.subspan(1)),
                first = light_image(shots, decoding, all.first(1)),
                white = light_image(shots, decoding, whites) - first,
                border = light_image(shots, decoding, borders) - first;
  std::vector<Share> shares;
  for (int r = 0; r + k_tile_px <= black.rows; r += k_tile_px / 2)
    for (int c = 0; c + k_tile_px <= black.cols; c += k_tile_px / 2) {
      const cv::Rect tile(c, r, k_tile_px, k_tile_px);
      if (const auto share = share_in(black(tile), white(tile), border(tile))) shares.push_back(*share);
    }
  return shares;
}

}  // namespace

Result<ProjectorResponse> fitted_curves(const std::string& projector,
                                        const std::string& where,
                                        std::span<const DecodedSamples> samples) {
  ProjectorResponse response;
  response.projector = projector;
  std::vector<double>* curves[] = {&response.blue, &response.green, &response.red};
  for (int c = 0; c < 3; ++c) {
    const Ramp levels = ramp(c);
    const std::vector<double> shares = shares_of(levels, samples);
    LIMN_TRY_STATUS(check_smooth(levels, shares, root_stddevs(levels, shares, samples), where));
    *curves[c] = curve_through(points_of(levels, shares));
  }
  response.captures = static_cast<int>(response_images().size());
  add_checks(samples, &response);
  return response;
}

std::optional<Measurement> fitted_black_level(std::span<const ResponseShots* const> shots,
                                              std::span<const Decoding> decodings) {
  std::vector<Share> shares;
  for (size_t i = 0; i < shots.size(); ++i) {
    const auto more = shares_at_edges(*shots[i], decodings[i]);
    shares.insert(shares.end(), more.begin(), more.end());
  }
  if (shares.size() < k_least_tiles) return std::nullopt;
  // Huber: an object's outline in a tile does not belong to the plane.
  std::vector<double> values;
  for (const Share& share : shares) values.push_back(share.value);
  double centre = median(std::move(values)), scatter = 0;
  constexpr double k_robust_at = 2;
  for (int pass = 0; pass < 20; ++pass) {
    double weights = 0, sum = 0, spread = 0;
    for (const Share& share : shares) {
      const double off = std::abs(share.value - centre) / std::sqrt(share.variance);
      const double weight = std::min(1.0, k_robust_at / std::max(off, 1e-9)) / share.variance;
      weights += weight;
      sum += weight * share.value;
      spread += weight * weight * (share.value - centre) * (share.value - centre);
    }
    centre = sum / weights;
    scatter =
        std::sqrt(2 * spread) / weights;  // tiles overlap by half: four share each pixel, half their noise
  }
  // The share follows from black / (white - black).
  return Measurement{std::max(0.0, centre / (1 + centre)), scatter};
}

ProjectorResponse with_black_level(ProjectorResponse response,
                                   const std::optional<Measurement>& black_level) {
  response.black_level = black_level;
  if (!black_level) return response;
  for (auto* curve : {&response.red, &response.green, &response.blue})
    for (double& light : *curve) light = black_level->value + (1 - black_level->value) * light;
  return response;
}

double light_over_black(const ProjectorResponse& response, int channel, int value) {
  const std::vector<double>* curves[] = {&response.blue, &response.green, &response.red};
  const std::vector<double>& curve = *curves[channel];
  const double black = response.black_level ? response.black_level->value : 0;
  return (lookup(curve, value / 255.0) - black) / (1 - black);
}

}  // namespace limn::calib
