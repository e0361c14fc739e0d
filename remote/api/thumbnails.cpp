#include "remote/api/thumbnails.h"

#include "core/image_encoder.h"
#include "device/gl_context.h"
#include "session/drawing/thumbnail.h"

namespace limn::remote {
namespace {

constexpr int k_side_px = 320;

}  // namespace

Result<std::shared_ptr<const std::string>> Thumbnails::png(const std::shared_ptr<const scene::Scene>& scene,
                                                           const std::string& slot,
                                                           const std::string& variant) {
  if (drawn_ != scene) {
    images_.clear();
    drawn_.reset();
    LIMN_TRY_STATUS(draw(*scene));
    drawn_ = scene;
  }
  const auto found = images_.find({slot, variant});
  if (found == images_.end()) return error("expected a slot and a variant of the scene, found others.");
  return found->second;
}

Status Thumbnails::draw(const scene::Scene& scene) {
  LIMN_TRY(const device::GlContext context, device::GlContext::create());
  LIMN_TRY(projector::Renderer renderer, projector::Renderer::create(scene, Rig{}));
  for (const scene::Slot& slot : scene.slots)
    for (const scene::Variant& variant : slot.variants) {
      images_[{slot.name, variant.name}] = std::make_shared<const std::string>(
          encode_png(session::draw_thumbnail(&renderer, scene, slot.name, variant.name, k_side_px)));
    }
  return {};
}

}  // namespace limn::remote
