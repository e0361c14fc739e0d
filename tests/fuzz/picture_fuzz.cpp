// Small grey images: three bytes, then the levels row by row. The first byte is the width. The lower three
// bits of the second byte are the width in pixels at which a level is drawn; the others choose the lens. The
// lower four bits of the third byte: blurred, sRGB, also follow markers, also train a template. If its upper
// four bits are all set, the image may be larger.
#include <opencv2/imgproc.hpp>

#include "tests/fuzz/fuzz_file.h"
#include "tracker/detector.h"
#include "tracker/marker_pose.h"
#include "tracker/template_training.h"

namespace {

using namespace limn;

constexpr int k_max_pixels = 80 * 80;
constexpr int k_max_large_pixels = 160 * 120;

// An image with one level for each byte, drawn as `scale` x `scale` pixels; blurred, so that edges have a
// slope.
cv::Mat image_of(const std::uint8_t* levels, std::size_t count, int width, int scale, bool blurred) {
  const int height = static_cast<int>(count) / width;
  if (height == 0) return {};
  const cv::Mat small(height, width, CV_8UC1, const_cast<std::uint8_t*>(levels));
  cv::Mat grey;
  cv::resize(small, grey, {}, scale, scale, cv::INTER_NEAREST);
  if (blurred) cv::GaussianBlur(grey, grey, {0, 0}, 0.7);
  return grey;
}

tracker::Families families() {
  const std::string letter =
      std::string("artoolkit:") + LIMN_SOURCE_DIR + "/tests/fuzz/corpus/template/letter.patt";
  return tracker::Families::load(std::vector<std::string>{"apriltag_36h11", "apriltag_16h5", "aruco_4x4_50",
                                                          "aruco_original", "artoolkit_3x3", letter})
      .value();
}

Lens lens_for(const cv::Mat& grey, bool bent) {
  const double f = 1.2 * grey.cols;
  const double cx = (grey.cols - 1) / 2.0;
  const double cy = (grey.rows - 1) / 2.0;
  if (!bent) return Lens::pinhole(f, f, cx, cy);
  return Lens::create("LENSMODEL_OPENCV8", {f, f, cx, cy, -0.35, 0.1, 1e-2, -1e-2, 0.02, 0, 0, 0}).value();
}

// Every image must give valid detections and poses, or none.
void check(const tracker::Detection& detection, const Lens* lens) {
  LIMN_CHECK(detection.score >= 0 && detection.score <= 1 && !detection.marker.id.empty());
  for (std::size_t i = 0; i < 4; ++i) {
    LIMN_CHECK(detection.corners_px[i].allFinite() && detection.corner_covariance[i].allFinite());
    LIMN_CHECK(detection.corner_covariance[i].determinant() > 0);
  }
  if (!lens) return;
  for (const tracker::MarkerPose& pose :
       tracker::marker_poses(*lens, 0.08, detection.corners_px, detection.corner_covariance))
    LIMN_CHECK(pose.camera_from_marker.is_finite() && pose.covariance.allFinite());
}

// Follows the markers after the image has shifted, and once more after a second shift.
void check_followed(tracker::Detector& detector,
                    const cv::Mat& grey,
                    const Lens* lens,
                    std::vector<tracker::Detection> last) {
  std::vector<tracker::Detection> found;
  for (const int moved : {0, 3, 4}) {
    detector.follow(grey.colRange(std::min(moved, grey.cols), grey.cols), lens, last, &found);
    LIMN_CHECK(found.size() <= last.size());
    for (const tracker::Detection& detection : found) check(detection, lens);
    std::swap(found, last);
  }
}

void check_training(const cv::Mat& grey) {
  const auto trained = tracker::train_template(grey);
  if (trained)
    LIMN_CHECK(trained->side_px > 0 && !tracker::template_text(*trained).empty());
  else
    LIMN_CHECK(trained.message().find("expected") != std::string::npos);
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  constexpr std::size_t k_head = 3;
  if (size < k_head) return 0;
  const int width = std::max<int>(1, bytes[0]);
  const int scale = 1 + bytes[1] % 8;
  const int max_pixels = bytes[2] >> 4 == 15 ? k_max_large_pixels : k_max_pixels;
  const auto most = static_cast<std::size_t>(max_pixels / (scale * scale));
  const cv::Mat grey = image_of(bytes + k_head, std::min(size - k_head, most), width, scale, bytes[2] & 1);
  if (grey.empty()) return 0;
  const std::optional<Lens> own_lens =
      bytes[1] & 8 ? std::optional(lens_for(grey, bytes[1] & 16)) : std::nullopt;
  const Lens* lens = own_lens ? &*own_lens : nullptr;
  static tracker::Detector linear(families());
  static tracker::Detector srgb(families(),
                                {.min_contrast = 8, .min_side_px = 3, .encoding = tracker::Encoding::srgb});
  tracker::Detector& detector = bytes[2] & 2 ? srgb : linear;
  const std::vector<tracker::Detection> found = detector.detect(grey, lens);
  for (const tracker::Detection& detection : found) check(detection, lens);
  if (bytes[2] & 4) check_followed(detector, grey, lens, found);
  if (bytes[2] & 8) check_training(grey);
  return 0;
}
