#pragma once

#include <opencv2/core/mat.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "calib/online_intrinsics.h"
#include "core/imager.h"
#include "core/marker.h"
#include "core/track.h"
#include "tracker/body_correspondences.h"
#include "tracker/detector.h"

namespace limn::remote {

/// The pose of a tablet's camera at the moment of an image.
struct TabletPose {
  /// The camera with its estimated lens and its pose; nullopt: none was found, and `why` says what to do.
  std::optional<Imager> view;
  std::string why;
  int markers = 0;    ///< How many markers the pose was fitted to.
  double rms_px = 0;  ///< The residual of their corners.
  /// The covariance of the camera's pose, camera_from_world, for the lens as it is taken to be; and how the
  /// pose depends on that lens (pose_by_lens.h).
  Matrix6d covariance = Matrix6d::Zero();
  Eigen::Matrix<double, 6, 3> by_lens = Eigen::Matrix<double, 6, 3>::Zero();
  /// New tracks of bodies of a single marker that the tablet sees elsewhere than `tracks` says, since
  /// somebody is moving them.
  std::vector<Track> moved;
  double focal_stddev_px = 0;  ///< Standard deviation of the lens's focal length.
  int lens_frames = 0;         ///< How many images the lens was estimated from.
};

/// Finds the pose of one tablet's camera from the markers in its images, and estimates its lens over many
/// images. The same images give the same answers. Nothing is smoothed: `view` fits its own image only.
class TabletLocalizer {
 public:
  /// `lenses` are earlier estimates for the same device, one for each aspect ratio of its images.
  explicit TabletLocalizer(tracker::Families families,
                           std::span<const calib::IntrinsicsEstimate> lenses = {});

  /// Finds the camera's pose. `bgr` is a whole image, sRGB, of any size. `bodies` carry the markers, `tracks`
  /// are their poses in the world; a body without a track, or with a lost one, is not used.
  TabletPose localize(const cv::Mat& bgr, std::span<const Body> bodies, std::span<const Track> tracks);

  /// Improves the lens by the last image. It takes 1 to 2 ms, which the answer need not wait for.
  void update_intrinsics();

  /// The estimates of the lenses, one for each aspect ratio.
  std::vector<calib::IntrinsicsEstimate> lenses() const;
  /// Whether an estimate has become noticeably better since mark_lenses_saved().
  bool has_better_lenses() const;
  void mark_lenses_saved();

 private:
  // The lens of images of one aspect ratio, in pixels of the lens's own size.
  struct Aspect {
    calib::OnlineIntrinsics lens;
    calib::IntrinsicsEstimate used;  // for drawing; it is replaced when `lens` differs noticeably
    double saved_stddev_px = 0;
  };
  Aspect& aspect_of(int width, int height);
  void collect_views(const Imager& camera,
                     std::span<const tracker::Detection> detections,
                     std::span<const Body> bodies,
                     std::span<const Track> tracks);

  tracker::Detector detector_;
  std::vector<Aspect> aspects_;         // in the order of their last use
  int width_ = 0;                       // width of the last image, px
  std::optional<Pose> last_pose_;       // camera_from_world of the last image, if it was found
  std::vector<calib::BodyView> views_;  // bodies in the last image, for update_intrinsics()
};

}  // namespace limn::remote
