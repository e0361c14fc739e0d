#include "projector/light_balance.h"

#include "projector/bindings.h"

namespace limn::projector {

PrototypeAlbedo::PrototypeAlbedo(const scene::Prototype& prototype) {
  const cv::Mat colours = fitting_texture(relative_albedo(prototype), "the prototype's albedo");
  mean_ = static_cast<float>(mean_albedo_of(prototype));
  relative_ = make_texture(GL_TEXTURE_2D, GL_RGB32F, colours.cols, colours.rows);
  for (const GLenum filter : {GL_TEXTURE_MIN_FILTER, GL_TEXTURE_MAG_FILTER})
    glTextureParameteri(*relative_, filter, GL_LINEAR);
  for (const GLenum wrap : {GL_TEXTURE_WRAP_S, GL_TEXTURE_WRAP_T})
    glTextureParameteri(*relative_, wrap, GL_REPEAT);
  upload(relative_, colours);
}

void PrototypeAlbedo::bind(const Use& use) const {
  glBindTextureUnit(k_albedo_unit, *relative_);
  use.program.set("u_mean_albedo", mean_);
}

Result<LightBalance> LightBalance::create(const scene::Scene& scene_in) {
  using enum Resource;
  LIMN_TRY(FullscreenPass irradiance,
           FullscreenPass::link(
               {.shader = "irradiance.frag", .reads = {scene, viewpoints, occlusion, lens, projector}}));
  return LightBalance(scene_in, std::move(irradiance));
}

LightBalance::LightBalance(const scene::Scene& scene, FullscreenPass irradiance)
    : irradiance_(std::move(irradiance)),
      prototype_(scene.prototype),
      albedo_(prototype_ ? *prototype_ : scene::Prototype{}) {
  mixing_ = make_texture(GL_TEXTURE_2D_ARRAY, GL_RGBA16F, 1, 1);
}

bool LightBalance::set_options(const LightOptions& options) {
  const bool is_same = options_.compensation == options.compensation &&
                       options_.even_black == options.even_black && options_.level == options.level;
  options_ = options;
  return !is_same;
}

Status LightBalance::measure(const MeasuredSurface& measured,
                             const Rig& rig,
                             SceneCache* scene,
                             CanvasPool* canvases) {
  const Imager& camera = measured.camera;
  scene::PosedScene bare;
  bare.world_from_prototype = measured.world_from_prototype;
  scene->prepare(bare, SceneCache::FromProjectors::prototype);
  scene->draw_from_imager(camera);
  const Canvas& canvas = canvases->canvas(camera.width, camera.height, GL_R32F);
  const Resources resources = scene->resources(scene->lens_of(camera));
  std::vector<cv::Mat> irradiances;
  for (std::size_t i = 0; i < rig.projectors.size(); ++i) {
    const ProjectorIndex projector(i);
    irradiance_.draw(canvas, resources.with(Resource::projector, projector));
    irradiances.push_back(read_back(canvas.framebuffer, camera.width, camera.height, CV_32FC1, GL_RED));
  }
  LIMN_TRY(SurfaceMixing found, surface_mixing(measured, irradiances));
  scene->draw_from_reference_camera(camera);
  mixing_ = make_texture(GL_TEXTURE_2D_ARRAY, GL_RGBA16F, camera.width, camera.height,
                         static_cast<int>(found.layers.size()));
  for (std::size_t i = 0; i < found.layers.size(); ++i)
    glTextureSubImage3D(*mixing_, 0, 0, 0, static_cast<GLint>(i), camera.width, camera.height, 1, GL_RGBA,
                        GL_FLOAT, found.layers[i].data);
  found.layers.clear();
  surface_ = std::move(found);
  return {};
}

void LightBalance::find_level(const Rig& rig, const scene::PosedScene& posed) {
  if (!level_by_geometry_ && prototype_ && posed.world_from_prototype)
    level_by_geometry_ = geometric_level(*prototype_, rig, *posed.world_from_prototype);
}

void LightBalance::bind(const Use& use) const {
  const bool by_measurement = options_.compensation == Compensation::measured;
  const double level = by_measurement ? surface_->level : level_by_geometry_.value_or(1);
  use.program.set("u_compensation", static_cast<int>(options_.compensation));
  use.program.set("u_even_black", options_.even_black);
  use.program.set("u_level", static_cast<float>(options_.level.value_or(level)));
  use.program.set("u_mean_mixing",
                  by_measurement ? surface_->mean : Eigen::Matrix3f(Eigen::Matrix3f::Identity()));
  glBindTextureUnit(k_colour_mixing_unit, *mixing_);
  albedo_.bind(use);
}

}  // namespace limn::projector
