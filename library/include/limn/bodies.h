#pragma once

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
  std::string family = {}, id = {};
  double size_m = 0;  ///< side of the black square, at its outer edges
  Pose body_from_marker = {};
};

/// A rigid thing with markers on it.
struct Body {
  std::string name = {};
  std::vector<BodyMarker> markers = {};
};

/// Reads limn.body/1 (`limn markers --learn-body`) or limn.markers/1 (`limn align --body`).
LIMN_API Body load_body(const std::filesystem::path& path, const std::string& name);
/// The families that a detector needs for these bodies, each once.
LIMN_API std::vector<std::string> families_of(std::span<const Body> bodies);

/// What one camera's image shows; borrows both.
struct View {
  const Imager* camera = nullptr;
  std::span<const Marker> markers = {};
};

enum class Tracking {
  measured,      ///< seen in the newest images
  extrapolated,  ///< predicted from earlier images, for a limited time
  lost           ///< not seen for longer: the pose is the last one and must not be shown
};

/// A body's pose at a moment.
struct Track {
  std::string body = {};
  Pose world_from_body = {};
  Covariance6 covariance = {};
  int marker_count = 0;
  double rms_px = 0;         ///< residual of the markers' corners
  double captured_at_s = 0;  ///< when the newest image that showed the body was taken
  double at_s = 0;           ///< the moment of the pose
  Tracking tracking = Tracking::measured;
};

/// The poses of bodies in the images of one moment alone. Bodies that no camera sees are absent. Cameras
/// stand where their imager_from_world says.
LIMN_API std::vector<Track> locate_bodies(std::span<const Body> bodies, std::span<const View> views);

/// How bodies are expected to move. The defaults suit a hand.
struct Motion {
  double jerk = 3;         ///< white jerk of a moving body, m²/s⁵; higher follows sooner and jitters more
  double turn_jerk = 50;   ///< rad²/s⁵
  double drift = 0.05e-3;  ///< random walk of a body that stands, m per square root of a second
  double turn_drift = 0.9e-3;          ///< rad per square root of a second
  double starts_per_s = 0.5;           ///< how often a still body begins to move
  double stops_per_s = 1;              ///< how often a moving one comes to rest
  double extrapolation_limit_s = 0.3;  ///< not seen for longer: lost
};

/// Follows bodies over time: what `limn live` does with its cameras. Times are seconds on any clock that
/// never goes back (of the cameras' stamps: the middle of the exposure).
///
///     limn::Tracker tracker({body});
///     tracker.update({&view, 1}, captured_at_s);
///     for (const limn::Track& track : tracker.predict(shown_at_s)) …
class LIMN_API Tracker {
 public:
  /// Error: two bodies of one name, a body without markers, a size that is not positive.
  explicit Tracker(std::vector<Body> bodies, const Motion& motion = {});
  Tracker(Tracker&&) noexcept;
  Tracker& operator=(Tracker&&) noexcept;
  ~Tracker();

  /// Adds the images that were taken at one moment, of all cameras that took one. Images older than the
  /// newest ones change nothing.
  void update(std::span<const View> views, double captured_at_s);
  /// The poses of all bodies that have been seen, at a moment: usually when the light will be shown.
  /// Covariances grow with the time since the newest image.
  std::vector<Track> predict(double at_s) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace limn::LIMN_VERSIONED
