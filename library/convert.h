#pragma once

#include <opencv2/core/mat.hpp>
#include <string>
#include <utility>

#include "core/imager.h"
#include "core/pose.h"
#include "core/result.h"
#include "core/rig.h"
#include "core/stage.h"
#include "limn/error.h"
#include "limn/image.h"
#include "limn/pose.h"
#include "limn/rig.h"

/// Between the types of the public headers (limn::v0_1::Pose) and those of the rooms (limn::Pose). No number
/// changes.
namespace limn::LIMN_VERSIONED {

/// The value, or its error as an exception.
template <class T>
T value_of(limn::Result<T> result) {
  if (!result) throw Error(result.message());
  return std::move(result).value();
}
void throw_error(const limn::Status& status);

/// Calls `function` of the caller for a room's stages and remembers that it asked to stop.
class StageReporter {
 public:
  explicit StageReporter(const ReportProgress& report) : report_(report) {}
  /// Empty if the caller gave no function.
  limn::ReportStage function();
  /// As value_of(); throws Stopped if the caller asked to stop.
  template <class T>
  T value_of(limn::Result<T> result) const {
    if (!result && is_stopped_) throw Stopped(result.message());
    return LIMN_VERSIONED::value_of(std::move(result));
  }

 private:
  const ReportProgress& report_;
  bool is_stopped_ = false;
};

inline Point2 to_public(const Eigen::Vector2d& px) { return {px.x(), px.y()}; }
inline Point3 to_public(const Eigen::Vector3d& p) { return {p.x(), p.y(), p.z()}; }
Covariance6 to_public(const limn::Matrix6d& covariance);
Pose to_public(const limn::Pose& pose);

inline Eigen::Vector2d to_room(const Point2& px) { return {px[0], px[1]}; }
inline Eigen::Vector3d to_room(const Point3& p) { return {p[0], p[1], p[2]}; }
limn::Pose to_room(const Pose& pose);

/// The image where it is. Error: no pixels, a size or stride that cannot be.
cv::Mat mat_of(const ImageView& image);
/// The same for writing; the width and height must be those given.
cv::Mat mat_of(const MutableImageView& image, int width, int height);
/// Grey, where it is if it is grey already.
cv::Mat grey_of(const ImageView& image);
/// BGR, where it is if it is BGR already; a grey image stays grey.
cv::Mat bgr_or_grey_of(const ImageView& image);
/// Writes a BGR image in the format of `out`, which must not be grey.
void write_bgr(const cv::Mat& bgr, const MutableImageView& out);
/// A BGR image as RGB.
Image rgb_of(const cv::Mat& bgr);

struct Imager::Impl {
  limn::Imager imager;
};
Imager to_public(limn::Imager imager);
inline const limn::Imager& to_room(const Imager& imager) { return imager.impl().imager; }

struct Rig::Impl {
  limn::Rig rig;
};
inline const limn::Rig& to_room(const Rig& rig) { return rig.impl().rig; }

}  // namespace limn::LIMN_VERSIONED
