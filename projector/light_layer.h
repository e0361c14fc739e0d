#pragma once

#include <array>
#include <functional>
#include <opencv2/core/types.hpp>
#include <span>
#include <vector>

#include "core/result.h"
#include "projector/pass_times.h"
#include "projector/pixel_list.h"
#include "projector/shader.h"

namespace limn::projector {

/// Rectangles of a projector's image in which it may give light, none over another: for parts of one mode,
/// or of both.
struct PlacesByMode {
  std::vector<cv::Rect> view, surface, both;

  std::array<const std::vector<cv::Rect>*, 3> each() const { return {&view, &surface, &both}; }
  void clear();
  /// The places of these parts' own rectangles.
  void divide(std::span<const cv::Rect> of_view, std::span<const cv::Rect> of_surface);
};

struct Smoothing;

/// Draws the light that a projector is to give, by lists of pixels: each program does what all of its pixels
/// need (shaders/light.glsl). Lists take 20 bytes a pixel, 28 where parts of both modes lie over each other.
class LightLayer {
 public:
  /// `looks`: names that are defined where looks are drawn, each with a blank behind it; `by_measurement`:
  /// light is balanced by the measured surface.
  static Result<LightLayer> link(const std::string& looks, bool by_measurement);

  struct Target {
    const GlName& light;  ///< GL_RGBA32F
    cv::Size size;
    bool is_unknown;  ///< what shaders/known.glsl keeps is of another time
  };
  /// Within `places` alone. `set_up` gives every program what it needs, and binds what is known.
  void draw(const Target& target,
            const PlacesByMode& places,
            const Smoothing& smoothing,
            const std::function<void(const Program&)>& set_up,
            PassTimes* times);
  /// Runs a program over all pixels that may have light since the last draw (shaders/listed.glsl).
  void work_through_lit(const Program& program) const;

 private:
  struct ByMode {
    Program where, centre, edges;
    PixelList lit, at_edges;  // pixels that may be
    bool is_used = false;     // by the last draw
  };
  Program hits_, unknown_, listed_hits_, shares_, where_edges_, rest_;
  std::array<ByMode, 3> modes_;  // in the order of PlacesByMode
  PixelList rest_list_;
};

}  // namespace limn::projector
