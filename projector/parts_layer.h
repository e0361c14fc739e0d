#pragma once

#include <opencv2/core/types.hpp>
#include <optional>
#include <vector>

#include "core/result.h"
#include "projector/pass.h"
#include "projector/pass_times.h"
#include "projector/pixel_list.h"

namespace limn::projector {

struct Smoothing;

/// Draws what an imager is to see of parts, linear light and coverage, by lists of pixels as LightLayer does:
/// where there may be some, at pixel centres, by more samples at edges, and what few of those need.
class PartsLayer {
 public:
  /// `looks`: what is defined where looks are drawn.
  static Result<PartsLayer> link(Defines looks);
  /// Contact shadows, too; once is enough.
  Status link_shadowed();

  struct What {
    bool is_view;      ///< of a virtual camera, with the prototype; else of parts over a camera's image
    bool is_shadowed;  ///< with contact shadows: link_shadowed() has been called
  };
  struct Target {
    const GlName& light;  ///< GL_RGBA32F
    cv::Size size;
  };
  /// Within `places` alone. `resources`: scene, viewpoints, lens, room light, albedo (views) or composite
  /// weights (parts), and the contact shadow where there is one.
  void draw(What what,
            const Target& target,
            const std::vector<cv::Rect>& places,
            const Smoothing& smoothing,
            const Resources& resources,
            PassTimes* times);

 private:
  struct Passes {
    ComputePass where, centre, edges;
    std::optional<ComputePass> rest;
  };
  struct Both {
    Passes parts, view;
    static Result<Both> link(Defines defines);
  };
  Defines looks_;
  Both plain_;
  std::optional<Both> shadowed_;
  ComputePass where_edges_;
  PixelList list_;          // of pixels that may see something, then of those at edges
  PixelList beside_unlit_;  // pixels at edges that may lack what light cannot show
};

}  // namespace limn::projector
