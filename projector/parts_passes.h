#pragma once

#include <array>
#include <opencv2/core/types.hpp>
#include <optional>
#include <vector>

#include "core/result.h"
#include "projector/pass.h"
#include "projector/pass_times.h"
#include "projector/pixel_list.h"

namespace limn::projector {

struct Smoothing;

/// Draws the parts as an imager sees them, in linear light with coverage. It works with pixel lists, as
/// LightPasses does: it lists the pixels that may see a part, draws one sample at their centres, then several
/// samples at edges, and then the few pixels that need an extra pass.
class PartsPasses {
 public:
  /// The defines of the shading programs: GpuScene::shading_defines() and finish_defines().
  static Result<PartsPasses> link(Defines shading_defines, Defines finish_defines);
  /// Links the programs with contact shadows. Further calls do nothing.
  Status link_shadowed();

  struct What {
    bool is_view;      ///< A virtual camera's view, with the prototype; else parts over a camera's image.
    bool is_shadowed;  ///< With contact shadows; link_shadowed() must have been called.
    bool is_painted;   ///< The prototype has a finish or lines.
  };
  struct Target {
    const GlName& light;  ///< GL_RGBA32F
    cv::Size size;
  };
  /// Draws within `places` only, where the light must be 0 before. `resources` must hold scene, viewpoints,
  /// lens, room light, albedo (views) or composite weights (parts), and the contact shadow if it is used.
  void draw(What what,
            const Target& target,
            const std::vector<cv::Rect>& places,
            const Smoothing& smoothing,
            const Resources& resources,
            PassTimes* times);

 private:
  struct Steps {
    ComputePass find_candidates, centre, edges;
    std::optional<ComputePass> edges_deferred;
  };
  struct Both {
    Steps parts, view;
    static Result<Both> link(Defines defines);
  };
  Status link_programs(bool is_shadowed, bool is_painted);

  Defines shading_defines_, finish_defines_;
  // By contact shadows (1: with them), and by the prototype's paint (1: it has a finish or lines); linked on
  // demand.
  std::array<std::array<std::optional<Both>, 2>, 2> programs_;
  ComputePass find_edges_;
  PixelList work_list_;      // first the pixels that may see something, then those at edges
  PixelList deferred_list_;  // pixels at edges with samples that light may not show
};

}  // namespace limn::projector
