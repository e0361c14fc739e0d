#pragma once

#include <filesystem>
#include <vector>

#include "device/camera_source.h"

namespace limn::device {

struct ImageSequenceCameraOptions {
  std::string name = "camera0";   ///< The camera's name in its frames.
  double frames_per_second = 30;  ///< Determines the frames' stamps only; next() never waits.
  bool repeat = false;            ///< Whether to start again after the last image instead of ending.
};

/// A camera that plays stored images: all images of a folder (is_image_name) in the order of their names, or
/// one file. Stamps start at the session clock's zero and advance by the frame period, so that each replay is
/// the same.
class ImageSequenceCamera : public CameraSource {
 public:
  /// Errors: no such path, no image in the folder, first image unreadable.
  static Result<ImageSequenceCamera> open(const std::filesystem::path& path,
                                          const ImageSequenceCameraOptions& options = {});

  const std::string& name() const override { return options_.name; }
  cv::Size size() const override { return size_; }
  /// Error after the last image, for an unreadable image, and for an image of another size than the first.
  Result<Frame> next() override;
  bool is_finite() const override { return !options_.repeat; }
  std::string description() const override;

 private:
  ImageSequenceCamera() = default;
  ImageSequenceCameraOptions options_;
  std::vector<std::filesystem::path> images_;
  cv::Size size_;
  std::size_t shown_ = 0;  // number of frames returned so far
  int used_bits_ = 0;      // bits of 16-bit samples; grows with the brightest so far, so that none is clipped
};

}  // namespace limn::device
