#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>
#include <vector>

#include "scene/posed_scene.h"

namespace limn::sim {

/// Lines of light on the prototype as they should be, with sharp edges: the reference for projector/.
class ReferenceLines {
 public:
  ReferenceLines() = default;
  /// The lines that a posed scene shows.
  ReferenceLines(const scene::Scene& scene, const scene::PosedScene& posed);

  bool is_empty() const { return repeated_.empty() && pieces_.empty(); }
  /// Colour (linear light, red, green, blue) of the line at a point of the prototype, in its frame; nullopt
  /// where there is none. `d_face`: unit normal of the triangle there, as it winds.
  std::optional<Eigen::Vector3d> colour_at(const Eigen::Vector3d& p, const Eigen::Vector3d& d_face) const;

 private:
  struct Repeated {
    scene::RepeatedLines lines;
    scene::LineStyle style;
  };
  struct Piece {
    Eigen::Vector3d a, b, d_side;
    scene::LineStyle style;
    Eigen::AlignedBox3d box;  // around all its points
  };
  struct Group {  // consecutive pieces
    std::size_t first = 0, end = 0;
    Eigen::AlignedBox3d box;
  };
  void add(const scene::SurfaceCurve& curve, const scene::LineStyle& style);

  std::vector<Repeated> repeated_;
  std::vector<Piece> pieces_;
  std::vector<Group> groups_;
};

}  // namespace limn::sim
