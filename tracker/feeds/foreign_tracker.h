#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/enum_names.h"
#include "core/foreign_pose.h"
#include "tracker/feeds/feed_clock.h"
#include "tracker/feeds/feed_registration.h"

namespace limn::tracker {

/// Which sensor of a feed is fixed to which body.
struct FeedBody {
  std::string sensor, body;
  /// Known mounting, for bodies that our cameras never see. Absent: it is found from simultaneous poses, and
  /// where there are none the sensor's frame is taken for the body's.
  std::optional<Pose> body_from_sensor;
  /// Only the position counts (a viewer's eye), so that a sensor without rotation can be used.
  bool needs_position_only = false;
};

/// Another tracking system, as a session uses it.
struct FeedSetup {
  std::string name;
  std::vector<FeedBody> bodies;
  /// Known frame, for a feed of which our cameras see no body. What they see counts more.
  std::optional<Pose> world_from_feed;
  double delay_s = 0;  ///< Known delay, until it is measured.
};

/// A pose and the moment of the session's clock at which its message arrived.
struct ArrivedPose {
  ForeignPose pose;
  Stamp arrived_at;
};

/// How far a body of a feed can be used.
enum class FeedState {
  waiting,     ///< no pose of its sensor has come yet
  collecting,  ///< poses come, but how they relate to the room is not known yet: FeedStatus::advice
  registered,  ///< its poses are used
  lost,        ///< its poses have ended, or the system does not see the sensor
  disagrees    ///< our cameras contradict it; it is registered anew
};
inline constexpr EnumNames<FeedState, 5> k_feed_states{
    {"waiting", "collecting", "registered", "lost", "disagrees"}};

struct FeedStatus {
  std::string feed, body;
  FeedState state = FeedState::waiting;
  std::string advice = {};               ///< what to do, or why; empty: nothing
  std::optional<Delay> delay = {};       ///< measured against our cameras
  double stddev_mm = 0, stddev_deg = 0;  ///< registration errors at the body, where registered
};

/// The poses of one other tracking system as motions of bodies in the room. It knows no sockets and no clock
/// but the stamps it is given, so the same input gives the same results.
class ForeignTracker {
 public:
  explicit ForeignTracker(FeedSetup setup);

  /// Processes what has arrived, in the order of arrival. At most k_most_at_once poses count, the newest;
  /// poses of unknown sensors and those that are not finite are left out.
  void receive(std::span<const ArrivedPose> poses);
  /// The pose of a body by our cameras alone. Give it before update().
  void add_own(const std::string& body, const Fix& own);
  /// Registers as far as possible, with what was received and added.
  void update();

  /// The motions of the bodies whose poses can be used now, in the world frame, with the covariance of noise,
  /// registration and delay. A body whose poses have ended stays with the time of the last one.
  std::vector<BodyFilter> motions(Stamp now) const;
  std::vector<FeedStatus> statuses(Stamp now) const;
  /// What has changed since the last call, as sentences for people.
  std::vector<std::string> take_notes(Stamp now);

  static constexpr std::size_t k_most_at_once = 512;

 private:
  struct Sensor {
    FeedBody setup;
    std::optional<BodyFilter> motion = {};  // in the feed's frame, by its clock before the delay
    FeedRegistration registration = {};
    bool has_rotation = true, is_lost = false;
    std::optional<Stamp> arrived_at = {};
    FeedNoise noise = {};
    FeedState reported = FeedState::waiting;
  };
  void receive(const ArrivedPose& arrived, Sensor* sensor);
  std::optional<Registration> registration_of(const Sensor& sensor) const;
  FeedStatus status_of(const Sensor& sensor, Stamp now) const;

  FeedSetup setup_;
  FeedClock clock_;
  std::vector<Sensor> sensors_;
  std::size_t refused_ = 0;
  bool is_refusal_reported_ = false;
};

/// The best estimate of a body's motion by our cameras and a feed, both up to now: combined by their
/// covariances where both have seen it lately, else that of the one that has. `camera` may be null.
BodyFilter combined(const BodyFilter* camera, const BodyFilter& feed, const MotionModel& model = {});

}  // namespace limn::tracker
