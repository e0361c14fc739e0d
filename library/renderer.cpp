#include "limn/renderer.h"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>

#include "core/log.h"
#include "core/names.h"
#include "library/body_conversion.h"
#include "library/convert.h"
#include "library/own_context.h"
#include "projector/renderer.h"
#include "scene/posed_scene.h"
#include "scene/scene.h"
#include "tracker/family.h"
#include "tracker/marker_light.h"

namespace limn::LIMN_VERSIONED {

struct Scene::Impl {
  limn::scene::Scene scene;
};

namespace {

PosedScene to_public(const limn::scene::PosedScene& posed) {
  PosedScene out;
  if (posed.world_from_prototype)
    out.world_from_prototype = LIMN_VERSIONED::to_public(*posed.world_from_prototype);
  for (const limn::scene::PosedPart& part : posed.parts)
    out.parts.push_back({part.slot, part.variant, LIMN_VERSIONED::to_public(part.world_from_part)});
  for (const limn::scene::Viewpoint& viewpoint : posed.viewpoints)
    out.viewpoints.push_back(
        {viewpoint.viewer, LIMN_VERSIONED::to_public(viewpoint.p_world), viewpoint.weight});
  return out;
}

// Error: a slot or a variant that the scene lacks.
limn::scene::PosedScene to_room(const PosedScene& posed, const limn::scene::Scene& scene) {
  limn::scene::PosedScene out;
  if (posed.world_from_prototype)
    out.world_from_prototype = LIMN_VERSIONED::to_room(*posed.world_from_prototype);
  for (const PosedPart& part : posed.parts) {
    const limn::scene::Slot* const slot = scene.find_slot(part.slot);
    if (!slot)
      throw Error(fmt::format("posed scene: expected a slot of the scene ({}), found '{}'.",
                              limn::joined_names(scene.slots), part.slot));
    if (!limn::find_named(slot->variants, part.variant))
      throw Error(fmt::format("posed scene: expected a variant of slot '{}' ({}), found '{}'.", part.slot,
                              limn::joined_names(slot->variants), part.variant));
    out.parts.push_back({part.slot, part.variant, LIMN_VERSIONED::to_room(part.world_from_part)});
  }
  for (const Viewpoint& viewpoint : posed.viewpoints)
    out.viewpoints.push_back(
        {viewpoint.viewer, LIMN_VERSIONED::to_room(viewpoint.p_world), viewpoint.weight});
  return out;
}

}  // namespace

Scene::Scene(std::shared_ptr<const Impl> impl) : impl_(std::move(impl)) {}

Scene Scene::load(const std::filesystem::path& path) {
  return Scene(std::make_shared<const Impl>(Impl{value_of(limn::scene::load_usable_scene(path))}));
}

bool Scene::has_prototype() const { return impl_->scene.prototype.has_value(); }

std::vector<Slot> Scene::slots() const {
  std::vector<Slot> list;
  for (const limn::scene::Slot& slot : impl_->scene.slots) {
    list.push_back({slot.name, {}});
    for (const limn::scene::Variant& variant : slot.variants) list.back().variants.push_back(variant.name);
  }
  return list;
}

std::vector<Body> Scene::bodies() const { return public_of(limn::scene::bodies(impl_->scene)); }

std::vector<std::string> Scene::families() const {
  return limn::tracker::families_of(limn::scene::bodies(impl_->scene));
}

std::filesystem::path Scene::folder() const { return impl_->scene.folder; }

PosedScene Scene::posed(std::span<const Track> tracks, std::span<const std::string> variants) const {
  std::vector<limn::Track> list;
  for (const Track& track : tracks) list.push_back(room_of(track));
  return to_public(limn::scene::posed(impl_->scene, list, variants));
}

PosedScene Scene::load_poses(const std::filesystem::path& path) const {
  return to_public(value_of(limn::scene::load_poses(path, impl_->scene)));
}

Imager Scene::viewer(const PosedScene& posed, const Rig& rig) const {
  const std::vector<limn::Imager>& cameras = LIMN_VERSIONED::to_room(rig).cameras;
  const Eigen::Vector3d d_up_world =
      cameras.empty() ? Eigen::Vector3d(0, -1, 0)
                      : cameras[0].imager_from_world.rotation.inverse() * Eigen::Vector3d(0, -1, 0);
  if (auto viewer = limn::scene::viewer_of(impl_->scene, to_room(posed, impl_->scene), d_up_world))
    return LIMN_VERSIONED::to_public(std::move(*viewer));
  if (cameras.empty())
    throw Error("viewer: expected a viewer of the scene or a camera of the rig, found neither.");
  return LIMN_VERSIONED::to_public(cameras[0]);
}

namespace {

void check_size(const char* what, int width, int height) {
  if (width < 1 || height < 1 || std::max(width, height) > limn::k_max_side)
    throw Error(fmt::format("renderer: expected {} with a size of 1 to {} pixels a side, found {}x{}.", what,
                            limn::k_max_side, width, height));
}

}  // namespace

struct Renderer::Impl {
  std::optional<OwnContext> context;
  std::unique_ptr<limn::projector::Renderer> renderer;
  Scene scene;
  Rig rig;
  limn::tracker::MarkerLight marker_light = limn::tracker::MarkerLight::as_is;
  std::string gl_description = {};

  Impl(const Scene& drawn, const Rig& drawn_for) : scene(drawn), rig(drawn_for) {}
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  // What is in the context ends in it. Where it cannot be current (another thread draws with it), that
  // memory is lost, which is better than to end objects of the caller's context with the same numbers.
  ~Impl() {
    try {
      const OwnContext::Scope scope = current();
      renderer.reset();
    } catch (const std::exception&) {
      static_cast<void>(renderer.release());
    }
  }

  // The headless context is current as long as the result exists.
  OwnContext::Scope current() const { return OwnContext::Scope(context ? &*context : nullptr); }

  const limn::scene::Scene& room_scene() const { return scene.impl().scene; }
  limn::scene::PosedScene room_of(const PosedScene& posed) const { return to_room(posed, room_scene()); }

  const limn::Imager& projector(std::size_t index) const {
    const auto& projectors = LIMN_VERSIONED::to_room(rig).projectors;
    if (index < projectors.size()) return projectors[index];
    throw Error(fmt::format("renderer: expected a projector below {} ({}), found {}.", projectors.size(),
                            limn::joined_names(projectors), index));
  }

  const limn::Imager& camera(std::size_t index) const {
    const auto& cameras = LIMN_VERSIONED::to_room(rig).cameras;
    if (index < cameras.size()) return cameras[index];
    throw Error(fmt::format("renderer: expected a camera below {} ({}), found {}.", cameras.size(),
                            limn::joined_names(cameras), index));
  }

  cv::Mat projector_image(std::size_t index, const PosedScene& posed, const Imager& viewer) {
    const limn::Imager& shown_by = projector(index);
    const limn::scene::PosedScene room = room_of(posed);
    const OwnContext::Scope scope = current();
    cv::Mat image = renderer->projector_image(index, room, LIMN_VERSIONED::to_room(viewer));
    if (marker_light == limn::tracker::MarkerLight::as_is) return image;
    const cv::Mat mask = limn::tracker::marker_mask(shown_by, limn::scene::bodies(room_scene()),
                                                    limn::scene::tracks_of(room_scene(), room));
    return limn::tracker::with_marker_light(image, mask, marker_light);
  }

  cv::Mat composite(std::size_t index, const ImageView& image, const PosedScene& posed, Composite what) {
    const limn::Imager& taken_by = camera(index);
    if (image.width != taken_by.width || image.height != taken_by.height)
      throw Error(fmt::format("composite: expected an image of {}'s size {}x{}, found {}x{}.", taken_by.name,
                              taken_by.width, taken_by.height, image.width, image.height));
    const cv::Mat behind = bgr_or_grey_of(image);
    const limn::scene::PosedScene room = room_of(posed);
    const OwnContext::Scope scope = current();
    return renderer->composite(
        index, behind, room,
        what == Composite::full ? limn::projector::Composite::full : limn::projector::Composite::rest);
  }
};

namespace {

limn::tracker::MarkerLight to_room(MarkerLight how) {
  switch (how) {
    case MarkerLight::as_is:
      return limn::tracker::MarkerLight::as_is;
    case MarkerLight::keep_out:
      return limn::tracker::MarkerLight::keep_out;
    case MarkerLight::spotlight:
      return limn::tracker::MarkerLight::spotlight;
  }
  throw Error("marker light: expected as_is, keep_out or spotlight, found another number.");
}

}  // namespace

Renderer::Renderer(const Scene& scene, const Rig& rig, const RendererOptions& options)
    : impl_(std::make_unique<Impl>(scene, rig)) {
  impl_->marker_light = to_room(options.marker_light);
  const limn::Rig& room_rig = LIMN_VERSIONED::to_room(rig);
  for (const limn::Imager& projector : room_rig.projectors)
    check_size(("projector '" + projector.name + "'").c_str(), projector.width, projector.height);
  if (options.context == GlContext::headless) {
    impl_->context.emplace();
    impl_->gl_description = impl_->context->description();
  }
  const OwnContext::Scope scope = impl_->current();
  impl_->renderer = std::make_unique<limn::projector::Renderer>(
      value_of(limn::projector::Renderer::create(impl_->room_scene(), room_rig)));
  limn::projector::LightOptions light;
  if (options.compensate_geometry) light.compensation = limn::projector::Compensation::geometry;
  light.even_black = options.even_black;
  throw_error(impl_->renderer->set_light(light));
}

Renderer::Renderer(Renderer&&) noexcept = default;
Renderer& Renderer::operator=(Renderer&&) noexcept = default;
Renderer::~Renderer() = default;

const std::string& Renderer::gl_description() const { return impl_->gl_description; }

Image Renderer::draw_projector(std::size_t projector, const PosedScene& posed, const Imager& viewer) {
  return rgb_of(impl_->projector_image(projector, posed, viewer));
}

void Renderer::draw_projector(std::size_t projector,
                              const PosedScene& posed,
                              const Imager& viewer,
                              const MutableImageView& out) {
  write_bgr(impl_->projector_image(projector, posed, viewer), out);
}

unsigned Renderer::draw_projector_texture(std::size_t projector,
                                          const PosedScene& posed,
                                          const Imager& viewer) {
  impl_->projector(projector);
  if (impl_->context)
    throw Error(
        "renderer: a texture of the headless context cannot be used elsewhere. Create the renderer in your "
        "context (GlContext::current), or call draw_projector.");
  return impl_->renderer->draw_projector(projector, impl_->room_of(posed), LIMN_VERSIONED::to_room(viewer));
}

Image Renderer::draw_composite(std::size_t camera,
                               const ImageView& image,
                               const PosedScene& posed,
                               Composite what) {
  return rgb_of(impl_->composite(camera, image, posed, what));
}

void Renderer::draw_composite(std::size_t camera,
                              const ImageView& image,
                              const PosedScene& posed,
                              Composite what,
                              const MutableImageView& out) {
  write_bgr(impl_->composite(camera, image, posed, what), out);
}

Image Renderer::draw_view(const Imager& camera, const PosedScene& posed) {
  check_size("a camera", camera.width(), camera.height());
  const limn::scene::PosedScene room = impl_->room_of(posed);
  const OwnContext::Scope scope = impl_->current();
  const cv::Scalar background(40, 36, 34);  // a dark room, as limn render --view draws it
  return rgb_of(impl_->renderer->view(LIMN_VERSIONED::to_room(camera), room, background));
}

}  // namespace limn::LIMN_VERSIONED
