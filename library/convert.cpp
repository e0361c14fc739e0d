#include "library/convert.h"

#include <fmt/format.h>

#include <memory>
#include <opencv2/imgproc.hpp>

namespace limn::LIMN_VERSIONED {
namespace {

int channels_of(PixelFormat format) { return format == PixelFormat::grey ? 1 : 3; }

void check_memory(const ImageView& image) {
  const int channels = channels_of(image.format);
  if (image.data && image.width > 0 && image.height > 0 &&
      image.stride >= static_cast<std::ptrdiff_t>(image.width) * channels)
    return;
  throw Error(
      fmt::format("image: expected pixels, a width and a height (> 0), and a stride of at least width times "
                  "{} bytes, found {}{}x{} "
                  "with a stride of {}. Set all members of the view.",
                  channels, image.data ? "" : "no pixels, ", image.width, image.height, image.stride));
}

cv::Mat converted(const cv::Mat& image, int code) {
  cv::Mat out;
  cv::cvtColor(image, out, code);
  return out;
}

}  // namespace

void throw_error(const limn::Status& status) {
  if (!status) throw Error(status.message());
}

limn::ReportStage StageReporter::function() {
  if (!report_) return {};
  return [this](const limn::Stage& stage) {
    is_stopped_ = is_stopped_ || !report_({stage.name, stage.done, stage.total});
    return !is_stopped_;
  };
}

Covariance6 to_public(const limn::Matrix6d& covariance) {
  Covariance6 rows;
  for (int row = 0; row < 6; ++row)
    for (int column = 0; column < 6; ++column)
      rows[static_cast<std::size_t>(6 * row + column)] = covariance(row, column);
  return rows;
}

Pose to_public(const limn::Pose& pose) {
  const Eigen::Quaterniond& q = pose.rotation;
  return {{q.w(), q.x(), q.y(), q.z()}, to_public(pose.translation)};
}

// A quaternion that comes from a room goes back as it is. One that a caller wrote with fewer digits becomes a
// unit.
limn::Pose to_room(const Pose& pose) {
  const auto& q = pose.rotation_wxyz;
  const Eigen::Quaterniond rotation(q[0], q[1], q[2], q[3]);
  limn::Pose out;
  out.translation = to_room(pose.translation);
  out.rotation = rotation;
  const double norm = rotation.norm();
  if (!out.is_finite() || norm < 0.5 || norm > 2)
    throw Error(
        fmt::format("pose: expected a unit quaternion (w, x, y, z) and a translation in metres, found ({}, "
                    "{}, {}, {}) and ({}, {}, "
                    "{}).",
                    q[0], q[1], q[2], q[3], pose.translation[0], pose.translation[1], pose.translation[2]));
  if (std::abs(norm - 1) > 1e-12) out.rotation.normalize();
  return out;
}

cv::Mat mat_of(const ImageView& image) {
  check_memory(image);
  // OpenCV has no type for pixels that are only read.
  return cv::Mat(image.height, image.width, CV_8UC(channels_of(image.format)),
                 const_cast<std::uint8_t*>(image.data), static_cast<std::size_t>(image.stride));
}

cv::Mat mat_of(const MutableImageView& image, int width, int height) {
  if (image.width != width || image.height != height)
    throw Error(fmt::format("image: expected memory for {}x{} pixels, found a view of {}x{}.", width, height,
                            image.width, image.height));
  return mat_of(static_cast<ImageView>(image));
}

cv::Mat grey_of(const ImageView& image) {
  cv::Mat pixels = mat_of(image);
  if (image.format == PixelFormat::grey) return pixels;
  return converted(pixels, image.format == PixelFormat::rgb ? cv::COLOR_RGB2GRAY : cv::COLOR_BGR2GRAY);
}

cv::Mat bgr_or_grey_of(const ImageView& image) {
  const cv::Mat pixels = mat_of(image);
  return image.format == PixelFormat::rgb ? converted(pixels, cv::COLOR_RGB2BGR) : pixels;
}

void write_bgr(const cv::Mat& bgr, const MutableImageView& out) {
  cv::Mat pixels = mat_of(out, bgr.cols, bgr.rows);
  if (out.format == PixelFormat::grey)
    throw Error("image: expected memory for RGB or BGR pixels, found a grey view.");
  if (out.format == PixelFormat::bgr)
    bgr.copyTo(pixels);
  else
    cv::cvtColor(bgr, pixels, cv::COLOR_BGR2RGB);
}

Image rgb_of(const cv::Mat& bgr) {
  Image image{.pixels = {}, .width = bgr.cols, .height = bgr.rows, .format = PixelFormat::rgb};
  image.pixels.resize(static_cast<std::size_t>(image.stride()) * static_cast<std::size_t>(image.height));
  write_bgr(bgr, image.view());
  return image;
}

Imager to_public(limn::Imager imager) {
  return Imager(std::make_shared<const Imager::Impl>(Imager::Impl{std::move(imager)}));
}

}  // namespace limn::LIMN_VERSIONED
