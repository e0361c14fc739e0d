// python_reference INPUTS: what the library gives to a C++ program for the inputs of the examples, for the
// tests in Python: a line for each result, its name and its numbers in hexadecimal. python_reference INPUTS
// SCENE OUT: images of a projector, a composite and a view, as raw RGB in the folder OUT.
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <span>
#include <string>
#include <vector>

#include "limn/limn.h"

namespace {

using Numbers = std::vector<double>;

void print(const std::string& name, std::span<const double> numbers) {
  std::printf("%s", name.c_str());
  for (const double number : numbers) std::printf(" %a", number);
  std::printf("\n");
}

void print(const std::string& name, const limn::Pose& pose) {
  print(name + ".rotation", pose.rotation_wxyz);
  print(name + ".translation", pose.translation);
  print(name + ".matrix", pose.matrix());
  print(name + ".inverse", pose.inverse().matrix());
  print(name + ".moved", pose * limn::Point3{0.1, -0.2, 0.3});
}

void print(const limn::Marker& marker, const limn::Imager& camera) {
  const std::string name = "marker:" + marker.family + ":" + marker.id;
  for (std::size_t i = 0; i < 4; ++i) {
    print(name + ".corner" + std::to_string(i), marker.corners_px[i]);
    print(name + ".covariance" + std::to_string(i), marker.corner_covariances[i]);
  }
  print(name + ".score", Numbers{marker.score});
  int count = 0;
  for (const limn::MarkerPose& pose : limn::marker_poses(marker, 0.08, camera)) {
    const std::string of = name + ".pose" + std::to_string(count++);
    print(of, pose.camera_from_marker);
    print(of + ".covariance", pose.covariance);
    print(of + ".fit", Numbers{pose.rms_px, pose.weight});
  }
}

void print_lens(const limn::Imager& camera) {
  print("lens", camera.parts().lens_values);
  for (int i = 0; i < 50; ++i) {
    const limn::Point2 px = {13.0 * i, 9.5 * i};
    const auto ray = camera.unproject(px);
    if (!ray) continue;
    print("ray" + std::to_string(i), ray->d);
    print("pixel" + std::to_string(i), camera.project(ray->d).value());
  }
}

void print(const std::string& name, const std::vector<limn::Track>& tracks) {
  for (const limn::Track& track : tracks) {
    print(name, track.world_from_body);
    print(name + ".covariance", track.covariance);
    print(name + ".fit", Numbers{track.rms_px, track.captured_at_s, track.at_s});
  }
}

void print_tracks(const limn::Imager& camera, const std::filesystem::path& video) {
  const std::vector<limn::Body> bodies = {limn::load_body(video / "body.json", "body")};
  limn::Detector detector(limn::families_of(bodies));
  limn::Tracker tracker(bodies);
  for (int i = 0; i < 3; ++i) {
    const limn::Image image =
        limn::read_image(video / ("image" + std::to_string(i) + ".png"), limn::PixelFormat::grey);
    const std::vector<limn::Marker> markers = detector.detect(image.view(), &camera);
    if (i == 0)
      for (const limn::Marker& marker : markers) print(marker, camera);
    const limn::View view{&camera, markers};
    print("located" + std::to_string(i), limn::locate_bodies(bodies, {&view, 1}));
    tracker.update({&view, 1}, 0.03 * i);
    print("predicted" + std::to_string(i), tracker.predict(0.03 * i + 0.02));
  }
}

void write(const limn::Image& image, const std::filesystem::path& file) {
  std::ofstream out(file, std::ios::binary);
  out.write(reinterpret_cast<const char*>(image.pixels.data()),
            static_cast<std::streamsize>(image.pixels.size()));
}

void draw(const std::filesystem::path& inputs, const char* folder, const std::filesystem::path& out) {
  const limn::Rig rig = limn::Rig::load(inputs / "rig");
  const limn::Scene scene = limn::Scene::load(folder);
  const limn::PosedScene posed = scene.load_poses(inputs / "poses.json");
  limn::Renderer renderer(scene, rig);
  write(renderer.draw_projector(0, posed, scene.viewer(posed, rig)), out / "projector.rgb");
  const limn::Image behind = limn::read_image(inputs / "video/image0.png");
  write(renderer.draw_composite(0, behind.view(), posed, limn::Composite::full), out / "composite.rgb");
  write(renderer.draw_view(rig.find("camera0"), posed), out / "view.rgb");
}

}  // namespace

int main(int count, char** words) try {
  if (count != 2 && count != 4) {
    std::fprintf(stderr, "python_reference INPUTS [SCENE OUT]\n");
    return 2;
  }
  const std::filesystem::path video = std::filesystem::path(words[1]) / "video";
  if (count == 4) {
    draw(words[1], words[2], words[3]);
    return 0;
  }
  const limn::Imager camera = limn::Imager::load(video / "camera0.cameramodel");
  print_lens(camera);
  print_tracks(camera, video);
  return 0;
} catch (const limn::Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
