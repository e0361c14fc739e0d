#include "tracker/pattern_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "tracker/square_to_quad.h"

namespace limn::tracker {
namespace {

constexpr int k_rounds = 16;
constexpr int k_even_rounds = 5;                  // where motion is looked for
constexpr double k_may_move_px = 1.8;             // blur below which motion tells nothing of its own
constexpr double k_clearly_better = 0.9;          // in mean square residuals: motion against blur alone
constexpr double k_motion_damping = 1;            // light^2 / px^4: far below what a blurred edge shows
constexpr double k_max_motion = 144;              // 24 px in all
constexpr int k_columns = 16;                     // of pixels, along a side
constexpr double k_depth_cells = 2.4;             // that are looked at inside the border's outer edge
constexpr double k_ends = 0.06;                   // of a side, left out at both ends
constexpr double k_no_margin = 1e3;               // cells: no outer edge of the paper in reach
constexpr double k_max_residual = 0.15;           // of the contrast, RMS: above it the model is wrong
constexpr double k_min_explained = 0.4;           // on the way
constexpr double k_min_explained_at_last = 0.75;  // of perfect Gaussian residuals: 0.89
constexpr double k_settled_px = 0.01;
constexpr double k_astray_px = 0.1;  // corners that still move so far at last have not settled
constexpr double k_max_moved_px = 5;
constexpr double k_systematic_px = 0.02;  // as in refine.cpp

// Standard normal distribution and density, from a table.
class Normal {
 public:
  struct Value {
    double below, density;
  };
  Normal() {
    for (int i = 0; i <= k_steps; ++i) {
      const double z = (i - k_steps / 2) * k_width;
      table_[static_cast<std::size_t>(i)] = {0.5 * std::erfc(-z / std::numbers::sqrt2),
                                             std::exp(-0.5 * z * z) / std::sqrt(2 * std::numbers::pi)};
    }
  }
  Value at(double z) const {
    const double x = z / k_width + k_steps / 2;
    if (!(x > 0)) return {0, 0};
    if (x >= k_steps) return {1, 0};
    const auto i = static_cast<std::size_t>(x);
    const double f = x - static_cast<double>(i);
    const Value& a = table_[i];
    const Value& b = table_[i + 1];
    return {a.below + f * (b.below - a.below), a.density + f * (b.density - a.density)};
  }

 private:
  static constexpr int k_steps = 1024;
  static constexpr double k_width = 8.0 / k_steps;
  std::array<Value, k_steps + 1> table_;
};

const Normal& normal() {
  static const Normal table;
  return table;
}

// What is unknown of a side. Lengths in cells, levels in light, t from -1 to 1 along the side. Blur is a
// Gaussian and an even motion; `motion` is the square of half the motion's length across the side, px^2.
enum Unknown : int {
  at_middle,
  at_turn,
  log_blur,
  motion,  // square of half its length across the side, px^2
  margin,
  ground,
  ground_t,
  paper,
  paper_t,
  ink,
  ink_t,
  k_unknowns
};
using Vector = Eigen::Matrix<double, k_unknowns, 1>;
using Matrix = Eigen::Matrix<double, k_unknowns, k_unknowns>;

// Pixels to the cells of one side: x along it, y inward; with the gradients of both.
struct CellMap {
  Eigen::Matrix3d cells_from_px;
  explicit CellMap(const std::array<Eigen::Vector2d, 4>& corners, std::size_t side, int count) {
    const SquareToQuad px_from_square(
        {corners[side], corners[(side + 1) % 4], corners[(side + 2) % 4], corners[(side + 3) % 4]});
    cells_from_px = Eigen::Vector3d(count, count, 1).asDiagonal() * px_from_square.matrix().inverse();
  }
  struct Place {
    double x, y, x_a_px, y_a_px;
  };
  Place at(const Eigen::Vector2d& px) const {
    const Eigen::Vector3d p = cells_from_px * px.homogeneous();
    const Eigen::Vector2d q = p.head<2>() / p.z();
    const Eigen::RowVector2d w = cells_from_px.block<1, 2>(2, 0);
    return {q.x(), q.y(), ((cells_from_px.block<1, 2>(0, 0) - q.x() * w) / p.z()).norm(),
            ((cells_from_px.block<1, 2>(1, 0) - q.y() * w) / p.z()).norm()};
  }
};

struct Side {
  Vector state = Vector::Zero();
  Matrix covariance = Matrix::Zero();
  double residual = 0;   // RMS, in light
  double explained = 0;  // share of the samples that agree with the model
};

bool is_white(const SeenCells& cells, std::size_t side, int row, int column) {
  const int last = cells.count - 1;
  if (row > last || column < 0 || column > last) return column < 0 || column > last;  // beside it: paper
  switch (side) {
    case 0:
      return cells.is_white(row, column);
    case 1:
      return cells.is_white(column, last - row);
    case 2:
      return cells.is_white(last - row, last - column);
    default:
      return cells.is_white(last - column, row);
  }
}

// A step from 0 to 1 after blur and motion, and its derivatives; all lengths in one unit.
struct Response {
  double value, slope, by_log_blur, by_motion;  // motion: the square of half its length
};
Response response(double distance, double blur, double motion_square) {
  const double half = std::sqrt(motion_square);
  if (half < 0.3 * blur) {  // as good as a wider Gaussian
    const double sigma = std::sqrt(blur * blur + motion_square / 3);
    const double z = distance / sigma;
    const Normal::Value n = normal().at(z);
    const double widening = -z * n.density / (sigma * sigma);
    return {n.below, n.density / sigma, widening * blur * blur, widening / 6};
  }
  const double later = (distance + half) / blur;
  const double earlier = (distance - half) / blur;
  const Normal::Value a = normal().at(later);
  const Normal::Value b = normal().at(earlier);
  const double value = blur / (2 * half) * (later * a.below + a.density - earlier * b.below - b.density);
  return {value, (a.below - b.below) / (2 * half), blur * (a.density - b.density) / (2 * half),
          (0.5 * (a.below + b.below) - value) / (2 * motion_square)};
}

// Whiteness of a row of cells at x, blurred along it.
double whiteness(const SeenCells& cells, std::size_t side, int row, double x, double blur) {
  const int first = static_cast<int>(std::floor(x - 3 * blur));
  const int last = static_cast<int>(std::floor(x + 3 * blur));
  double value = is_white(cells, side, row, first);
  for (int column = first + 1; column <= last; ++column) {
    const int step =
        static_cast<int>(is_white(cells, side, row, column)) - is_white(cells, side, row, column - 1);
    if (step != 0) value += step * normal().at((x - column) / blur).below;
  }
  return value;
}

// The model's light at a place, and its derivatives. `motion_along` is the motion along the side, as `motion`
// across.
double model(const Vector& state,
             const SeenCells& cells,
             std::size_t side,
             const CellMap::Place& place,
             double motion_along,
             Vector* derivative) {
  constexpr int k_edges = 5;  // of the paper, of the border, and of three rows of cells
  const double t = 2 * place.x / cells.count - 1;
  const double y = place.y - state[at_middle] - t * state[at_turn];
  const double blur_px = std::exp(state[log_blur]);
  const double blur = blur_px * place.y_a_px;
  const double moved = state[motion] * place.y_a_px * place.y_a_px;
  const double blur_along = std::sqrt(blur_px * blur_px + motion_along / 3) * place.x_a_px;
  const double white = state[paper] + t * state[paper_t];
  const double black = state[ink] + t * state[ink_t];
  const double behind = state[ground] + t * state[ground_t];
  std::array<double, k_edges + 1> level = {behind, white, black};
  std::array<double, k_edges + 1> share = {0, 1,
                                           0};  // of white: of the background, margin, border, rows of cells
  for (int row = 0; row <= 3; ++row) {
    const auto i = static_cast<std::size_t>(row + 2);
    share[i] = whiteness(cells, side, row, place.x, blur_along);
    level[i] = black + share[i] * (white - black);
  }
  double value = level[0];
  double slope = 0;
  double widening = 0;
  double by_motion = 0;
  double in_white = 0;
  double in_ground = 1;
  for (std::size_t i = 0; i < k_edges; ++i) {
    const double edge = i == 0 ? -state[margin] : static_cast<double>(i) - 1;
    const Response r = response(y - edge, blur, moved);
    const double step = level[i + 1] - level[i];
    value += step * r.value;
    slope += step * r.slope;
    widening += step * r.by_log_blur;
    by_motion += step * r.by_motion;
    in_white += (share[i + 1] - share[i]) * r.value;
    if (i == 0) {
      (*derivative)[margin] = step * r.slope;
      in_ground -= r.value;
    }
  }
  const double in_ink = 1 - in_ground - in_white;
  (*derivative)[at_middle] = -slope;
  (*derivative)[at_turn] = -t * slope;
  (*derivative)[log_blur] = widening;
  (*derivative)[motion] = by_motion * place.y_a_px * place.y_a_px;
  (*derivative)[ground] = in_ground;
  (*derivative)[ground_t] = t * in_ground;
  (*derivative)[paper] = in_white;
  (*derivative)[paper_t] = t * in_white;
  (*derivative)[ink] = in_ink;
  (*derivative)[ink_t] = t * in_ink;
  return value;
}

enum class Step {
  levels,  // of these alone
  even,    // all samples count the same: far from the solution most look wrong
  robust
};

struct Sample {
  CellMap::Place place;
  double light;
};

struct Fitted {
  RefinedQuad quad;
  double squares = 0;  // mean square residuals of all sides
};

class PatternFit {
 public:
  PatternFit(const cv::Mat& grey, const std::array<double, 256>& light, const SeenCells& cells, bool moving)
      : grey_(grey), light_(light), cells_(cells), moving_(moving) {}

  std::optional<Fitted> fit(const RefinedQuad& start) {
    std::array<Eigen::Vector2d, 4> corners = start.corners_px;
    std::array<Side, 4> sides;
    for (std::size_t s = 0; s < 4; ++s) sides[s] = begun(corners, s, start);
    double most = k_max_moved_px;  // that a corner moved in the last round
    const int even_rounds = moving_ ? k_even_rounds : 0;
    for (int round = 0; round < k_rounds; ++round) {
      for (std::size_t s = 0; s < 4; ++s) {
        if (!sample(corners, s, sides[s].state)) return std::nullopt;
        const double along = 0.5 * (sides[(s + 1) % 4].state[motion] + sides[(s + 3) % 4].state[motion]);
        if (round == 0 && !step(s, Step::levels, along, &sides[s])) return std::nullopt;
        if (!step(s, round < even_rounds ? Step::even : Step::robust, along, &sides[s])) return std::nullopt;
      }
      const auto before = corners;
      if (!moved(sides, &corners)) return std::nullopt;
      most = 0;
      for (std::size_t i = 0; i < 4; ++i) {
        most = std::max(most, (corners[i] - before[i]).norm());
        if (!((corners[i] - start.corners_px[i]).norm() < k_max_moved_px)) return std::nullopt;
      }
      for (Side& side : sides) side.state[at_middle] = side.state[at_turn] = 0;
      if (round > even_rounds + 1 && most < k_settled_px) break;
    }
    if (most > k_astray_px) return std::nullopt;
    auto quad = finished(start, corners, sides);
    if (!quad) return std::nullopt;
    Fitted fitted{std::move(*quad), 0};
    for (const Side& side : sides) fitted.squares += side.residual * side.residual;
    return fitted;
  }

 private:
  const cv::Mat& grey_;
  const std::array<double, 256>& light_;
  const SeenCells& cells_;
  const bool moving_;  ///< motion is looked for beside blur
  std::vector<Sample> samples_;
  std::vector<double> residuals_, sizes_;
  std::vector<Vector> derivatives_;

  double light_at(const Eigen::Vector2d& px) const {
    const int x = std::clamp(static_cast<int>(std::lround(px.x())), 0, grey_.cols - 1);
    const int y = std::clamp(static_cast<int>(std::lround(px.y())), 0, grey_.rows - 1);
    return light_[grey_.ptr(y)[x]];
  }

  // Blur and levels from the refiner's edge; the margin from where the light falls again outside.
  Side begun(const std::array<Eigen::Vector2d, 4>& corners, std::size_t s, const RefinedQuad& start) const {
    Side side;
    const Eigen::Vector2d from = corners[s];
    const Eigen::Vector2d along = corners[(s + 1) % 4] - from;
    const Eigen::Vector2d outward = Eigen::Vector2d(along.y(), -along.x()).normalized();
    const double px_a_cell = 1 / CellMap(corners, s, cells_.count).at(from + 0.5 * along).y_a_px;
    side.state[log_blur] = std::log(std::clamp(start.blur_px[s], 0.4, 5.0));
    if (moving_) side.state[motion] = 0.5 * start.blur_px[s] * start.blur_px[s];
    side.state[margin] = k_no_margin;
    constexpr int k_reach = 24;  // half pixels
    std::array<double, k_reach> level{};
    for (int d = 0; d < k_reach; ++d)
      for (int i = 0; i < k_columns; ++i)
        level[static_cast<std::size_t>(d)] +=
            light_at(from + (i + 0.5) / k_columns * along + 0.5 * (d + 1) * outward) / k_columns;
    std::size_t top = 0;
    while (top + 1 < k_reach && level[top + 1] >= level[top]) ++top;
    const double lowest = *std::min_element(level.begin() + static_cast<std::ptrdiff_t>(top), level.end());
    const double ink_level = light_[static_cast<std::size_t>(std::clamp(start.inside_level[s], 0.0, 255.0))];
    if (level[top] - lowest > 0.2 * (level[top] - ink_level))
      for (std::size_t d = top; d < k_reach; ++d)
        if (level[d] < 0.5 * (level[top] + lowest)) {
          side.state[margin] = 0.5 * static_cast<double>(d + 1) / px_a_cell;
          break;
        }
    return side;
  }

  // Pixels about the side: outside as far as the margin and some background, inside the first rows of cells.
  bool sample(const std::array<Eigen::Vector2d, 4>& corners, std::size_t s, const Vector& state) {
    samples_.clear();
    const CellMap map(corners, s, cells_.count);
    const Eigen::Vector2d from = corners[s];
    const Eigen::Vector2d along = corners[(s + 1) % 4] - from;
    const bool flat = std::abs(along.x()) >= std::abs(along.y());
    const int u_axis = flat ? 0 : 1;
    const int v_axis = 1 - u_axis;
    const int inward = (flat ? along.x() : -along.y()) > 0 ? 1 : -1;
    const double y_a_px = map.at(from + 0.5 * along).y_a_px;
    const double blur_px = std::sqrt(std::exp(2 * state[log_blur]) + state[motion] / 3);
    const bool has_margin = state[margin] < k_no_margin;
    const double outside_px = has_margin
                                  ? std::min(14.0, state[margin] / y_a_px + std::max(2.0, 1.5 * blur_px))
                                  : std::clamp(2.5 * blur_px, 2.0, 10.0);
    const double u_low =
        std::min(from[u_axis], from[u_axis] + along[u_axis]) + k_ends * std::abs(along[u_axis]);
    const double u_high =
        std::max(from[u_axis], from[u_axis] + along[u_axis]) - k_ends * std::abs(along[u_axis]);
    const int stride = std::max(1, static_cast<int>((u_high - u_low) / k_columns));
    const double lean = std::hypot(1, along[v_axis] / along[u_axis]);
    const int out = static_cast<int>(std::ceil(outside_px * lean));
    const int in = static_cast<int>(std::ceil(k_depth_cells / y_a_px * lean));
    for (int u = static_cast<int>(std::ceil(u_low)); u <= u_high; u += stride) {
      const int middle =
          static_cast<int>(std::lround(from[v_axis] + (u - from[u_axis]) / along[u_axis] * along[v_axis]));
      for (int k = -out; k <= in; ++k) {
        const int v = middle + k * inward;
        const int x = flat ? u : v;
        const int y = flat ? v : u;
        if (x < 0 || y < 0 || x >= grey_.cols || y >= grey_.rows) continue;
        const CellMap::Place place = map.at({x, y});
        if (place.y > k_depth_cells || place.x < 0 || place.x > cells_.count) continue;
        samples_.push_back({place, light_[grey_.ptr(y)[x]]});
      }
    }
    return samples_.size() >= 4 * k_unknowns;
  }

  // One Gauss-Newton step on the samples.
  bool step(std::size_t s, Step kind, double motion_along, Side* side) {
    residuals_.clear();
    derivatives_.resize(samples_.size());
    for (std::size_t i = 0; i < samples_.size(); ++i)
      residuals_.push_back(samples_[i].light -
                           model(side->state, cells_, s, samples_[i].place, motion_along, &derivatives_[i]));
    sizes_.clear();
    for (const double r : residuals_) sizes_.push_back(std::abs(r));
    std::nth_element(sizes_.begin(), sizes_.begin() + static_cast<std::ptrdiff_t>(sizes_.size() / 2),
                     sizes_.end());
    const double scale = std::max(0.5, 1.4826 * sizes_[sizes_.size() / 2]);
    Matrix information = Matrix::Zero();
    Vector right = Vector::Zero();
    double squares = 0;
    double weights = 0;
    for (std::size_t i = 0; i < samples_.size(); ++i) {
      const Vector& derivative = derivatives_[i];
      const double z = residuals_[i] / (4 * scale);  // Tukey's biweight
      const double w = kind != Step::robust ? 1 : z * z < 1 ? (1 - z * z) * (1 - z * z) : 0;
      if (w == 0) continue;
      information.selfadjointView<Eigen::Lower>().rankUpdate(derivative, w);
      right += w * residuals_[i] * derivative;
      squares += w * residuals_[i] * residuals_[i];
      weights += w;
    }
    side->explained = weights / static_cast<double>(samples_.size());
    if (side->explained < k_min_explained) return false;
    information.triangularView<Eigen::StrictlyUpper>() = information.transpose();
    constexpr double k_fixed = 1e15;
    const bool has_margin = side->state[margin] < k_no_margin;
    if (!has_margin)
      for (const int i : {margin, ground, ground_t}) information(i, i) += k_fixed;
    if (kind == Step::levels)
      for (const int i : {at_middle, at_turn, log_blur, motion, margin}) information(i, i) += k_fixed;
    information(motion, motion) += moving_ ? k_motion_damping : k_fixed;
    // Levels that nothing shows stay even.
    for (const int i : {ground_t, paper_t, ink_t})
      information(i, i) += 1e-3 * static_cast<double>(samples_.size());
    const Eigen::LDLT<Matrix> solver(information);
    Vector change = solver.solve(right);
    if (!change.allFinite()) return false;
    change[log_blur] = std::clamp(change[log_blur], -0.5, 0.5);
    const double reach = 4 + 0.5 * side->state[motion];  // px^2: a square changes fast
    change[motion] = std::clamp(change[motion], -reach, reach);
    side->state += change;
    side->state[motion] = std::clamp(side->state[motion], 0.0, k_max_motion);
    if (has_margin) side->state[margin] = std::clamp(side->state[margin], 0.02, 3.0);
    side->state[log_blur] = std::clamp(side->state[log_blur], std::log(0.25), std::log(8.0));
    side->residual = std::sqrt(squares / weights);
    const double freedom = std::max(1.0, weights - static_cast<int>(k_unknowns));
    side->covariance = solver.solve(Matrix::Identity()) * (squares / freedom);
    return true;
  }

  // The corners where the sides' lines now meet.
  bool moved(const std::array<Side, 4>& sides, std::array<Eigen::Vector2d, 4>* corners) const {
    std::array<Eigen::Vector2d, 4> from, along;
    for (std::size_t s = 0; s < 4; ++s) {
      const auto& c = *corners;
      const SquareToQuad square({c[s], c[(s + 1) % 4], c[(s + 2) % 4], c[(s + 3) % 4]});
      const Vector& state = sides[s].state;
      from[s] = square.at(0, (state[at_middle] - state[at_turn]) / cells_.count);
      along[s] = square.at(1, (state[at_middle] + state[at_turn]) / cells_.count) - from[s];
    }
    for (std::size_t i = 0; i < 4; ++i) {
      const std::size_t b = (i + 3) % 4;
      const double sine = along[b].x() * along[i].y() - along[b].y() * along[i].x();
      const Eigen::Vector2d apart = from[i] - from[b];
      const double way = (apart.x() * along[i].y() - apart.y() * along[i].x()) / sine;
      (*corners)[i] = from[b] + way * along[b];
      if (!(*corners)[i].allFinite()) return false;
    }
    return true;
  }

  std::optional<RefinedQuad> finished(const RefinedQuad& start,
                                      const std::array<Eigen::Vector2d, 4>& corners,
                                      const std::array<Side, 4>& sides) const {
    RefinedQuad result = start;
    result.corners_px = corners;
    for (const Side& side : sides) {
      const double contrast = side.state[paper] - side.state[ink];
      if (!(contrast > 0) || side.residual > k_max_residual * contrast ||
          side.explained < k_min_explained_at_last)
        return std::nullopt;
    }
    for (std::size_t i = 0; i < 4; ++i) {
      Eigen::Matrix2d normals;
      Eigen::Vector2d variances;
      for (int k = 0; k < 2; ++k) {
        const std::size_t s = k == 0 ? (i + 3) % 4 : i;
        const double t = k == 0 ? 1 : -1;
        const Eigen::Vector2d along = corners[(s + 1) % 4] - corners[s];
        normals.row(k) = Eigen::RowVector2d(-along.y(), along.x()) / along.norm();
        const double px_a_cell = 1 / CellMap(corners, s, cells_.count).at(corners[i]).y_a_px;
        const Matrix& c = sides[s].covariance;
        variances[k] = px_a_cell * px_a_cell *
                       (c(at_middle, at_middle) + 2 * t * c(at_middle, at_turn) + c(at_turn, at_turn));
      }
      const Eigen::Matrix2d inverse = normals.inverse();
      result.corner_covariance[i] = inverse * variances.asDiagonal() * inverse.transpose() +
                                    k_systematic_px * k_systematic_px * Eigen::Matrix2d::Identity();
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
  auto still = PatternFit(grey, light, cells, false).fit(start);
  std::optional<Fitted> moving;
  if (*std::max_element(start.blur_px.begin(), start.blur_px.end()) > k_may_move_px)
    moving = PatternFit(grey, light, cells, true).fit(start);
  if (moving && (!still || moving->squares < k_clearly_better * still->squares)) return moving->quad;
  if (still) return still->quad;
  return std::nullopt;
}

}  // namespace limn::tracker
