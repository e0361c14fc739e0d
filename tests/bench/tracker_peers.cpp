#include "tests/bench/tracker_peers.h"

#include <memory>

#include "core/opencv_aruco.h"
#include "core/predefined_family.h"
#include "tracker/detector.h"

extern "C" {
#include <apriltag/apriltag.h>
#include <apriltag/tag25h9.h>
#include <apriltag/tag36h11.h>
}

namespace limn::test {
namespace {

constexpr int k_apriltag_wrong_bits = 2;  // the library's default

std::array<Eigen::Matrix2d, 4> unstated() {
  std::array<Eigen::Matrix2d, 4> covariance;
  covariance.fill(Eigen::Matrix2d::Identity());
  return covariance;
}

// Owns what the C library allocates.
class Apriltag {
 public:
  Apriltag(std::span<const std::string> families, float decimate, int threads)
      : detector_(apriltag_detector_create(), apriltag_detector_destroy) {
    for (const std::string& name : families) add(name);
    detector_->quad_decimate = decimate;
    detector_->nthreads = threads;
  }

  std::vector<Found> detect(const cv::Mat& grey) const {
    image_u8_t image = {grey.cols, grey.rows, static_cast<int>(grey.step[0]), grey.data};
    zarray_t* list = apriltag_detector_detect(detector_.get(), &image);
    std::vector<Found> found;
    for (int i = 0; i < zarray_size(list); ++i) {
      apriltag_detection_t* d = nullptr;
      zarray_get(list, i, &d);
      const bool large = std::string(d->family->name) == "tag36h11";
      Found f{{large ? "apriltag_36h11" : "apriltag_25h9", std::to_string(d->id)}, {}, unstated()};
      // AprilTag's pixel centres lie at halves.
      for (int k = 0; k < 4; ++k)
        f.corners_px[static_cast<std::size_t>(k)] = {d->p[k][0] - 0.5, d->p[k][1] - 0.5};
      found.push_back(f);
    }
    apriltag_detections_destroy(list);
    return found;
  }

 private:
  // The families are declared before the detector, because the detector must be destroyed first.
  std::vector<std::shared_ptr<apriltag_family_t>> families_;
  std::unique_ptr<apriltag_detector_t, decltype(&apriltag_detector_destroy)> detector_;

  void add(const std::string& name) {
    if (name == "apriltag_36h11")
      families_.emplace_back(tag36h11_create(), tag36h11_destroy);
    else if (name == "apriltag_25h9")
      families_.emplace_back(tag25h9_create(), tag25h9_destroy);
    else
      return;
    apriltag_detector_add_family_bits(detector_.get(), families_.back().get(), k_apriltag_wrong_bits);
  }
};

}  // namespace

Peer limn_peer(std::span<const std::string> families, int threads) {
  auto detector = std::make_shared<tracker::Detector>(tracker::Families::load(families).value(),
                                                      tracker::DetectorOptions{.threads = threads});
  return {"limn", [detector](const cv::Mat& grey, const Lens* lens) {
            std::vector<Found> found;
            for (const auto& d : detector->detect(grey, lens))
              found.push_back({d.marker, d.corners_px, d.corner_covariance});
            return found;
          }};
}

Peer apriltag_peer(std::span<const std::string> families, float decimate, int threads) {
  auto detector = std::make_shared<Apriltag>(families, decimate, threads);
  return {decimate > 1 ? "AprilTag /2" : "AprilTag",
          [detector](const cv::Mat& grey, const Lens*) { return detector->detect(grey); }};
}

Peer opencv_peer(std::span<const std::string> families) {
  cv::aruco::DetectorParameters parameters;
  parameters.cornerRefinementMethod = cv::aruco::CORNER_REFINE_SUBPIX;
  const std::vector<std::string> names(families.begin(), families.end());
  return {"OpenCV", [names, parameters](const cv::Mat& grey, const Lens*) {
            std::vector<Found> found;
            for (const std::string& name : names) {
              const auto [corners, ids] = find_aruco_markers(
                  grey, aruco_dictionary(find_predefined_family(name)->opencv_dictionary), parameters);
              for (std::size_t i = 0; i < ids.size(); ++i) {
                Found f{{name, std::to_string(ids[i])}, {}, unstated()};
                for (std::size_t k = 0; k < 4; ++k) f.corners_px[k] = {corners[i][k].x, corners[i][k].y};
                found.push_back(f);
              }
            }
            return found;
          }};
}

}  // namespace limn::test
