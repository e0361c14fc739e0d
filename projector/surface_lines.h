#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "projector/gl.h"
#include "scene/posed_scene.h"
#include "scene/scene.h"

namespace limn::projector {

/// How far from its middle (m) a line gives light at most, when a pixel shows a wide patch.
double light_reach(const scene::LineStyle& style);

/// The lines of light on the GPU, in the layout that shaders/surface_lines.glsl reads: repeated lines as
/// formulas, curves as segments in the cells of a hash grid, so that a pixel looks at few of them.
class SurfaceLines {
 public:
  explicit SurfaceLines(const scene::Scene& scene) : lines_(scene.lines) {}

  /// Uploads the lines that a posed scene shows, if they have changed. At most 200000 segments are drawn;
  /// more are left out with a warning.
  void place(const scene::PosedScene& posed);
  /// 0: no lines are shown; else a number that changes with them.
  unsigned stamp() const { return is_empty_ ? 0 : changes_; }
  void bind() const;

 private:
  struct Staging;
  void add(const scene::Line& line, Staging* staging) const;

  std::vector<scene::Line> lines_;  // those of the scene
  std::optional<std::vector<std::string>> shown_;
  std::vector<scene::DrawnLine> drawn_;
  bool is_empty_ = true;
  unsigned changes_ = 0;
  GlName buffer_, texels_;
};

}  // namespace limn::projector
