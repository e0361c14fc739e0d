#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/result.h"
#include "core/rig.h"
#include "core/stereo.h"
#include "projector/overlays/overlays.h"
#include "scene/part_boxes.h"
#include "scene/scene.h"
#include "scene/show_state.h"
#include "session/drawing/frame_drawer.h"
#include "session/drift_watch.h"
#include "session/frame_input.h"
#include "session/part_fading.h"
#include "session/perception.h"
#include "session/projection_history.h"
#include "session/screen_composer.h"
#include "session/shadow_watch.h"
#include "session/viewpoint_selector.h"

namespace limn::session {

/// The images that are shown at one moment, and what they are made of.
struct ComposedFrame {
  std::vector<cv::Mat> projectors;  ///< in the rig's order, CV_8UC3
  /// The right eye's images of projectors in stereo, whose entry in `projectors` is the left eye's; in the
  /// rig's order, empty ones for the other projectors.
  std::vector<cv::Mat> right_eyes;
  std::vector<Track> tracks;  ///< predicted to shown_at
  scene::PosedScene posed;    ///< the scene posed by the tracks and the show state
  Stamp painted_at, shown_at;
  std::string follows;  ///< the guest whose tablet is the viewpoint; empty: the scene's own viewer
  Imager viewer = {};   ///< an imager at the viewpoint that `view` parts are drawn for
  /// The viewpoint (world frame, m) while it depends on a guest's tablet or moves back from it.
  std::optional<Eigen::Vector3d> p_guest_eye_world = {};

  EyeImages images(std::size_t projector) const { return {projectors[projector], right_eyes[projector]}; }
  /// All images, without the empty ones.
  std::vector<cv::Mat> eye_images() const;
};

/// The composed images with overlays drawn over them, one for each projector. Without overlays they share the
/// memory of `composed`.
std::vector<EyeImages> with_overlays(const ComposedFrame& composed,
                                     const Rig& rig,
                                     std::span<const projector::Overlay> overlays);

/// Loose markers that have been still for a second and carry no slot; a ring of light marks them. `pair`
/// without a marker uses the last one.
std::vector<LooseMarker> waiting_markers(const scene::Scene& scene,
                                         const scene::ShowState& show_state,
                                         const Percepts& percepts);

/// The projector side of a session: motions of bodies + show state -> images for projectors and screens.
/// Keeps the state of what fades; the same calls give the same images. A GL context must be current at every
/// call and at destruction.
class FrameComposer {
 public:
  static Result<FrameComposer> create(const scene::Scene& scene,
                                      const Rig& rig,
                                      const ComposeOptions& options = {});

  /// Composes the projectors' images for the moment at which their light arrives: describe(), then draw().
  /// Stamps must not go back.
  const ComposedFrame& compose(const FrameInput& input);
  /// Decides what the frame shows. Other machines can draw it from the description.
  const FrameDescription& describe(const FrameInput& input);
  /// Draws the frame that was described last.
  const ComposedFrame& draw();

  /// Checks by the projected light whether a device has moved, with the frames that compose() used last.
  /// After the prototype has come to rest this takes longer than a frame: call it when the images are shown.
  void check_drift(const Percepts& percepts);

  /// A screen's images for the cameras' newest frames (ScreenComposer::images). `tracks`:
  /// Prediction::at_image.
  EyeImages screen(const Percepts& percepts,
                   std::span<const Track> tracks,
                   const scene::ShowState& show_state,
                   const ScreenRequest& request);

  /// For each pixel of a projector, the point of the prototype (its frame, m) that it illuminates in the last
  /// composed frame, CV_32FC3. NaN where there is none, and on markers.
  cv::Mat free_surface(std::size_t projector);

  /// What the last frame shows.
  const FrameDescription& description() const { return frame_; }
  /// The last composed frame.
  const ComposedFrame& composed() const { return composed_; }
  /// The device that has moved, if any.
  const std::optional<Drift>& drift() const { return drifts_.drift(); }

 private:
  // The members point to these, which must keep their address when the composer is moved.
  struct Subject {
    scene::Scene scene;
    Rig rig;
    scene::PartBoxes part_boxes;
  };
  FrameComposer(std::unique_ptr<const Subject> subject, FrameDrawer drawer, const ComposeOptions& options);
  void select_viewpoint(const FrameInput& input);
  std::vector<cv::Mat> arriving_light(std::span<const std::string> dark_projectors) const;
  std::vector<projector::Overlay> surface_overlays(const scene::ShowState& show_state) const;
  void add_deviation_marks(const scene::ShowState& show_state, std::vector<projector::Overlay>* out) const;
  std::vector<projector::Overlay> marker_overlays(const FrameInput& input) const;
  void draw_projectors();
  std::optional<std::size_t> best_projector(const Pose& world_from_marker) const;
  // A place for the signs of a body, in front of one projector.
  struct SignPlace {
    std::size_t projector = 0;
    Pose world_from_marker = {};
    double size_m = 0;
  };
  std::vector<SignPlace> sign_places(const Track& track) const;

  std::unique_ptr<const Subject> subject_;
  FrameDrawer drawer_;
  ComposeOptions options_;
  Eigen::AlignedBox3d prototype_box_;  // in the prototype's frame
  ViewpointSelector viewpoints_;
  PartFading fading_;
  ScreenComposer screens_;
  ProjectionHistory shown_;
  ShadowWatch shadows_;
  DriftWatch drifts_;
  FrameDescription frame_;
  bool is_held_ = false;  // frame_ is frozen; a blackout has priority over that
  ComposedFrame composed_;
};

}  // namespace limn::session
