#pragma once

// Square markers: finding them in an image, and the pose of each from one image.
#include <array>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "limn/export.h"
#include "limn/image.h"
#include "limn/pose.h"
#include "limn/rig.h"

namespace limn::LIMN_VERSIONED {

/// A marker found in an image.
struct Marker {
  /// As the detector was given it; of a file, without its folder.
  std::string family = {};
  /// A number, or the file of a template.
  std::string id = {};
  /// Top-left, top-right, bottom-right and bottom-left corner of the black square as the marker stands
  /// upright; pixels of the raw image.
  std::array<Point2, 4> corners_px = {};
  /// The covariance of each corner's pixel: 2 x 2, row by row, px². The default is a standard deviation of
  /// 0.2 px, for corners that another detector found. Detector measures them.
  std::array<std::array<double, 4>, 4> corner_covariances = {
      {{0.04, 0, 0, 0.04}, {0.04, 0, 0, 0.04}, {0.04, 0, 0, 0.04}, {0.04, 0, 0, 0.04}}};
  /// False where a corner itself is covered and follows from the visible parts of its two sides.
  std::array<bool, 4> corner_visible = {true, true, true, true};
  /// Probability that the id is right; Detector gives only markers with 0.9 and more.
  double score = 1;
};

/// How a camera turns light into grey levels.
enum class Encoding { linear, srgb };

struct DetectorOptions {
  /// Smallest difference between black and white, grey levels of 255. Lower finds markers in the dark,
  /// slower.
  int min_contrast = 16;
  /// Smallest side, pixels.
  double min_side_px = 6;
  /// The wrong one makes markers appear a little too small.
  Encoding encoding = Encoding::linear;
  /// Also finds markers that fingers break up; takes half as much time again.
  bool broken_markers = true;
  /// Fits the pattern of small markers: corners are up to ten times better; slower.
  bool pattern_fits = true;
  /// For one image; the result does not depend on it.
  int threads = 1;
  /// Where relative names of family files begin; empty: the current folder.
  std::filesystem::path folder = {};
};

/// Finds markers in images. It holds its buffers, so use one for each thread.
///
///     limn::Detector detector({"apriltag_36h11"});
///     for (const limn::Marker& marker : detector.detect(image.view())) …
class LIMN_API Detector {
 public:
  /// Families: `apriltag_36h11`, `aruco_4x4_50` and the other dictionaries of OpenCV, `apriltag_41h12` and
  /// the others of AprilTag 3, `aruco_mip_36h12`, `artoolkit_3x3` and the other barcodes, `aruco:FILE.yml`,
  /// `artoolkit:FILE.patt`. `_inverted` after the name means light on dark. Error: no family, an unknown one
  /// (with a list of all), a broken file.
  explicit Detector(const std::vector<std::string>& families, const DetectorOptions& options = {});
  Detector(Detector&&) noexcept;
  Detector& operator=(Detector&&) noexcept;
  ~Detector();

  /// The markers of an image as the camera took it, in no particular order. A grey image is read where it is;
  /// one in colour is converted. With the camera, sides may be bent by its lens; its size must then be the
  /// image's. Corners are pixels of the raw image either way. Error: no image, or one of another size.
  std::vector<Marker> detect(const ImageView& image, const Imager* camera = nullptr);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// A marker's pose from one image. Marker frame: origin in the centre, x right, y down, z into the paper.
struct MarkerPose {
  Pose camera_from_marker = {};
  Covariance6 covariance = {};
  /// Residual of the corners.
  double rms_px = 0;
  /// Likelihood beside the other pose; those of a marker add up to 1.
  double weight = 1;
};

/// The poses that a marker of this side (m, the black square's outer edges) may have: a flat square far away
/// or almost straight ahead fits two. Likeliest first; none if the corners are no image of a square. Error: a
/// side that is not positive, a corner's covariance that is none.
LIMN_API std::vector<MarkerPose> marker_poses(const Marker& marker, double size_m, const Imager& camera);

/// Draws a whole marker with its white margin, grey, to print or to show, with about this many pixels (1 to
/// 1000) for each cell. Error: an unknown family or id.
LIMN_API Image draw_marker(const std::string& family, const std::string& id, int pixels_per_cell = 20);

}  // namespace limn::LIMN_VERSIONED
