#include "projector/imager_view.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "projector/bindings.h"
#include "projector/composite_policy.h"

namespace limn::projector {
namespace {

// The mask and shares of one part, counted in the output of coverage.frag.
PartCoverage counted(const scene::PosedPart& part, const cv::Mat& labels, std::uint8_t owner) {
  constexpr std::uint8_t k_projected = 2;  // as in shaders/part_coverage.glsl
  PartCoverage out{part.slot, part.variant, 0, 0, 0, cv::Mat::zeros(labels.size(), CV_8U)};
  int projected = 0;
  for (int row = 0; row < labels.rows; ++row) {
    for (int column = 0; column < labels.cols; ++column) {
      const auto& pixel = labels.at<cv::Vec2b>(row, column);
      if (pixel[0] != owner) continue;
      const bool is_projected = pixel[1] == k_projected;
      out.mask.at<std::uint8_t>(row, column) = is_projected ? 255 : 128;
      ++out.viewer_pixels;
      projected += is_projected;
    }
  }
  if (out.viewer_pixels > 0) {
    out.on_surface_share = static_cast<double>(projected) / out.viewer_pixels;
    out.off_surface_share = 1 - out.on_surface_share;
  }
  return out;
}

// Adds the meshes of `from` that `others` does not show in the same way.
void add_changed(const std::vector<PlacedRun>& from,
                 const std::vector<PlacedRun>& others,
                 std::vector<PlacedRun>* changed) {
  for (const PlacedRun& run : from)
    if (std::none_of(others.begin(), others.end(), [&](const PlacedRun& o) { return is_same(run, o); }))
      changed->push_back(run);
}

}  // namespace

CompositeWeights::CompositeWeights(Composite what) {
  if (what == Composite::full) bytes_.fill(~0U);
}

CompositeWeights::CompositeWeights(std::span<const CompositePolicy> policies,
                                   std::span<const std::string> slots) {
  for (std::size_t owner = 1; owner <= slots.size() && owner < 4 * bytes_.size(); ++owner)
    for (const CompositePolicy& treatment : policies)
      if (treatment.slot == slots[owner - 1])
        bytes_[owner / 4] |= static_cast<GLuint>(std::lround(255 * treatment.full_weight())) << owner % 4 * 8;
}

Result<ImagerView> ImagerView::create(const Shared& shared, const scene::Scene& scene_in) {
  using enum Resource;
  ImagerView view(shared);
  for (const scene::Slot& slot : scene_in.slots) view.slot_names_.push_back(slot.name);
  const GpuScene& gpu = shared.scene.scene();
  LIMN_TRY(view.parts_passes_, PartsPasses::link(gpu.shading_defines(), gpu.finish_defines()));
  LIMN_TRY(view.composite_pass_,
           FullscreenPass::link({.shader = "composite.frag", .reads = {light, camera_image}}));
  LIMN_TRY(view.coverage_pass_, FullscreenPass::link({.shader = "coverage.frag",
                                                      .defines = gpu.section_defines(),
                                                      .reads = {scene, viewpoints, lens}}));
  LIMN_TRY(view.illuminated_patches_pass_,
           FullscreenPass::link({.shader = "illuminated_patches.frag",
                                 .reads = {scene, viewpoints, occlusion, lens, projector}}));
  return view;
}

Status ImagerView::set_contact_shadow(const scene::Scene* scene) {
  const bool wanted = scene != nullptr;
  if (wanted) LIMN_TRY_STATUS(parts_passes_.link_shadowed());
  if (wanted && !contact_shadow_) contact_shadow_.emplace(*scene);
  if (has_contact_shadow_ != wanted)
    for (Overlay& overlay : overlays_) overlay.posed.reset();
  has_contact_shadow_ = wanted;
  return {};
}

bool ImagerView::Overlay::is_valid_for(const Imager& imager_now,
                                       const scene::PosedScene& posed_now,
                                       const CompositeWeights& weights_now) const {
  return posed && weights == weights_now && is_same(*posed, posed_now) &&
         is_same(imager.imager_from_world, imager_now.imager_from_world);
}

bool ImagerView::Overlay::keeps_other_pixels(const Imager& imager_now,
                                             const scene::PosedScene& posed_now,
                                             const CompositeWeights& weights_now) const {
  return posed && weights == weights_now && is_same_prototype(*posed, posed_now) &&
         posed->light == posed_now.light && posed->finish == posed_now.finish &&
         posed->deviation == posed_now.deviation &&
         is_same(imager.imager_from_world, imager_now.imager_from_world);
}

// The overlay drawn for this imager before, or a new one.
ImagerView::Overlay& ImagerView::overlay_of(const Imager& imager, bool is_view, Kind kind) {
  for (Overlay& overlay : overlays_)
    if (overlay.is_view == is_view && overlay.kind == kind && is_same_lens(overlay.imager, imager))
      return overlay;
  constexpr std::size_t k_most = 8;  // real and virtual cameras of a session
  if (overlays_.size() >= k_most) overlays_.erase(overlays_.begin());
  const int width = imager.width, height = imager.height;
  Overlay& overlay = overlays_.emplace_back();
  overlay.imager = imager;
  overlay.is_view = is_view;
  overlay.kind = kind;
  overlay.parts = Canvas(width, height, GL_RGBA32F);
  glClearTexImage(*overlay.parts.texture, 0, GL_RGBA, GL_FLOAT, nullptr);
  overlay.behind = make_texture(GL_TEXTURE_2D, GL_RGBA8, width, height);
  overlay.out = Canvas(width, height, GL_RGBA8);
  return overlay;
}

// Draws the parts as the imager sees them, and in a view the prototype, too. Where only parts have changed,
// only their old and new places are drawn again.
void ImagerView::draw_parts(const Imager& imager,
                            const scene::PosedScene& posed,
                            const CompositeWeights& weights,
                            Overlay* overlay) {
  SceneCache& scene = shared_.scene;
  const bool is_view = overlay->is_view;
  scene.prepare(posed, is_view ? SceneCache::FromProjectors::nothing : SceneCache::FromProjectors::prototype);
  const GpuLens& lens = scene.lens_of(imager);
  const bool sees_prototype = is_view || scene.is_painted();
  const double around_m = has_contact_shadow_ ? ContactShadow::k_reach : 0;
  const auto places_of = [&](const std::vector<PlacedRun>& runs) {
    return scene.visibility().visible_rects(imager, lens.baked, runs, scene.scene_from_world(),
                                            sees_prototype, around_m);
  };
  const cv::Size size(imager.width, imager.height);
  if (!overlay->keeps_other_pixels(imager, posed, weights)) {
    clear_light(overlay->parts.texture, size, overlay->places, 0);
    overlay->runs.clear();
  }
  std::vector<PlacedRun> changed;
  add_changed(scene.runs(), overlay->runs, &changed);
  add_changed(overlay->runs, scene.runs(), &changed);
  const std::vector<cv::Rect> places = without_overlaps(places_of(changed));
  clear_light(overlay->parts.texture, size, places, 0);
  if (!sees_prototype) std::erase_if(changed, [](const PlacedRun& run) { return run.owner == 0; });
  scene.draw_from_imager_over(imager, changed, around_m, is_view);
  Resources resources = scene.resources(lens, imager)
                            .with(Resource::albedo, shared_.balance.albedo())
                            .with(Resource::composite_weights, weights);
  if (has_contact_shadow_) {
    contact_shadow_->place(posed);
    resources = resources.with(Resource::contact_shadow, *contact_shadow_);
  }
  parts_passes_.draw(
      {.is_view = is_view, .is_shadowed = has_contact_shadow_, .is_painted = scene.is_painted()},
      {overlay->parts.texture, size}, places, smoothing_, resources, &shared_.times);
  overlay->runs = scene.runs();
  overlay->places = places_of(scene.runs());
  overlay->posed = posed;
  overlay->imager = imager;
  overlay->weights = weights;
}

// Draws the parts over an imager's image (BGR). The parts themselves are drawn again only if something has
// changed.
cv::Mat ImagerView::lay_over(const cv::Mat& bgr,
                             const Imager& imager,
                             const scene::PosedScene& posed,
                             const CompositeWeights& weights,
                             Overlay* overlay) {
  if (!overlay->is_valid_for(imager, posed, weights)) draw_parts(imager, posed, weights, overlay);
  cv::Mat out = bgr.clone();
  for (const cv::Rect& place : overlay->places) upload(overlay->behind, out, place);
  const TextureAt light(k_light_unit, overlay->parts.texture), behind(k_camera_image_unit, overlay->behind);
  {
    const PassTimes::Scope scope(&shared_.times, "over the image");
    composite_pass_.draw(overlay->out, overlay->places,
                         Resources().with(Resource::light, light).with(Resource::camera_image, behind));
  }
  for (const cv::Rect& place : overlay->places) read_back(overlay->out.framebuffer, place, &out);
  return out;
}

cv::Mat ImagerView::composite(const Imager& camera,
                              const cv::Mat& image,
                              const scene::PosedScene& posed,
                              Kind kind,
                              const CompositeWeights& weights) {
  LIMN_CHECK(image.cols == camera.width && image.rows == camera.height && image.depth() == CV_8U);
  cv::Mat bgr = image;
  if (image.channels() == 1) cv::cvtColor(image, bgr, cv::COLOR_GRAY2BGR);
  return lay_over(bgr, camera, posed, weights, &overlay_of(camera, false, kind));
}

cv::Mat ImagerView::view(const Imager& imager, const scene::PosedScene& posed, const cv::Scalar& background) {
  const cv::Mat plain(imager.height, imager.width, CV_8UC3, background);
  return lay_over(plain, imager, posed, {}, &overlay_of(imager, true, Kind::full));
}

std::vector<PartCoverage> ImagerView::coverage(const scene::PosedScene& posed, const Imager& viewer) {
  SceneCache& scene = shared_.scene;
  scene.prepare(posed, SceneCache::FromProjectors::prototype);
  scene.draw_from_imager(viewer);
  const Canvas& canvas = shared_.canvases.canvas(viewer.width, viewer.height, GL_RG8);
  const GpuLens& lens = scene.lens_of(viewer);
  coverage_pass_.draw(
      canvas,
      scene.visibility().visible_rects(viewer, lens.baked, scene.runs(), scene.scene_from_world(), false, 0),
      scene.resources(lens));
  const cv::Mat labels = read_back(canvas.framebuffer, viewer.width, viewer.height, CV_8UC2, GL_RG);
  std::vector<PartCoverage> out;
  for (const scene::PosedPart& part : posed.parts) {
    const auto slot = std::find(slot_names_.begin(), slot_names_.end(), part.slot);
    const auto owner = static_cast<std::uint8_t>(slot - slot_names_.begin() + 1);
    out.push_back(counted(part, labels, owner));
  }
  return out;
}

IlluminatedPatches ImagerView::illuminated_patches(const Imager& imager,
                                                   const scene::PosedScene& posed,
                                                   int side_px) {
  SceneCache& scene = shared_.scene;
  scene.prepare(posed, SceneCache::FromProjectors::prototype);
  scene.draw_from_imager(imager);
  const Canvas& canvas = shared_.canvases.canvas(std::max(1, imager.width / side_px),
                                                 std::max(1, imager.height / side_px), GL_RGBA32F);
  const Resources resources = scene.resources(scene.lens_of(imager));
  illuminated_patches_pass_.program().set("u_side", static_cast<float>(side_px));
  const auto drawn = [&](int index) {
    const ProjectorIndex projector(index);
    illuminated_patches_pass_.draw(canvas, resources.with(Resource::projector, projector));
    return read_back(canvas.framebuffer, canvas.width, canvas.height, CV_32FC4, GL_RGBA);
  };
  IlluminatedPatches patches{side_px, scene.scene_from_world(), drawn(-1), {}};
  for (std::size_t i = 0; i < shared_.rig.projectors.size(); ++i)
    patches.by_projector.push_back(drawn(static_cast<int>(i)));
  return patches;
}

}  // namespace limn::projector
