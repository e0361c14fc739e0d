#include "projector/scene_cache.h"

#include <algorithm>

namespace limn::projector {
bool is_same(const PlacedRun& a, const PlacedRun& b) {
  return a.owner == b.owner && a.run == b.run && is_same(a.scene_from_owner, b.scene_from_owner) &&
         a.material == b.material && a.finish == b.finish && a.lines == b.lines && a.cut == b.cut &&
         a.deviation == b.deviation && a.volume == b.volume;
}

bool is_same_lens(const Imager& a, const Imager& b) {
  return a.width == b.width && a.height == b.height && a.lens.model == b.lens.model &&
         a.lens.values == b.lens.values;
}

Result<SceneCache> SceneCache::create(const scene::Scene& scene, const Rig& rig, PassTimes* times) {
  LIMN_TRY_STATUS(GpuScene::check_fits(scene, GpuScene::most_triangles()));
  LIMN_TRY_STATUS(VolumeStack::check_fits(scene));
  LIMN_TRY(VisibilityBuffers visibility, VisibilityBuffers::create(rig, scene.section.has_value()));
  return SceneCache(scene, rig, std::move(visibility), times);
}

SceneCache::SceneCache(const scene::Scene& scene,
                       const Rig& rig,
                       VisibilityBuffers visibility,
                       PassTimes* times)
    : scene_(scene),
      visibility_(std::move(visibility)),
      occlusion_(rig.projectors.size()),
      room_lighting_(scene),
      times_(times) {}

void SceneCache::prepare(const scene::PosedScene& posed, FromProjectors needed) {
  if (!prepared_ || !is_same(*prepared_, posed)) {
    const bool stays = prepared_ && is_same_prototype(*prepared_, posed);
    const bool are_ids_same = prepared_ && is_same_without_lines(*prepared_, posed);
    scene_.place_lines(posed);
    scene_.placed(posed, &runs_);
    scene_from_world_ = GpuScene::scene_from_world(posed);
    scene_.place(runs_);
    if (!stays) ++prototype_moves_;
    is_prototype_drawn_ &= stays;
    are_soft_edges_drawn_ &= stays;
    are_surface_parts_drawn_ &= are_ids_same;
    if (!are_ids_same) viewpoint_kind_ = ViewpointKind::none;
    prepared_ = posed;
  }
  scene_.cut_prototype(false);
  const bool all = needed == FromProjectors::all;
  if (needed == FromProjectors::nothing || (is_prototype_drawn_ && !all) ||
      (are_soft_edges_drawn_ && are_surface_parts_drawn_))
    return;
  const PassTimes::Scope scope(times_, "ids from projectors");
  if (!is_prototype_drawn_ || (all && !are_soft_edges_drawn_)) {
    visibility_.draw_prototype_from_projectors(scene_, runs_, scene_from_world_, all);
    is_prototype_drawn_ = true;
    are_soft_edges_drawn_ = all;
  }
  if (!all) return;
  visibility_.draw_surface_parts_from_projectors(scene_, runs_, scene_from_world_);
  are_surface_parts_drawn_ = true;
}

void SceneCache::set_deviation(const scene::DeviationLayer& layer) {
  scene_.set_deviation(layer);
  prepared_.reset();
}

bool SceneCache::is_painted() const {
  return std::any_of(runs_.begin(), runs_.end(),
                     [](const PlacedRun& run) { return run.finish >= 0 || run.lines != 0; });
}

void SceneCache::draw_from_viewer(const Imager& viewer) {
  if (viewpoint_kind_ == ViewpointKind::viewer &&
      is_same(viewpoint_imager_.imager_from_world, viewer.imager_from_world))
    return;
  const Pose scene_from_viewer = scene_from_world_ * viewer.imager_from_world.inverse();
  const PassTimes::Scope scope(times_, "ids from the viewer");
  visibility_.draw_from_viewer(scene_, runs_, scene_from_world_, scene_from_viewer.translation,
                               scene_from_viewer.rotation * -Eigen::Vector3d::UnitY());
  viewpoint_kind_ = ViewpointKind::viewer;
  viewpoint_imager_ = viewer;
}

bool SceneCache::is_drawn_from(ViewpointKind kind, const Imager& imager) const {
  return viewpoint_kind_ == kind && is_same_lens(viewpoint_imager_, imager) &&
         is_same(viewpoint_imager_.imager_from_world, imager.imager_from_world);
}

void SceneCache::draw_from_imager(const Imager& imager) {
  if (is_drawn_from(ViewpointKind::imager, imager)) return;
  const PassTimes::Scope scope(times_, "ids from a camera");
  visibility_.draw_from_imager(scene_, runs_, scene_from_world_, imager, lens_of(imager).baked);
  viewpoint_kind_ = ViewpointKind::imager;
  viewpoint_imager_ = imager;
}

void SceneCache::draw_from_imager_over(const Imager& imager,
                                       const std::vector<PlacedRun>& over,
                                       double around_m,
                                       bool cuts_prototype) {
  const auto is_equal = [](const PlacedRun& a, const PlacedRun& b) { return is_same(a, b); };
  scene_.cut_prototype(cuts_prototype);
  if (is_drawn_from(ViewpointKind::places_of_imager, imager) && viewpoint_around_m_ == around_m &&
      viewpoint_cuts_prototype_ == cuts_prototype && std::ranges::equal(viewpoint_over_, over, is_equal))
    return;
  const PassTimes::Scope scope(times_, "ids from a camera");
  visibility_.draw_from_imager_over(scene_, runs_, scene_from_world_, imager, lens_of(imager).baked, over,
                                    around_m);
  viewpoint_kind_ = ViewpointKind::places_of_imager;
  viewpoint_imager_ = imager;
  viewpoint_over_ = over;
  viewpoint_around_m_ = around_m;
  viewpoint_cuts_prototype_ = cuts_prototype;
}

void SceneCache::draw_from_reference_camera(const Imager& camera) {
  visibility_.draw_from_reference_camera(scene_, runs_, scene_from_world_, camera, lens_of(camera).baked);
}

const GpuLens& SceneCache::lens_of(const Imager& imager) {
  for (const auto& [known, lens] : lenses_) {
    if (is_same_lens(known, imager)) return lens;
  }
  constexpr std::size_t k_most = 8;  // cameras and viewers of a session
  if (lenses_.size() >= k_most) lenses_.erase(lenses_.begin());
  return lenses_.emplace_back(imager, GpuLens(imager)).second;
}

Resources SceneCache::resources(const GpuLens& lens) const {
  return Resources()
      .with(Resource::scene, scene_)
      .with(Resource::viewpoints, visibility_)
      .with(Resource::occlusion, occlusion_)
      .with(Resource::lens, lens);
}

Resources SceneCache::resources(const GpuLens& lens, const Imager& viewer) {
  room_lighting_.place(*prepared_, scene_from_world_, viewer);
  return resources(lens).with(Resource::room_light, room_lighting_);
}

}  // namespace limn::projector
