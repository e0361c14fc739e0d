#pragma once

// Rigid bodies with markers on them: their poses in the images of one moment, and over time.
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "limn/export.h"
#include "limn/markers.h"
#include "limn/pose.h"
#include "limn/rig.h"

namespace limn::LIMN_VERSIONED {

/// A marker on a body.
struct BodyMarker {
  /// As Detector names them.
  std::string family = {}, id = {};
  /// Side of the black square, at its outer edges, m.
  double size_m = 0;
  /// Marker frame: origin in the centre, x right, y down, z into the paper. The body's frame is its own.
  Pose body_from_marker = {};
};

/// A rigid thing with markers on it.
struct Body {
  std::string name = {};
  std::vector<BodyMarker> markers = {};
};

/// Reads limn.body/1 (`limn markers --learn-body` writes it) or limn.markers/1 (`limn align --body`); both in
/// docs/formats.md. Error: a file that cannot be read; the message names the entry.
LIMN_API Body load_body(const std::filesystem::path& path, const std::string& name);

/// The families that a detector needs for these bodies, each once. Errors as of Tracker.
LIMN_API std::vector<std::string> families_of(std::span<const Body> bodies);

/// What one camera's image shows. It borrows both, which must outlive the call that gets the view.
struct View {
  /// Stands where its imager_from_world says.
  const Imager* camera = nullptr;
  /// What Detector found in the camera's image, or another detector.
  std::span<const Marker> markers = {};
};

enum class Tracking {
  /// Seen in the newest images.
  measured,
  /// Predicted from earlier images, for a limited time (Motion::extrapolation_limit_s).
  extrapolated,
  /// Not seen for longer: the pose is the last one and must not be shown.
  lost
};

/// A body's pose at a moment.
struct Track {
  std::string body = {};
  Pose world_from_body = {};
  Covariance6 covariance = {};
  /// Number of markers that the pose rests on.
  int marker_count = 0;
  /// Residual of the markers' corners.
  double rms_px = 0;
  /// When the newest image that showed the body was taken, s on the caller's clock.
  double captured_at_s = 0;
  /// The moment of the pose, s on the same clock.
  double at_s = 0;
  Tracking tracking = Tracking::measured;
};

/// The poses of bodies in the images of one moment alone, without history. Bodies that no camera sees are
/// absent; captured_at_s and at_s are 0. Errors: as of Tracker; a view without a camera.
LIMN_API std::vector<Track> locate_bodies(std::span<const Body> bodies, std::span<const View> views);

/// How bodies are expected to move. The defaults suit a hand.
struct Motion {
  /// White jerk of a moving body, m²/s⁵; more follows sooner and jitters more.
  double jerk = 3;
  /// The same of its rotation, rad²/s⁵.
  double turn_jerk = 50;
  /// Random walk of a body that stands, m per square root of a second.
  double drift = 0.05e-3;
  /// The same of its rotation, rad per square root of a second.
  double turn_drift = 0.9e-3;
  /// How often a still body begins to move.
  double starts_per_s = 0.5;
  /// How often a moving one comes to rest.
  double stops_per_s = 1;
  /// A body that was not seen for longer is lost; where images come more rarely, after one and a half times
  /// their interval.
  double extrapolation_limit_s = 0.3;
};

/// Follows bodies over time: what `limn live` does with its cameras. Times are seconds on any clock of the
/// caller that never goes back; an image's time is the middle of its exposure.
///
///     limn::Tracker tracker({body});
///     const limn::View view{&camera, markers};
///     tracker.update({&view, 1}, captured_at_s);
///     for (const limn::Track& track : tracker.predict(shown_at_s)) …
class LIMN_API Tracker {
 public:
  /// Errors: two bodies of one name, a body without markers, a size or a number of Motion that is not
  /// positive.
  explicit Tracker(std::vector<Body> bodies, const Motion& motion = {});
  Tracker(Tracker&&) noexcept;
  Tracker& operator=(Tracker&&) noexcept;
  ~Tracker();

  /// Adds the images that were taken at one moment, of all cameras that took one. Images that are older than
  /// the newest ones change nothing. Errors: a view without a camera, a corner's covariance that is none, a
  /// time that is not finite.
  void update(std::span<const View> views, double captured_at_s);
  /// The poses of all bodies that have been seen, at a moment: usually that at which the light will be shown.
  /// Covariances grow with the time since the newest image.
  std::vector<Track> predict(double at_s) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace limn::LIMN_VERSIONED
