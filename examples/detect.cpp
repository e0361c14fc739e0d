// detect IMAGE FAMILY [CAMERA SIDE_MM]: prints the markers of an image, and with a camera file their poses.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <optional>

#include "limn/error.h"
#include "limn/image.h"
#include "limn/markers.h"

namespace {

void print_poses(const limn::Marker& marker, double side_m, const limn::Imager& camera) {
  for (const limn::MarkerPose& pose : limn::marker_poses(marker, side_m, camera)) {
    const auto& p = pose.camera_from_marker.translation;
    // Element (5, 5) of the covariance: the variance of the distance along the camera's axis.
    std::printf("  at (%.1f, %.1f, %.1f) mm, %.2f mm standard deviation in depth, weight %.2f\n", 1e3 * p[0],
                1e3 * p[1], 1e3 * p[2], 1e3 * std::sqrt(pose.covariance[35]), pose.weight);
  }
}

}  // namespace

int main(int count, char** words) try {
  if (count != 3 && count != 5) {
    std::fprintf(stderr, "detect IMAGE FAMILY [CAMERA SIDE_MM]\n");
    return 2;
  }
  const limn::Image image = limn::read_image(words[1], limn::PixelFormat::grey);
  std::optional<limn::Imager> camera;
  if (count == 5) camera = limn::Imager::load(words[3]);

  limn::Detector detector({words[2]});
  for (const limn::Marker& marker : detector.detect(image.view(), camera ? &*camera : nullptr)) {
    std::printf("%s:%s corner (%.2f, %.2f) px, score %.3f\n", marker.family.c_str(), marker.id.c_str(),
                marker.corners_px[0][0], marker.corners_px[0][1], marker.score);
    if (camera) print_poses(marker, 1e-3 * std::atof(words[4]), *camera);
  }
  return 0;
} catch (const limn::Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
