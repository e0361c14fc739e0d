#include "projector/projector_view.h"

#include <algorithm>
#include <limits>
#include <opencv2/imgproc.hpp>

#include "projector/bindings.h"
#include "projector/changed_lines.h"
#include "projector/renderer.h"

namespace limn::projector {
namespace {

constexpr int k_response_columns = 1025;
// Around a changed rectangle light is drawn, too, because edges are found by the neighbours of a pixel.
constexpr int k_beside_px = 2;
// Anti-aliasing of the edges of light: for still images, for moving images, and for even black, whose steps
// are very small.
constexpr Smoothing k_light_edges, k_quick_edges{.samples = 4},
    k_dark_edges{.samples = 16, .least_step = 0.0001};

const ProjectorResponse* find_response(const Rig& rig, const std::string& projector) {
  const auto found = std::find_if(rig.responses.begin(), rig.responses.end(),
                                  [&](const ProjectorResponse& r) { return r.projector == projector; });
  return found == rig.responses.end() ? nullptr : &*found;
}

cv::Rect grown(const cv::Rect& rect, int px) {
  return {rect.x - px, rect.y - px, rect.width + 2 * px, rect.height + 2 * px};
}

// Limits the places to a rectangle.
void keep_inside(const cv::Rect& rect, PlacesByMode* places) {
  for (std::vector<cv::Rect>* each : {&places->view, &places->surface, &places->both}) {
    for (cv::Rect& place : *each) place &= rect;
    std::erase_if(*each, [](const cv::Rect& place) { return place.empty(); });
  }
}

}  // namespace

ProjectorView::HitCache::HitCache(int width, int height)
    : hits_(make_texture(GL_TEXTURE_2D, GL_RGBA32UI, width, height)),
      shares_(make_texture(GL_TEXTURE_2D, GL_RGBA32F, width, height)) {
  glClearTexImage(*hits_, 0, GL_RGBA_INTEGER, GL_UNSIGNED_INT, nullptr);
}

void ProjectorView::HitCache::bind(const Use& use) const {
  glBindImageTexture(k_cached_hits_image, *hits_, 0, GL_FALSE, 0, GL_READ_WRITE, GL_RGBA32UI);
  glBindImageTexture(k_cached_shares_image, *shares_, 0, GL_FALSE, 0, GL_READ_WRITE, GL_RGBA32F);
  use.program.set_id("u_cache_stamp", stamp_);
}

bool ProjectorView::CachedImage::is_valid_for(const scene::PosedScene& posed_now,
                                              const Imager& viewer) const {
  return is_current && is_same(posed, posed_now) && is_same(imager_from_world, viewer.imager_from_world);
}

void ProjectorView::CachedImage::mark_valid_for(const scene::PosedScene& posed_now, const Imager& viewer) {
  posed = posed_now;
  imager_from_world = viewer.imager_from_world;
  image.release();
  is_current = true;
}

Result<ProjectorView> ProjectorView::create(const Shared& shared) {
  using enum Resource;
  ProjectorView view(shared);
  LIMN_TRY_STATUS(view.link_light(false, false));
  LIMN_TRY(view.response_pass_, ComputePass::link({.shader = "light_response.comp",
                                                   .reads = {viewpoints, projector, light, response},
                                                   .writes = {target}}));
  LIMN_TRY(view.points_pass_,
           FullscreenPass::link({.shader = "points.frag", .reads = {scene, viewpoints, lens, projector}}));
  LIMN_TRY(view.blend_pass_,
           FullscreenPass::link(
               {.shader = "blend.frag", .reads = {scene, viewpoints, occlusion, lens, projector}}));
  for (const Imager& imager : shared.rig.projectors) {
    view.responses_.push_back(make_texture(GL_TEXTURE_2D, GL_RGB32F, k_response_columns, 1));
    upload(view.responses_.back(),
           response_table(find_response(shared.rig, imager.name), k_response_columns));
  }
  return view;
}

// Links the programs for a bare prototype, or those for one with a finish or lines.
Status ProjectorView::link_light(bool by_measurement, bool is_painted) {
  std::optional<LightPasses>& passes = light_passes_[by_measurement ? 1 : 0][is_painted ? 1 : 0];
  if (passes) return {};
  const GpuScene& scene = shared_.scene.scene();
  LIMN_TRY(passes,
           LightPasses::link(is_painted ? scene.finish_defines() : scene.shading_defines(), by_measurement));
  return {};
}

Status ProjectorView::link_measured() { return link_light(true, false); }

void ProjectorView::invalidate() {
  for (CachedImage& cached : cached_images_) cached.is_current = false;
}

// Whether to use half the samples. Never with even black: its light begins and ends within a pixel, and the
// change would be visible.
bool ProjectorView::is_quick() const { return quick_motion_ && !shared_.balance.options().even_black; }

const Smoothing& ProjectorView::smoothing(bool is_quick) const {
  if (shared_.balance.options().even_black) return k_dark_edges;
  return is_quick ? k_quick_edges : k_light_edges;
}

LightPasses& ProjectorView::light_passes() {
  const bool by_measurement = shared_.balance.options().compensation == Compensation::measured;
  const bool is_painted = shared_.scene.is_painted();
  if (is_painted) LIMN_CHECK(link_light(by_measurement, true).ok());
  return *light_passes_[by_measurement ? 1 : 0][is_painted ? 1 : 0];
}

// Finds where there may be light: at the parts, or on the whole prototype with even black, a finish or lines.
void ProjectorView::find_places(std::size_t index, const Imager& viewer) {
  const SceneCache& scene = shared_.scene;
  if (shared_.balance.options().even_black || scene.is_painted()) {
    light_places_.clear();
    light_places_.both.push_back(
        scene.visibility().prototype_rect(index, scene.runs(), scene.scene_from_world()));
    return;
  }
  const Eigen::Vector3d p_viewer_scene =
      (scene.scene_from_world() * viewer.imager_from_world.inverse()).translation;
  scene.visibility().light_rects(index, scene.runs(), scene.scene_from_world(), p_viewer_scene, &view_places_,
                                 &surface_places_);
  light_places_.divide(view_places_, surface_places_);
}

// The rectangle in which the projector's image differs from the last one: that of changed lines if nothing
// else has changed, else the whole image.
cv::Rect ProjectorView::changed_rect(std::size_t index,
                                     const scene::PosedScene& posed,
                                     const Imager& viewer) const {
  const CachedImage& cached = cached_images_[index];
  const Imager& imager = shared_.rig.projectors[index];
  const cv::Rect whole(0, 0, imager.width, imager.height);
  if (!cached.is_current || cached.is_quick != is_quick() || !cached.is_painted ||
      !shared_.scene.is_painted() || !posed.world_from_prototype ||
      !is_same(cached.imager_from_world, viewer.imager_from_world))
    return whole;
  const auto boxes = changed_lines(cached.posed, posed);
  return boxes ? rect_around(*boxes, *posed.world_from_prototype, imager).value_or(whole) : whole;
}

GLuint ProjectorView::draw(std::size_t index, const scene::PosedScene& posed, const Imager& viewer) {
  LIMN_CHECK(index < cached_images_.size());
  CachedImage& cached = cached_images_[index];
  if (cached.is_valid_for(posed, viewer) && cached.is_quick == is_quick()) return *cached.display.texture;

  const Imager& imager = shared_.rig.projectors[index];
  SceneCache& scene = shared_.scene;
  scene.prepare(posed, SceneCache::FromProjectors::all);
  scene.draw_from_viewer(viewer);
  shared_.balance.find_level(shared_.rig, posed);
  find_places(index, viewer);
  const cv::Rect changed = changed_rect(index, posed, viewer), whole(0, 0, imager.width, imager.height);
  cached.is_quick = is_quick();
  cached.is_painted = scene.is_painted();
  if (changed != whole) keep_inside(grown(changed, k_beside_px), &light_places_);

  if (!cached.display.texture) {
    cached.display = Canvas(imager.width, imager.height, GL_RGBA8);
    cached.hit_cache = HitCache(imager.width, imager.height);
  }
  const Canvas& light = shared_.canvases.canvas(imager.width, imager.height, GL_RGBA32F);
  const ProjectorIndex projector(index);
  const Resources resources = scene.resources(scene.projector_lens(index), viewer)
                                  .with(Resource::projector, projector)
                                  .with(Resource::hit_cache, cached.hit_cache)
                                  .with(Resource::light_balance, shared_.balance);
  draw_light(index, light, resources);
  draw_display(index, changed, light, resources);
  cached.mark_valid_for(posed, viewer);
  return *cached.display.texture;
}

void ProjectorView::draw_light(std::size_t index, const Canvas& light, const Resources& resources) {
  CachedImage& cached = cached_images_[index];
  const GLuint stamp = shared_.scene.stamp();
  cached.hit_cache.begin(stamp);
  light_passes().draw({light.texture, {light.width, light.height}, cached.hit_cache.is_outdated(stamp)},
                      light_places_, smoothing(cached.is_quick), resources, &shared_.times);
  cached.hit_cache.end();
}

// Converts the light to display values.
void ProjectorView::draw_display(std::size_t index,
                                 const cv::Rect& changed,
                                 const Canvas& light,
                                 const Resources& resources) {
  const PassTimes::Scope scope(&shared_.times, "response");
  const LightOptions& options = shared_.balance.options();
  const GlName& display = cached_images_[index].display.texture;
  const TextureAt linear(k_light_unit, light.texture), response(k_response_unit, responses_[index]);
  const ImageAt drawn(k_target_image, display, GL_RGBA8);
  response_pass_.program().set("u_is_balanced",
                               options.compensation != Compensation::none || options.even_black);
  response_pass_.program().set("u_first", changed.x, changed.y);
  response_pass_.program().set("u_end", changed.br().x, changed.br().y);
  glClearTexSubImage(*display, 0, changed.x, changed.y, 0, changed.width, changed.height, 1, GL_RGBA,
                     GL_UNSIGNED_BYTE, nullptr);
  light_passes().run_over_drawn_pixels(response_pass_, resources.with(Resource::light, linear)
                                                           .with(Resource::response, response)
                                                           .with(Resource::target, drawn));
}

cv::Mat ProjectorView::image(std::size_t index, const scene::PosedScene& posed, const Imager& viewer) {
  draw(index, posed, viewer);
  CachedImage& cached = cached_images_[index];
  if (cached.image.empty()) {
    const Canvas& display = cached.display;
    const cv::Mat bgra = read_back(display.framebuffer, display.width, display.height, CV_8UC4, GL_BGRA);
    cv::cvtColor(bgra, cached.image, cv::COLOR_BGRA2BGR);
    cv::extractChannel(bgra, cached.clipped, 3);
  }
  return cached.image.clone();
}

cv::Mat ProjectorView::surface_points(std::size_t index, const scene::PosedScene& posed) {
  LIMN_CHECK(index < cached_images_.size());
  const Imager& imager = shared_.rig.projectors[index];
  shared_.scene.prepare(posed, SceneCache::FromProjectors::prototype);
  const Canvas& canvas = shared_.canvases.canvas(imager.width, imager.height, GL_RGBA32F);
  const ProjectorIndex projector(index);
  points_pass_.draw(
      canvas,
      shared_.scene.resources(shared_.scene.projector_lens(index)).with(Resource::projector, projector));
  const cv::Mat points = read_back(canvas.framebuffer, imager.width, imager.height, CV_32FC4, GL_RGBA);
  cv::Mat out(points.size(), CV_32FC3, cv::Scalar::all(std::numeric_limits<double>::quiet_NaN()));
  for (int row = 0; row < out.rows; ++row) {
    for (int column = 0; column < out.cols; ++column) {
      const auto& p = points.at<cv::Vec4f>(row, column);
      if (p[3] > 0) out.at<cv::Vec3f>(row, column) = {p[0], p[1], p[2]};
    }
  }
  return out;
}

cv::Mat ProjectorView::blend(std::size_t index, const scene::PosedScene& posed) {
  LIMN_CHECK(index < cached_images_.size());
  const Imager& imager = shared_.rig.projectors[index];
  shared_.scene.prepare(posed, SceneCache::FromProjectors::all);
  const Canvas& canvas = shared_.canvases.canvas(imager.width, imager.height, GL_RG32F);
  const ProjectorIndex projector(index);
  blend_pass_.draw(
      canvas,
      shared_.scene.resources(shared_.scene.projector_lens(index)).with(Resource::projector, projector));
  return read_back(canvas.framebuffer, imager.width, imager.height, CV_32FC2, GL_RG);
}

}  // namespace limn::projector
