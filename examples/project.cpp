// project RIG SCENE POSES.json OUT: draws the image of each projector, and what a screen shows over each
// camera's image, for a scene in given poses, without a display.
#include <cstdio>
#include <filesystem>
#include <vector>

#include "limn/error.h"
#include "limn/image.h"
#include "limn/renderer.h"
#include "limn/rig.h"

int main(int count, char** words) try {
  if (count != 5) {
    std::fprintf(stderr, "project RIG SCENE POSES.json OUT\n");
    return 2;
  }
  const limn::Rig rig = limn::Rig::load(words[1]);
  const limn::Scene scene = limn::Scene::load(words[2]);
  const limn::PosedScene posed = scene.load_poses(words[3]);
  const std::filesystem::path out = words[4];
  std::filesystem::create_directories(out);

  limn::Renderer renderer(scene, rig);
  std::printf("%s\n", renderer.gl_description().c_str());
  const limn::Imager viewer = scene.viewer(posed, rig);
  const std::vector<limn::Imager> projectors = rig.projectors();
  for (std::size_t i = 0; i < projectors.size(); ++i) {
    const limn::Image image = renderer.draw_projector(i, posed, viewer);
    limn::write_png(out / ("projector-" + projectors[i].name() + ".png"), image.view());
  }
  const std::vector<limn::Imager> cameras = rig.cameras();
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    // A black image in the place of the camera's own.
    limn::Image image{.pixels = {}, .width = cameras[i].width(), .height = cameras[i].height()};
    image.pixels.resize(static_cast<std::size_t>(image.stride()) * static_cast<std::size_t>(image.height));
    renderer.draw_composite(i, image.view(), posed, limn::Composite::rest, image.view());
    limn::write_png(out / ("composite-" + cameras[i].name() + ".png"), image.view());
  }
  return 0;
} catch (const limn::Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
