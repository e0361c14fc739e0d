#include "limn/markers.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "library/convert.h"
#include "library/marker_conversion.h"
#include "tracker/detector.h"
#include "tracker/family.h"
#include "tracker/marker_pose.h"

namespace limn::LIMN_VERSIONED {
namespace {

limn::tracker::DetectorOptions to_room(const DetectorOptions& options) {
  return {.min_contrast = options.min_contrast,
          .min_side_px = options.min_side_px,
          .encoding = options.encoding == Encoding::srgb ? limn::tracker::Encoding::srgb
                                                         : limn::tracker::Encoding::linear,
          .broken_markers = options.broken_markers,
          .pattern_fits = options.pattern_fits,
          .threads = options.threads};
}

Marker to_public(const limn::tracker::Detection& detection) {
  Marker marker{.family = detection.marker.family, .id = detection.marker.id, .score = detection.score};
  marker.corner_visible = detection.corner_visible;
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Matrix2d& c = detection.corner_covariance[i];
    marker.corners_px[i] = LIMN_VERSIONED::to_public(detection.corners_px[i]);
    marker.corner_covariances[i] = {c(0, 0), c(0, 1), c(1, 0), c(1, 1)};
  }
  return marker;
}

bool is_covariance(const std::array<double, 4>& c) {
  const bool is_finite =
      std::isfinite(c[0]) && std::isfinite(c[1]) && std::isfinite(c[2]) && std::isfinite(c[3]);
  return is_finite && c[0] > 0 && c[3] > 0 && c[0] * c[3] > c[1] * c[2];
}

}  // namespace

limn::tracker::Detection detection_of(const Marker& marker) {
  limn::tracker::Detection detection;
  detection.marker = {marker.family, marker.id};
  detection.corner_visible = marker.corner_visible;
  detection.score = marker.score;
  for (std::size_t i = 0; i < 4; ++i) {
    const auto& c = marker.corner_covariances[i];
    if (!is_covariance(c))
      throw Error(
          fmt::format("marker {}:{}, corner {}: expected a covariance of its pixel (positive definite, px²), "
                      "found {}, {}, "
                      "{}, {}. Keep the default of 0.2 px where it is not known.",
                      marker.family, marker.id, i, c[0], c[1], c[2], c[3]));
    detection.corners_px[i] = LIMN_VERSIONED::to_room(marker.corners_px[i]);
    detection.corner_covariance[i] << c[0], c[1], c[2], c[3];
  }
  return detection;
}

struct Detector::Impl {
  limn::tracker::Detector detector;
};

Detector::Detector(const std::vector<std::string>& families, const DetectorOptions& options) {
  if (families.empty()) throw Error("detector: expected at least one marker family, found none.");
  impl_ = std::make_unique<Impl>(Impl{limn::tracker::Detector(
      value_of(limn::tracker::Families::load(families, options.folder)), to_room(options))});
}

Detector::Detector(Detector&&) noexcept = default;
Detector& Detector::operator=(Detector&&) noexcept = default;
Detector::~Detector() = default;

std::vector<Marker> Detector::detect(const ImageView& image, const Imager* camera) {
  const cv::Mat grey = grey_of(image);
  const limn::Imager* const imager = camera ? &LIMN_VERSIONED::to_room(*camera) : nullptr;
  if (imager && imager->width > 0 && (imager->width != grey.cols || imager->height != grey.rows))
    throw Error(
        fmt::format("detector: expected an image of {}x{} pixels, the size of camera '{}', found {}x{}. Use "
                    "the camera's own images "
                    "or calibrate this size.",
                    imager->width, imager->height, imager->name, grey.cols, grey.rows));
  std::vector<Marker> markers;
  for (const limn::tracker::Detection& detection :
       impl_->detector.detect(grey, imager ? &imager->lens : nullptr))
    markers.push_back(to_public(detection));
  return markers;
}

std::vector<MarkerPose> marker_poses(const Marker& marker, double size_m, const Imager& camera) {
  if (!(size_m > 0)) throw Error(fmt::format("marker: expected a side in metres (> 0), found {}.", size_m));
  const limn::tracker::Detection detection = detection_of(marker);
  std::vector<MarkerPose> poses;
  for (const limn::tracker::MarkerPose& pose : limn::tracker::marker_poses(
           LIMN_VERSIONED::to_room(camera).lens, size_m, detection.corners_px, detection.corner_covariance))
    poses.push_back({LIMN_VERSIONED::to_public(pose.camera_from_marker),
                     LIMN_VERSIONED::to_public(pose.covariance), pose.rms_px, pose.weight});
  return poses;
}

Image draw_marker(const std::string& family, const std::string& id, int pixels_per_cell) {
  if (pixels_per_cell < 1 || pixels_per_cell > 1000)
    throw Error(fmt::format("marker: expected 1 to 1000 pixels for each cell, found {}.", pixels_per_cell));
  const limn::MarkerDrawing drawing =
      value_of(limn::tracker::draw_whole_marker({family, id}, pixels_per_cell));
  // A detector needs light around a dark square: at least a cell, as on paper.
  const int margin = 2 * pixels_per_cell;
  Image image{.pixels = {},
              .width = drawing.image.cols + 2 * margin,
              .height = drawing.image.rows + 2 * margin,
              .format = PixelFormat::grey};
  image.pixels.resize(static_cast<std::size_t>(image.stride()) * static_cast<std::size_t>(image.height));
  cv::Mat pixels = mat_of(static_cast<ImageView>(image.view()));
  cv::copyMakeBorder(drawing.image, pixels, margin, margin, margin, margin, cv::BORDER_CONSTANT,
                     cv::Scalar(255));
  return image;
}

}  // namespace limn::LIMN_VERSIONED
