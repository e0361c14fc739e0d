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

/// Where a guest's camera was when it took an image.
struct TabletPose {
  /// The camera with its lens as far as it is known, and its place; none: `why` says what to do.
  std::optional<Imager> view;
  std::string why;
  int markers = 0;    ///< that the place rests on
  double rms_px = 0;  ///< of their corners, each
  /// Bodies of a single marker that the guest sees elsewhere than `tracks` says, for they are being moved:
  /// where they are by the guest's own image.
  std::vector<Track> moved;
  /// Of the lens: one standard deviation of its focal length, and the images that it was found in.
  double focal_stddev_px = 0;
  int lens_frames = 0;
};

/// Finds a guest's camera by the markers in its images, and its lens while it looks round. One a device.
/// Pure: the same images give the same answers. What is drawn by `view` fits the image that it was found
/// in, and no other: nothing is smoothed.
class TabletLocalizer {
 public:
  /// `lenses` are what is known of the device's from before, one for each aspect ratio of its images.
  explicit TabletLocalizer(tracker::Families families,
                           std::span<const calib::IntrinsicsEstimate> lenses = {});

  /// `bgr` is a whole image, sRGB, of any size. `bodies` are what markers stand on, `tracks` where those
  /// are; a body without a track, or with a lost one, is not to be gone by.
  TabletPose look(const cv::Mat& bgr, std::span<const Body> bodies, std::span<const Track> tracks);

  /// Learns of the lens what the last image tells: a millisecond or two that need not be waited for.
  void learn();

  /// What is known of the lenses. `has_learnt`: noticeably more than when they were last asked for.
  std::vector<calib::IntrinsicsEstimate> lenses() const;
  bool has_learnt() const;
  void note_kept();

 private:
  // Images of one aspect ratio, in pixels of its lens's own size.
  struct Aspect {
    calib::OnlineIntrinsics lens;
    calib::IntrinsicsEstimate used;  // for drawing: it stays until the found one differs noticeably
    double kept_stddev_px = 0;
  };
  Aspect& aspect_of(int width, int height);
  void note_views(const Imager& camera,
                  std::span<const tracker::Detection> detections,
                  std::span<const Body> bodies,
                  std::span<const Track> tracks);

  tracker::Detector detector_;
  std::vector<Aspect> aspects_;         // the newest last
  int width_ = 0;                       // of the last image
  std::optional<Pose> last_;            // camera_from_world, if the last image gave one
  std::vector<calib::BodyView> views_;  // of the last image, to learn from
};

}  // namespace limn::remote
