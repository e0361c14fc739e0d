#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn::apps {

struct DetectOptions {
  std::vector<std::filesystem::path> images;
  /// Families as in docs/formats.md. The default pair is what `limn markers` is used with most.
  std::vector<std::string> families = {"apriltag_36h11", "aruco_4x4_50"};
  std::filesystem::path camera;  ///< anything load_imager reads; empty: no lens, no poses
  double size_mm = 0;            ///< side of the black square; poses need it and the camera
  std::string pose = "ippe";     ///< ippe: both planar branches, refined; triangle: the 2011 paper's method
  /// linear: grey levels are proportional to light; srgb: webcams, photographs.
  std::string encoding = "linear";
  std::filesystem::path csv, json, draw;  ///< what to write; empty: nothing. `draw` is a folder
  int threads = 1;                        ///< images worked on at a time; with `repeat` always one
  int repeat = 0;                         ///< N: also the median time of N detections of the image in memory
};

/// One line a marker on stdout, and the files asked for. An image that cannot be read is reported on stderr,
/// the others are still done, and the status is an error that counts them.
Status run_detect(const DetectOptions& options);

}  // namespace limn::apps
