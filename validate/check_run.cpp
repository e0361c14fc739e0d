#include "validate/check_run.h"

#include <fmt/format.h>

#include "validate/check_images.h"

namespace limn::validate {
namespace {

sim::World reduced_world(const Check& check) {
  sim::World world = check.truth;
  world.room = {};
  std::erase_if(world.objects, [](const sim::Object& object) { return object.name != "prototype"; });
  for (sim::Object& object : world.objects) {
    object.albedo.setOnes();
    object.texture.release();
  }
  for (sim::ProjectorEffects& effects : world.projector_effects)
    effects = {.illuminance_at_1m = 1, .gamma = k_projector_gamma, .falloff = false, .incidence = false};
  return world;
}

}  // namespace

CheckRun::CheckRun(const Check& check) : check_(check), world_(reduced_world(check)) {
  for (const CheckLimit& limit : check.limits) asked_.insert(limit.measure.name);
}

Status CheckRun::open() {
  LIMN_TRY(renderer_, projector::Renderer::create(check_.renderer_input.scene, check_.renderer_input.rig));
  return {};
}

Error CheckRun::nothing_to_judge(const std::string& measure, const std::string& expected) const {
  return error("{}: limits.{}: expected {}, found none. Change poses or viewer.", check_.name, measure,
               expected);
}

std::vector<cv::Mat> CheckRun::projector_images_by(projector::Renderer& renderer,
                                                   const scene::PosedScene& posed) const {
  std::vector<cv::Mat> images;
  for (std::size_t i = 0; i < check_.renderer_input.rig.projectors.size(); ++i)
    images.push_back(renderer.projector_image(i, posed, check_.viewer));
  return images;
}

const std::vector<cv::Mat>& CheckRun::projector_images() {
  if (projector_images_.empty())
    projector_images_ = projector_images_by(*renderer_, check_.renderer_input.posed);
  return projector_images_;
}

const std::vector<sim::PartImage>& CheckRun::reference_projector_images() {
  if (reference_projector_images_.empty())
    for (std::size_t i = 0; i < world_.rig.projectors.size(); ++i)
      reference_projector_images_.push_back(reference().projector_image(i));
  return reference_projector_images_;
}

const ReferenceView& CheckRun::reference_view() {
  if (!reference_view_) reference_view_.emplace(world_, check_.viewer, 1);
  return *reference_view_;
}

const ReferenceView& CheckRun::fine_reference_view() {
  if (!fine_reference_view_) {
    fine_reference_view_.emplace(world_, check_.viewer, k_finer);
    fine_reaches_ = fine_reference_view_->reaches();
  }
  return *fine_reference_view_;
}

const std::vector<cv::Mat>& CheckRun::fine_reaches() {
  fine_reference_view();
  return fine_reaches_;
}

std::pair<scene::Scene, scene::PosedScene> CheckRun::scene_with_mesh(const scene::Mesh& mesh,
                                                                     scene::Mode mode) const {
  scene::Scene scene = check_.renderer_input.scene;
  scene::Slot slot;
  slot.name = "judged";
  slot.mode = mode;
  slot.variants = {{"judged", mesh}};
  scene.slots = {slot};
  const Pose& world_from_prototype = *check_.renderer_input.posed.world_from_prototype;
  return {scene, {world_from_prototype, {{"judged", "judged", world_from_prototype}}}};
}

Result<std::vector<cv::Mat>> CheckRun::projector_images_of(const scene::Mesh& mesh, scene::Mode mode) const {
  const auto [scene, posed] = scene_with_mesh(mesh, mode);
  LIMN_TRY(projector::Renderer renderer, projector::Renderer::create(scene, check_.renderer_input.rig));
  return projector_images_by(renderer, posed);
}

scene::Mesh CheckRun::coat() const {
  scene::Mesh coat = check_.renderer_input.scene.prototype->mesh;
  coat.materials = {
      scene::Material{.base_colour = Eigen::Vector3f::Constant(float(k_coat)), .unlit = true, .texture = {}}};
  coat.triangle_materials.assign(coat.triangles.size(), 0);
  coat.uvs.clear();
  coat.colours.clear();
  return coat;
}

Result<const Imager*> CheckRun::camera(const std::string& measure) const {
  if (check_.renderer_input.rig.cameras.empty()) return nothing_to_judge(measure, "a camera in the world");
  return &check_.renderer_input.rig.cameras.front();
}

CheckResult CheckRun::result() && {
  CheckResult result{check_.name, check_.about, {}, std::move(images_), 0, ""};
  for (const CheckLimit& limit : check_.limits)
    result.readings.push_back({limit, values_.at(limit.measure.name)});
  return result;
}

}  // namespace limn::validate
