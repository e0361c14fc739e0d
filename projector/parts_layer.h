#pragma once

#include <functional>
#include <opencv2/core/types.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/result.h"
#include "projector/pass_times.h"
#include "projector/pixel_list.h"
#include "projector/shader.h"

namespace limn::projector {

struct Smoothing;

/// Draws what an imager is to see of parts, linear light and coverage, by lists of pixels as LightLayer does:
/// where there may be some, at pixel centres, by more samples at edges, and what few of those need.
class PartsLayer {
 public:
  /// `looks`: names that are defined where looks are drawn, each with a blank behind it.
  static Result<PartsLayer> link(const std::string& looks);
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
  /// Within `places` alone. `set_up` gives every program what it needs.
  void draw(What what,
            const Target& target,
            const std::vector<cv::Rect>& places,
            const Smoothing& smoothing,
            const std::function<void(const Program&)>& set_up,
            PassTimes* times);

 private:
  struct Programs {
    Program where, centre, edges;
    std::optional<Program> rest;
  };
  struct Both {
    Programs parts, view;
    static Result<Both> link(const std::string& defined);
  };
  std::string looks_;
  Both plain_;
  std::optional<Both> shadowed_;
  Program where_edges_;
  PixelList list_, rest_list_;
};

}  // namespace limn::projector
