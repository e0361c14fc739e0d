#pragma once

#include <array>
#include <opencv2/core/types.hpp>
#include <span>
#include <vector>

#include "core/result.h"
#include "projector/pass.h"
#include "projector/pass_times.h"
#include "projector/pixel_list.h"

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

/// Draws the light that a projector is to give, by lists of pixels: each pass does what all of its pixels
/// need (shaders/light.glsl). Lists take 20 bytes a pixel, 28 where parts of both modes lie over each other.
class LightLayer {
 public:
  /// `looks`: what is defined where looks are drawn; `by_measurement`: light is balanced by the measured
  /// surface.
  static Result<LightLayer> link(Defines looks, bool by_measurement);

  struct Target {
    const GlName& light;  ///< GL_RGBA32F
    cv::Size size;
    bool is_unknown;  ///< what the hit cache keeps is of another time
  };
  /// Within `places` alone. `resources`: scene, viewpoints, occlusion, lens, room light, projector, hit cache
  /// and light balance.
  void draw(const Target& target,
            const PlacesByMode& places,
            const Smoothing& smoothing,
            const Resources& resources,
            PassTimes* times);
  /// Runs a pass over all pixels that may have light since the last draw.
  void work_through_lit(const ComputePass& pass, const Resources& resources) const;

 private:
  struct ByMode {
    ComputePass where, centre, edges;
    PixelList lit, at_edges;  // pixels that may be
    bool is_used = false;     // by the last draw
  };
  // What the phases of one draw share.
  struct Drawing {
    const Target& target;
    const PlacesByMode& places;
    const Smoothing& smoothing;
    const Resources& resources;
    PassTimes* times;
  };
  void find_hits(const Drawing& drawing);
  void list_lit(const Drawing& drawing);
  void draw_centres(const Drawing& drawing);
  void list_edges(const Drawing& drawing);
  void draw_edges(const Drawing& drawing);
  PixelList& start_deferred(const Drawing& drawing);
  template <class Do>
  void for_modes(const PlacesByMode& places, const Do& draw_mode);

  ComputePass hits_, unknown_, listed_hits_, shares_, where_edges_, rest_;
  std::array<ByMode, 3> modes_;  // in the order of PlacesByMode
  PixelList deferred_;           // of one phase at a time, which names what it holds
};

}  // namespace limn::projector
