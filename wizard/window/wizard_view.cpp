#include "wizard/window/wizard_view.h"

#include <algorithm>

namespace limn::wizard {

double SeenCells::share() const {
  if (counts.empty()) return 0;
  const auto seen = std::count_if(counts.begin(), counts.end(), [](int count) { return count > 0; });
  return static_cast<double>(seen) / static_cast<double>(counts.size());
}

SeenCells cells_of(const std::vector<Eigen::Vector2d>& px, int width, int height, int columns) {
  SeenCells out{columns, std::max(1, columns * height / std::max(1, width)), {}};
  out.counts.resize(static_cast<std::size_t>(out.columns) * static_cast<std::size_t>(out.rows));
  for (const Eigen::Vector2d& one : px) {
    const double x = (one.x() + 0.5) / width, y = (one.y() + 0.5) / height;
    if (!(x >= 0 && x < 1 && y >= 0 && y < 1)) continue;
    const auto column = static_cast<std::size_t>(x * out.columns),
               row = static_cast<std::size_t>(y * out.rows);
    ++out.counts[row * static_cast<std::size_t>(out.columns) + column];
  }
  return out;
}

}  // namespace limn::wizard
