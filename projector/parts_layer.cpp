#include "projector/parts_layer.h"

#include <algorithm>
#include <utility>

#include "projector/bindings.h"
#include "projector/renderer.h"

namespace limn::projector {

Result<PartsLayer> PartsLayer::link(Defines looks) {
  using enum Resource;
  PartsLayer layer;
  layer.looks_ = looks;
  LIMN_TRY(layer.plain_, Both::link(looks));
  LIMN_TRY(layer.where_edges_,
           ComputePass::link({.shader = "edges.comp", .reads = {light}, .writes = {work_list}}));
  return layer;
}

Status PartsLayer::link_shadowed() {
  if (shadowed_) return {};
  LIMN_TRY(shadowed_, Both::link(looks_ + Defines{Define::contact_shadow}));
  return {};
}

auto PartsLayer::Both::link(Defines defines) -> Result<Both> {
  using enum Resource;
  std::vector<Resource> rays = {scene, viewpoints, lens}, parts = {room_light, composite_weights},
                        view = {room_light, albedo};
  parts.insert(parts.end(), rays.begin(), rays.end());
  view.insert(view.end(), rays.begin(), rays.end());
  if (defines.contains(Define::contact_shadow))
    for (std::vector<Resource>* reads : {&parts, &view}) reads->push_back(contact_shadow);
  Both out;
  const std::pair<ComputePass*, Pass::Description> passes[] = {
      {&out.parts.where, {"parts_where.comp", defines, rays, {work_list}}},
      {&out.parts.centre, {"parts_centre.comp", defines, parts, {target}}},
      {&out.parts.edges, {"parts_edges.comp", defines, parts, {target, deferred_list}}},
      {&out.view.where, {"view_where.comp", defines, rays, {work_list}}},
      {&out.view.centre, {"view_centre.comp", defines, view, {target}}},
      {&out.view.edges, {"view_edges.comp", defines, view, {target}}}};
  for (const auto& [pass, description] : passes) {
    LIMN_TRY(*pass, ComputePass::link(description));
  }
  LIMN_TRY(out.parts.rest, ComputePass::link({"parts_rest.comp", defines, parts, {target}}));
  return out;
}

void PartsLayer::draw(What what,
                      const Target& target,
                      const std::vector<cv::Rect>& places,
                      const Smoothing& smoothing,
                      const Resources& resources_in,
                      PassTimes* times) {
  Both& both = what.is_shadowed ? *shadowed_ : plain_;
  const Passes& passes = what.is_view ? both.view : both.parts;
  // Where places overlap, pixels are listed more than once.
  const int room = target.size.area() * static_cast<int>(std::max<std::size_t>(1, places.size()));
  const ImageAt drawn(k_target_image, target.light, GL_RGBA32F);
  const TextureAt light(k_light_unit, target.light);
  const Resources resources = resources_in.with(Resource::target, drawn)
                                  .with(Resource::light, light)
                                  .with(Resource::work_list, list_)
                                  .with(Resource::deferred_list, beside_unlit_);
  clear_light(target.light, target.size, places);
  {
    const PassTimes::Scope scope(times, "where there may be light");
    list_.start(room);
    passes.where.look_through(places, resources);
  }
  {
    const PassTimes::Scope scope(times, "light at pixel centres");
    passes.centre.work_through(list_, resources);
  }
  {
    const PassTimes::Scope scope(times, "where edges are");
    where_edges_.program().set("u_least_step", static_cast<float>(smoothing.least_step));
    list_.start(room);
    where_edges_.look_through(places, resources);
  }
  const PassTimes::Scope scope(times, "light at edges");
  passes.edges.program().set("u_samples", smoothing.samples);
  beside_unlit_.start(room);
  passes.edges.work_through(list_, resources);
  if (!passes.rest) return;
  passes.rest->program().set("u_samples", smoothing.samples);
  passes.rest->work_through(beside_unlit_, resources);
}

}  // namespace limn::projector
