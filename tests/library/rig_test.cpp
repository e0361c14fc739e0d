#include "limn/rig.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/cameramodel.h"
#include "library/convert.h"
#include "tests/library/example_inputs.h"
#include "tests/support/matchers.h"

namespace limn {
namespace {

namespace api = LIMN_VERSIONED;

TEST(LibraryImager, ProjectsAsTheRoomDoes) {
  Imager room = test::example_camera();
  room.imager_from_world = looking_at({0.1, 0.1, 1.2}, {0, 0, 0}, {0, 1, 0});
  const api::Imager imager = api::to_public(room);
  const api::Point3 p = {0.1, -0.05, 0.02};
  const auto px = imager.project(p);
  ASSERT_TRUE(px);
  EXPECT_EQ(*px, api::to_public(*room.project(api::to_room(p))));
  const auto ray = imager.unproject(*px);
  ASSERT_TRUE(ray);
  EXPECT_EQ(ray->d, api::to_public(room.ray(api::to_room(*px))->d));

  const std::array<api::Point3, 2> points = {p, api::Point3{0, 0, 5}};  // the second is behind
  std::array<api::Point2, 2> pixels;
  imager.project(points, pixels);
  EXPECT_EQ(pixels[0], *px);
  EXPECT_TRUE(std::isnan(pixels[1][0]));
  std::array<api::Point2, 1> few;
  EXPECT_THROW(imager.project(points, few), api::Error);
}

TEST(LibraryImager, ComesBackFromFilesOfOtherPrograms) {
  const auto folder = test::test_folder();
  const api::Imager imager = api::to_public(test::example_camera());
  const api::Point3 p = {0.2, 0.1, 1};
  for (const auto format : {api::CameraFile::mrcal, api::CameraFile::opencv, api::CameraFile::ros}) {
    const auto file = folder / (format == api::CameraFile::mrcal ? "a.cameramodel" : "a.yaml");
    imager.save(file, format);
    const api::Imager again = api::Imager::load(file);
    EXPECT_EQ(again.width(), 640);
    EXPECT_NEAR((*again.project(p))[0], (*imager.project(p))[0], 1e-6);
  }
}

TEST(LibraryImager, OfWrongPartsIsRefusedWithTheRoomsMessage) {
  api::ImagerParts parts{.name = "a", .width = 640, .height = 480};
  parts.lens_model = "LENSMODEL_NONE";
  try {
    const api::Imager imager(parts);
    FAIL() << "expected an error";
  } catch (const api::Error& error) {
    EXPECT_EQ(error.what(), LensModel::parse("LENSMODEL_NONE").message());
  }
  parts.lens_model = "LENSMODEL_PINHOLE";
  parts.lens_values = {1, 1, 0};
  EXPECT_THROW(api::Imager{parts}, api::Error);
  parts.lens_values = {500, 500, 320, 240};
  EXPECT_EQ(api::Imager(parts).parts().lens_values, parts.lens_values);
  parts.width = -1;
  EXPECT_THROW(api::Imager{parts}, api::Error);
}

TEST(LibraryRig, IsSavedAndLoaded) {
  const auto folder = test::test_folder();
  const Rig room = test::example_rig();
  const std::vector<api::Imager> cameras = {api::to_public(room.cameras[0])},
                                 projectors = {api::to_public(room.projectors[0])};
  api::Rig(cameras, projectors).save(folder);
  const api::Rig rig = api::Rig::load(folder);
  EXPECT_EQ(rig.cameras().size(), 1U);
  EXPECT_EQ(rig.find("projector0").imager_from_world(),
            api::to_public(load_rig(folder)->projectors[0].imager_from_world));
  EXPECT_THROW(rig.find("projector7"), api::Error);
  EXPECT_THROW(api::Rig(cameras, cameras), api::Error);
}

}  // namespace
}  // namespace limn
