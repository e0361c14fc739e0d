// Heap use: allocations while a projector's image is drawn, after the renderer's buffers have reached their
// size, and memory needed to upload a large mesh to the GPU.
#include <gtest/gtest.h>
#include <malloc.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cstdlib>
#include <functional>
#include <iostream>
#include <new>

#include "device/gl_context.h"
#include "projector/renderer.h"
#include "tests/support/meshes.h"

namespace {
// Counted for this thread only, because drivers have threads of their own.
thread_local long allocations = 0, bytes_now = 0, bytes_most = 0;

void* counted(std::size_t size) {
  ++allocations;
  void* memory = std::malloc(size);
  if (!memory) throw std::bad_alloc();
  bytes_now += static_cast<long>(malloc_usable_size(memory));
  bytes_most = std::max(bytes_most, bytes_now);
  return memory;
}
void returned(void* memory) {
  bytes_now -= static_cast<long>(malloc_usable_size(memory));
  std::free(memory);
}
}  // namespace

void* operator new(std::size_t size) { return counted(size); }
void operator delete(void* memory) noexcept { returned(memory); }
void operator delete(void* memory, std::size_t) noexcept { returned(memory); }

namespace limn::projector {
namespace {

scene::Scene scene_of(int cells) {
  scene::Scene scene;
  scene.prototype = scene::Prototype{test::sheet(0.5, 0.4, 0, cells), {}, 0.8, {}};
  for (const auto& [name, mode] : {std::pair("mirror", scene::Mode::view), {"trim", scene::Mode::surface}}) {
    scene::Slot slot;
    slot.name = name;
    slot.mode = mode;
    slot.variants.push_back({"a", test::sheet(0.1, 0.1, mode == scene::Mode::view ? -0.03 : 0, 4)});
    scene.slots.push_back(slot);
  }
  return scene;
}

Rig two_projectors() {
  Rig rig;
  for (const double x : {-0.3, 0.3})
    rig.projectors.push_back({x < 0 ? "projector0" : "projector1", 320, 200,
                              Lens::pinhole(450, 450, 160, 100),
                              looking_at({x, -0.1, -1}, {0, 0, 0}, {0, -1, 0})});
  return rig;
}

class Allocation : public testing::Test {
 protected:
  device::GlContext context_ = device::GlContext::create().value();
};

TEST_F(Allocation, StopsAfterTheFirstImages) {
  auto drawing = Renderer::create(scene_of(8), two_projectors());
  ASSERT_TRUE(drawing) << drawing.message();
  const Imager viewer =
      viewer_imager(looking_at({0.1, -0.2, -1}, {0, 0, 0}, {0, -1, 0}).inverse(), 320, 240, 35);
  scene::PosedScene posed{Pose(), {{"mirror", "a", Pose()}, {"trim", "a", Pose()}}};
  const auto asked = [&](const std::function<void(int)>& move) {
    long count = 0;
    for (int frame = 0; frame < 6; ++frame) {
      move(frame);
      const long before = allocations;
      for (std::size_t i = 0; i < 2; ++i) drawing->draw_projector(i, posed, viewer);
      count = allocations - before;
    }
    return count;  // count of the last frame
  };
  const long still = asked([](int) {});
  const long part_moves =
      asked([&](int frame) { posed.parts[0].world_from_part.translation.x() = 1e-3 * frame; });
  const long all_moves =
      asked([&](int frame) { posed.world_from_prototype->translation.x() = 1e-3 * frame; });
  std::cout << "allocations for a frame of two projectors: still " << still << ", a part moves " << part_moves
            << ", the prototype moves " << all_moves << "\n";
  EXPECT_EQ(still, 0);
  EXPECT_EQ(part_moves, 0);
  EXPECT_EQ(all_moves, 0);
}

TEST_F(Allocation, OfALargeMeshIsBoundedByItsTriangles) {
  const scene::Scene scene = scene_of(316);
  const auto triangles = static_cast<double>(scene.prototype->mesh.triangles.size());
  ASSERT_GT(triangles, 199000);
  const Rig rig = two_projectors();
  ASSERT_TRUE(Renderer::create(scene_of(2), rig));  // first use, for the driver's own allocations
  const long before = bytes_now;
  bytes_most = bytes_now;
  const auto drawing = Renderer::create(scene, rig);
  ASSERT_TRUE(drawing) << drawing.message();
  const double most = static_cast<double>(bytes_most - before) / triangles;
  std::cout << "bytes for each triangle: at most " << most << "\n";
  EXPECT_LT(most, 127);  // 116 of them are one copy of corners, normals, owners and neighbours
}

}  // namespace
}  // namespace limn::projector
