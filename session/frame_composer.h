#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/result.h"
#include "core/rig.h"
#include "projector/renderer.h"
#include "scene/scene.h"
#include "scene/show_state.h"
#include "session/drift_watch.h"
#include "session/frame_input.h"
#include "session/overlays.h"
#include "session/part_fading.h"
#include "session/perception.h"
#include "session/projection_history.h"
#include "session/screen_composer.h"
#include "session/shadow_watch.h"
#include "session/viewpoint_selector.h"

namespace limn::apps {

/// What is shown at a moment.
struct ComposedFrame {
  std::vector<cv::Mat> projectors;  ///< in the rig's order, CV_8UC3
  std::vector<Track> tracks;        ///< predicted to shown_at
  scene::PosedScene posed;          ///< what the tracks and the show state make of the scene
  Stamp painted_at, shown_at;
  std::string follows;  ///< the guest whose tablet `view` parts are drawn for; empty: the scene's own viewer
  Imager viewer = {};   ///< whose eye they are drawn for
  /// That eye's place while a guest has part in it, or it is on its way back.
  std::optional<Eigen::Vector3d> p_guest_eye_world = {};
};

/// What projectors show: what was painted, and overlays over it. Images that nothing is drawn over are the
/// painted ones themselves.
std::vector<cv::Mat> with_overlays(const ComposedFrame& painted,
                                   const Rig& rig,
                                   std::span<const Overlay> overlays);

/// Loose markers that lie still for a second and carry no slot: they glow. The last one is the one that a
/// `pair` without a marker means.
std::vector<LooseMarker> waiting_markers(const scene::Scene& scene,
                                         const scene::ShowState& show_state,
                                         const Percepts& watched);

/// The projector side of a session: motions of bodies + show state -> projector images and the screen's.
/// Holds what fades; the same calls give the same images. A GL context must be current at every call and at
/// destruction.
class FrameComposer {
 public:
  static Result<FrameComposer> create(const scene::Scene& scene,
                                      const Rig& rig,
                                      const ComposeOptions& options = {});

  /// Projector images for the moment at which their light arrives. Stamps must not go back.
  const ComposedFrame& compose(const FrameInput& input);

  /// Whether the light lies where the rig says, as the same frames show it that were painted for last. When
  /// the prototype has come to rest this takes longer than an image: call it when that is shown.
  void look_for_drift(const Percepts& watched);

  /// A large screen's image for the newest frame of camera 0; empty before the first frame and for
  /// Screen::off. `tracks`: Prediction::at_image.
  cv::Mat screen(const Percepts& watched,
                 std::span<const Track> tracks,
                 const scene::ShowState& show_state,
                 scene::Screen what);

  /// The prototype's point (its own frame, m) that each pixel of a projector lights, CV_32FC3, as painted
  /// last; NaN where none, and on markers.
  cv::Mat free_surface(std::size_t projector);

  /// What was painted last.
  const ComposedFrame& painted() const { return painted_; }
  /// A device that was nudged.
  const std::optional<Drift>& drift() const { return drifts_.drift(); }

 private:
  // What the parts of a painter refer to stays where it is when the painter moves.
  struct Subject {
    scene::Scene scene;
    Rig rig;
  };
  FrameComposer(std::unique_ptr<const Subject> subject,
                projector::Renderer renderer,
                const ComposeOptions& options);
  void select_viewpoint(const FrameInput& input);
  std::vector<Overlay> surface_overlays(const scene::ShowState& show_state) const;
  std::vector<Overlay> marker_overlays(const FrameInput& input) const;
  cv::Mat drawn(std::size_t projector, std::span<const Overlay> on_surface);
  void keep_off_markers(const FrameInput& input);
  OverlayTarget target(std::size_t projector, cv::Mat* image);
  std::optional<std::size_t> best_projector(const Pose& world_from_marker) const;

  std::unique_ptr<const Subject> subject_;
  projector::Renderer renderer_;
  ComposeOptions options_;
  std::vector<Body> bodies_;
  Eigen::AlignedBox3d prototype_box_;  // its own frame
  ViewpointSelector viewpoints_;
  PartFading fading_;
  ScreenComposer screens_;
  ProjectionHistory shown_;
  ShadowWatch shadows_;
  DriftWatch drifts_;
  ComposedFrame painted_;
  bool is_black_ = false;  // by blackout, which goes before a freeze
};

}  // namespace limn::apps
