// The prototype with a finish as the page's 3D view gets it.
#include "remote/api/painted_mesh.h"

#include <gtest/gtest.h>

#include "core/photometric_response.h"
#include "tests/support/matchers.h"
#include "tests/support/meshes.h"

namespace limn::remote {
namespace {

scene::Mesh clay() {
  scene::Mesh mesh = test::sheet(0.4, 0.2, 0.1, 1);
  mesh.uvs.assign(mesh.positions.size(), {0.25F, 0.5F});
  mesh.materials.resize(2);
  mesh.triangle_materials.assign(mesh.triangles.size(), 1);
  mesh.colours.assign(mesh.positions.size(), {0.1F, 0.1F, 0.1F});
  return mesh;
}

scene::Finish lacquer() {
  scene::Finish finish;
  finish.base_colour = {0.5, 0.25, 0};
  finish.metallic = 0.75;
  finish.roughness = 0.5;
  finish.clearcoat = 1;
  finish.clearcoat_roughness = 0.125;
  return finish;
}

TEST(PaintedMesh, HasOneMaterialAndNoColoursOfItsOwn) {
  const scene::Mesh painted = painted_mesh(clay(), lacquer());
  ASSERT_EQ(painted.materials.size(), 1u);
  const scene::Material& material = painted.materials[0];
  EXPECT_EQ(material.base_colour, Eigen::Vector3f(0.5F, 0.25F, 0));
  EXPECT_EQ(material.metallic, 0.75F);
  EXPECT_EQ(material.roughness, 0.5F);
  EXPECT_EQ(material.coat.factor, 1);
  EXPECT_EQ(material.coat.roughness, 0.125F);
  EXPECT_TRUE(material.texture.empty());
  EXPECT_EQ(painted.triangle_materials, std::vector<std::uint16_t>(painted.triangles.size(), 0));
  EXPECT_TRUE(painted.colours.empty());
  EXPECT_EQ(painted.uvs, clay().uvs);
}

TEST(PaintedMesh, AnImageLiesOverTheColourByItsAlpha) {
  scene::Finish finish = lacquer();
  finish.image.emplace();
  finish.image->texture.image = cv::Mat(1, 2, CV_8UC4, cv::Scalar(0, 0, 255, 0));  // red, seen through
  finish.image->texture.image.at<cv::Vec4b>(0, 1) = {0, 0, 255, 51};               // a fifth of red
  const scene::Material material = painted_mesh(clay(), finish).materials.at(0);
  EXPECT_EQ(material.base_colour, Eigen::Vector3f(1, 1, 1)) << "the image has the colour";
  const auto level = [](double light) {
    return cv::saturate_cast<std::uint8_t>(255 * srgb_from_linear(light));
  };
  EXPECT_EQ(material.texture.at<cv::Vec3b>(0, 0), cv::Vec3b(0, level(0.25), level(0.5)));
  EXPECT_EQ(material.texture.at<cv::Vec3b>(0, 1), cv::Vec3b(0, level(0.2), level(0.6)));
}

TEST(PaintedMesh, APatternIsProjectedAlongZOfItsFrame) {
  scene::Finish finish = lacquer();
  finish.image.emplace();
  finish.image->texture.image = cv::Mat(1, 1, CV_8UC3, cv::Scalar(1, 2, 3));
  finish.image->repeats = true;
  finish.image->projection = scene::FinishImage::Projection();
  finish.image->projection->prototype_from_image.translation = {0.1, -0.05, 7};
  finish.image->projection->size_m = {0.2, 0.1};
  const scene::Mesh bare = clay(), painted = painted_mesh(bare, finish);
  ASSERT_EQ(painted.uvs.size(), bare.positions.size());
  for (std::size_t i = 0; i < bare.positions.size(); ++i) {
    const Eigen::Vector3f& p = bare.positions[i];
    EXPECT_TRUE(test::near(painted.uvs[i].cast<double>(),
                           Eigen::Vector2d((p.x() - 0.1) / 0.2 + 0.5, (p.y() + 0.05) / 0.1 + 0.5), 1e-5));
  }
  finish.image->repeats = false;  // a decal that is projected is left out
  EXPECT_TRUE(painted_mesh(bare, finish).materials[0].texture.empty());
}

}  // namespace
}  // namespace limn::remote
