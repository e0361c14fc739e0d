#include "tracker/pattern_model.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "tracker/square_to_quad.h"

namespace limn::tracker::pattern {
namespace {

// Standard normal distribution and density, from a table.
class Normal {
 public:
  static constexpr double k_reach = 4;
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
  static constexpr double k_width = 2 * k_reach / k_steps;
  std::array<Value, k_steps + 1> table_;
};

const Normal k_normal;

// The cells about one coordinate of a place, seen through a Gaussian: of every cell its share, and the
// share's first and second derivative by the place in sigmas.
struct Shares {
  static constexpr int k_most = SeenCells::k_max + 2;
  int first = 0, count = 0;  // cells, -1 the paper before the marker
  std::array<double, k_most> share, slope, bend;

  Shares(double at, double sigma, int cells) {
    const double reach = Normal::k_reach * sigma;
    // Rounded towards zero is right there: below it the lines begin.
    const int from = std::max(0, static_cast<int>(at - reach) + (at > reach ? 1 : 0));
    const int to = at + reach < 0 ? -1 : std::min(cells, static_cast<int>(at + reach));
    first = from - 1;
    const double sigmas = 1 / sigma;
    double below = 1;
    double density = 0;
    double turn = 0;
    for (int line = from; line <= to; ++line) {
      const double z = (at - line) * sigmas;
      const Normal::Value n = k_normal.at(z);
      const auto i = static_cast<std::size_t>(count++);
      share[i] = below - n.below;
      slope[i] = density - n.density;
      bend[i] = turn + z * n.density;
      below = n.below;
      density = n.density;
      turn = -z * n.density;
    }
    const auto i = static_cast<std::size_t>(count++);
    share[i] = below;
    slope[i] = density;
    bend[i] = turn;
  }
};

// Even motion as so many places, whose spread is that of the motion.
int places_of(const State& state) {
  const double length = state.motion.norm();
  return length == 0 ? 1 : std::clamp(2 + static_cast<int>(length / (1.3 * std::exp(state.log_blur))), 2, 40);
}

}  // namespace

Pattern::Pattern(const SeenCells& cells) : count_(cells.count) {
  for (int row = 0; row < count_; ++row)
    for (int column = 0; column < count_; ++column)
      ink_[static_cast<std::size_t>((row + 1) * k_row + column + 1)] = !cells.is_white(row, column);
}

// The bivariate normal's first terms in its correlation (tetrachoric series, Pearson 1900).
Ink Pattern::at(double x, double y, const CellBlur& blur) const {
  Ink seen;
  const double reach_x = Normal::k_reach * blur.x;
  const double reach_y = Normal::k_reach * blur.y;
  if (!(x > -reach_x && y > -reach_y && x < count_ + reach_x && y < count_ + reach_y)) return seen;
  const Shares columns(x, blur.x, count_);
  const Shares rows(y, blur.y, count_);
  double twist = 0;
  double warp = 0;
  for (int r = 0; r < rows.count; ++r) {
    const double* ink = &ink_[static_cast<std::size_t>((rows.first + r + 1) * k_row + columns.first + 1)];
    double share = 0;
    double slope = 0;
    double bend = 0;
    for (int c = 0; c < columns.count; ++c) {
      const auto i = static_cast<std::size_t>(c);
      share += columns.share[i] * ink[c];
      slope += columns.slope[i] * ink[c];
      bend += columns.bend[i] * ink[c];
    }
    const auto i = static_cast<std::size_t>(r);
    seen.value += rows.share[i] * share;
    seen.by_x += rows.share[i] * slope;
    seen.by_y += rows.slope[i] * share;
    seen.by_log_blur += rows.share[i] * bend + rows.bend[i] * share;
    twist += rows.slope[i] * slope;
    warp += rows.bend[i] * bend;
  }
  seen.value += blur.correlation * (twist + 0.5 * blur.correlation * warp);
  seen.by_log_blur += 2 * blur.correlation * twist;
  seen.by_x /= blur.x;
  seen.by_y /= blur.y;
  return seen;
}

Model::Model(const Pattern& pattern, const State& state, bool has_ground)
    : pattern_(pattern), state_(state), has_ground_(has_ground), places_(places_of(state)) {
  const double count = pattern.count();
  cells_from_px_ =
      Eigen::Vector3d(count, count, 1).asDiagonal() * SquareToQuad(state.corners).matrix().inverse();
  step_ = cells_from_px_.leftCols<2>() * state.motion;
  blur_px_ = std::exp(state.log_blur);
}

bool Model::shows_edge(const Eigen::Vector2d& px) const {
  constexpr double k_edge = 0.01;  // of a step's steepest slope
  const Place place = place_of(px);
  const Eigen::Vector2d at = place.p.head<2>() / place.p.z();
  const Ink seen = pattern_.at(at.x(), at.y(), place.blur);
  return std::max(std::abs(seen.by_x * place.blur.x), std::abs(seen.by_y * place.blur.y)) > k_edge;
}

double Model::at(const Sample& sample, Vector* derivative, double* behind) const {
  const Place place = place_of(sample.px);
  const auto& [p, cells_a_px, blur] = place;
  const Eigen::Vector3d plane(1, sample.place.x(), sample.place.y());
  const double white = state_.paper.dot(plane);
  const double black = state_.ink.dot(plane);
  const double half = 2.0 / pattern_.count();
  Vector& d = *derivative;
  double ink_share = 0;
  std::array<double, 12> by_shape{};
  double by_log_blur = 0;
  Eigen::Vector2d by_motion = Eigen::Vector2d::Zero();
  Ground ground_seen;
  const double spacing = places_ > 1 ? 1 / std::sqrt(places_ * places_ - 1.0) : 0;
  for (int i = 0; i < places_; ++i) {
    const double t = (i - 0.5 * (places_ - 1)) * spacing;
    const Eigen::Vector3d at = p + t * step_;
    double x = at.x() / at.z();
    double y = at.y() / at.z();
    const double u = half * x - 1;
    const double v = half * y - 1;
    const double arch_x = 1 - u * u;
    const double arch_y = 1 - v * v;
    x -= (state_.bend[0] * arch_x + state_.bend[1] * arch_y) / half;
    y -= (state_.bend[2] * arch_x + state_.bend[3] * arch_y) / half;
    const Ink seen = pattern_.at(x, y, blur);
    ink_share += seen.value;
    double by_x = (black - white) * seen.by_x;
    double by_y = (black - white) * seen.by_y;
    by_log_blur += (black - white) * seen.by_log_blur;
    if (has_ground_) add_ground(x, y, blur, white, &by_x, &by_y, &ground_seen);
    const double both = by_x * u + by_y * v;
    by_shape[0] -= by_x, by_shape[1] -= by_x * u, by_shape[2] -= by_x * v;
    by_shape[3] -= by_y, by_shape[4] -= by_y * u, by_shape[5] -= by_y * v;
    by_shape[6] -= both * u, by_shape[7] -= both * v;
    by_shape[8] -= by_x * arch_x, by_shape[9] -= by_x * arch_y;
    by_shape[10] -= by_y * arch_x, by_shape[11] -= by_y * arch_y;
    by_motion += t * Eigen::Vector2d(by_x, by_y);
  }
  const double share = 1.0 / places_;
  for (int i = 0; i < 8; ++i) d[shape + i] = share / half * by_shape[static_cast<std::size_t>(i)];
  for (int i = 0; i < 4; ++i) d[bend + i] = share / half * by_shape[static_cast<std::size_t>(8 + i)];
  d[log_blur] = share * (by_log_blur + ground_seen.by_log_blur);
  d.segment<4>(margin) = share * ground_seen.by_margin;
  ink_share *= share;
  const Eigen::Vector4d ground_share = share * ground_seen.share;
  const Eigen::Vector2d moved = share * cells_a_px.transpose() * by_motion;
  d[motion_x] = moved.x();
  d[motion_y] = moved.y();
  const double ground_sum = ground_share.sum();
  const double paper_share = 1 - ink_share - ground_sum;
  d.segment<3>(paper) = paper_share * plane;
  d.segment<3>(ink) = ink_share * plane;
  d.segment<4>(ground) = ground_share;
  *behind = ground_sum;
  return black * ink_share + white * paper_share + state_.ground.dot(ground_share);
}

Model::Place Model::place_of(const Eigen::Vector2d& px) const {
  Place place;
  place.p = cells_from_px_ * px.homogeneous();
  const Eigen::Vector2d q = place.p.head<2>() / place.p.z();
  const Eigen::Matrix2d& m = place.cells_a_px =
      (cells_from_px_.topLeftCorner<2, 2>() - q * cells_from_px_.block<1, 2>(2, 0)) / place.p.z();
  const double x_a_px = m.row(0).norm();
  const double y_a_px = m.row(1).norm();
  place.blur = {blur_px_ * x_a_px, blur_px_ * y_a_px, m.row(0).dot(m.row(1)) / (x_a_px * y_a_px)};
  return place;
}

void Model::add_ground(
    double x, double y, const CellBlur& blur, double white, double* by_x, double* by_y, Ground* seen) const {
  const double count = pattern_.count();
  const double z_top = (-state_.margin[0] - y) / blur.y;
  const double z_right = (x - count - state_.margin[1]) / blur.x;
  const double z_bottom = (y - count - state_.margin[2]) / blur.y;
  const double z_left = (-state_.margin[3] - x) / blur.x;
  if (std::max({z_top, z_right, z_bottom, z_left}) < -Normal::k_reach) return;
  const Normal::Value top = k_normal.at(z_top), right = k_normal.at(z_right), bottom = k_normal.at(z_bottom),
                      left = k_normal.at(z_left);
  const double between = 1 - left.below - right.below;
  seen->share += Eigen::Vector4d(between * top.below, right.below, between * bottom.below, left.below);
  const Eigen::Vector4d step = state_.ground.array() - white;
  const double across = step[0] * top.below + step[2] * bottom.below;
  const double by_left = (step[3] - across) * left.density / blur.x;
  const double by_right = (step[1] - across) * right.density / blur.x;
  const double by_top = between * step[0] * top.density / blur.y;
  const double by_bottom = between * step[2] * bottom.density / blur.y;
  *by_x += by_right - by_left;
  *by_y += by_bottom - by_top;
  seen->by_log_blur -= z_left * by_left * blur.x + z_right * by_right * blur.x + z_top * by_top * blur.y +
                       z_bottom * by_bottom * blur.y;
  seen->by_margin -= Eigen::Vector4d(by_top, by_right, by_bottom, by_left);
}

}  // namespace limn::tracker::pattern
