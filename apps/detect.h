#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn::apps {

struct DetectOptions {
  std::vector<std::filesystem::path> images;
  /// Families as in docs/formats.md. The default is the pair that `limn markers` is used with most.
  std::vector<std::string> families = {"apriltag_36h11", "aruco_4x4_50"};
  std::filesystem::path camera;  ///< Any file that load_imager reads; empty: no lens, no poses.
  double size_mm = 0;            ///< Side of the black square; poses need it and the camera.
  std::string pose =
      "ippe";  ///< ippe: both planar branches, refined; triangle: the method of the 2011 paper.
  /// linear: grey levels are proportional to light; srgb: webcams, photographs.
  std::string encoding = "linear";
  std::filesystem::path csv, json, draw;  ///< Output files, `draw` is a folder; empty: not written.
  int threads = 1;                        ///< Images processed at the same time; with `repeat` always one.
  int repeat = 0;  ///< N: also measures the median time of N detections of the image in memory.
};

/// Prints one line for each marker and writes the files asked for. An image that cannot be read is reported
/// on stderr; the others are still processed, and the status is an error that counts the failures.
Status run_detect(const DetectOptions& options);

}  // namespace limn::apps
