#include "projector/parts_passes.h"

#include <algorithm>
#include <utility>

#include "projector/bindings.h"
#include "projector/renderer.h"

namespace limn::projector {

Result<PartsPasses> PartsPasses::link(Defines shading_defines, Defines finish_defines) {
  using enum Resource;
  PartsPasses passes;
  passes.shading_defines_ = shading_defines;
  passes.finish_defines_ = finish_defines;
  LIMN_TRY_STATUS(passes.link_programs(false, false));
  LIMN_TRY(passes.find_edges_,
           ComputePass::link({.shader = "edges.comp", .reads = {light}, .writes = {work_list}}));
  return passes;
}

Status PartsPasses::link_programs(bool is_shadowed, bool is_painted) {
  std::optional<Both>& programs = programs_[is_shadowed ? 1 : 0][is_painted ? 1 : 0];
  if (programs) return {};
  const Defines shadow = is_shadowed ? Defines{Define::contact_shadow} : Defines{};
  LIMN_TRY(programs, Both::link((is_painted ? finish_defines_ : shading_defines_) + shadow));
  return {};
}

Status PartsPasses::link_shadowed() { return link_programs(true, false); }

auto PartsPasses::Both::link(Defines defines) -> Result<Both> {
  using enum Resource;
  std::vector<Resource> rays = {scene, viewpoints, lens}, parts = {room_light, composite_weights},
                        view = {room_light, albedo};
  parts.insert(parts.end(), rays.begin(), rays.end());
  view.insert(view.end(), rays.begin(), rays.end());
  if (defines.contains(Define::contact_shadow))
    for (std::vector<Resource>* reads : {&parts, &view}) reads->push_back(contact_shadow);
  Both out;
  const std::pair<ComputePass*, Pass::Description> steps[] = {
      {&out.parts.find_candidates, {"parts_candidates.comp", defines, rays, {work_list}}},
      {&out.parts.centre, {"parts_centre.comp", defines, parts, {target}}},
      {&out.parts.edges, {"parts_edges.comp", defines, parts, {target, deferred_list}}},
      {&out.view.find_candidates, {"view_candidates.comp", defines, rays, {work_list}}},
      {&out.view.centre, {"view_centre.comp", defines, view, {target}}},
      {&out.view.edges, {"view_edges.comp", defines, view, {target}}}};
  for (const auto& [pass, description] : steps) {
    LIMN_TRY(*pass, ComputePass::link(description));
  }
  LIMN_TRY(out.parts.edges_deferred,
           ComputePass::link({"parts_edges_deferred.comp", defines, parts, {target}}));
  return out;
}

void PartsPasses::draw(What what,
                       const Target& target,
                       const std::vector<cv::Rect>& places,
                       const Smoothing& smoothing,
                       const Resources& resources_in,
                       PassTimes* times) {
  if (what.is_painted) LIMN_CHECK(link_programs(what.is_shadowed, true).ok());
  Both& both = *programs_[what.is_shadowed ? 1 : 0][what.is_painted ? 1 : 0];
  const Steps& steps = what.is_view ? both.view : both.parts;
  // Where places overlap, pixels are listed more than once.
  const int room = target.size.area() * static_cast<int>(std::max<std::size_t>(1, places.size()));
  const ImageAt drawn(k_target_image, target.light, GL_RGBA32F);
  const TextureAt light(k_light_unit, target.light);
  const Resources resources = resources_in.with(Resource::target, drawn)
                                  .with(Resource::light, light)
                                  .with(Resource::work_list, work_list_)
                                  .with(Resource::deferred_list, deferred_list_);
  {
    const PassTimes::Scope scope(times, "where there may be light");
    work_list_.start(room);
    steps.find_candidates.run_over_rects(places, resources);
  }
  {
    const PassTimes::Scope scope(times, "light at pixel centres");
    steps.centre.run_over_list(work_list_, resources);
  }
  {
    const PassTimes::Scope scope(times, "where edges are");
    find_edges_.program().set("u_least_step", static_cast<float>(smoothing.least_step));
    work_list_.start(room);
    find_edges_.run_over_rects(places, resources);
  }
  const PassTimes::Scope scope(times, "light at edges");
  steps.edges.program().set("u_samples", smoothing.samples);
  deferred_list_.start(room);
  steps.edges.run_over_list(work_list_, resources);
  if (!steps.edges_deferred) return;
  steps.edges_deferred->program().set("u_samples", smoothing.samples);
  steps.edges_deferred->run_over_list(deferred_list_, resources);
}

}  // namespace limn::projector
