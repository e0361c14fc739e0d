#include "scene/meshes/closed_pieces.h"

#include <algorithm>
#include <cstdint>
#include <numeric>

namespace limn::scene {
namespace {

struct Side {
  std::uint32_t lower, upper;  // places
  std::uint32_t triangle;
  int direction;  // 1: the triangle runs from lower to upper; -1: from upper to lower

  bool is_beside(const Side& other) const { return lower == other.lower && upper == other.upper; }
};

std::vector<Side> sides_of(const Mesh& mesh) {
  const std::vector<std::uint32_t> place = first_at_place(mesh);
  std::vector<Side> sides;
  sides.reserve(3 * mesh.triangles.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = place[mesh.triangles[t][k]], b = place[mesh.triangles[t][(k + 1) % 3]];
      if (a != b)
        sides.push_back({std::min(a, b), std::max(a, b), static_cast<std::uint32_t>(t), a < b ? 1 : -1});
    }
  std::sort(sides.begin(), sides.end(), [](const Side& a, const Side& b) {
    return a.lower != b.lower ? a.lower < b.lower : a.upper < b.upper;
  });
  return sides;
}

}  // namespace

std::vector<bool> are_of_closed_pieces(const Mesh& mesh) {
  const std::vector<Side> sides = sides_of(mesh);
  std::vector<std::uint32_t> parent(mesh.triangles.size());
  std::iota(parent.begin(), parent.end(), 0U);
  const auto piece_of = [&](std::uint32_t triangle) {
    while (parent[triangle] != triangle) triangle = parent[triangle] = parent[parent[triangle]];
    return triangle;
  };
  std::vector<std::uint32_t> at_ends;  // triangles with a side where their mesh ends
  for (std::size_t first = 0; first < sides.size();) {
    int sum = 0;
    std::size_t i = first;
    for (; i < sides.size() && sides[i].is_beside(sides[first]); ++i) {
      sum += sides[i].direction;
      parent[piece_of(sides[i].triangle)] = piece_of(sides[first].triangle);
    }
    if (sum != 0) at_ends.push_back(sides[first].triangle);
    first = i;
  }
  std::vector<bool> is_open(mesh.triangles.size()), closed(mesh.triangles.size());
  for (const std::uint32_t triangle : at_ends) is_open[piece_of(triangle)] = true;
  for (std::size_t t = 0; t < closed.size(); ++t)
    closed[t] = !is_open[piece_of(static_cast<std::uint32_t>(t))];
  return closed;
}

}  // namespace limn::scene
