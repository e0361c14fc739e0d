#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <opencv2/core/mat.hpp>
#include <span>

#include "tracker/family.h"
#include "tracker/quad_sampler.h"
#include "tracker/refine.h"

/// Reads the light inside a quad, relative to the levels beside its edges. For tracker/identify.cpp.
namespace limn::tracker::identity {

constexpr double k_brightest = 2;         // bound on brightness, so that glare counts no more than this
constexpr double k_sharpen_below_px = 4;  // smaller cells blur into each other

// The plane a + b x + c y over the unit square, through the values at the middles of its four sides.
struct Plane {
  float a, b, c;
  explicit Plane(const std::array<double, 4>& side)
      : a(static_cast<float>(0.25 * (side[0] + side[1] + side[2] + side[3]) - 0.5 * (side[1] - side[3]) -
                             0.5 * (side[2] - side[0]))),
        b(static_cast<float>(side[1] - side[3])),
        c(static_cast<float>(side[2] - side[0])) {}
};

// Places in the unit square.
struct Places {
  std::size_t count = 0;
  std::array<float, QuadSampler::k_most> x, y;

  void add(double at_x, double at_y) {
    x[count] = static_cast<float>(at_x);
    y[count++] = static_cast<float>(at_y);
  }
  // Adds `count` places along each side of the square that lies `inset` inside the unit square.
  void add_ring(double inset, int count) {
    for (int i = 0; i < count; ++i) {
      const double along = inset + (1 - 2 * inset) * i / count;
      add(along, inset);
      add(1 - inset, along);
      add(1 - along, 1 - inset);
      add(inset, 1 - along);
    }
  }
  // Adds one or five places in the middle half of the cell about (x, y), of a grid with `cells` a side.
  void add_cell(double at_x, double at_y, double cells, bool several) {
    add(at_x, at_y);
    if (!several) return;
    const double d = 0.2 / cells;
    add(at_x - d, at_y - d);
    add(at_x + d, at_y - d);
    add(at_x - d, at_y + d);
    add(at_x + d, at_y + d);
  }
};

using Fractions = std::array<float, QuadSampler::k_most>;
using Grid = std::array<double, CodeGrid::k_max_width * CodeGrid::k_max_width>;

// The limits between black and white that are tried. It is the middle, or lower where a shadow crosses: white
// paper in the shadow must be lighter than the ink in the light (a shadow 4 times darker and ink 7 times
// darker than paper).
constexpr double k_middle = 0.5;
constexpr std::array<double, 3> k_limits = {k_middle, 0.35, 0.22};

// Samples as fractions of the way from black to white, at one or five places of every cell, border included.
struct CellSamples {
  int cells = 0;  // cells along a side, border included
  int rings = 0;  // those of them that are outside of the square
  bool several = false;
  Fractions fraction;

  std::size_t places() const { return several ? 5 : 1; }
};
static_assert(5 * CodeGrid::k_max_width * CodeGrid::k_max_width <= QuadSampler::k_most);

// -1 at black, 0 at the limit, 1 as far above the limit as black is below it.
inline float relative(float fraction, float limit) {
  constexpr auto k_most = static_cast<float>(k_brightest);
  const float value = (fraction - limit) / limit;
  const float bounded = value < k_most ? value : k_most;
  return bounded > -k_most ? bounded : -k_most;
}

/// Mean of relative() over the places of one cell.
double mean_relative(const float* fractions, std::size_t places, double limit);

/// Values of all cells, border included. Where there is one sample in a cell, blur from the neighbours is
/// removed.
Grid grid_of(const CellSamples& samples, double limit);

// Reads one quad, relative to the levels inside and outside its edges.
struct QuadReader {
  QuadSampler levels;
  Plane light, dark;
  double side_px, blur_px;

  // `beyond`: how far outside of the square there are places to read, as share of its side.
  QuadReader(const cv::Mat& image, const RefinedQuad& quad, double beyond)
      : levels(image, quad.corners_px, beyond),
        light(quad.outside_level),
        dark(quad.inside_level),
        side_px(std::sqrt(area(quad.corners_px))),
        blur_px(*std::max_element(quad.blur_px.begin(), quad.blur_px.end())) {}

  static double area(const std::array<Eigen::Vector2d, 4>& q) {
    const Eigen::Vector2d a = q[2] - q[0];
    const Eigen::Vector2d b = q[3] - q[1];
    return 0.5 * std::abs(a.x() * b.y() - a.y() * b.x());
  }

  // Fractions of the way from black to white at some places.
  void fractions(const Places& places, Fractions* into) const;

  // Number of places that are light.
  int light_places(const Places& places) const {
    Fractions found;
    fractions(places, &found);
    return static_cast<int>(std::count_if(found.begin(),
                                          found.begin() + static_cast<std::ptrdiff_t>(places.count),
                                          [](float fraction) { return fraction > k_middle; }));
  }

  // `width` cells along a side, of which `rings` lie outside of the square.
  void read(int width, int rings, CellSamples* samples) const {
    const int side = width - 2 * rings;
    samples->rings = rings;
    read_cells(
        width, side, [&](int i) { return (i - rings + 0.5) / side; }, samples);
  }

  // For a border that is no whole number of cells wide: it counts as one ring of cells, read in its middle.
  void read_inside(int inner_cells, double border_cells, CellSamples* samples) const {
    const double side_cells = inner_cells + 2 * border_cells;
    const auto middle = [&](int i) {
      if (i == 0) return 0.5 * border_cells / side_cells;
      if (i > inner_cells) return 1 - 0.5 * border_cells / side_cells;
      return (border_cells + i - 0.5) / side_cells;
    };
    samples->rings = 0;
    read_cells(inner_cells + 2, side_cells, middle, samples);
  }

 private:
  template <typename Middle>
  void read_cells(int cells, double side_cells, const Middle& middle, CellSamples* samples) const {
    samples->cells = cells;
    samples->several = side_px / side_cells >= k_sharpen_below_px;
    Places places;
    for (int row = 0; row < cells; ++row)
      for (int column = 0; column < cells; ++column)
        places.add_cell(middle(column), middle(row), side_cells, samples->several);
    fractions(places, &samples->fraction);
  }
};

}  // namespace limn::tracker::identity
