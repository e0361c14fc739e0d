#include "projector/renderer.h"

#include "projector/composite_policy.h"
#include "projector/imager_view.h"
#include "projector/projector_view.h"

namespace limn::projector {
namespace {

Status check_context() {
  if (epoxy_has_gl_extension("GL_ARB_direct_state_access") && epoxy_gl_version() >= 45) return {};
  return error("OpenGL: expected a current context of version 4.5 or later, found version {}.{}.",
               epoxy_gl_version() / 10, epoxy_gl_version() % 10);
}

ImagerView::Kind kind_of(Composite what) {
  return what == Composite::full ? ImagerView::Kind::full : ImagerView::Kind::rest;
}

}  // namespace

struct Renderer::Impl {
  // The objects that the views share.
  struct Base {
    Rig rig;
    std::unique_ptr<PassTimes> times;
    SceneCache scene;
    LightBalance balance;
    CanvasPool canvases;

    Shared shared() { return {rig, scene, balance, canvases, *times}; }
  };
  std::unique_ptr<Base> base;
  ProjectorView projectors;
  ImagerView imagers;

  const Imager& camera(std::size_t index) const {
    LIMN_CHECK(index < base->rig.cameras.size());
    return base->rig.cameras[index];
  }
};

Renderer::Renderer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Renderer::Renderer(Renderer&&) noexcept = default;
Renderer& Renderer::operator=(Renderer&&) noexcept = default;
Renderer::~Renderer() = default;

Result<Renderer> Renderer::create(const scene::Scene& scene, const Rig& rig) {
  LIMN_TRY_STATUS(check_context());
  forget_gl_errors();
  auto times = std::make_unique<PassTimes>();
  LIMN_TRY(SceneCache cache, SceneCache::create(scene, rig, times.get()));
  LIMN_TRY(LightBalance balance, LightBalance::create(scene));
  auto base = std::make_unique<Impl::Base>(
      Impl::Base{rig, std::move(times), std::move(cache), std::move(balance), {}});
  LIMN_TRY(ProjectorView projectors, ProjectorView::create(base->shared()));
  LIMN_TRY(ImagerView imagers, ImagerView::create(base->shared(), scene));
  LIMN_TRY_STATUS(check_gl_memory("the scene"));
  return Renderer(std::make_unique<Impl>(Impl{std::move(base), std::move(projectors), std::move(imagers)}));
}

Status Renderer::set_light(const LightOptions& options, const MeasuredSurface* surface) {
  Impl::Base& base = *impl_->base;
  const bool by_measurement = options.compensation == Compensation::measured;
  if (by_measurement) {
    LIMN_CHECK(surface != nullptr);
    LIMN_TRY_STATUS(check_fits(*surface, base.rig));
    LIMN_TRY_STATUS(impl_->projectors.link_measured());
    LIMN_TRY_STATUS(base.balance.measure(*surface, base.rig, &base.scene, &base.canvases));
  }
  if (base.balance.set_options(options) || by_measurement) impl_->projectors.invalidate();
  return {};
}

void Renderer::set_occlusion(std::size_t index, const cv::Mat& map) {
  LIMN_CHECK(index < impl_->base->rig.projectors.size());
  if (impl_->base->scene.occlusion().set(index, map)) impl_->projectors.invalidate();
}

void Renderer::set_deviation(const scene::DeviationLayer& layer) {
  impl_->base->scene.set_deviation(layer);
  impl_->projectors.invalidate();
}

void Renderer::set_smoothing(const Smoothing& smoothing) {
  LIMN_CHECK(smoothing.samples == 4 || smoothing.samples == 8);
  impl_->imagers.set_smoothing(smoothing);
}

void Renderer::set_quick_motion(bool wanted) { impl_->projectors.set_quick_motion(wanted); }

Status Renderer::set_contact_shadow(const scene::Scene* scene) {
  return impl_->imagers.set_contact_shadow(scene);
}

cv::Mat Renderer::clipped(std::size_t index) const { return impl_->projectors.clipped(index); }

void Renderer::time_passes(bool wanted) { impl_->base->times->enable(wanted); }

std::vector<PassTime> Renderer::pass_times() { return impl_->base->times->take_times(); }

unsigned Renderer::draw_projector(std::size_t index, const scene::PosedScene& posed, const Imager& viewer) {
  return impl_->projectors.draw(index, posed, viewer);
}

cv::Mat Renderer::projector_image(std::size_t index, const scene::PosedScene& posed, const Imager& viewer) {
  return impl_->projectors.image(index, posed, viewer);
}

cv::Mat Renderer::surface_points(std::size_t index, const scene::PosedScene& posed) {
  return impl_->projectors.surface_points(index, posed);
}

cv::Mat Renderer::blend(std::size_t index, const scene::PosedScene& posed) {
  return impl_->projectors.blend(index, posed);
}

IlluminatedPatches Renderer::illuminated_patches(std::size_t camera,
                                                 const scene::PosedScene& posed,
                                                 int side_px) {
  LIMN_CHECK(side_px > 0);
  return impl_->imagers.illuminated_patches(impl_->camera(camera), posed, side_px);
}

cv::Mat Renderer::composite(std::size_t camera,
                            const cv::Mat& image,
                            const scene::PosedScene& posed,
                            Composite what) {
  return composite(impl_->camera(camera), image, posed, what);
}

cv::Mat Renderer::composite(std::size_t camera,
                            const cv::Mat& image,
                            const scene::PosedScene& posed,
                            std::span<const CompositePolicy> policies) {
  return composite(impl_->camera(camera), image, posed, policies);
}

cv::Mat Renderer::composite(const Imager& camera,
                            const cv::Mat& image,
                            const scene::PosedScene& posed,
                            Composite what) {
  return impl_->imagers.composite(camera, image, posed, kind_of(what), CompositeWeights(what));
}

cv::Mat Renderer::composite(const Imager& camera,
                            const cv::Mat& image,
                            const scene::PosedScene& posed,
                            std::span<const CompositePolicy> policies) {
  return impl_->imagers.composite(camera, image, posed, ImagerView::Kind::each,
                                  CompositeWeights(policies, impl_->imagers.slot_names()));
}

cv::Mat Renderer::view(const Imager& imager, const scene::PosedScene& posed, const cv::Scalar& background) {
  return impl_->imagers.view(imager, posed, background);
}

std::vector<PartCoverage> Renderer::coverage(const scene::PosedScene& posed, const Imager& viewer) {
  return impl_->imagers.coverage(posed, viewer);
}

}  // namespace limn::projector
