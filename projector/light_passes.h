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

/// Rectangles of a projector's image in which it may give light. They do not overlap. A rectangle is for
/// parts of one mode or of both.
struct PlacesByMode {
  std::vector<cv::Rect> view, surface, both;

  std::array<const std::vector<cv::Rect>*, 3> each() const { return {&view, &surface, &both}; }
  void clear();
  /// Sets the rectangles from those of the view parts and of the surface parts, which may overlap.
  void divide(std::span<const cv::Rect> of_view, std::span<const cv::Rect> of_surface);
};

/// The area of rectangles that may overlap, as rectangles that do not.
std::vector<cv::Rect> without_overlaps(std::span<const cv::Rect> places);

struct Smoothing;

/// Draws the light that a projector should give (shaders/light.glsl). Each pass processes a list of pixels
/// that all need the same work. The lists take 20 bytes for each pixel, 28 where parts of both modes overlap.
class LightPasses {
 public:
  /// `shading_defines`: the defines of the shading programs (GpuScene::shading_defines); `by_measurement`:
  /// light is compensated by the measured surface.
  static Result<LightPasses> link(Defines shading_defines, bool by_measurement);

  struct Target {
    const GlName& light;  ///< GL_RGBA32F
    cv::Size size;
    bool is_cache_outdated;  ///< The contents of the hit cache are outdated.
  };
  /// Draws within `places` only. `resources` must hold scene, viewpoints, occlusion, lens, room light,
  /// projector, hit cache and light balance.
  void draw(const Target& target,
            const PlacesByMode& places,
            const Smoothing& smoothing,
            const Resources& resources,
            PassTimes* times);
  /// Runs a pass over all pixels that the last draw may have given light.
  void run_over_drawn_pixels(const ComputePass& pass, const Resources& resources) const;

 private:
  struct ByMode {
    ComputePass find_candidates, centre, edges;
    PixelList candidates, at_edges;  // the pixels that may give light, and those at edges
    bool is_used = false;            // whether the last draw had places of this mode
  };
  // The arguments of one draw, which its phases share.
  struct Drawing {
    const Target& target;
    const PlacesByMode& places;
    const Smoothing& smoothing;
    const Resources& resources;
    PassTimes* times;
  };
  void find_hits(const Drawing& drawing);
  void list_candidates(const Drawing& drawing);
  void draw_centres(const Drawing& drawing);
  void list_edges(const Drawing& drawing);
  void draw_edges(const Drawing& drawing);
  PixelList& start_deferred(const Drawing& drawing);
  template <class Do>
  void for_modes(const PlacesByMode& places, const Do& draw_mode);

  ComputePass hits_, cache_misses_, listed_hits_, shares_, find_edges_, edges_deferred_;
  std::array<ByMode, 3> modes_;  // in the order of PlacesByMode
  PixelList deferred_;           // used by one phase at a time, which gives it a name that says what it holds
};

}  // namespace limn::projector
