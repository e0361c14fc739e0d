// web_film FOLDER: images of a tablet that is moved around the virtual rig of `limn live`, used as a
// browser's camera. Writes tablet.mjpeg (each view for 0.2 s), the views NN.jpg, and NN-parts.png, the true
// mask of the mirror in each view.
#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "device/jpeg.h"
#include "sim/reference_renderer.h"
#include "sim/sensor_model.h"
#include "sim/trace.h"
#include "sim/world.h"
#include "tracker/marker_image.h"

namespace {

namespace fs = std::filesystem;
using namespace limn;

constexpr int k_views = 8, k_images_a_view = 6, k_width = 640, k_height = 480;
constexpr double k_fov_deg = 65;

// The tablet's camera: it moves around the prototype, 0.65 to 0.8 m away, up to 35 degrees to the side.
Imager tablet(const sim::World& world, int view) {
  const double turn = 2 * std::numbers::pi * view / k_views;
  const double side = 0.6 * std::sin(turn), height = 0.3 * std::cos(2 * turn),
               away = 0.72 + 0.08 * std::cos(turn);
  const Eigen::Vector3d p_middle = world.world_from_prototype.translation;
  const Eigen::Vector3d d = {std::sin(side) * std::cos(height), -std::cos(side) * std::cos(height),
                             std::sin(height)};
  Imager out = viewer_imager(Pose{}, k_width, k_height, k_fov_deg);
  out.name = "tablet";
  out.imager_from_world =
      looking_at(p_middle + away * d, p_middle + Eigen::Vector3d(0.05 * std::cos(3 * turn), 0, 0),
                 {0.1 * std::sin(turn), 0, 1});
  return out;
}

bool write(const fs::path& path, const std::vector<std::uint8_t>& bytes, int times = 1) {
  std::ofstream file(path, std::ios::binary | std::ios::app);
  for (int i = 0; i < times; ++i)
    file.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  return file.good();
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    fmt::print(stderr, "web_film: expected a folder to write to.\n");
    return 2;
  }
  const fs::path folder = argv[1];
  fs::remove_all(folder);
  fs::create_directories(folder);
  auto loaded =
      sim::load_world(fs::path(LIMN_SOURCE_DIR) / "config/worlds/studio.json", tracker::marker_image);
  if (!loaded) {
    fmt::print(stderr, "{}\n", loaded.message());
    return 1;
  }
  sim::World world = std::move(*loaded);
  scene::PosedScene parts = sim::true_poses(world);
  // Parts on the surface are shown by projectors, so the window does not draw them.
  std::erase_if(parts.parts, [](const scene::PosedPart& part) { return part.slot != "mirror"; });
  world.rig.projectors.clear();  // dark
  world.projector_effects.clear();
  world.camera_effects = {{.colour = true, .exposure = 0.57, .psf_px = 0.6, .read_noise = 1, .srgb = true}};
  for (int view = 0; view < k_views; ++view) {
    world.rig.cameras = {tablet(world, view)};
    const cv::Mat image = sim::photograph(world, sim::trace(world, 0), {}, static_cast<std::uint64_t>(view));
    const std::vector<std::uint8_t> jpeg = device::encode_jpeg(image, 85);
    cv::Mat where;
    sim::ReferenceRenderer(world, parts, world.rig.cameras[0])
        .parts_image(world.rig.cameras[0])
        .cover.convertTo(where, CV_8U, 255);
    cv::resize(where, where, {}, 0.5, 0.5, cv::INTER_AREA);
    const bool is_written = write(folder / "tablet.mjpeg", jpeg, k_images_a_view) &&
                            write(folder / fmt::format("{:02}.jpg", view), jpeg) &&
                            cv::imwrite((folder / fmt::format("{:02}-parts.png", view)).string(), where);
    if (!is_written) {
      fmt::print(stderr, "{}: cannot be written to.\n", folder.string());
      return 1;
    }
  }
  return 0;
}
