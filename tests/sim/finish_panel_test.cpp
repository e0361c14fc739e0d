#include "sim/finish_panel.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>

#include "core/file.h"
#include "scene/meshes/mesh_bvh.h"
#include "scene/scene.h"
#include "tests/support/matchers.h"

namespace limn {
namespace {

namespace fs = std::filesystem;

const fs::path k_finishes = fs::path(LIMN_SOURCE_DIR) / "config/scenes/finishes";

// Shapes and images are compared, not bytes: another processor's sine differs in its last bit.
TEST(FinishPanel, TheCommittedFilesAreWhatTheGeneratorMakes) {
  const fs::path made = test::test_folder();
  for (const auto& [name, content] : sim::finish_panel_files()) {
    SCOPED_TRACE(name + ": after a change run limn_write_finishes config/scenes/finishes and commit");
    EXPECT_LT(content.size(), 100000U);
    ASSERT_TRUE(write_file(made / name, content));
    const auto found = scene::load_mesh(k_finishes / name, scene::LengthUnit::metre),
               expected = scene::load_mesh(made / name, scene::LengthUnit::metre);
    ASSERT_TRUE(found && expected);
    ASSERT_EQ(found->positions.size(), expected->positions.size());
    for (std::size_t i = 0; i < found->positions.size(); ++i)
      ASSERT_LT((found->positions[i] - expected->positions[i]).norm(), 2e-6F);
    for (const auto map : {&scene::SurfaceMaps::metallic_roughness, &scene::SurfaceMaps::normals,
                           &scene::SurfaceMaps::occlusion, &scene::SurfaceMaps::emission}) {
      const cv::Mat &a = (found->materials[0].maps.*map).image, &b = (expected->materials[0].maps.*map).image;
      ASSERT_EQ(a.size(), b.size());
      if (a.empty()) continue;
      EXPECT_LE(cv::norm(a, b, cv::NORM_INF), 1);
    }
  }
}

TEST(FinishPanel, TheSceneHasAllMapsAndItsPlateLiesOnThePanel) {
  const auto scene = scene::load_scene(k_finishes);
  ASSERT_TRUE(scene) << scene.message();
  ASSERT_TRUE(scene->light.has_value());
  const scene::SurfaceMaps& maps = scene->find_slot("emblem")->variants[0].mesh.materials[0].maps;
  for (const scene::Texture& map : {maps.metallic_roughness, maps.normals, maps.occlusion, maps.emission})
    EXPECT_FALSE(map.image.empty());
  const scene::Mesh& plate = scene->find_slot("plate")->variants[0].mesh;
  EXPECT_EQ(scene->find_slot("plate")->mode, scene::Mode::surface);
  for (const Eigen::Vector3f& p : plate.positions) {
    const scene::MeshPoint nearest = scene::nearest_on(scene->prototype->mesh, p.cast<double>());
    EXPECT_LT(nearest.distance, 1e-3);
    EXPECT_GT((p.cast<double>() - nearest.p).dot(nearest.d_normal), 0);
  }
}

}  // namespace
}  // namespace limn
