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
  double display_delay_s = 0.033;  ///< From show() to light on the surface.
  double camera_delay_s = 0.020;   ///< From the exposure to the return of next().
  double frame_period_s = 1 / 30.0;
  /// True: a grab waits until the image shown last is on the surface, as captures need. False: frames come at
  /// the camera's rate, even while an image is on its way (live session).
  bool grab_waits_for_light = true;
  /// True: after an object has moved, only the affected parts of an image are traced again (ViewTracer). This
  /// is fast for sessions; it needs more memory, and images may differ from those of a whole trace by
  /// rounding.
  bool follows_changes = false;
};

/// A world whose cameras and projectors behave as devices on a virtual clock. Nothing sleeps, and every run
/// is identical. To be used by one thread at a time. Devices borrow the rig and must not outlive it.
class VirtualRig {
 public:
  explicit VirtualRig(World world, const VirtualRigOptions& options = {});
  ~VirtualRig();

  /// `index` refers to world().rig.cameras or .projectors.
  device::CameraSource& camera(int index);
  device::Display& projector(int index);

  const World& world() const { return world_; }
  /// The world, for changes of any kind. Discards the traced samples.
  World& edit();
  /// Moves an object of the world ("board", "prototype" with all that is attached to it).
  void move(const std::string& object, const Pose& world_from_object);
  /// Adds an object, or replaces the one of that name.
  void place(const Object& object);
  void remove(const std::string& object);
  /// Gives cameras and projectors other sizes: those of `sized`, which has the same devices with their lenses
  /// for these sizes. Poses stay. Projected images are scaled.
  void resize(const Rig& sized);
  /// How finely cameras are traced, from the next image on.
  void set_trace_effort(const TraceEffort& effort);
  /// A camera's sensor settings. Changing them (colour, exposure, encoding) keeps the traced samples.
  CameraEffects& camera_effects(int camera) {
    return world_.camera_effects.at(static_cast<std::size_t>(camera));
  }
  /// For calibration: removes the prototype from the room and makes the cameras deliver grey frames.
  /// restore_prototype() undoes both.
  void remove_prototype();
  void restore_prototype();
  /// Makes all projectors black.
  void darken();

  /// Frames of these cameras, all exposed at one moment, as with a trigger line. Advances the clock as their
  /// next() does. With no cameras, one frame period passes.
  std::vector<Frame> expose(std::span<const int> cameras);
  /// The moment of the next exposure.
  Stamp next_exposure() const;

  Stamp now() const { return now_; }
  void advance(double seconds) { now_ = shifted(now_, seconds); }

  /// What `camera` sees. Traced at the first call after a change.
  const Samples& samples(int camera);

 private:
  class Camera;
  class Projector;
  struct ProjectedImage {
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
  std::optional<Pose> prototype_home_;  // set while the prototype is removed
  std::vector<CameraEffects> effects_home_;
  // For each projector, oldest first; the first one is on the surface.
  std::vector<std::vector<ProjectedImage>> projected_;
  TraceEffort effort_;
  std::vector<std::optional<Samples>> samples_;  // those of whole traces
  std::vector<ViewTracer> tracers_;              // with follows_changes
  std::vector<const Samples*> traced_;           // the valid samples of each camera; null: to be traced
  std::vector<std::unique_ptr<Camera>> cameras_;
  std::vector<std::unique_ptr<Projector>> projectors_;
};

}  // namespace limn::sim
