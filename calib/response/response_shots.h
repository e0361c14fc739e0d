#pragma once

#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "calib/capture.h"
#include "calib/capture_set.h"
#include "calib/response/response_patterns.h"
#include "core/result.h"

namespace limn::calib {

/// The photographs by one camera of one projector's response images.
struct ResponseShots {
  int projector = 0;
  int camera = 0;
  std::filesystem::path folder;  ///< response/projector0/camera0 of the captures
  std::vector<cv::Mat> images;   ///< 8-bit grey or BGR, all of one type, in the order of response_images()
};

/// Every projector shows the response images in turn, and every camera photographs each of them, into the
/// captures' response/ folder. The prototype should stand in front of the rig, and nothing may move.
Status capture_response(const CaptureSet& plan, const CaptureBackend& backend);

/// A projector and a camera with response images.
struct ResponsePair {
  int projector = 0;
  int camera = 0;
};
/// Lists the pairs of the captures; empty when there is no response/ folder. A subfolder that is named after
/// no device is an error.
Result<std::vector<ResponsePair>> response_pairs(const CaptureSet& captures);

/// Reads the photographs of a pair. A missing, damaged or additional image, another size than the camera's,
/// or grey mixed with colour is an error that names the file.
Result<ResponseShots> read_response_shots(const CaptureSet& captures, const ResponsePair& pair);

/// Levels of some pixels' channels in all images, the input of the fits.
struct ResponseSamples {
  int camera = 0;
  int projector = 0;
  size_t count = 0;
  std::vector<uchar> levels;  ///< [sample][image]
  const uchar* at(size_t sample) const { return levels.data() + sample * response_images().size(); }
};

/// Levels from here on may be clipped by the sensor.
constexpr int k_clipped = 251;

/// Samples pixels that the projector illuminates, evenly spread, at most `most`. Errors: none is illuminated
/// (dark), or nearly all are clipped (saturated).
Result<ResponseSamples> sampled(const ResponseShots& shots, size_t most);

/// Indices of the images of one role, in their order.
std::vector<size_t> images_of(ResponseImage::Role role);
/// Indices of the ramp of one channel (0 blue, 1 green, 2 red), darkest first.
std::vector<size_t> ramp_of(int channel);

}  // namespace limn::calib
