#include "limn/markers.h"

#include <memory>
#include <mutex>

#include "library/python/calls.h"
#include "library/python/record.h"

namespace limn::python {
namespace {

// A detector that several threads may use: they wait for each other.
class SharedDetector {
 public:
  SharedDetector(const std::vector<std::string>& families, const DetectorOptions& options)
      : detector_(families, options) {}

  std::vector<Marker> detect(const ImageView& image, const Imager* camera) {
    const std::lock_guard lock(mutex_);
    return detector_.detect(image, camera);
  }

 private:
  std::mutex mutex_;
  Detector detector_;
};

std::unique_ptr<SharedDetector> new_detector(const std::vector<std::string>& families,
                                             int min_contrast,
                                             double min_side_px,
                                             Encoding encoding,
                                             bool broken_markers,
                                             bool pattern_fits,
                                             int threads,
                                             const std::optional<std::filesystem::path>& folder) {
  const DetectorOptions options = {min_contrast, min_side_px, encoding,           broken_markers,
                                   pattern_fits, threads,     folder.value_or("")};
  return without_gil([&] { return std::make_unique<SharedDetector>(families, options); });
}

void add_marker(py::module_& module) {
  Record<Marker>(
      module, "Marker",
      R"(A marker found in an image; px are pixels of the raw image, (0, 0) is the centre of the top-left
pixel.)")
      .field("family", &Marker::family, "As the detector was given it, files without their folders.")
      .field("id", &Marker::id, "A number, or the file of a template; a str.")
      .array<4, 2>(
          "corners_px", &Marker::corners_px,
          R"(Top-left, top-right, bottom-right and bottom-left corner of the black square as the marker stands
upright, shape (4, 2).)")
      .array<4, 2, 2>(
          "corner_covariances", &Marker::corner_covariances,
          R"(The covariance of each corner: px², shape (4, 2, 2). To the constructor None is a standard deviation
of 0.2 px, for corners that another detector found; Detector measures them.)")
      .array<4>(
          "corner_visible", &Marker::corner_visible,
          R"(False where a corner itself is covered and follows from the visible parts of its two sides, shape
(4,).)")
      .field("score", &Marker::score,
             "Probability that the id is right; Detector gives only markers with 0.9 and more.")
      .init(
          [](std::string family, std::string id, const Numbers<double, 4, 2>& corners,
             const std::optional<Numbers<double, 4, 2, 2>>& covariances, const Numbers<bool, 4>& visible,
             double score) {
            Marker marker{.family = std::move(family), .id = std::move(id), .score = score};
            marker.corner_visible = visible.values;
            for (std::size_t i = 0; i < 4; ++i) {
              std::copy_n(&corners.values[2 * i], 2, marker.corners_px[i].begin());
              if (covariances)
                std::copy_n(&covariances->values[4 * i], 4, marker.corner_covariances[i].begin());
            }
            return marker;
          },
          py::arg("family"), py::arg("id"), py::arg("corners_px"), py::arg("corner_covariances") = py::none(),
          py::arg_v("corner_visible", py::make_tuple(true, true, true, true), "(True, True, True, True)"),
          py::arg("score") = 1.0)
      .ended();
}

void add_detector(py::module_& module) {
  const DetectorOptions defaults;
  py::class_<SharedDetector>(
      module, "Detector",
      R"(Finds markers in images. It holds its buffers, so that threads that share one wait for each other:
use one for each thread.

    detector = limn.Detector(["apriltag_36h11"])
    for marker in detector.detect(image): ...)")
      .def(py::init(&new_detector), py::arg("families"), py::kw_only(),
           py::arg("min_contrast") = defaults.min_contrast, py::arg("min_side_px") = defaults.min_side_px,
           py::arg_v("encoding", defaults.encoding, "'linear'"),
           py::arg("broken_markers") = defaults.broken_markers,
           py::arg("pattern_fits") = defaults.pattern_fits, py::arg("threads") = defaults.threads,
           py::arg("folder") = py::none(),
           R"(families: a list of `apriltag_36h11`, `aruco_4x4_50` and the other dictionaries of OpenCV,
`apriltag_41h12` and the others of AprilTag 3, `aruco_mip_36h12`, `artoolkit_3x3` and the other
barcodes, `aruco:FILE.yml`, `artoolkit:FILE.patt`; `_inverted` after the name: light on dark.
min_contrast: smallest difference between black and white, grey levels; lower: in the dark, slower.
min_side_px: smallest side. encoding: 'linear' or 'srgb', how the camera turns light into grey
levels; the wrong one makes markers appear a little too small. broken_markers: also finds those that
fingers break up; half as much time again. pattern_fits: fits the pattern of small markers: corners
up to ten times better, slower. threads: for one image; the result does not depend on it. folder:
where relative names of family files begin. Error: an unknown family, with a list of all; a broken
file.)")
      .def(
          "detect",
          [](SharedDetector& detector, const ImageArray& image, const Imager* camera, PixelFormat format) {
            const ImageView view = view_of(image, format);
            return without_gil([&] { return detector.detect(view, camera); });
          },
          py::arg("image"), py::arg("camera") = nullptr, py::kw_only(),
          py::arg_v("format", PixelFormat::rgb, "'rgb'"),
          R"(The markers of an image as the camera took it: uint8, (height, width), which is read where it is, or
(height, width, 3) in `format` 'rgb' or 'bgr', which is converted. Rows may have gaps between them.
With the camera, sides may be bent by its lens; its size must then be the image's. Corners are
pixels of the raw image either way. Other threads of Python run meanwhile. Error: no image, or one
of another size.)");
}

}  // namespace

void add_markers(py::module_& module) {
  add_marker(module);
  Record<MarkerPose>(
      module, "MarkerPose",
      R"(A marker's pose from one image. Marker frame: origin in the centre, x right, y down, z into the
paper.)")
      .field("camera_from_marker", &MarkerPose::camera_from_marker, "The pose.")
      .array<6, 6>(
          "covariance", &MarkerPose::covariance,
          R"(Of a small change (w, v): w (rad) is a rotation about the camera's axes, R' = Exp(w) R; v (m) is
added to the translation. Shape (6, 6).)")
      .field("rms_px", &MarkerPose::rms_px, "Residual of the corners.")
      .field("weight", &MarkerPose::weight,
             "Likelihood beside the other pose; those of a marker add up to 1.")
      .ended();
  add_detector(module);
  module.def(
      "marker_poses",
      [](const Marker& marker, double size_m, const Imager& camera) {
        return without_gil([&] { return marker_poses(marker, size_m, camera); });
      },
      py::arg("marker"), py::arg("size_m"), py::arg("camera"),
      R"(The poses that a marker of this side (m, the black square's outer edges) may have: a flat square far
away or almost straight ahead fits two. Likeliest first; none if the corners are no image of a
square. Error: a side that is not positive, a corner's covariance that is none.)");
  module.def(
      "draw_marker",
      [](const std::string& family, const std::string& id, int pixels_per_cell) {
        return owning(without_gil([&] { return draw_marker(family, id, pixels_per_cell); }));
      },
      py::arg("family"), py::arg("id"), py::arg("pixels_per_cell") = 20,
      R"(Draws a whole marker with its white margin, to print or to show, with about this many pixels (1 to
1000) for each cell: grey, (height, width). Error: an unknown family or id.)");
}

}  // namespace limn::python
