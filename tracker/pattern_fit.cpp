#include "tracker/pattern_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>
#include <vector>

#include "tracker/local_undistortion.h"
#include "tracker/pattern_model.h"
#include "tracker/pattern_normal_sums.h"
#include "tracker/square_to_quad.h"

namespace limn::tracker {
namespace {

using namespace pattern;

constexpr std::size_t k_few_samples = 150;  // while several motions are tried
constexpr std::size_t k_coarse_samples = 300;
constexpr std::size_t k_moving_samples = 600;
constexpr std::size_t k_samples = 400;
constexpr std::size_t k_most_samples = 600;
constexpr std::size_t k_followed_samples = 300;
constexpr int k_rounds = 16;
constexpr int k_rounds_followed = 4;
constexpr double k_may_move_px = 1.0;     // with less blur, motion cannot be measured separately
constexpr double k_clearly_better = 0.9;  // ratio of mean square residuals, with motion to without
constexpr double k_max_motion_px = 30;
constexpr double k_min_blur_px = 0.28;    // the blur of a pixel's own area
constexpr double k_no_margin = 1e3;       // cells: no outer edge of the paper within reach
constexpr double k_max_residual = 0.075;  // share of the contrast, RMS: above it the model is wrong
constexpr double k_min_explained = 0.77;  // perfect Gaussian residuals give 0.89
constexpr double k_settled_px = 0.02;     // movement in a round: further rounds would add a quarter of it
constexpr double k_roughly_settled_px = 0.03;
constexpr double k_followed_settled_px = 0.1;  // a quarter of it is less than the corners' noise
// Corners that still move more than this in the last round have not converged.
constexpr double k_astray_px = 0.1;
constexpr double k_max_moved_px = 6;  // plus half the motion
// Chi-square with four degrees of freedom: flat paper exceeds it once in 2000 times.
constexpr double k_bend_evidence = 20;
constexpr double k_max_bend = 0.1;   // share of half a side
constexpr std::size_t k_choice = 3;  // times as many pixels are considered, and most flat ones are dropped
constexpr std::size_t k_choice_of_seen = 2;
constexpr double k_steep = 0.8;        // share of the largest change of light over two pixels at an edge
constexpr int k_flat_stride = 8;       // one of this many flat samples is kept
constexpr double k_rough_scale = 0.1;  // share of the contrast
constexpr double k_least_scale = 0.5;  // in light
constexpr double k_bound = 0.15;       // share of the contrast: larger residuals do not count more
constexpr double k_noise = 0.02;       // share of the contrast: with lower RMS residuals no motion is tried
// A pattern still looks the same while its contrast, blur, misfit and explained share are within these
// limits.
constexpr double k_like_contrast = 0.5, k_like_log_blur = 0.3, k_like_misfit = 1.5, k_like_explained = 0.06;
constexpr double k_systematic_px = 0.002;  // the same as for edge lines (refine.cpp)
constexpr double k_most_outside_px = 10;   // largest distance of samples from the marker

enum class Bend {
  none,
  tested,  // its evidence is computed, but it is not fitted
  fitted
};

struct Free {
  bool motion = false;
  Bend bend = Bend::none;
  bool levels_alone = false;
};

// The unknowns that are fitted in a round, ascending.
struct Active {
  std::array<int, k_unknowns> unknowns{};
  int count = 0;
  int padded() const { return (count + k_fours - 1) / k_fours * k_fours; }
};

using SomeMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, k_unknowns, k_unknowns>;
using SomeVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, k_unknowns, 1>;

struct Fitted {
  State state;
  double misfit = std::numeric_limits<double>::infinity();  // mean square residual, with bounded residuals
  double explained = 0;                                     // share of the samples that agree with the model
  double moved_px = 0;                                      // largest movement of a corner in the last round
  // From the last round: the information matrix of the fitted unknowns, and the chi-square that the bend
  // would explain if it were fitted.
  SomeMatrix information;
  double variance = 0;  // one sample's
  double bend_evidence = 0;
};

Eigen::Vector2d middle_of(const RefinedQuad& quad) {
  const auto& c = quad.corners_px;
  return 0.25 * (c[0] + c[1] + c[2] + c[3]);
}

// Which pixels are taken as samples; most of them follow this choice.
enum class Taken {
  evenly,
  at_known_edges,  // edges of the pattern
  at_seen_edges
};

class PatternFit {
 public:
  PatternFit(const cv::Mat& grey,
             const std::array<double, 256>& light,
             const SeenCells& cells,
             const RefinedQuad& start,
             const Lens* lens,
             PatternFitBuffers* buffers)
      : grey_(grey),
        levels_(light),
        cells_(cells),
        start_(start),
        straight_(LocalUndistortion::about(lens, start.corners_px, k_most_outside_px)),
        buffers_(*buffers) {
    for (Eigen::Vector2d& corner : start_.corners_px) corner = straight_.straight(corner);
  }

  std::optional<FittedPattern> fit() {
    const State begun = this->begun();
    take_samples(k_coarse_samples);
    Fitted rough;
    rough.state = begun;
    rough = step({.levels_alone = true}, &rough) ? settled(rough.state, {}, k_roughly_settled_px) : Fitted{};
    const double blur_px = *std::max_element(start_.blur_px.begin(), start_.blur_px.end());
    Free free{.bend = Bend::tested};
    if (blur_px > k_may_move_px && !is_explained(rough)) {
      Fitted moving = most_likely_motion(begun);
      if (moving.misfit < k_clearly_better * rough.misfit) {
        rough = moving;
        free.motion = true;
      }
    }
    least_scale_ = k_least_scale;
    if (free.motion)
      take_samples(k_moving_samples);
    else
      take_samples(k_samples, Taken::at_known_edges, &rough.state);
    Fitted fitted = settled(rough.state, free, k_settled_px);
    if (fitted.bend_evidence > k_bend_evidence) {
      free.bend = Bend::fitted;
      fitted = settled(fitted.state, free, k_settled_px);
    }
    return finished(fitted);
  }

  std::optional<FittedPattern> follow(const PatternAppearance& known) {
    has_ground_ = (known.look.margin.array() < k_no_margin).any();
    margin_ = known.look.margin;
    contrast_ = known.look.contrast();
    least_scale_ = k_least_scale;
    const bool moves = !known.look.motion.isZero();
    if (moves)
      take_samples(k_moving_samples);
    else
      take_samples(k_followed_samples, Taken::at_seen_edges);
    Fitted fitted;
    static_cast<Appearance&>(fitted.state) = known.look;
    fitted.state.corners = start_.corners_px;
    const Free free{.motion = moves, .bend = known.look.bend.isZero() ? Bend::none : Bend::fitted};
    fitted = settled(fitted.state, free, k_followed_settled_px, k_rounds_followed);
    // The residuals are from before the last step, which may have been large; so one more step may be needed.
    if (!is_like(known, fitted) &&
        !(fitted.moved_px > k_settled_px && step(free, &fitted) && is_like(known, fitted)))
      return std::nullopt;
    auto found = finished(fitted, known.correlation);
    if (!found) return std::nullopt;
    PatternAppearance seen = known;
    seen.look = found->seen.look;
    found->seen = seen;
    return found;
  }

 private:
  const cv::Mat& grey_;
  const std::array<double, 256>& levels_;
  const SeenCells& cells_;
  RefinedQuad start_;  // its corners are in the undistorted image, like everything that follows
  const LocalUndistortion straight_;
  const Eigen::Vector2d origin_ = middle_of(start_);  // origin of the samples' pixels
  bool has_ground_ = false;
  Eigen::Vector4d margin_;  // at the start
  double contrast_ = 0;     // at the start
  // Smallest scale of residuals: far from the solution most of them look like outliers.
  double least_scale_ = 0;
  PatternFitBuffers& buffers_;
  PatternFitBuffers::Samples& samples_ = buffers_.samples;
  const PatternKernels& light_ = pattern_kernels(pattern_kernel_versions() - 1);
  std::size_t count_ = 0;  // number of samples; the last one is repeated up to padded_count()

  double light_at(const Eigen::Vector2d& px) const {
    const auto nearest = [](double at, int size) {
      return static_cast<int>(std::min(std::max(0.0, at), size - 1.0) + 0.5);
    };
    return levels_[grey_.ptr(nearest(px.y(), grey_.rows))[nearest(px.x(), grey_.cols)]];
  }
  double light_of(double level) const {
    return levels_[static_cast<std::size_t>(std::clamp(level, 0.0, 255.0))];
  }

  double px_a_cell(const std::array<Eigen::Vector2d, 4>& corners, std::size_t s) const {
    const double side = (corners[(s + 1) % 4] - corners[s]).norm();
    const Eigen::Vector2d far = 0.5 * (corners[(s + 2) % 4] + corners[(s + 3) % 4]);
    const Eigen::Vector2d along = (corners[(s + 1) % 4] - corners[s]) / side;
    const Eigen::Vector2d across = far - corners[s];
    return std::abs(along.x() * across.y() - along.y() * across.x()) / cells_.count;
  }

  // The initial state: blur and levels from the refined edges; margins from where light falls again outside.
  State begun() {
    State state;
    state.corners = start_.corners_px;
    const double blur = *std::min_element(start_.blur_px.begin(), start_.blur_px.end());
    state.log_blur = std::log(std::clamp(blur, 0.4, 5.0));
    for (std::size_t s = 0; s < 4; ++s) {
      state.paper[0] += 0.25 * light_of(start_.outside_level[s]);
      state.ink[0] += 0.25 * light_of(start_.inside_level[s]);
      find_margin(s, &state);
    }
    margin_ = state.margin;
    contrast_ = state.contrast();
    least_scale_ = k_rough_scale * contrast_;
    return state;
  }

  void find_margin(std::size_t s, State* state) {
    const Eigen::Vector2d from = state->corners[s];
    const Eigen::Vector2d along = state->corners[(s + 1) % 4] - from;
    const Eigen::Vector2d outward = Eigen::Vector2d(along.y(), -along.x()).normalized();
    constexpr int k_columns = 16;
    constexpr int k_reach = 24;  // half pixels
    std::array<double, k_reach> level{};
    for (int i = 0; i < k_columns; ++i) {
      const Eigen::Vector2d at = from + (i + 0.5) / k_columns * along;
      const Eigen::Vector2d bent = straight_.bent(at);  // pixels nearby are bent by as much
      for (int d = 0; d < k_reach; ++d)
        level[static_cast<std::size_t>(d)] += light_at(bent + 0.5 * (d + 1) * outward) / k_columns;
    }
    std::size_t top = 0;
    while (top + 1 < k_reach && level[top + 1] >= level[top]) ++top;
    const double lowest = *std::min_element(level.begin() + static_cast<std::ptrdiff_t>(top), level.end());
    const auto side = static_cast<Eigen::Index>(s);
    state->margin[side] = k_no_margin;
    state->ground[side] = lowest;
    if (!(level[top] - lowest > 0.2 * (level[top] - light_of(start_.inside_level[s])))) return;
    for (std::size_t d = top; d < k_reach; ++d)
      if (level[d] < 0.5 * (level[top] + lowest)) {
        state->margin[side] = 0.5 * static_cast<double>(d + 1) / px_a_cell(state->corners, s);
        has_ground_ = true;
        return;
      }
  }

  // Takes about `most` pixels on the marker and in the surroundings that blur mixes with it.
  void take_samples(std::size_t most, Taken taken = Taken::evenly, const State* known = nullptr) {
    for (auto* values : samples_values()) values->clear();
    const std::array<Eigen::Vector2d, 4>& corners = start_.corners_px;
    const Eigen::Matrix3d square_from_px = SquareToQuad(corners).matrix().inverse();
    Eigen::AlignedBox2d box;  // in the grey image
    for (const Eigen::Vector2d& c : corners) box.extend(straight_.bent(c));
    const double blur_px = *std::max_element(start_.blur_px.begin(), start_.blur_px.end());
    const double outside_px = std::clamp(2.5 * blur_px, 2.0, k_most_outside_px);
    const Eigen::Vector2d a = corners[2] - corners[0];
    const Eigen::Vector2d b = corners[3] - corners[1];
    const double side_px = std::sqrt(0.5 * std::abs(a.x() * b.y() - a.y() * b.x()));
    const double out = outside_px / side_px;
    Eigen::Array4d reach = Eigen::Array4d::Constant(out);
    if (has_ground_) reach = reach.min(margin_.array() / cells_.count);
    const int x0 = std::max(0, static_cast<int>(std::ceil(box.min().x() - outside_px)));
    const int y0 = std::max(0, static_cast<int>(std::ceil(box.min().y() - outside_px)));
    const int x1 = std::min(grey_.cols - 1, static_cast<int>(std::floor(box.max().x() + outside_px)));
    const int y1 = std::min(grey_.rows - 1, static_cast<int>(std::floor(box.max().y() + outside_px)));
    const double pixels = side_px * side_px * (1 + 2 * out) * (1 + 2 * out);
    const std::size_t choice = taken == Taken::evenly          ? 1
                               : taken == Taken::at_seen_edges ? k_choice_of_seen
                                                               : k_choice;
    const double wanted = static_cast<double>(choice * most);
    const int stride = std::max(1, static_cast<int>(std::lround(pixels / wanted)));
    const int lean = std::max(1, static_cast<int>(std::lround(0.618 * stride)));  // offset from row to row
    const auto columns = static_cast<std::size_t>((std::max(x1, x0 - 1) - x0) / stride + 1);
    const auto rows = static_cast<std::size_t>(std::max(y1, y0 - 1) - y0 + 1);
    for (auto* values : samples_values()) values->resize(columns * rows);
    count_ = 0;
    int flat = 0;
    // For a step edge under the blur.
    const double least_rise = k_steep * contrast_ * std::erf(1 / (std::numbers::sqrt2 * blur_px));
    for (int y = y0; y <= y1; ++y)
      for (int x = x0 + (lean * (y - y0)) % stride; x <= x1; x += stride) {
        if (taken == Taken::at_seen_edges && rise_at(x, y) < least_rise && ++flat % k_flat_stride != 0)
          continue;
        const Eigen::Vector2d px = straight_.straight(Eigen::Vector2d(x, y)) - origin_;
        samples_.x[count_] = static_cast<float>(px.x());
        samples_.y[count_] = static_cast<float>(px.y());
        samples_.light[count_++] = static_cast<float>(levels_[grey_.ptr(y)[x]]);
      }
    buffers_.keeps.resize(count_);
    Eigen::Matrix3d square_from_sample = square_from_px;
    square_from_sample.col(2) += square_from_px.leftCols<2>() * origin_;
    const Eigen::Matrix<float, 3, 3, Eigen::RowMajor> by = square_from_sample.cast<float>();
    const Eigen::Array4f reaches = reach.cast<float>();
    find_places(samples_.x.data(), samples_.y.data(), count_, by.data(), reaches.data(),
                samples_.level_x.data(), samples_.level_y.data(), buffers_.keeps.data());
    keep();
    if (taken == Taken::at_known_edges) keep_edges(*known);
    // In blurred or small markers all pixels show edges.
    if (count_ > k_most_samples) {
      const double every = static_cast<double>(count_) / static_cast<double>(k_most_samples);
      for (auto* values : samples_values())
        for (std::size_t i = 0; i < k_most_samples; ++i)
          (*values)[i] = (*values)[static_cast<std::size_t>(every * static_cast<double>(i))];
      count_ = k_most_samples;
    }
    for (auto* values : samples_values()) {
      const float last = count_ == 0 ? 0 : (*values)[count_ - 1];
      values->resize(count_);
      values->resize(padded_count(), last);
    }
  }

  // How much light changes over the two pixels around this one, along both axes; the pixel's own noise does
  // not count.
  double rise_at(int x, int y) const {
    const int left = std::max(0, x - 1), right = std::min(grey_.cols - 1, x + 1);
    const std::uint8_t* row = grey_.ptr(y);
    const std::uint8_t above = grey_.ptr(std::max(0, y - 1))[x];
    const std::uint8_t below = grey_.ptr(std::min(grey_.rows - 1, y + 1))[x];
    return std::abs(levels_[row[right]] - levels_[row[left]]) + std::abs(levels_[below] - levels_[above]);
  }

  std::array<std::vector<float>*, 5> samples_values() {
    return {&samples_.x, &samples_.y, &samples_.level_x, &samples_.level_y, &samples_.light};
  }

  // Keeps the samples that show an edge of the pattern, and some others.
  void keep_edges(const State& known) {
    for (auto* values : samples_values()) values->resize(padded_count(), 0);
    std::vector<std::int32_t>& shows = buffers_.keeps;
    shows.resize(padded_count());
    light_.find_edges(guess_of(cells_, known, has_ground_, origin_), samples_.x.data(), samples_.y.data(),
                      padded_count(), shows.data());
    int flat = 0;
    for (std::size_t i = 0; i < count_; ++i)
      if (!shows[i]) shows[i] = ++flat % k_flat_stride == 0;
    keep();
  }

  // Keeps the samples whose `keeps` is not 0.
  void keep() {
    const std::int32_t* keeps = buffers_.keeps.data();
    float *x = samples_.x.data(), *y = samples_.y.data(), *light = samples_.light.data();
    float *level_x = samples_.level_x.data(), *level_y = samples_.level_y.data();
    std::size_t kept = 0;
    for (std::size_t i = 0; i < count_; ++i) {
      x[kept] = x[i], y[kept] = y[i], light[kept] = light[i];
      level_x[kept] = level_x[i], level_y[kept] = level_y[i];
      kept += keeps[i] != 0;
    }
    count_ = kept;
  }

  // Whether the pattern still looks the same.
  static bool is_like(const PatternAppearance& known, const Fitted& now) {
    const double contrast = now.state.contrast(), before = known.look.contrast();
    return contrast > k_like_contrast * before && contrast * k_like_contrast < before &&
           std::abs(now.state.log_blur - known.look.log_blur) < k_like_log_blur &&
           now.misfit < (k_like_misfit * known.misfit + k_noise * k_noise) * contrast * contrast &&
           now.explained > known.explained - k_like_explained && now.moved_px < k_followed_settled_px;
  }

  Fitted settled(const State& start, Free free, double settled_px, int rounds = k_rounds) {
    Fitted fitted;
    fitted.state = start;
    for (int round = 0; round < rounds; ++round) {
      if (!step(free, &fitted)) return {};
      if (fitted.moved_px < settled_px) break;
    }
    return fitted;
  }

  // Whether blur alone explains everything except noise.
  static bool is_explained(const Fitted& fitted) {
    const double contrast = fitted.state.contrast();
    return fitted.misfit < k_noise * k_noise * contrast * contrast;
  }

  static constexpr int k_directions = 8;
  static constexpr std::array<double, 2> k_lengths = {7, 14};  // pixels

  // Tries motions in all directions; the better ones continue with more rounds and samples.
  Fitted most_likely_motion(const State& begun) {
    std::array<Fitted, k_directions * k_lengths.size()> all;
    std::size_t count = 0;
    take_samples(k_few_samples);
    for (int i = 0; i < k_directions; ++i)
      for (const double length : k_lengths) {
        const double angle = std::numbers::pi * i / k_directions;
        Fitted fitted;
        fitted.state = begun;
        fitted.state.log_blur = std::log(1.5);
        fitted.state.motion = length * Eigen::Vector2d(std::cos(angle), std::sin(angle));
        if (step({.levels_alone = true}, &fitted)) all[count++] = fitted;
      }
    std::span<Fitted> fits = best_of(std::span(all).first(count), 1, 6);
    fits = best_of(fits, 2, 3);
    take_samples(k_coarse_samples);
    fits = best_of(fits, 3, 1);
    return fits.empty() ? Fitted{} : fits[0];
  }

  // The best of the fits after some more rounds, at most `most`.
  std::span<Fitted> best_of(std::span<Fitted> fits, int rounds, std::size_t most) {
    for (Fitted& fitted : fits)
      for (int round = 0; round < rounds; ++round)
        if (!step({.motion = true}, &fitted)) {
          fitted.misfit = std::numeric_limits<double>::infinity();
          break;
        }
    std::sort(fits.begin(), fits.end(), [](const Fitted& a, const Fitted& b) { return a.misfit < b.misfit; });
    while (!fits.empty() && (fits.size() > most || std::isinf(fits.back().misfit)))
      fits = fits.first(fits.size() - 1);
    return fits;
  }

  std::size_t padded_count() const { return (count_ + k_together - 1) / k_together * k_together; }

  // The unknowns to fit; the bend comes last.
  static Active active(Free free, const State& state, bool has_ground) {
    Active active;
    const auto add = [&](int from, int number) {
      for (int i = from; i < from + number; ++i)
        active.unknowns[static_cast<std::size_t>(active.count++)] = i;
    };
    if (!free.levels_alone) add(shape, 8), add(log_blur, 1);
    if (free.motion) add(motion_x, 2);
    add(paper, 3);
    add(ink, 3);
    for (const int of_side : {int{ground}, int{margin}})
      for (int s = 0; s < 4 && has_ground; ++s)
        if (state.margin[s] < k_no_margin && !(free.levels_alone && of_side == margin)) add(of_side + s, 1);
    if (free.bend != Bend::none) add(bend, 4);
    return active;
  }

  // Standard deviation of a weak prior that keeps an unknown near its current value.
  static double loose(int unknown) {
    if (unknown < log_blur) return 0.2;
    if (unknown < motion_x) return 1;
    if (unknown < paper) return 10;
    if (unknown < margin) return 100;
    return unknown < bend ? 0.5 : 0.02;
  }

  // One Gauss-Newton step on the samples.
  bool step(Free free, Fitted* fitted) {
    if (count_ < 2 * k_unknowns) return false;
    auto& [samples, keeps, residuals, sizes, behind, roots, pulls, derivatives, unused] = buffers_;
    const Active active = this->active(free, fitted->state, has_ground_);
    const std::size_t stride = padded_count();
    residuals.resize(stride);
    sizes.resize(stride);
    behind.resize(stride);
    unused.resize(stride);
    const auto number = static_cast<std::size_t>(active.count);
    derivatives.resize(static_cast<std::size_t>(active.padded()) * stride);
    std::fill(derivatives.begin() + static_cast<std::ptrdiff_t>(number * stride), derivatives.end(), 0.0F);
    Results results{residuals.data(), behind.data(), {}};
    std::fill_n(results.derivatives, k_unknowns, unused.data());
    for (std::size_t a = 0; a < number; ++a)
      results.derivatives[active.unknowns[a]] = &derivatives[a * stride];
    const Places places{samples.x.data(), samples.y.data(), samples.level_x.data(), samples.level_y.data()};
    light_.evaluate(guess_of(cells_, fitted->state, has_ground_, origin_), places, stride, results);
    compare(samples.light.data(), count_, residuals.data(), sizes.data());
    const double scale = std::max(least_scale_, 1.4826 * median(sizes.data(), count_));
    // The background is one level for each side only by chance, so its residuals are weighted by their size.
    const Unlike unlike = sum_behind(residuals.data(), behind.data(), count_);
    const double bound = k_bound * k_bound * contrast_ * contrast_;
    pulls.assign(stride, 0);
    roots.assign(stride, 0);
    const Weights sums =
        weigh(residuals.data(), behind.data(), count_,
              static_cast<float>(unlike.squares / unlike.weights / (scale * scale)),
              static_cast<float>(scale), static_cast<float>(bound), roots.data(), pulls.data());
    fitted->explained = sums.weights / sums.trusted;
    fitted->misfit = sums.misfit / sums.trusted;
    const double lost = sums.weights / std::max(1.0, static_cast<double>(sums.weights) - active.count);
    fitted->variance = lost * sums.weights * sums.scores / (sums.slopes * sums.slopes);
    for (std::size_t a = 0; a < number; ++a) scale_by(roots.data(), stride, &derivatives[a * stride]);
    return solved(free, active, scale * scale, fitted);
  }

  // Solves for the change from the weighted derivatives and residuals, and applies it.
  bool solved(Free free, const Active& active, double noise, Fitted* fitted) const {
    constexpr int k_padded = (k_unknowns + k_fours - 1) / k_fours * k_fours;
    const int padded = active.padded();
    std::array<double, static_cast<std::size_t>(k_padded * k_padded)> lower;
    std::array<double, static_cast<std::size_t>(k_padded)> products;
    add_products(buffers_.derivatives.data(), padded, padded_count(), buffers_.pulls.data(), lower.data(),
                 products.data());
    SomeMatrix information(active.count, active.count);
    SomeVector right(active.count);
    for (int i = 0; i < active.count; ++i) {
      for (int j = 0; j <= i; ++j)
        information(i, j) = information(j, i) = lower[static_cast<std::size_t>(i * padded + j)];
      const double deviation = loose(active.unknowns[static_cast<std::size_t>(i)]);
      information(i, i) += noise / (deviation * deviation);
      right[i] = products[static_cast<std::size_t>(i)];
    }
    const int number = active.count - (free.bend == Bend::tested ? 4 : 0);
    fitted->information = information.topLeftCorner(number, number);
    const Eigen::LDLT<SomeMatrix> solver(fitted->information);
    const SomeVector some = solver.solve(right.head(number));
    if (!some.allFinite()) return false;
    if (free.bend == Bend::tested) {  // what the fitted unknowns would leave to it (Schur complement)
      const Eigen::Matrix<double, Eigen::Dynamic, 4, 0, k_unknowns, 4> beside =
          information.topRightCorner(number, 4);
      const Eigen::Matrix4d own =
          information.bottomRightCorner<4, 4>() - beside.transpose() * solver.solve(beside);
      const Eigen::Vector4d pull = right.tail<4>() - beside.transpose() * some;
      fitted->bend_evidence = pull.dot(own.ldlt().solve(pull)) / fitted->variance;
    }
    Vector change = Vector::Zero();
    for (int i = 0; i < number; ++i) change[active.unknowns[static_cast<std::size_t>(i)]] = some[i];
    return moved(change, fitted);
  }

  // The covariance with the first eight unknowns (the shape), if samples had independent noise.
  static Eigen::Matrix<double, Eigen::Dynamic, 8, 0, k_unknowns, 8> shape_covariance(const Fitted& fitted) {
    const Eigen::Index number = fitted.information.rows();
    const Eigen::Matrix<double, Eigen::Dynamic, 8, 0, k_unknowns, 8> ones =
        Eigen::Matrix<double, Eigen::Dynamic, 8, 0, k_unknowns, 8>::Identity(number, 8);
    return fitted.variance * fitted.information.ldlt().solve(ones);
  }

  // Ratio by which the shape's covariance grows because neighbouring residuals are correlated: from the sums
  // over blocks of the last step's samples ("sandwich", Liang and Zeger 1986), divided by that of independent
  // samples.
  double correlation(const Eigen::Matrix<double, Eigen::Dynamic, 8, 0, k_unknowns, 8>& covariance) const {
    const Eigen::Matrix<float, Eigen::Dynamic, 8, Eigen::RowMajor, k_unknowns, 8> by =
        covariance.cast<float>();
    BlockSums sums{};
    sum_blocks(buffers_.derivatives.data(), by.data(), static_cast<std::size_t>(by.rows()), padded_count(),
               buffers_.pulls.data(), samples_.level_x.data(), samples_.level_y.data(), count_, &sums);
    using Moves = Eigen::Matrix<float, Eigen::Dynamic, 8, Eigen::RowMajor>;
    const Eigen::Map<const Moves> blocks(sums.blocks, k_blocks * k_blocks, 8);
    const Eigen::Matrix<double, 8, 8> independent =
        Eigen::Map<const Moves>(sums.products, 8, 8).cast<double>();
    const Eigen::Matrix<double, 8, 8> together = (blocks.transpose() * blocks).cast<double>();
    constexpr double k_number = k_blocks * k_blocks;
    // The shape's eight unknowns have absorbed a part of the sums.
    constexpr double k_unseen = k_number / (k_number - 8);
    return std::max(1.0, k_unseen * independent.ldlt().solve(together).trace() / 8);
  }

  bool moved(const Vector& change, Fitted* fitted) const {
    State& state = fitted->state;
    const SquareToQuad px_from_square(state.corners);
    const auto before = state.corners;
    fitted->moved_px = 0;
    for (std::size_t i = 0; i < 4; ++i) {
      const Eigen::Vector2d at = corner_place(i);
      const Eigen::Vector2d to = 0.5 * (at + shift_of(at) * change.head<8>() + Eigen::Vector2d::Ones());
      state.corners[i] = px_from_square.at(to.x(), to.y());
      if (!state.corners[i].allFinite()) return false;
      fitted->moved_px = std::max(fitted->moved_px, (state.corners[i] - before[i]).norm());
      if (!((state.corners[i] - start_.corners_px[i]).norm() < k_max_moved_px + 0.5 * state.motion.norm()))
        return false;
    }
    state.log_blur = std::clamp(state.log_blur + std::clamp(change[log_blur], -0.4, 0.4),
                                std::log(k_min_blur_px), std::log(8.0));
    Eigen::Vector2d turn = change.segment<2>(motion_x);
    if (turn.norm() > 4) turn *= 4 / turn.norm();
    state.motion += turn;
    if (state.motion.norm() > k_max_motion_px) return false;
    state.paper += change.segment<3>(paper);
    state.ink += change.segment<3>(ink);
    state.ground += change.segment<4>(ground);
    state.bend += change.segment<4>(bend);
    if (!(state.bend.norm() < k_max_bend)) return false;
    for (int s = 0; s < 4; ++s)
      if (state.margin[s] < k_no_margin)
        state.margin[s] = std::clamp(state.margin[s] + std::clamp(change[margin + s], -0.3, 0.3), 0.02, 4.0);
    return true;
  }

  // A corner of the unit square in coordinates from -1 to 1.
  static Eigen::Vector2d corner_place(std::size_t i) {
    return {i == 1 || i == 2 ? 1.0 : -1.0, i >= 2 ? 1.0 : -1.0};
  }

  // How the first eight unknowns move a place.
  static Eigen::Matrix<double, 2, 8> shift_of(const Eigen::Vector2d& p) {
    const double x = p.x();
    const double y = p.y();
    Eigen::Matrix<double, 2, 8> m;
    m << 1, x, y, 0, 0, 0, x * x, x * y, 0, 0, 0, 1, x, y, x * y, y * y;
    return m;
  }

  std::optional<FittedPattern> finished(const Fitted& fitted,
                                        std::optional<double> known_correlation = std::nullopt) const {
    const State& state = fitted.state;
    const double contrast = state.contrast();
    if (!(fitted.misfit < k_max_residual * k_max_residual * contrast * contrast) || !(contrast > 0) ||
        fitted.explained < k_min_explained || fitted.moved_px > k_astray_px)
      return std::nullopt;
    FittedPattern result;
    result.seen.cells = cells_;
    result.seen.look = state;
    result.seen.misfit = fitted.misfit / (contrast * contrast);
    result.seen.explained = fitted.explained;
    for (std::size_t i = 0; i < 4; ++i) result.corners_px[i] = straight_.bent(state.corners[i]);
    const SquareToQuad px_from_square(state.corners);
    const auto shape_by_all = shape_covariance(fitted);
    result.seen.correlation = known_correlation ? *known_correlation : correlation(shape_by_all);
    const Eigen::Matrix<double, 8, 8> covariance = result.seen.correlation * shape_by_all.topRows<8>();
    for (std::size_t i = 0; i < 4; ++i) {
      const Eigen::Vector2d at = corner_place(i);
      constexpr double k_step = 1e-4;
      const auto px = [&](double x, double y) { return px_from_square.at(0.5 * (x + 1), 0.5 * (y + 1)); };
      Eigen::Matrix2d px_a_place;
      px_a_place << (px(at.x() + k_step, at.y()) - px(at.x() - k_step, at.y())) / (2 * k_step),
          (px(at.x(), at.y() + k_step) - px(at.x(), at.y() - k_step)) / (2 * k_step);
      const Eigen::Matrix<double, 2, 8> by = px_a_place * shift_of(at);
      result.corner_covariance[i] =
          by * covariance * by.transpose() + k_systematic_px * k_systematic_px * Eigen::Matrix2d::Identity();
      if (!result.corner_covariance[i].allFinite()) return std::nullopt;
    }
    return result;
  }
};

}  // namespace

std::optional<FittedPattern> fit_pattern(const cv::Mat& grey,
                                         const std::array<double, 256>& light,
                                         const RefinedQuad& start,
                                         const SeenCells& cells,
                                         const Lens* lens,
                                         PatternFitBuffers* buffers) {
  return PatternFit(grey, light, cells, start, lens, buffers).fit();
}

std::optional<FittedPattern> follow_pattern(const cv::Mat& grey,
                                            const std::array<double, 256>& light,
                                            const std::array<Eigen::Vector2d, 4>& corners_px,
                                            const PatternAppearance& known,
                                            const Lens* lens,
                                            PatternFitBuffers* buffers) {
  RefinedQuad start{};
  start.corners_px = corners_px;
  start.corner_covariance.fill(Eigen::Matrix2d::Zero());
  // The standard deviation of a uniform motion is its length over sqrt(12).
  start.blur_px.fill(std::sqrt(std::exp(2 * known.look.log_blur) + known.look.motion.squaredNorm() / 12));
  return PatternFit(grey, light, known.cells, start, lens, buffers).follow(known);
}

}  // namespace limn::tracker
