#include "tracker/pattern_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "tracker/pattern_model.h"
#include "tracker/simd.h"
#include "tracker/square_to_quad.h"

namespace limn::tracker {
namespace {

using namespace pattern;

constexpr std::size_t k_few_samples = 150;  // while hypotheses of the motion compete
constexpr std::size_t k_coarse_samples = 300;
constexpr std::size_t k_moving_samples = 600;
constexpr std::size_t k_samples = 700;
constexpr std::size_t k_most_samples = 1200;
constexpr int k_rounds = 16;
constexpr double k_may_move_px = 1.0;     // blur below which motion tells nothing of its own
constexpr double k_clearly_better = 0.9;  // in mean square residuals: motion against blur alone
constexpr double k_max_motion_px = 30;
constexpr double k_min_blur_px = 0.28;    // of a pixel's own area
constexpr double k_no_margin = 1e3;       // cells: no outer edge of the paper in reach
constexpr double k_max_residual = 0.075;  // of the contrast, RMS: above it the model is wrong
constexpr double k_min_explained = 0.77;  // of perfect Gaussian residuals: 0.89
constexpr double k_settled_px = 0.02;     // of a round: the next ones would add a quarter of it
constexpr double k_roughly_settled_px = 0.03;
constexpr double k_astray_px = 0.1;     // corners that still move so far at last have not settled
constexpr double k_max_moved_px = 6;    // and half the motion
constexpr double k_bend_evidence = 20;  // chi-square of four: flat paper shows as much once in 2000 times
constexpr double k_max_bend = 0.1;      // of half a side
constexpr std::size_t k_choice = 3;     // times as many pixels, of which the flat ones are left out
constexpr int k_flat_stride = 8;        // but one in so many
constexpr double k_rough_scale = 0.1;   // of the contrast
constexpr double k_least_scale = 0.5;   // of light
constexpr double k_bound = 0.15;        // of the contrast: residuals beyond tell no more
constexpr double k_noise = 0.02;        // of the contrast, RMS: residuals that ask for no motion
constexpr double k_systematic_px = 0.004;

LIMN_SIMD void scale_by(const double* __restrict factors, std::size_t count, double* __restrict values) {
  for (std::size_t i = 0; i < count; ++i) values[i] *= factors[i];
}

LIMN_SIMD double product(const double* a, const double* b, std::size_t count) {
  double sum = 0;
#pragma omp simd reduction(+ : sum)
  for (std::size_t i = 0; i < count; ++i) sum += a[i] * b[i];
  return sum;
}

struct Free {
  bool motion = false, bend = false;
  bool levels_alone = false;
};

struct Fitted {
  State state;
  double misfit = std::numeric_limits<double>::infinity();  // mean square residual, bounded
  double explained = 0;                                     // share of the samples that agree with the model
  double moved_px = 0;                                      // the most that a corner moved in the last round
  Matrix covariance = Matrix::Zero();
  Eigen::Vector4d bend = Eigen::Vector4d::Zero();  // of the last round, had it been free
  Eigen::Matrix4d bend_covariance = Eigen::Matrix4d::Identity();
};

class PatternFit {
 public:
  PatternFit(const cv::Mat& grey,
             const std::array<double, 256>& light,
             const SeenCells& cells,
             const RefinedQuad& start)
      : grey_(grey), light_(light), pattern_(cells), start_(start) {}

  std::optional<RefinedQuad> fit() {
    const State begun = this->begun();
    take_samples(k_coarse_samples);
    Fitted rough;
    rough.state = begun;
    rough = step({.levels_alone = true}, &rough) ? settled(rough.state, {}, k_roughly_settled_px) : Fitted{};
    const double blur_px = *std::max_element(start_.blur_px.begin(), start_.blur_px.end());
    Free free;
    if (blur_px > k_may_move_px && !is_explained(rough)) {
      Fitted moving = most_likely_motion(begun);
      if (moving.misfit < k_clearly_better * rough.misfit) {
        rough = moving;
        free.motion = true;
      }
    }
    take_samples(free.motion ? k_moving_samples : k_samples, &rough.state);
    Fitted fitted = settled(rough.state, free, k_settled_px);
    if (is_bent(fitted)) {
      free.bend = true;
      fitted = settled(fitted.state, free, k_settled_px);
    }
    return finished(fitted);
  }

 private:
  const cv::Mat& grey_;
  const std::array<double, 256>& light_;
  const Pattern pattern_;
  const RefinedQuad& start_;
  bool has_ground_ = false;
  Eigen::Vector4d margin_;  // at the start
  double contrast_ = 0;     // at the start
  double least_scale_ = 0;  // of residuals: far from the solution most look wrong
  std::vector<Sample> samples_;
  std::vector<double> residuals_, sizes_, behind_;
  std::vector<double> roots_;  // of the weights, then times the residuals
  Eigen::Matrix<double, Eigen::Dynamic, k_unknowns>
      derivatives_;  // of the samples, then times their weight's root

  double light_at(const Eigen::Vector2d& px) const {
    const int x = std::clamp(static_cast<int>(std::lround(px.x())), 0, grey_.cols - 1);
    const int y = std::clamp(static_cast<int>(std::lround(px.y())), 0, grey_.rows - 1);
    return light_[grey_.ptr(y)[x]];
  }
  double light_of(double level) const {
    return light_[static_cast<std::size_t>(std::clamp(level, 0.0, 255.0))];
  }

  double px_a_cell(const std::array<Eigen::Vector2d, 4>& corners, std::size_t s) const {
    const double side = (corners[(s + 1) % 4] - corners[s]).norm();
    const Eigen::Vector2d far = 0.5 * (corners[(s + 2) % 4] + corners[(s + 3) % 4]);
    const Eigen::Vector2d along = (corners[(s + 1) % 4] - corners[s]) / side;
    const Eigen::Vector2d across = far - corners[s];
    return std::abs(along.x() * across.y() - along.y() * across.x()) / pattern_.count();
  }

  // Blur and levels from the refiner's edges; margins from where the light falls again outside.
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
    contrast_ = state.paper[0] - state.ink[0];
    return state;
  }

  void find_margin(std::size_t s, State* state) {
    const Eigen::Vector2d from = state->corners[s];
    const Eigen::Vector2d along = state->corners[(s + 1) % 4] - from;
    const Eigen::Vector2d outward = Eigen::Vector2d(along.y(), -along.x()).normalized();
    constexpr int k_columns = 16;
    constexpr int k_reach = 24;  // half pixels
    std::array<double, k_reach> level{};
    for (int d = 0; d < k_reach; ++d)
      for (int i = 0; i < k_columns; ++i)
        level[static_cast<std::size_t>(d)] +=
            light_at(from + (i + 0.5) / k_columns * along + 0.5 * (d + 1) * outward) / k_columns;
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

  // About so many pixels over the marker and what blur mixes with it; those that show an edge of the `known`
  // pattern come first.
  void take_samples(std::size_t most, const State* known = nullptr) {
    least_scale_ = known ? k_least_scale : k_rough_scale * contrast_;
    samples_.clear();
    const std::array<Eigen::Vector2d, 4>& corners = start_.corners_px;
    const Eigen::Matrix3d square_from_px = SquareToQuad(corners).matrix().inverse();
    Eigen::Vector2d low = corners[0];
    Eigen::Vector2d high = corners[0];
    for (const Eigen::Vector2d& c : corners) low = low.cwiseMin(c), high = high.cwiseMax(c);
    const double blur_px = *std::max_element(start_.blur_px.begin(), start_.blur_px.end());
    const double outside_px = std::clamp(2.5 * blur_px, 2.0, 10.0);
    const Eigen::Vector2d a = corners[2] - corners[0];
    const Eigen::Vector2d b = corners[3] - corners[1];
    const double side_px = std::sqrt(0.5 * std::abs(a.x() * b.y() - a.y() * b.x()));
    const double out = outside_px / side_px;
    Eigen::Array4d reach = Eigen::Array4d::Constant(out);
    if (has_ground_) reach = reach.min(margin_.array() / pattern_.count());
    const int x0 = std::max(0, static_cast<int>(std::ceil(low.x() - outside_px)));
    const int y0 = std::max(0, static_cast<int>(std::ceil(low.y() - outside_px)));
    const int x1 = std::min(grey_.cols - 1, static_cast<int>(std::floor(high.x() + outside_px)));
    const int y1 = std::min(grey_.rows - 1, static_cast<int>(std::floor(high.y() + outside_px)));
    const double pixels = side_px * side_px * (1 + 2 * out) * (1 + 2 * out);
    const bool choose = known && known->motion.isZero();
    const double wanted = static_cast<double>(choose ? k_choice * most : most);
    const int stride = std::max(1, static_cast<int>(std::lround(pixels / wanted)));
    const int lean = std::max(1, static_cast<int>(std::lround(0.618 * stride)));  // from row to row
    std::optional<Model> model;
    if (choose) model.emplace(pattern_, *known, has_ground_);
    int flat = 0;
    for (int y = y0; y <= y1; ++y)
      for (int x = x0 + (lean * (y - y0)) % stride; x <= x1; x += stride) {
        const Eigen::Vector3d p = square_from_px * Eigen::Vector3d(x, y, 1);
        const Eigen::Vector2d q = p.head<2>() / p.z();
        // Beside a corner, what is behind the paper has no model.
        const bool beside_x = q.x() < 0 || q.x() > 1;
        const bool beside_y = q.y() < 0 || q.y() > 1;
        if ((beside_x && beside_y) ||
            !(q.y() > -reach[0] && q.x() < 1 + reach[1] && q.y() < 1 + reach[2] && q.x() > -reach[3]))
          continue;
        if (choose && !model->shows_edge(Eigen::Vector2d(x, y)) && ++flat % k_flat_stride != 0) continue;
        samples_.push_back({Eigen::Vector2d(x, y), 2 * q - Eigen::Vector2d::Ones(), light_[grey_.ptr(y)[x]]});
      }
    // Blurred or small, they all do.
    if (samples_.size() <= k_most_samples) return;
    const double every = static_cast<double>(samples_.size()) / static_cast<double>(k_most_samples);
    for (std::size_t i = 0; i < k_most_samples; ++i)
      samples_[i] = samples_[static_cast<std::size_t>(every * static_cast<double>(i))];
    samples_.resize(k_most_samples);
  }

  Fitted settled(const State& start, Free free, double settled_px) {
    Fitted fitted;
    fitted.state = start;
    for (int round = 0; round < k_rounds; ++round) {
      if (!step(free, &fitted)) return {};
      if (fitted.moved_px < settled_px) break;
    }
    return fitted;
  }

  // Whether the paper's bend, were it looked for, would be too large for noise.
  static bool is_bent(const Fitted& fitted) {
    return fitted.bend.dot(fitted.bend_covariance.ldlt().solve(fitted.bend)) > k_bend_evidence;
  }

  // Whether blur alone leaves no more than noise.
  static bool is_explained(const Fitted& fitted) {
    const double contrast = fitted.state.paper[0] - fitted.state.ink[0];
    return fitted.misfit < k_noise * k_noise * contrast * contrast;
  }

  // Motions in all directions compete, the better ones on with more rounds and samples.
  Fitted most_likely_motion(const State& begun) {
    constexpr int k_directions = 8;
    std::vector<Fitted> fits;
    take_samples(k_few_samples);
    for (int i = 0; i < k_directions; ++i)
      for (const double length : {7.0, 14.0}) {
        const double angle = std::numbers::pi * i / k_directions;
        Fitted fitted;
        fitted.state = begun;
        fitted.state.log_blur = std::log(1.5);
        fitted.state.motion = length * Eigen::Vector2d(std::cos(angle), std::sin(angle));
        if (step({.levels_alone = true}, &fitted)) fits.push_back(fitted);
      }
    keep_best(1, 6, &fits);
    keep_best(2, 3, &fits);
    take_samples(k_coarse_samples);
    keep_best(3, 1, &fits);
    return fits.empty() ? Fitted{} : fits[0];
  }

  void keep_best(int rounds, std::size_t most, std::vector<Fitted>* fits) {
    for (Fitted& fitted : *fits)
      for (int round = 0; round < rounds; ++round)
        if (!step({.motion = true}, &fitted)) {
          fitted.misfit = std::numeric_limits<double>::infinity();
          break;
        }
    std::sort(fits->begin(), fits->end(),
              [](const Fitted& a, const Fitted& b) { return a.misfit < b.misfit; });
    while (!fits->empty() && (fits->size() > most || std::isinf(fits->back().misfit))) fits->pop_back();
  }

  // One Gauss-Newton step on the samples.
  bool step(Free free, Fitted* fitted) {
    State& state = fitted->state;
    const Model model(pattern_, state, has_ground_);
    const std::size_t count = samples_.size();
    if (count < 2 * k_unknowns) return false;
    if (derivatives_.rows() != static_cast<Eigen::Index>(count))
      derivatives_.resize(static_cast<Eigen::Index>(count), Eigen::NoChange);
    residuals_.resize(count);
    behind_.resize(count);
    roots_.resize(count);
    sizes_.resize(count);
    for (std::size_t i = 0; i < count; ++i) {
      Vector derivative;
      residuals_[i] = samples_[i].light - model.at(samples_[i], &derivative, &behind_[i]);
      derivatives_.row(static_cast<Eigen::Index>(i)) = derivative;
      sizes_[i] = std::abs(residuals_[i]);
    }
    const auto middle = sizes_.begin() + static_cast<std::ptrdiff_t>(count / 2);
    std::nth_element(sizes_.begin(), middle, sizes_.end());
    const double scale = std::max(least_scale_, 1.4826 * *middle);
    // What is behind the paper is one level a side only by chance.
    double unlike = 0;
    double unlike_weights = 1e-9;
    for (std::size_t i = 0; i < count; ++i) {
      unlike += behind_[i] * residuals_[i] * residuals_[i];
      unlike_weights += behind_[i];
    }
    unlike /= unlike_weights * scale * scale;
    Matrix information = Matrix::Zero();
    Vector right = Vector::Zero();
    double weights = 0;
    double agree = 0;
    double scores = 0;  // squares of the biweight's, and its slopes: a robust mean's variance (Huber 1981)
    double slopes = 0;
    double trusted = 0;
    double misfit = 0;
    const double bound = k_bound * k_bound * contrast_ * contrast_;
    for (std::size_t i = 0; i < count; ++i) {
      const double trust = 1 / (1 + unlike * behind_[i] * behind_[i]);
      const double z = residuals_[i] / (4 * scale) * std::sqrt(trust);
      const double robust = z * z < 1 ? (1 - z * z) * (1 - z * z) : 0;  // Tukey's biweight
      trusted += trust;
      const double square = residuals_[i] * residuals_[i];
      misfit += trust * square / (1 + square / bound);
      const double w = trust * robust;
      agree += w;
      roots_[i] = std::sqrt(w);
      scores += trust * robust * robust * residuals_[i] * residuals_[i];
      if (z * z < 1) slopes += trust * (1 - z * z) * (1 - 5 * z * z);
      weights += w;
    }
    fitted->explained = agree / trusted;
    fitted->misfit = misfit / trusted;
    for (int i = 0; i < k_unknowns; ++i) scale_by(roots_.data(), count, derivatives_.col(i).data());
    for (std::size_t i = 0; i < count; ++i) roots_[i] *= residuals_[i];
    for (int i = 0; i < k_unknowns; ++i) {
      const double* column = derivatives_.col(i).data();
      right[i] = product(column, roots_.data(), count);
      for (int j = 0; j <= i; ++j)
        information(i, j) = information(j, i) = product(column, derivatives_.col(j).data(), count);
    }
    constexpr double k_fixed = 1e15;
    const auto fix = [&](int from, int number) {
      for (int i = from; i < from + number; ++i) information(i, i) += k_fixed;
    };
    if (free.levels_alone) fix(shape, paper), fix(margin, 4);
    if (!free.motion) fix(motion_x, 2);
    for (int s = 0; s < 4; ++s)
      if (state.margin[s] >= k_no_margin) fix(ground + s, 1), fix(margin + s, 1);
    const double noise = scale * scale;
    const auto loosely = [&](int from, int number, double deviation) {
      for (int i = from; i < from + number; ++i) information(i, i) += noise / (deviation * deviation);
    };
    loosely(paper, 3, 100), loosely(ink, 3, 100), loosely(ground, 4, 100);
    loosely(margin, 4, 0.5), loosely(motion_x, 2, 10), loosely(log_blur, 1, 1), loosely(shape, 8, 0.2);
    loosely(bend, 4, 0.02);
    const double lost = weights / std::max(1.0, weights - static_cast<int>(k_unknowns));
    const double variance = lost * weights * scores / (slopes * slopes);
    if (!free.bend) {
      const Eigen::LDLT<Matrix> bending(information);
      Eigen::Matrix<double, k_unknowns, 4> of_bend = Eigen::Matrix<double, k_unknowns, 4>::Zero();
      of_bend.bottomRows<4>().setIdentity();
      const Eigen::Matrix<double, k_unknowns, 4> inverse = bending.solve(of_bend);
      fitted->bend = inverse.transpose() * right;
      fitted->bend_covariance = variance * inverse.bottomRows<4>();
      fix(bend, 4);
    }
    const Eigen::LDLT<Matrix> solver(information);
    Vector change = solver.solve(right);
    if (!change.allFinite()) return false;
    fitted->covariance = solver.solve(Matrix::Identity()) * variance;
    return moved(change, fitted);
  }

  // By how much the shape's covariance is larger for neighbouring residuals that have one cause: from the
  // sums over blocks of the last step's samples ("sandwich", Liang and Zeger 1986) over that of independent
  // ones.
  double correlation(const Matrix& covariance) const {
    constexpr int k_blocks = 8;  // a side
    const auto count = static_cast<Eigen::Index>(samples_.size());
    const Eigen::Map<const Eigen::VectorXd> pulls(roots_.data(), count);
    const Eigen::Matrix<double, Eigen::Dynamic, 8> moves =
        pulls.asDiagonal() * (derivatives_ * covariance.leftCols<8>());
    Eigen::Matrix<double, k_blocks * k_blocks, 8> sums;
    sums.setZero();
    for (std::size_t i = 0; i < samples_.size(); ++i) {
      const auto block = [&](double place) {
        return std::clamp(static_cast<int>(std::floor((0.5 * place + 0.5) * k_blocks)), 0, k_blocks - 1);
      };
      const Eigen::Vector2d& place = samples_[i].place;
      sums.row(k_blocks * block(place.y()) + block(place.x())) += moves.row(static_cast<Eigen::Index>(i));
    }
    const Eigen::Matrix<double, 8, 8> independent = moves.transpose() * moves;
    const Eigen::Matrix<double, 8, 8> together = sums.transpose() * sums;
    return std::max(1.0, independent.ldlt().solve(together).trace() / 8);
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

  // Of the unit square's corner, -1 to 1.
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

  std::optional<RefinedQuad> finished(const Fitted& fitted) const {
    const State& state = fitted.state;
    const double contrast = state.paper[0] - state.ink[0];
    if (!(fitted.misfit < k_max_residual * k_max_residual * contrast * contrast) || !(contrast > 0) ||
        fitted.explained < k_min_explained || fitted.moved_px > k_astray_px)
      return std::nullopt;
    RefinedQuad result = start_;
    result.corners_px = state.corners;
    const SquareToQuad px_from_square(state.corners);
    const Eigen::Matrix<double, 8, 8> covariance =
        correlation(fitted.covariance) * fitted.covariance.topLeftCorner<8, 8>();
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

std::optional<RefinedQuad> fit_pattern(const cv::Mat& grey,
                                       const std::array<double, 256>& light,
                                       const RefinedQuad& start,
                                       const SeenCells& cells) {
  return PatternFit(grey, light, cells, start).fit();
}

}  // namespace limn::tracker
