#include "sim/virtual_rig.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "sim/sensor_model.h"

namespace limn::sim {

class VirtualRig::Camera : public device::CameraSource {
 public:
  Camera(VirtualRig& rig, int index) : rig_(rig), index_(index) {}
  const std::string& name() const override { return imager().name; }
  cv::Size size() const override { return {imager().width, imager().height}; }
  Result<Frame> next() override { return rig_.expose(std::span(&index_, 1)).front(); }

 private:
  const Imager& imager() const { return rig_.world_.rig.cameras[static_cast<std::size_t>(index_)]; }
  VirtualRig& rig_;
  int index_;
};

class VirtualRig::Projector : public device::Display {
 public:
  Projector(VirtualRig& rig, int index) : rig_(rig), index_(index) {}
  const std::string& name() const override { return imager().name; }
  cv::Size size() const override { return {imager().width, imager().height}; }
  Result<Stamp> show(const cv::Mat& image) override { return rig_.show(index_, image); }

 private:
  const Imager& imager() const { return rig_.world_.rig.projectors[static_cast<std::size_t>(index_)]; }
  VirtualRig& rig_;
  int index_;
};

VirtualRig::VirtualRig(World world, const VirtualRigOptions& options)
    : world_(std::move(world)), options_(options) {
  LIMN_CHECK(options_.frame_period_s > 0);
  LIMN_CHECK(world_.rig.cameras.size() == world_.camera_effects.size());
  LIMN_CHECK(world_.rig.projectors.size() == world_.projector_effects.size());
  for (std::size_t i = 0; i < world_.rig.cameras.size(); ++i)
    cameras_.push_back(std::make_unique<Camera>(*this, static_cast<int>(i)));
  for (std::size_t i = 0; i < world_.rig.projectors.size(); ++i)
    projectors_.push_back(std::make_unique<Projector>(*this, static_cast<int>(i)));
  for (std::size_t i = 0; i < cameras_.size(); ++i) tracers_.emplace_back(static_cast<int>(i));
  samples_.resize(cameras_.size());
  traced_.resize(cameras_.size());
  darken();
}

VirtualRig::~VirtualRig() = default;

device::CameraSource& VirtualRig::camera(int index) { return *cameras_.at(static_cast<std::size_t>(index)); }

device::Display& VirtualRig::projector(int index) { return *projectors_.at(static_cast<std::size_t>(index)); }

World& VirtualRig::edit() {
  for (auto& samples : samples_) samples.reset();
  std::fill(traced_.begin(), traced_.end(), nullptr);
  return world_;
}

void VirtualRig::move(const std::string& object, const Pose& world_from_object) {
  World& world = edit();
  if (object == "prototype") return move_prototype(world, world_from_object);
  Object* found = world.find(object);
  LIMN_CHECK(found != nullptr);
  found->world_from_object = world_from_object;
}

void VirtualRig::place(const Object& object) {
  World& world = edit();
  if (Object* found = world.find(object.name))
    *found = object;
  else
    world.objects.push_back(object);
}

void VirtualRig::remove(const std::string& object) {
  World& world = edit();
  std::erase_if(world.objects, [&](const Object& o) { return o.name == object; });
  std::erase_if(world.markers, [&](const PlacedMarker& m) { return m.object == object; });
}

void VirtualRig::remove_prototype() {
  if (prototype_home_) return;
  prototype_home_ = world_.world_from_prototype;
  effects_home_ = world_.camera_effects;
  const Eigen::Vector3d away(0, 0, -100);  // far below the table
  move_prototype(edit(), Pose(prototype_home_->rotation, prototype_home_->translation + away));
  for (CameraEffects& effects : world_.camera_effects) effects.colour = false;
}

void VirtualRig::restore_prototype() {
  if (!prototype_home_) return;
  move_prototype(edit(), *prototype_home_);
  world_.camera_effects = effects_home_;
  prototype_home_.reset();
}

void VirtualRig::darken() { projected_.assign(projectors_.size(), {ProjectedImage{cv::Mat(), now_}}); }

void VirtualRig::resize(const Rig& sized) {
  const auto take_sizes = [](const std::vector<Imager>& from, std::vector<Imager>* to) {
    LIMN_CHECK(from.size() == to->size());
    for (std::size_t i = 0; i < from.size(); ++i) {
      (*to)[i].width = from[i].width;
      (*to)[i].height = from[i].height;
      (*to)[i].lens = from[i].lens;
    }
  };
  Rig& rig = edit().rig;
  take_sizes(sized.cameras, &rig.cameras);
  take_sizes(sized.projectors, &rig.projectors);
  for (std::size_t i = 0; i < projected_.size(); ++i)
    for (ProjectedImage& projected : projected_[i])
      if (!projected.image.empty())
        cv::resize(projected.image, projected.image, projectors_[i]->size(), 0, 0, cv::INTER_AREA);
}

void VirtualRig::set_trace_effort(const TraceEffort& effort) {
  if (effort == effort_) return;
  effort_ = effort;
  edit();
}

const Samples& VirtualRig::samples(int camera) {
  const auto i = static_cast<std::size_t>(camera);
  const Samples*& traced = traced_.at(i);
  if (traced) return *traced;
  if (options_.follows_changes)
    traced = &tracers_[i].samples(world_, effort_);
  else
    traced = &samples_[i].emplace(trace(world_, camera, effort_));
  return *traced;
}

Result<Stamp> VirtualRig::show(int projector, const cv::Mat& image) {
  const cv::Size size = this->projector(projector).size();
  if (image.size() != size || (image.type() != CV_8UC1 && image.type() != CV_8UC3))
    return error(
        "{}: expected an 8-bit grey or BGR image of {}x{}, found {}x{} with {} channels. Draw it at the "
        "projector's size.",
        this->projector(projector).name(), size.width, size.height, image.cols, image.rows, image.channels());
  const Stamp shown_at = shifted(now_, options_.display_delay_s);
  projected_[static_cast<std::size_t>(projector)].push_back({image.clone(), shown_at});
  return shown_at;
}

Stamp VirtualRig::light_settles_at() const {
  Stamp settled = now_;
  for (const auto& queue : projected_) settled = std::max(settled, queue.back().shown_at);
  return settled;
}

std::vector<cv::Mat> VirtualRig::images_at(Stamp moment) const {
  std::vector<cv::Mat> images;
  for (const auto& queue : projected_) {
    const auto later = std::find_if(queue.begin() + 1, queue.end(),
                                    [&](const ProjectedImage& s) { return s.shown_at > moment; });
    images.push_back(std::prev(later)->image);
  }
  return images;
}

Stamp VirtualRig::next_exposure() const {
  const Stamp earliest = options_.grab_waits_for_light ? light_settles_at() : now_;
  const double periods = seconds_between(Stamp{}, earliest) / options_.frame_period_s;
  return shifted(Stamp{}, std::floor(periods + 1) * options_.frame_period_s);
}

std::vector<Frame> VirtualRig::expose(std::span<const int> cameras) {
  const Stamp captured_at = next_exposure();
  const std::vector<cv::Mat> shown = images_at(captured_at);
  for (auto& queue : projected_)  // images that a newer one has replaced are dropped
    while (queue.size() > 1 && queue[1].shown_at <= captured_at) queue.erase(queue.begin());
  std::vector<Frame> frames;
  for (const int camera : cameras)
    frames.push_back({this->camera(camera).name(),
                      photograph(world_, samples(camera), shown, world_.seed + ++frames_), captured_at});
  now_ = shifted(captured_at, options_.camera_delay_s);
  return frames;
}

}  // namespace limn::sim
