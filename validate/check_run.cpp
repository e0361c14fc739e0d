#include "validate/check_run.h"

#include <fmt/format.h>

#include "validate/check_images.h"

namespace limn::apps {
namespace {

sim::World staged(const Check& check) {
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

CheckRun::CheckRun(const Check& check) : check_(check), world_(staged(check)) {
  for (const CheckLimit& limit : check.limits) asked_.insert(limit.measure.name);
}

Status CheckRun::open() {
  LIMN_TRY(renderer_, projector::Renderer::create(check_.told.scene, check_.told.rig));
  return {};
}

Error CheckRun::nothing_to_judge(const std::string& measure, const std::string& expected) const {
  return error("{}: limits.{}: expected {}, found none. Change poses or viewer.", check_.name, measure,
               expected);
}

std::vector<cv::Mat> CheckRun::drawn_by(projector::Renderer& renderer, const scene::PosedScene& posed) const {
  std::vector<cv::Mat> images;
  for (std::size_t i = 0; i < check_.told.rig.projectors.size(); ++i)
    images.push_back(renderer.projector_image(i, posed, check_.viewer));
  return images;
}

const std::vector<cv::Mat>& CheckRun::projector_images() {
  if (projector_images_.empty()) projector_images_ = drawn_by(*renderer_, check_.told.posed);
  return projector_images_;
}

const std::vector<sim::PartImage>& CheckRun::aims() {
  if (aims_.empty())
    for (std::size_t i = 0; i < world_.rig.projectors.size(); ++i)
      aims_.push_back(reference().projector_image(i));
  return aims_;
}

const ReferenceView& CheckRun::eye() {
  if (!eye_) eye_.emplace(world_, check_.viewer, 1);
  return *eye_;
}

const ReferenceView& CheckRun::fine_eye() {
  if (!fine_eye_) {
    fine_eye_.emplace(world_, check_.viewer, k_finer);
    fine_reaches_ = fine_eye_->reaches();
  }
  return *fine_eye_;
}

const std::vector<cv::Mat>& CheckRun::fine_reaches() {
  fine_eye();
  return fine_reaches_;
}

std::pair<scene::Scene, scene::PosedScene> CheckRun::shown_instead(const scene::Mesh& mesh,
                                                                   scene::Mode mode) const {
  scene::Scene scene = check_.told.scene;
  scene::Slot slot;
  slot.name = "judged";
  slot.mode = mode;
  slot.variants = {{"judged", mesh}};
  scene.slots = {slot};
  const Pose& world_from_prototype = *check_.told.posed.world_from_prototype;
  return {scene, {world_from_prototype, {{"judged", "judged", world_from_prototype}}}};
}

Result<std::vector<cv::Mat>> CheckRun::drawn_instead(const scene::Mesh& mesh, scene::Mode mode) const {
  const auto [scene, posed] = shown_instead(mesh, mode);
  LIMN_TRY(projector::Renderer renderer, projector::Renderer::create(scene, check_.told.rig));
  return drawn_by(renderer, posed);
}

scene::Mesh CheckRun::coat() const {
  scene::Mesh coat = check_.told.scene.prototype->mesh;
  coat.materials = {
      scene::Material{.base_colour = Eigen::Vector3f::Constant(float(k_coat)), .unlit = true, .texture = {}}};
  coat.triangle_materials.assign(coat.triangles.size(), 0);
  coat.uvs.clear();
  return coat;
}

Result<const Imager*> CheckRun::camera(const std::string& measure) const {
  if (check_.told.rig.cameras.empty()) return nothing_to_judge(measure, "a camera in the world");
  return &check_.told.rig.cameras.front();
}

CheckResult CheckRun::result() && {
  CheckResult result{check_.name, check_.about, {}, std::move(images_), 0, ""};
  for (const CheckLimit& limit : check_.limits)
    result.readings.push_back({limit, values_.at(limit.measure.name)});
  return result;
}

}  // namespace limn::apps
