#pragma once

#include <Eigen/Core>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "core/enum_names.h"
#include "core/pose.h"
#include "core/result.h"
#include "tracker/hand_eye.h"

namespace limn::remote {

/// The marker on a pair of glasses at a moment, as the room's cameras measured it.
struct MeasuredMarker {
  double at_s = 0;  ///< By the session's clock.
  Pose world_from_marker;
  Matrix6d covariance = Matrix6d::Identity() * 1e-6;
  /// By the lens's errors, as in MeasuredView; 0 for the room's cameras.
  Eigen::Matrix<double, 6, 3> by_lens = Eigen::Matrix<double, 6, 3>::Zero();
};

/// The eye of a pair of glasses by their own odometry (the feed).
struct OdometryPose {
  double at_s = 0;           ///< By the page's clock.
  double received_at_s = 0;  ///< By the session's clock.
  Pose feed_from_eye;
};

/// The glasses' own camera at a moment, as the markers in its picture give it, and as the odometry does.
struct MeasuredView {
  double at_s = 0;         ///< By the page's clock, at the frame that both belong to.
  Pose feed_from_camera;   ///< By the odometry; here the camera has y up and looks along -z, as in WebXR.
  Pose camera_from_world;  ///< By the markers; here it has y down and looks along z, as an imager.
  Matrix6d covariance = Matrix6d::Identity() * 1e-6;  ///< For camera_from_world.
  /// How camera_from_world (boxplus's delta) depends on errors of the stated lens: a share of the focal
  /// length, and the image's centre in x and y as shares of the focal length.
  Eigen::Matrix<double, 6, 3> by_lens = Eigen::Matrix<double, 6, 3>::Zero();
};

enum class GlassesState {
  waiting,        ///< The cameras have not seen the marker yet, or the glasses' camera no markers.
  looking_round,  ///< The registration needs more motion; advice() says which.
  registered,     ///< world_from_feed is known well enough to draw with.
  lost,           ///< The glasses do not track, or their poses no longer arrive.
  asleep          ///< The page is hidden, or the glasses were taken off.
};
inline constexpr EnumNames<GlassesState, 5> k_glasses_states{
    {"waiting", "looking_round", "registered", "lost", "asleep"}};

struct GlassesOptions {
  /// How much the odometry drifts, as a random walk: standard deviations after one second. Larger values
  /// follow the cameras faster and average less.
  double drift_m = 0.3e-3, drift_rad = 0.02 * 0.017453;
  /// Standard deviations of a single pose of the odometry, without drift.
  double odometry_m = 0.3e-3, odometry_rad = 0.5e-3;
  /// The registration is used below these standard deviations at the eye, and given up above the others.
  double use_m = 2e-3, use_rad = 0.1 * 0.017453;
  double give_up_m = 10e-3, give_up_rad = 0.5 * 0.017453;
  /// The glasses have no marker; add_view() gets what their own camera sees.
  bool by_camera = false;
  /// Standard deviations of constant errors of what the browser states of the camera: its pose, the focal
  /// length as a share, and the image's centre as a share of the focal length. They are estimated, too.
  double camera_m = 0.3e-3, camera_rad = 0.5e-3, focal_share = 1e-3, centre_share = 1e-3;
};

/// For glasses that are registered by their own camera. Its views are more exact than a marker on a head, and
/// its pose belongs to the same frame, so that the noise of the odometry is stated less cautiously.
GlassesOptions camera_options();

/// The relation of a pair of glasses to the room.
struct GlassesPlace {
  Pose world_from_feed;
  Matrix6d covariance = Matrix6d::Zero();  ///< As in boxplus (core/pose.h).
  Pose marker_from_eye;                    ///< By camera: the constant error of its pose.
  double delay_s = 0;                      ///< The session's clock minus the page's, for the same motion.
  double delay_stddev_s = 0;
  double eye_stddev_m = 0, eye_stddev_rad = 0;  ///< The eye's newest pose in the world: the largest axis.
};

/// Registers the odometry of a pair of glasses to the room: world_from_marker * marker_from_eye =
/// world_from_feed * feed_from_eye, where neither marker_from_eye nor the clocks' offset is known. The first
/// solution is tracker::solve_hand_eye with the delay of tracker::estimate_delay. From it on an extended
/// Kalman filter over both poses and the delay uses each new pair once; world_from_feed is a random walk
/// about the head, so that old pairs fade as the odometry drifts. Pairs far outside the stated covariance are
/// left out; several in turn start the registration again, since the marker has moved on the glasses. After a
/// jump of the odometry only world_from_feed starts again, with the marker_from_eye that is known.
///
/// By the glasses' own camera (GlassesOptions::by_camera) the same filter starts with the first view: the
/// camera takes the place of the marker and the eye alike, so that marker_from_eye is nearly the identity,
/// and there is no delay, since picture and pose belong to one frame. It has no clock and no threads.
class GlassesRegistration {
 public:
  /// `marker`: the marker's name, for messages.
  explicit GlassesRegistration(std::string marker, const GlassesOptions& options = {});

  /// Errors, and the pose is left out: numbers that are not finite, a quaternion that is not of unit length,
  /// a position more than 1 km away. A clock that runs backwards or jumps starts the registration again, and
  /// is an error, too.
  Status add_eye(const Eigen::Vector4d& rotation_wxyz,
                 const Eigen::Vector3d& translation_m,
                 double at_s,
                 double received_at_s);
  /// In the order of time; others are left out.
  void add_marker(const MeasuredMarker& marker);
  /// By camera only: in the order of time. One from before the odometry started or jumped, or with numbers
  /// that are not finite, is left out.
  void add_view(const MeasuredView& view);
  /// By camera only: why the newest picture gave no view, a sentence that says what to do.
  void set_view_problem(const std::string& why) { view_problem_ = why; }
  /// The page says that the glasses do not track, sleep, or track again. After both the odometry counts as
  /// another one, since it may have jumped.
  void set_lost();
  void set_asleep();
  /// Makes pairs of what was added, and updates state and place. `now_s` is by the session's clock.
  void update(double now_s);

  GlassesState state() const { return state_; }
  /// What to do, or what is wrong, as a sentence; empty when registered.
  const std::string& advice() const { return advice_; }
  /// The place while registered; else nullopt: nothing may be drawn.
  const std::optional<GlassesPlace>& place() const { return place_; }
  /// world_from_eye of the newest pose; nullopt unless registered.
  std::optional<Pose> world_from_eye() const;
  /// Pairs used, and pairs left out as wrong.
  int used() const { return used_; }
  int left_out() const { return left_out_; }

 private:
  static constexpr int k_size = 16;
  using Covariance = Eigen::Matrix<double, k_size, k_size>;
  struct Filter {
    Pose world_from_feed, marker_from_eye;
    double delay_s = 0;
    Eigen::Vector3d lens = Eigen::Vector3d::Zero();  // errors as in MeasuredView::by_lens
    Covariance covariance = Covariance::Zero();      // [world_from_feed; marker_from_eye; delay; lens]
    double at_s = 0;
  };
  using Step = Eigen::Matrix<double, k_size, 1>;  // a change of the state, in the covariance's order
  struct Moving {
    Pose pose;
    Vector6d speed;  // boxplus's delta, per second
  };
  // What a pair says of a step from a state: residual + jacobian * step is noise of this covariance.
  struct PairEquations {
    Vector6d residual;
    Eigen::Matrix<double, 6, k_size> jacobian;
    Matrix6d noise;
  };

  void restart();
  std::optional<Moving> eye_at(double page_s) const;
  bool is_new_place(const MeasuredMarker& marker, const Pose& feed_from_eye) const;
  void start_filter(double now_s);
  Filter filtered(const Filter& prior, int* rejected) const;
  PairEquations equations_at(const Filter& state, const MeasuredMarker& marker, const Moving& eye) const;
  static bool update(const PairEquations& pair, Step* step, Covariance* covariance);
  static void move_by(const Step& step, Filter* filter);
  bool use_pair(const MeasuredMarker& marker, const Moving& eye, Filter* filter) const;
  bool continue_with(const MeasuredMarker& marker, const Moving& eye);
  std::string unseen_advice() const;
  void predict_to(double at_s, const Pose& feed_from_eye, Filter* filter) const;
  void continue_filter();
  void restart_feed(const MeasuredMarker& marker, const Pose& feed_from_eye);
  GlassesPlace place_of(const Filter& filter, double now_s) const;
  void decide_state(double now_s);
  std::string missing_motion() const;

  std::string marker_;
  GlassesOptions options_;
  std::deque<OdometryPose> eyes_;
  std::deque<MeasuredMarker> markers_;  // newer than the newest pair
  std::vector<MeasuredMarker> first_;   // the markers that the filter starts from
  std::optional<MeasuredMarker> last_marker_;
  std::optional<Pose> last_eye_;
  double clock_offset_s_ = 0;  // least difference of received_at_s and at_s
  double last_start_s_ = 0;
  std::optional<double> marker_seen_s_;
  std::optional<Filter> filter_;
  bool is_feed_new_ = false;  // the odometry may have jumped
  bool is_suspended_ = false, is_asleep_ = false;
  int rejected_in_turn_ = 0, accepted_since_start_ = 0;
  Eigen::Quaterniond started_facing_ = Eigen::Quaterniond::Identity();  // when the feed was new
  double turned_rad_ = 0;                                               // the largest turn since then
  int used_ = 0, left_out_ = 0;
  std::string problem_;       // why the filter could not be started
  std::string view_problem_;  // why the newest picture gave no view
  GlassesState state_ = GlassesState::waiting;
  std::string advice_;
  std::optional<GlassesPlace> place_;
};

}  // namespace limn::remote
