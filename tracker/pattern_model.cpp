#include "tracker/pattern_model.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "tracker/square_to_quad.h"

namespace limn::tracker::pattern {
namespace {

static_assert(Guess::k_max_cells == SeenCells::k_max);

// Number of places along a uniform motion; their spread is that of the motion.
int places_of(const State& state) {
  const double length = state.motion.norm();
  return length == 0 ? 1 : std::clamp(2 + static_cast<int>(length / (1.3 * std::exp(state.log_blur))), 2, 40);
}

}  // namespace

Guess guess_of(const SeenCells& cells, const State& state, bool has_ground, const Eigen::Vector2d& origin) {
  Guess guess{};
  guess.cells = cells.count;
  guess.places = places_of(state);
  guess.has_ground = has_ground;
  Eigen::Matrix3d cells_from_px = Eigen::Vector3d(cells.count, cells.count, 1).asDiagonal() *
                                  SquareToQuad(state.corners).matrix().inverse();
  const Eigen::Vector3d step = cells_from_px.leftCols<2>() * state.motion;
  cells_from_px.col(2) += cells_from_px.leftCols<2>() * origin;
  const auto copy = [](const auto& values, float* into) {
    for (Eigen::Index i = 0; i < values.size(); ++i) into[i] = static_cast<float>(values(i));
  };
  copy(cells_from_px.transpose().reshaped().eval(), guess.cells_from_px);
  copy(step, guess.step);
  copy(state.paper, guess.paper);
  copy(state.ink, guess.black);
  copy(state.ground, guess.behind);
  copy(state.margin, guess.margin);
  copy(state.bend, guess.bends);
  guess.blur_px = static_cast<float>(std::exp(state.log_blur));
  guess.half = 2 / static_cast<float>(cells.count);
  for (int row = 0; row < cells.count; ++row)
    for (int column = 0; column < cells.count; ++column)
      guess.is_ink[(row + 1) * Guess::k_row + column + 1] = cells.is_white(row, column) ? 0 : 1;
  return guess;
}

}  // namespace limn::tracker::pattern
