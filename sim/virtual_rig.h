#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "device/camera_source.h"
#include "device/display.h"
#include "sim/trace.h"
#include "sim/world.h"

namespace limn::sim {

struct VirtualRigOptions {
  double display_delay_s = 0.033;  ///< from show() to light on the surface
  double camera_delay_s = 0.020;   ///< from exposure to next() returning
  double frame_period_s = 1 / 30.0;
  /// A capture waits until what was shown last is on the surface before it grabs; false: frames come at the
  /// camera's pace whatever is on its way (the live session).
  bool grab_waits_for_light = true;
};

/// A world whose cameras and projectors are devices, on a virtual clock: nothing sleeps, every run is the
/// same. One thread at a time. Devices borrow the rig and must not outlive it.
class VirtualRig {
 public:
  explicit VirtualRig(World world, const VirtualRigOptions& options = {});
  ~VirtualRig();

  /// `index` counts in world().rig.cameras and .projectors.
  device::CameraSource& camera(int index);
  device::Display& projector(int index);

  const World& world() const { return world_; }
  /// For changes of any kind; what was traced is forgotten.
  World& edit();
  /// Moves an object of the world ("board", "prototype" with all that is attached to it).
  void move(const std::string& object, const Pose& world_from_object);
  /// Adds an object, or replaces the one of that name.
  void place(const Object& object);
  void remove(const std::string& object);
  /// A camera's sensor settings; changing them (colour, exposure, encoding) keeps what was traced.
  CameraEffects& camera_effects(int camera) {
    return world_.camera_effects.at(static_cast<std::size_t>(camera));
  }
  /// For calibration: the prototype is carried out of the room, cameras deliver grey. restore_prototype()
  /// undoes it.
  void remove_prototype();
  void restore_prototype();
  /// All projectors black.
  void darken();

  /// Frames of these cameras, exposed at one moment, as a trigger line makes them; waits as their next()
  /// does. None: a frame period passes.
  std::vector<Frame> expose(std::span<const int> cameras);
  /// The moment of the next exposure.
  Stamp next_exposure() const;

  Stamp now() const { return now_; }
  void advance(double seconds) { now_ = shifted(now_, seconds); }

  /// What `camera` sees, traced at the first call after a change.
  const Samples& samples(int camera);

 private:
  class Camera;
  class Projector;
  struct ShownImage {
    cv::Mat image;
    Stamp shown_at;
  };

  Result<Stamp> show(int projector, const cv::Mat& image);
  Stamp light_settles_at() const;
  std::vector<cv::Mat> images_at(Stamp moment) const;

  World world_;
  VirtualRigOptions options_;
  Stamp now_;
  std::uint64_t frames_ = 0;
  std::optional<Pose> prototype_home_;  // set while the stage is clear
  std::vector<CameraEffects> effects_home_;
  std::vector<std::vector<ShownImage>> shown_;  // per projector, oldest first; the first is on the surface
  std::vector<std::optional<Samples>> samples_;
  std::vector<std::unique_ptr<Camera>> cameras_;
  std::vector<std::unique_ptr<Projector>> projectors_;
};

}  // namespace limn::sim
