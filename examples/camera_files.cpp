// camera_files CAMERA OUT: reads a camera file of any program, writes it as OUT.cameramodel (mrcal), OUT.yml
// (OpenCV) and OUT_ros.yaml, and checks that a pixel's ray comes back to the pixel.
#include <cmath>
#include <cstdio>
#include <string>

#include "limn/error.h"
#include "limn/rig.h"

int main(int count, char** words) try {
  if (count != 3) {
    std::fprintf(stderr, "camera_files CAMERA OUT\n");
    return 2;
  }
  const limn::Imager camera = limn::Imager::load(words[1]);
  const limn::ImagerParts parts = camera.parts();
  std::printf("%s: %dx%d pixels, %s, focal lengths %.1f and %.1f px\n", parts.name.c_str(), parts.width,
              parts.height, parts.lens_model.c_str(), parts.lens_values[0], parts.lens_values[1]);

  const std::string out = words[2];
  camera.save(out + ".cameramodel");
  camera.save(out + ".yml", limn::CameraFile::opencv);
  camera.save(out + "_ros.yaml", limn::CameraFile::ros);

  // Corners of the image: one metre along the ray of a pixel, and back.
  for (const limn::Point2& px : {limn::Point2{0, 0}, limn::Point2{parts.width - 1.0, parts.height - 1.0}}) {
    const auto ray = camera.unproject(px);
    if (!ray) continue;  // a fisheye lens may have black corners
    limn::Point3 p;
    for (std::size_t i = 0; i < 3; ++i) p[i] = ray->p_origin[i] + ray->d[i];
    const auto back = camera.project(p);
    if (!back) continue;
    const double error_px = std::hypot((*back)[0] - px[0], (*back)[1] - px[1]);
    std::printf("pixel (%.0f, %.0f): back within %.1e px\n", px[0], px[1], error_px);
  }
  return 0;
} catch (const limn::Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
