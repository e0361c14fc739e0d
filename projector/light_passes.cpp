#include "projector/light_passes.h"

#include <algorithm>

#include "projector/bindings.h"
#include "projector/renderer.h"

namespace limn::projector {
namespace {

// Adds the area of `place` that lies outside `others` and outside `*places`, as rectangles.
void add_outside(const cv::Rect& place, std::span<const cv::Rect> others, std::vector<cv::Rect>* places) {
  if (place.empty()) return;
  for (const std::span<const cv::Rect> taken : {others, std::span<const cv::Rect>(*places)}) {
    for (const cv::Rect& other : taken) {
      const cv::Rect both = place & other;
      if (both.empty()) continue;
      const int left = place.x, top = place.y, right = place.br().x, bottom = place.br().y;
      for (const cv::Rect& piece : {cv::Rect({left, top}, cv::Point(right, both.y)),
                                    cv::Rect({left, both.br().y}, cv::Point(right, bottom)),
                                    cv::Rect({left, both.y}, cv::Point(both.x, both.br().y)),
                                    cv::Rect({both.br().x, both.y}, cv::Point(right, both.br().y))})
        add_outside(piece, others, places);
      return;
    }
  }
  places->push_back(place);
}

}  // namespace

std::vector<cv::Rect> without_overlaps(std::span<const cv::Rect> places) {
  std::vector<cv::Rect> out;
  for (const cv::Rect& place : places) add_outside(place, {}, &out);
  return out;
}

void PlacesByMode::clear() {
  for (std::vector<cv::Rect>* places : {&view, &surface, &both}) places->clear();
}

void PlacesByMode::divide(std::span<const cv::Rect> of_view, std::span<const cv::Rect> of_surface) {
  clear();
  for (const cv::Rect& v : of_view)
    for (const cv::Rect& s : of_surface) add_outside(v & s, {}, &both);
  for (const cv::Rect& v : of_view) add_outside(v, both, &view);
  for (const cv::Rect& s : of_surface) add_outside(s, both, &surface);
}

Result<LightPasses> LightPasses::link(Defines shading_defines, bool by_measurement) {
  using enum Resource;
  LightPasses passes;
  const Defines balance = by_measurement ? Defines{Define::by_measurement} : Defines{};
  const Defines drawing = shading_defines + balance;
  const Defines finish = shading_defines.contains(Define::finish) ? Defines{Define::finish} : Defines{};
  const std::vector<Resource> rays = {scene, viewpoints, lens, projector};
  LIMN_TRY(passes.hits_,
           ComputePass::link({.shader = "light_hits.comp", .reads = rays, .writes = {hit_cache}}));
  LIMN_TRY(
      passes.cache_misses_,
      ComputePass::link({.shader = "hit_cache_misses.comp", .reads = {hit_cache}, .writes = {work_list}}));
  LIMN_TRY(passes.listed_hits_, ComputePass::link({.shader = "light_hits.comp",
                                                   .defines = {Define::work_list},
                                                   .reads = rays,
                                                   .writes = {hit_cache}}));
  LIMN_TRY(passes.shares_, ComputePass::link({.shader = "light_shares.comp",
                                              .defines = balance,
                                              .reads = {scene, viewpoints, occlusion, lens, projector,
                                                        hit_cache, light_balance, target},
                                              .writes = {hit_cache, target}}));
  LIMN_TRY(passes.find_edges_, ComputePass::link({.shader = "edges.comp",
                                                  .defines = {Define::cached_shares},
                                                  .reads = {light, hit_cache},
                                                  .writes = {work_list, deferred_list}}));
  LIMN_TRY(passes.edges_deferred_,
           ComputePass::link({.shader = "light_edges_deferred.comp",
                              .defines = drawing + Defines{Define::view_parts, Define::surface_parts},
                              .reads = {scene, viewpoints, occlusion, lens, room_light, projector, hit_cache,
                                        light_balance},
                              .writes = {target}}));
  const Defines modes[] = {
      {Define::view_parts}, {Define::surface_parts}, {Define::view_parts, Define::surface_parts}};
  for (std::size_t i = 0; i < passes.modes_.size(); ++i) {
    ByMode& mode = passes.modes_[i];
    LIMN_TRY(mode.find_candidates,
             ComputePass::link({.shader = "light_candidates.comp",
                                .defines = modes[i] + finish,
                                .reads = {scene, viewpoints, projector, hit_cache, light_balance},
                                .writes = {work_list}}));
    const std::vector<Resource> reads = {scene,     viewpoints, lens,         room_light,
                                         projector, hit_cache,  light_balance};
    LIMN_TRY(mode.centre, ComputePass::link({.shader = "light_centre.comp",
                                             .defines = drawing + modes[i],
                                             .reads = reads,
                                             .writes = {target, deferred_list}}));
    LIMN_TRY(mode.edges, ComputePass::link({.shader = "light_edges.comp",
                                            .defines = drawing + modes[i],
                                            .reads = reads,
                                            .writes = {target, deferred_list}}));
  }
  return passes;
}

void LightPasses::draw(const Target& target,
                       const PlacesByMode& places,
                       const Smoothing& smoothing,
                       const Resources& resources,
                       PassTimes* times) {
  const ImageAt drawn(k_target_image, target.light, GL_RGBA32F);
  const TextureAt light(k_light_unit, target.light);
  const Resources with_target = resources.with(Resource::target, drawn).with(Resource::light, light);
  const Drawing drawing{target, places, smoothing, with_target, times};
  for (std::size_t i = 0; i < modes_.size(); ++i) modes_[i].is_used = !places.each()[i]->empty();
  for_modes(places, [&](ByMode&, const std::vector<cv::Rect>& parted) {
    clear_light(target.light, target.size, parted, 1);  // the edge detection reads the pixels around them
  });
  find_hits(drawing);
  list_candidates(drawing);
  draw_centres(drawing);
  list_edges(drawing);
  draw_edges(drawing);
}

// Computes what the pixel centres see, where the hit cache does not hold it yet.
void LightPasses::find_hits(const Drawing& drawing) {
  const PassTimes::Scope scope(drawing.times, "hits at pixel centres");
  PixelList& misses = start_deferred(drawing);
  const Resources resources = drawing.resources.with(Resource::work_list, misses);
  const ComputePass& pass = drawing.target.is_cache_outdated ? hits_ : cache_misses_;
  for_modes(drawing.places,
            [&](ByMode&, const std::vector<cv::Rect>& parted) { pass.run_over_rects(parted, resources); });
  if (!drawing.target.is_cache_outdated) listed_hits_.run_over_list(misses, resources);
}

void LightPasses::list_candidates(const Drawing& drawing) {
  const PassTimes::Scope scope(drawing.times, "where there may be light");
  for_modes(drawing.places, [&](ByMode& mode, const std::vector<cv::Rect>& parted) {
    mode.candidates.start(drawing.target.size.area());
    mode.find_candidates.run_over_rects(parted, drawing.resources.with(Resource::work_list, mode.candidates));
  });
}

// Draws one sample for each pixel. Blending shares that the hit cache does not hold yet are computed and
// cached.
void LightPasses::draw_centres(const Drawing& drawing) {
  const PassTimes::Scope scope(drawing.times, "light at pixel centres");
  PixelList& without_share = start_deferred(drawing);
  const Resources resources = drawing.resources.with(Resource::deferred_list, without_share);
  for_modes(drawing.places, [&](ByMode& mode, const std::vector<cv::Rect>&) {
    mode.centre.run_over_list(mode.candidates, resources);
  });
  shares_.run_over_list(without_share, resources);
}

// Lists the pixels beside an edge of light. Their samples will use the shares at their centres, so missing
// shares are computed here.
void LightPasses::list_edges(const Drawing& drawing) {
  const PassTimes::Scope scope(drawing.times, "where edges are");
  PixelList& without_share = start_deferred(drawing);
  find_edges_.program().set("u_least_step", static_cast<float>(drawing.smoothing.least_step));
  const Resources resources = drawing.resources.with(Resource::deferred_list, without_share);
  for_modes(drawing.places, [&](ByMode& mode, const std::vector<cv::Rect>& parted) {
    mode.at_edges.start(drawing.target.size.area());
    find_edges_.run_over_rects(parted, resources.with(Resource::work_list, mode.at_edges));
  });
  shares_.run_over_list(without_share, resources);
}

// Draws several samples for each pixel. Some pixels need a share of their own for each sample.
void LightPasses::draw_edges(const Drawing& drawing) {
  const PassTimes::Scope scope(drawing.times, "light at edges");
  PixelList& with_many_shares = start_deferred(drawing);
  const Resources resources = drawing.resources.with(Resource::deferred_list, with_many_shares);
  for_modes(drawing.places, [&](ByMode& mode, const std::vector<cv::Rect>&) {
    mode.edges.program().set("u_samples", drawing.smoothing.samples);
    mode.edges.run_over_list(mode.at_edges, resources);
  });
  edges_deferred_.program().set("u_samples", drawing.smoothing.samples);
  edges_deferred_.run_over_list(with_many_shares, resources);
}

PixelList& LightPasses::start_deferred(const Drawing& drawing) {
  deferred_.start(drawing.target.size.area());
  return deferred_;
}

template <class Do>
void LightPasses::for_modes(const PlacesByMode& places, const Do& draw_mode) {
  for (std::size_t i = 0; i < modes_.size(); ++i)
    if (modes_[i].is_used) draw_mode(modes_[i], *places.each()[i]);
}

void LightPasses::run_over_drawn_pixels(const ComputePass& pass, const Resources& resources) const {
  for (const ByMode& mode : modes_) {
    if (!mode.is_used) continue;
    pass.run_over_list(mode.candidates, resources);
    pass.run_over_list(mode.at_edges, resources);
  }
}

}  // namespace limn::projector
