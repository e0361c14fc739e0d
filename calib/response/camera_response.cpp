#include "calib/response/camera_response.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <functional>

#include "core/least_squares.h"

namespace limn::calib {
namespace {

using Role = ResponseImage::Role;

// Number of samples of all images together; the exponent of a power is then accurate to 0.001.
constexpr size_t k_most_samples = 1500;
// Share of the mean slope: a flatter encoding cannot be distinguished there.
constexpr double k_least_slope = 0.05;
// A simpler encoding is chosen if its fit is worse by at most this, relatively and in levels: a free curve
// always follows noise and rounding a little, and what it then explains is less than 0.1 % of full scale.
constexpr double k_same_rms = 1.03, k_same_levels = 0.2;
constexpr double k_worst_rms = 3;      // levels; sums that disagree by more are no sums of light
constexpr double k_least_sure = 0.25;  // maximum standard deviation of an exponent; see power_stddev
constexpr int k_rows = 10, k_unknowns = 5;

using Light = std::array<double, 256>;
using Values = Eigen::VectorXd;

// Levels of one pixel in black, the eight share images and white, and which shares each shows.
struct Sums {
  std::vector<std::array<double, k_rows>> levels;
  Eigen::Matrix<double, k_rows, k_unknowns> shown;  // dark and four shares
  std::array<double, k_rows> repeats;               // number of images that a level is the mean of
  double lowest = 0, highest = 255;                 // levels, without the outermost pixels
};

void find_range(Sums* sums) {
  if (sums->levels.empty()) return;
  std::vector<double> blacks, whites;
  for (const auto& levels : sums->levels) blacks.push_back(levels.front()), whites.push_back(levels.back());
  std::sort(blacks.begin(), blacks.end());
  std::sort(whites.begin(), whites.end());
  sums->lowest = blacks[blacks.size() / 20];
  sums->highest = std::max(whites[whites.size() * 19 / 20], sums->lowest + 1);
}

Sums sums_of(std::span<const ResponseSamples* const> samples) {
  const auto blacks = images_of(Role::black), whites = images_of(Role::white),
             shares = images_of(Role::share);
  Sums sums;
  std::array<std::vector<size_t>, k_rows> rows;
  rows[0] = blacks;
  for (size_t i = 0; i < shares.size(); ++i) rows[i + 1] = {shares[i]};
  rows[k_rows - 1] = whites;
  for (size_t row = 0; row < rows.size(); ++row) {
    const ResponseImage& image = response_images()[rows[row][0]];
    const auto r = static_cast<Eigen::Index>(row);
    sums.shown(r, 0) = 1;
    for (int i = 0; i < 4; ++i)
      sums.shown(r, i + 1) = image.role != Role::black && (image.shares >> i & 1) != 0 ? 1 : 0;
    sums.repeats[row] = static_cast<double>(rows[row].size());
  }
  size_t total = 0;
  for (const ResponseSamples* set : samples) total += set->count;
  const size_t step = std::max<size_t>(1, total / k_most_samples);
  for (const ResponseSamples* set : samples)
    for (size_t k = 0; k < set->count; k += step) {
      std::array<double, k_rows> levels{};
      bool clipped = false;
      for (size_t row = 0; row < rows.size(); ++row)
        for (const size_t image : rows[row]) {
          levels[row] += set->at(k)[image] / sums.repeats[row];
          clipped = clipped || set->at(k)[image] >= k_clipped || set->at(k)[image] == 0;
        }
      if (!clipped) sums.levels.push_back(levels);
    }
  find_range(&sums);
  return sums;
}

// An encoding with parameters, as the light of levels.
struct Family {
  CameraEncoding encoding = CameraEncoding::linear;
  Values start;
  std::function<Light(const Values&)> light;
  Eigen::MatrixXd prior;  // times (parameters - start): weak prior towards 0, in standard deviations
};

Light linear_light(const Values&) {
  Light light{};
  for (size_t i = 0; i < light.size(); ++i) light[i] = static_cast<double>(i) / 255;
  return light;
}

double above(double level, double pedestal) { return std::max(0.0, (level - pedestal) / (255 - pedestal)); }

Light srgb_light(const Values& values) {
  Light light{};
  for (size_t i = 0; i < light.size(); ++i)
    light[i] = linear_from_srgb(above(static_cast<double>(i), values[0]));
  return light;
}

Light power_light(const Values& values) {
  Light light{};
  for (size_t i = 0; i < light.size(); ++i)
    light[i] = std::pow(above(static_cast<double>(i), values[1]), values[0]);
  return light;
}

// Logarithms of the slope at knots, linear between them, integrated and scaled to 1.
constexpr std::array<double, 13> k_knots = {0, 10, 22, 36, 52, 72, 96, 122, 148, 174, 200, 226, 255};
Light free_light(const Values& values) {
  Light light{};
  size_t knot = 0;
  for (size_t i = 1; i < light.size(); ++i) {
    const double at = static_cast<double>(i) - 0.5;
    while (at > k_knots[knot + 1]) ++knot;
    const double share = (at - k_knots[knot]) / (k_knots[knot + 1] - k_knots[knot]);
    const auto k = static_cast<Eigen::Index>(knot);
    light[i] = light[i - 1] + std::exp((1 - share) * values[k] + share * values[k + 1]);
  }
  for (double& value : light) value /= light[255];
  return light;
}

// Prior: the free curve's slope changes by a tenth from knot to knot, so that it continues straight where no
// pixel has data; its scale is a convention.
Eigen::MatrixXd smooth_prior() {
  constexpr double k_bend = 0.1, k_scale = 1;
  const auto knots = static_cast<Eigen::Index>(k_knots.size());
  Eigen::MatrixXd prior = Eigen::MatrixXd::Zero(knots - 1, knots);
  for (Eigen::Index i = 0; i + 2 < knots; ++i)
    prior.row(i).segment<3>(i) << 1 / k_bend, -2 / k_bend, 1 / k_bend;
  prior.row(knots - 2).setConstant(1 / (k_scale * static_cast<double>(knots)));
  return prior;
}

std::vector<Family> families() {
  constexpr double k_pedestal = 2, k_pedestal_stddev = 10;  // levels
  const Values none = Values::Zero(0);
  const auto knots = static_cast<Eigen::Index>(k_knots.size());
  const Eigen::MatrixXd pedestal = Eigen::MatrixXd::Constant(1, 1, 1 / k_pedestal_stddev);
  const Eigen::MatrixXd power = Eigen::RowVector2d(0, 1 / k_pedestal_stddev);
  return {{CameraEncoding::linear, none, linear_light, Eigen::MatrixXd::Zero(0, 0)},
          {CameraEncoding::srgb, Values::Constant(1, k_pedestal), srgb_light, pedestal},
          {CameraEncoding::gamma, Eigen::Vector2d(1.5, k_pedestal), power_light, power},
          {CameraEncoding::measured, Values::Zero(knots), free_light, smooth_prior()}};
}

double light_at(const Light& light, double level) {
  const auto first = std::min<size_t>(static_cast<size_t>(level), 254);
  return light[first] + (level - static_cast<double>(first)) * (light[first + 1] - light[first]);
}

double mean_slope(const Light& light, double low, double high) {
  return (light_at(light, high) - light_at(light, low)) / (high - low);
}

// Slope over a few levels, so that the weights do not jump with a level's noise.
double slope_at(const Light& light, double level) {
  return mean_slope(light, std::max(0.0, level - 2), std::min(255.0, level + 2));
}

// One pixel's light in the rows' images, as predicted by the sums in an encoding.
Eigen::Matrix<double, k_rows, 1> summed(const Sums& sums, size_t i, const Light& light) {
  const double least = k_least_slope * mean_slope(light, sums.lowest, sums.highest);
  Eigen::Matrix<double, k_rows, 1> y;
  Eigen::Matrix<double, k_rows, k_unknowns> a;
  for (int r = 0; r < k_rows; ++r) {
    const double level = sums.levels[i][static_cast<size_t>(r)];
    const double root =
        std::sqrt(sums.repeats[static_cast<size_t>(r)]) / std::max(least, slope_at(light, level));
    y[r] = root * light_at(light, level);
    a.row(r) = root * sums.shown.row(r);
  }
  const Eigen::Matrix<double, k_unknowns, k_unknowns> normal = a.transpose() * a;
  const Eigen::Matrix<double, k_unknowns, 1> x = normal.ldlt().solve(a.transpose() * y);
  return sums.shown * x;
}

double level_of(const Light& light, double value) {
  const auto above = std::upper_bound(light.begin(), light.end(), value);
  if (above == light.begin()) return 0;
  if (above == light.end()) return 255;
  return static_cast<double>(above - 1 - light.begin()) + (value - *(above - 1)) / (*above - *(above - 1));
}

// Residuals of the sums, in standard deviations of one image's levels: k_rows numbers for each pixel. They
// are compared as levels: compared as light over the curve's slope, a curve that bends enough would explain
// anything.
Values residuals(const Sums& sums, const Light& light) {
  Values all(static_cast<Eigen::Index>(sums.levels.size()) * k_rows);
  for (size_t i = 0; i < sums.levels.size(); ++i) {
    const Eigen::Matrix<double, k_rows, 1> seen = summed(sums, i, light);
    for (int r = 0; r < k_rows; ++r) {
      const auto row = static_cast<size_t>(r);
      all[static_cast<Eigen::Index>(i) * k_rows + r] =
          std::sqrt(sums.repeats[row]) * (sums.levels[i][row] - level_of(light, seen[r]));
    }
  }
  return all;
}

// The same sums without noise.
Sums without_noise(const Sums& sums, const Light& light) {
  Sums smooth = sums;
  for (size_t i = 0; i < sums.levels.size(); ++i) {
    const Eigen::Matrix<double, k_rows, 1> seen = summed(sums, i, light);
    for (int r = 0; r < k_rows; ++r) smooth.levels[i][static_cast<size_t>(r)] = level_of(light, seen[r]);
  }
  return smooth;
}

// Standard deviation of the exponent of a power on top of an encoding: it says how much the images determine
// at all. It is computed from sums without noise, because noise alone would look like information. A minimum
// for single pixels is needed as well: thousands of pixels with almost no information do not add up to much,
// because systematic errors are then larger.
double power_stddev(const Sums& sums, const Light& light, double rms) {
  constexpr double k_step = 0.05;
  Light bent = light;
  for (double& value : bent) value = std::pow(value, 1 + k_step);
  const Sums smooth = without_noise(sums, light);
  const double change = (residuals(smooth, bent) - residuals(smooth, light)).norm();
  return rms * k_step / std::max(change, 1e-9);
}

struct Fit {
  CameraEncoding encoding = CameraEncoding::linear;
  Values values;
  Light light{};
  double rms = 0;  // levels
};

// A family's unknowns by the sums and by what is known of them before, for minimise(): few of them,
// derivatives by differences.
struct FamilyProblem {
  FamilyProblem(const Sums& all_sums, const Family& of)
      : sums(all_sums), family(of), state(of.start), now(stacked(state)) {}

  Values stacked(const Values& values) const {
    const Values data = residuals(sums, family.light(values));
    Values all(data.size() + family.prior.rows());
    all << data, family.prior * (values - family.start);
    return all;
  }
  double cost() const { return now.squaredNorm(); }
  bool linearise() {
    Eigen::MatrixXd jacobian(now.size(), state.size());
    for (Eigen::Index i = 0; i < state.size(); ++i) {
      constexpr double k_step = 1e-4;
      Values moved = state;
      moved[i] += k_step;
      jacobian.col(i) = (stacked(moved) - now) / k_step;
    }
    matrix = jacobian.transpose() * jacobian;
    downhill = -jacobian.transpose() * now;
    return true;
  }
  bool solve(double damping) {
    trial = state + damped(matrix, damping).ldlt().solve(downhill);
    return true;
  }
  double evaluate_trial() {
    then = stacked(trial);
    return then.squaredNorm();
  }
  void accept_trial() {
    state = trial;
    now = then;
  }
  bool is_settled(const LeastSquaresTrial& tried) const {
    return tried.is_accepted && tried.gain() < 1e-7 * tried.cost_after;
  }

  const Sums& sums;
  const Family& family;
  Values state, trial;
  Values now, then;  // their residuals
  Eigen::MatrixXd matrix;
  Values downhill;
};

Fit fitted(const Sums& sums, const Family& family) {
  Fit fit{family.encoding, family.start, {}, 0};
  if (family.start.size() > 0) {
    FamilyProblem problem(sums, family);
    minimise(&problem, {.max_steps = 30,
                        .first_damping = 1e-3,
                        .least_damping = 1e-9,
                        .most_damping = 5e4,
                        .accepts_equal_cost = false});
    fit.values = problem.state;
  }
  fit.light = family.light(fit.values);
  const double freedom = static_cast<double>(sums.levels.size()) * (k_rows - k_unknowns);
  fit.rms = std::sqrt(residuals(sums, fit.light).squaredNorm() / std::max(1.0, freedom));
  return fit;
}

// Scatter of one pixel, over the samples; each image's mean is removed, so that drift does not count as
// noise.
double scatter(std::span<const ResponseSamples* const> samples, Role role) {
  const auto images = images_of(role);
  std::vector<double> squares;
  double sum = 0, count = 0;
  for (const ResponseSamples* set : samples) {
    std::vector<double> shift;
    for (const size_t image : images) {
      std::vector<double> differences;
      for (size_t k = 0; k < set->count; ++k)
        differences.push_back(set->at(k)[image] - static_cast<double>(set->at(k)[images[0]]));
      double mean = 0;
      for (const double d : differences) mean += d / static_cast<double>(differences.size());
      shift.push_back(mean);
    }
    for (size_t k = 0; k < set->count; ++k) {
      double mean = 0, square = 0;
      bool clipped = false;
      for (size_t i = 0; i < images.size(); ++i) {
        const double level = set->at(k)[images[i]] - shift[i];
        clipped = clipped || set->at(k)[images[i]] >= k_clipped;
        mean += level / static_cast<double>(images.size());
        square += level * level;
      }
      if (clipped) continue;
      sum += square - static_cast<double>(images.size()) * mean * mean;
      count += static_cast<double>(images.size()) - 1;
    }
  }
  return count > 0 ? std::sqrt(std::max(0.0, sum / count)) : 0;
}

CameraResponse unknown_encoding() {
  CameraResponse response;
  const Light light = linear_light({});
  response.light.assign(light.begin(), light.end());
  response.encoding = CameraEncoding::unknown;
  return response;
}

}  // namespace

std::array<double, 2> noise_levels(std::span<const ResponseSamples* const> samples) {
  return {scatter(samples, Role::black), scatter(samples, Role::white)};
}

CameraResponse fitted_encoding(std::span<const ResponseSamples* const> samples) {
  CameraResponse response = unknown_encoding();
  const auto noise = noise_levels(samples);
  response.noise_dark = noise[0];
  response.noise_bright = noise[1];
  const Sums sums = sums_of(samples);
  constexpr size_t k_least_samples = 100;
  if (sums.levels.size() < k_least_samples) return response;
  std::vector<Fit> fits;
  for (const Family& family : families()) fits.push_back(fitted(sums, family));
  double best = fits[0].rms;
  for (const Fit& fit : fits) best = std::min(best, fit.rms);
  const Fit& chosen = *std::find_if(fits.begin(), fits.end(), [&](const Fit& fit) {
    return fit.rms <= std::hypot(k_same_rms * best, k_same_levels);
  });
  response.gamma_stddev = power_stddev(sums, chosen.light, chosen.rms);
  const double of_one = response.gamma_stddev * std::sqrt(static_cast<double>(sums.levels.size()));
  if (!(best < k_worst_rms) || !(of_one < k_least_sure)) return response;
  response.encoding = chosen.encoding;
  response.light.assign(chosen.light.begin(), chosen.light.end());
  if (chosen.encoding == CameraEncoding::srgb) response.pedestal = chosen.values[0];
  if (chosen.encoding == CameraEncoding::gamma) {
    response.gamma = chosen.values[0];
    response.pedestal = chosen.values[1];
  }
  return response;
}

Decoding decoding(const CameraResponse& response) {
  Light light{};
  std::copy(response.light.begin(), response.light.end(), light.begin());
  Decoding decoding{};
  for (size_t level = 0; level < light.size(); ++level) {
    const double slope = std::max(k_least_slope, slope_at(light, static_cast<double>(level)) * 255);
    decoding.light[level] = static_cast<float>(light[level]);
    decoding.weight[level] = level >= k_clipped ? 0 : static_cast<float>(1 / (slope * slope));
  }
  return decoding;
}

}  // namespace limn::calib
