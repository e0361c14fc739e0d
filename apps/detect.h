#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/enum_names.h"
#include "core/result.h"
#include "tracker/refine.h"

namespace limn::apps {

/// How a marker's pose is computed from its corners.
enum class PoseMethod {
  ippe,     ///< Both planar branches, refined.
  triangle  ///< The method of the 2011 paper.
};
/// The names of --pose.
inline constexpr EnumNames<PoseMethod, 2> k_pose_methods{{"ippe", "triangle"}};

struct DetectOptions {
  std::vector<std::filesystem::path> images;
  /// Families as in docs/formats.md. The default is the pair that `limn markers` is used with most.
  std::vector<std::string> families = {"apriltag_36h11", "aruco_4x4_50"};
  std::filesystem::path camera;  ///< Any file that load_imager reads; empty: no lens, no poses.
  double size_mm = 0;            ///< Side of the black square; poses need it and the camera.
  PoseMethod pose = PoseMethod::ippe;
  tracker::Encoding encoding = tracker::Encoding::linear;
  std::filesystem::path csv, json, draw;  ///< Output files, `draw` is a folder; empty: not written.
  int threads = 1;                        ///< Images processed at the same time; with `repeat` always one.
  int repeat = 0;  ///< N: also measures the median time of N detections of the image in memory.
};

/// Prints one line for each marker and writes the files asked for. An image that cannot be read is reported
/// on stderr; the others are still processed, and the status is an error that counts the failures.
Status run_detect(const DetectOptions& options);

}  // namespace limn::apps
