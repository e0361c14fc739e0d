#pragma once

#include <Eigen/Geometry>
#include <map>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "session/drift_watch.h"
#include "session/shadow_watch.h"
#include "session/projection_history.h"
#include "session/perception.h"
#include "core/result.h"
#include "core/rig.h"
#include "projector/renderer.h"
#include "projector/composite_policy.h"
#include "scene/scene.h"
#include "scene/show_state.h"
#include "tracker/marker_light.h"
#include "tracker/predict.h"

namespace limn::apps {

struct ComposeOptions {
  tracker::Prediction prediction = tracker::Prediction::filtered;
  tracker::MotionModel motion;  ///< as the Watcher's
  tracker::MarkerLight marker_light = tracker::MarkerLight::keep_out;
  double fade_s = 0.15;   ///< in which a part's light goes when its marker is lost
  double label_s = 1.2;   ///< for which a variant's name stands by its marker
  double lost_s = 1.5;    ///< for which a ring marks where a part was lost
  double stereo_mm = 63;  ///< between the eyes of Screen::stereo
  bool refill = true;     ///< light lost to a shadow is given by other projectors
  /// Camera 0's images are proportional to light; a screen's are made of them as sRGB.
  bool is_linear_camera = false;
};

/// Where a guest's tablet looks from, by its own image; the guest has a name.
struct TabletViewpoint {
  std::string guest;
  Eigen::Vector3d p_eye_world = Eigen::Vector3d::Zero();
  Stamp at;  ///< when it became known
};
/// A place as old as this is no guest's any more.
constexpr double k_guest_place_lasts_s = 1;

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

/// Loose markers that lie still for a second and carry no slot: they glow. The last one is the one that a
/// `pair` without a marker means.
std::vector<LooseMarker> waiting_markers(const scene::Scene& scene,
                                         const scene::ShowState& show_state,
                                         const Percepts& watched);

/// The projector side of a session: motions of bodies + show state -> projector images and the screen's. Holds
/// what fades; the same calls give the same images. A GL context must be current at every call and at
/// destruction.
class FrameComposer {
 public:
  static Result<FrameComposer> create(const scene::Scene& scene, const Rig& rig, const ComposeOptions& options = {});

  /// Projector images for the moment at which their light arrives; what is lost is judged by `now`. Stamps
  /// must not go back. A guest's place counts while it is new, for the guest that the show state names, whose
  /// eye is then the only one, else for those who are among the scene's viewers: the eye passes to it, and
  /// back, as between viewers (scene/viewpoint.h), and glides with it.
  const ComposedFrame& paint(const Percepts& watched,
                       const scene::ShowState& show_state,
                       Stamp now,
                       Stamp shown_at,
                       std::span<const TabletViewpoint> places = {});

  /// Whether the light lies where the rig says, as the same frames show it that were painted for last. When
  /// the prototype has come to rest this takes longer than an image: call it when that is shown.
  void look_for_drift(const Percepts& watched);

  /// A large screen's image for the newest frame of camera 0, at that frame's own stamp; empty before the
  /// first frame and for Screen::off.
  cv::Mat screen(const Percepts& watched, const scene::ShowState& show_state, scene::Screen what);

  /// The prototype's point (its own frame, m) that each pixel of a projector lights, CV_32FC3, as painted
  /// last; NaN where none, and on markers.
  cv::Mat free_surface(std::size_t projector);

  /// What was painted last.
  const ComposedFrame& painted() const { return painted_; }
  /// A device that was nudged.
  const std::optional<Drift>& drift() const { return drifts_.drift(); }

 private:
  struct Fading {
    scene::PosedPart part;
    Stamp lost_at;
  };
  struct Gone {
    scene::PosedScene posed;
    Stamp lost_at;
  };
  struct Label {
    std::string text;
    Stamp since;
  };
  FrameComposer(const scene::Scene& scene,
          const Rig& rig,
          projector::Renderer renderer,
          const ComposeOptions& options);
  const Imager* still_viewer() const;
  const Imager& stand_in() const;
  std::vector<scene::Viewpoint> guests_eyes(const scene::ShowState& show_state,
                                      std::span<const TabletViewpoint> places,
                                      Stamp now) const;
  Imager viewer_for(const scene::PosedScene& posed, std::vector<scene::Viewpoint> guests, Stamp at);
  void glide(std::vector<scene::Viewpoint>* guests, double seconds);
  void note_changes(const scene::PosedScene& posed, const scene::ShowState& show_state, Stamp at);
  cv::Mat lit(std::size_t projector, const scene::PosedScene& posed, const Imager& viewer, Stamp at);
  cv::Mat screen_of(const cv::Mat& behind,
                    const scene::PosedScene& posed,
                    scene::Screen what,
                    std::span<const projector::CompositePolicy> policies);
  cv::Mat lit_for(std::size_t projector, const scene::ShowState& show_state, const Imager& viewer, Stamp at);
  void draw_feedback(const scene::ShowState& show_state);
  void draw_waiting(std::span<const LooseMarker> waiting);
  const Imager* best_projector(const Pose& world_from_marker) const;

  scene::Scene scene_;
  Rig rig_;
  projector::Renderer renderer_;
  ComposeOptions options_;
  std::vector<Body> bodies_;
  ProjectionHistory shown_;
  ShadowWatch shadows_;
  DriftWatch drifts_;
  Eigen::Vector3d d_up_world_;
  Eigen::AlignedBox3d prototype_box_;  // its own frame
  ComposedFrame painted_;
  bool is_black_ = false;  // by blackout, which goes before a freeze
  scene::SharedViewpoint shared_viewpoint_;
  Stamp eye_at_;
  std::vector<scene::Viewpoint> gliding_;  // guests' eyes, as they are followed
  bool is_away_ = false;             // a guest has part in the eye, or it is on its way back
  std::vector<projector::CompositePolicy> policies_;
  Stamp treated_at_;
  scene::PosedScene last_;                       // as last shown
  std::map<std::string, Fading> fading_;         // parts whose marker was lost, by slot
  std::optional<Gone> gone_;                     // all, since the prototype was lost
  std::map<std::string, std::string> variants_;  // last shown
  std::map<std::string, Label> labels_;
};

}  // namespace limn::apps
