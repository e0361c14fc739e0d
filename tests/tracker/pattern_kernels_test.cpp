// The light that the pattern fit expects, and its derivatives.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "tracker/pattern_model.h"
#include "tracker/square_to_quad.h"

namespace limn::tracker::pattern {
namespace {

constexpr std::size_t k_side = 44, k_count = k_side * k_side;
const Eigen::Vector2d k_origin(500, 300);
static_assert(k_count % k_together == 0);

SeenCells some_cells() {
  SeenCells cells;
  cells.count = 8;
  for (int row = 1; row < 7; ++row)
    for (int column = 1; column < 7; ++column)
      cells.white[static_cast<std::size_t>(row * cells.count + column)] = (row * row + 3 * column) % 5 < 2;
  return cells;
}

// A marker of some 30 px, turned and seen from the side, blurred, with a little motion and bend.
State some_state() {
  State state;
  state.corners = {k_origin + Eigen::Vector2d(-17, -9), k_origin + Eigen::Vector2d(9, -18),
                   k_origin + Eigen::Vector2d(16, 13), k_origin + Eigen::Vector2d(-12, 15)};
  state.log_blur = std::log(0.8);
  state.motion = {2, -1};
  state.paper = {200, 6, -4};
  state.ink = {30, -3, 2};
  state.ground = {90, 60, 120, 20};
  state.margin = {1, 0.8, 1.5, 0.6};
  state.bend = {0.01, -0.01, 0.005, 0.01};
  return state;
}

struct Light {
  std::vector<float> light, behind;
  std::vector<std::vector<float>> derivatives;  // for each unknown
  std::vector<std::int32_t> edges;
};

// At all pixels around the marker.
Light light_of(const State& state, int version) {
  std::vector<float> x, y, level_x, level_y;
  const Eigen::Matrix3d square_from_px = SquareToQuad(some_state().corners).matrix().inverse();
  for (std::size_t i = 0; i < k_count; ++i) {
    const Eigen::Vector2d from_origin(static_cast<double>(i % k_side) - 22,
                                      static_cast<double>(i / k_side) - 22);
    const Eigen::Vector2d place =
        2 * (square_from_px * (k_origin + from_origin).homogeneous()).hnormalized().array() - 1;
    x.push_back(static_cast<float>(from_origin.x()));
    y.push_back(static_cast<float>(from_origin.y()));
    level_x.push_back(static_cast<float>(place.x()));
    level_y.push_back(static_cast<float>(place.y()));
  }
  Light seen{std::vector<float>(k_count), std::vector<float>(k_count),
             std::vector<std::vector<float>>(k_unknowns, std::vector<float>(k_count)),
             std::vector<std::int32_t>(k_count)};
  Results results{seen.light.data(), seen.behind.data(), {}};
  for (std::size_t i = 0; i < k_unknowns; ++i) results.derivatives[i] = seen.derivatives[i].data();
  const Guess guess = guess_of(some_cells(), state, true, k_origin);
  const PatternKernels& functions = pattern_kernels(version);
  functions.evaluate(guess, {x.data(), y.data(), level_x.data(), level_y.data()}, k_count, results);
  functions.find_edges(guess, x.data(), y.data(), k_count, seen.edges.data());
  return seen;
}

// The cells, convolved with the Gaussian and the motion place by place.
double expected_light(const State& state, const Eigen::Vector2d& px) {
  const SeenCells cells = some_cells();
  const Eigen::Matrix3d square_from_px = SquareToQuad(state.corners).matrix().inverse();
  const Eigen::Vector3d plane = [&] {
    const Eigen::Vector2d at = 2 * (square_from_px * px.homogeneous()).hnormalized().array() - 1;
    return Eigen::Vector3d(1, at.x(), at.y());
  }();
  const double sigma = std::exp(state.log_blur), step = 0.25 * sigma;
  double sum = 0, weights = 0;
  constexpr int k_times = 8;
  for (int t = 0; t < k_times; ++t)
    for (double dy = -4 * sigma; dy <= 4 * sigma; dy += step)
      for (double dx = -4 * sigma; dx <= 4 * sigma; dx += step) {
        const Eigen::Vector2d moved = ((t + 0.5) / k_times - 0.5) * state.motion;
        Eigen::Vector2d at =
            (square_from_px * (px + Eigen::Vector2d(dx, dy) + moved).homogeneous()).hnormalized();
        at *= cells.count;
        const int column = static_cast<int>(std::floor(at.x())), row = static_cast<int>(std::floor(at.y()));
        const bool inside = row >= 0 && column >= 0 && row < cells.count && column < cells.count;
        const bool is_ink = inside && !cells.is_white(row, column);
        const double weight = std::exp(-(dx * dx + dy * dy) / (2 * sigma * sigma));
        sum += weight * (is_ink ? state.ink : state.paper).dot(plane);
        weights += weight;
      }
  return sum / weights;
}

TEST(PatternLight, IsThatOfTheCellsThroughAGaussian) {
  State state = some_state();
  state.bend.setZero();
  state.motion = {0.8, -0.4};
  state.margin.setConstant(1e3);  // paper all around
  const Light seen = light_of(state, 0);
  double worst = 0;
  for (std::size_t i = 0; i < k_count; i += 13) {
    const Eigen::Vector2d px = k_origin + Eigen::Vector2d(static_cast<double>(i % k_side) - 22,
                                                          static_cast<double>(i / k_side) - 22);
    worst = std::max(worst, std::abs(static_cast<double>(seen.light[i]) - expected_light(state, px)));
  }
  EXPECT_LT(worst, 0.02 * (state.paper[0] - state.ink[0]));
}

TEST(PatternLight, ChangesAsItsDerivativesSay) {
  const Light here = light_of(some_state(), pattern_kernel_versions() - 1);
  const auto check = [&](int unknown, double step, const auto& value_of) {
    State less = some_state(), more = some_state();
    *value_of(&less) -= step;
    *value_of(&more) += step;
    const Light low = light_of(less, 0), high = light_of(more, 0);
    double apart = 0, size = 0;
    for (std::size_t i = 0; i < k_count; ++i) {
      const double by = here.derivatives[static_cast<std::size_t>(unknown)][i];
      const double difference = (static_cast<double>(high.light[i]) - low.light[i]) / (2 * step);
      apart += (by - difference) * (by - difference);
      size += difference * difference;
    }
    EXPECT_LT(std::sqrt(apart), 0.05 * std::sqrt(size)) << "unknown " << unknown;
    EXPECT_GT(size, 0);
  };
  check(log_blur, 0.01, [](State* s) { return &s->log_blur; });
  for (int i = 0; i < 2; ++i) check(motion_x + i, 0.02, [i](State* s) { return &s->motion[i]; });
  for (int i = 0; i < 3; ++i) check(paper + i, 1, [i](State* s) { return &s->paper[i]; });
  for (int i = 0; i < 3; ++i) check(ink + i, 1, [i](State* s) { return &s->ink[i]; });
  for (int i = 0; i < 4; ++i) check(ground + i, 1, [i](State* s) { return &s->ground[i]; });
  for (int i = 0; i < 4; ++i) check(margin + i, 0.01, [i](State* s) { return &s->margin[i]; });
  for (int i = 0; i < 4; ++i) check(bend + i, 0.002, [i](State* s) { return &s->bend[i]; });
}

TEST(PatternLight, IsTheSameOnEveryProcessor) {
  // Samples are processed together. What lies beyond four sigmas of all of them is omitted: 3e-5.
  const Light any = light_of(some_state(), 0);
  for (int version = 1; version < pattern_kernel_versions(); ++version) {
    const Light own = light_of(some_state(), version);
    for (std::size_t i = 0; i < k_count; ++i) {
      ASSERT_NEAR(own.light[i], any.light[i], 0.02);
      ASSERT_NEAR(own.behind[i], any.behind[i], 1e-4);
    }
    for (std::size_t u = 0; u < k_unknowns; ++u) {
      const auto& expected = any.derivatives[u];
      float most = 0;
      for (const float by : expected) most = std::max(most, std::abs(by));
      for (std::size_t i = 0; i < k_count; ++i)
        ASSERT_NEAR(own.derivatives[u][i], expected[i], 2e-3F * most) << "unknown " << u;
    }
    int apart = 0;
    for (std::size_t i = 0; i < k_count; ++i) apart += own.edges[i] != any.edges[i];
    EXPECT_LE(apart, 2) << "at the limit";
  }
  const auto edges = std::count_if(any.edges.begin(), any.edges.end(), [](std::int32_t e) { return e != 0; });
  EXPECT_GT(edges, 500);
  EXPECT_LT(edges, 1500);
}

}  // namespace
}  // namespace limn::tracker::pattern
