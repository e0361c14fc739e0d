// limn markers --learn-constellation and limn detect --constellation, from rendered photographs.

#include <gtest/gtest.h>

#include "apps/detect_balls.h"
#include "apps/learn_constellation.h"
#include "core/cameramodel.h"
#include "core/config.h"
#include "core/image_io.h"
#include "tests/support/json.h"
#include "tests/support/matchers.h"
#include "tests/tracker/seen_balls.h"
#include "tracker/balls/three_point_pose.h"

namespace limn::apps {
namespace {

using namespace test::literals;

struct Photographs {
  std::filesystem::path folder = test::test_folder();
  Imager camera = {
      "camera0", 1280, 960,
      Lens::create("LENSMODEL_OPENCV4", {1400, 1402, 642, 477, -0.12, 0.05, 1e-4, -2e-4}).value(), Pose{}};
  std::vector<std::filesystem::path> images;
  std::vector<Pose> camera_from_body;

  Photographs(const Constellation& truth, int count) {
    auto rng = test::test_rng();
    EXPECT_TRUE(save_cameramodel(camera, folder / "camera0.cameramodel"));
    for (int i = 0; i < count; ++i) {
      const double a = 2 * M_PI * i / count;
      camera_from_body.emplace_back(exp_rotation({0.6 * std::cos(a), 0.6 * std::sin(a), 0.15 * i}),
                                    Eigen::Vector3d(0.03 * std::sin(3 * a), 0.02, 0.7));
      images.push_back(folder / fmt::format("{}.png", i));
      EXPECT_TRUE(write_png(images.back(),
                            test::image_of(camera.lens, test::plain(camera.width, camera.height, 50),
                                           test::placed_balls({{truth, camera_from_body.back()}}, camera),
                                           {.blur_px = 0.7, .noise_levels = 2}, rng)));
    }
  }
};

TEST(Balls, AConstellationIsLearnedAndFoundAgain) {
  const Constellation truth = test::five_balls();
  const Photographs photographs(truth, 12);
  LearnConstellationOptions options;
  options.images = photographs.images;
  options.camera = photographs.folder / "camera0.cameramodel";
  options.out = photographs.folder / "wand.json";
  const Status status = run_learn_constellation(options);
  ASSERT_TRUE(status) << status.message();
  const auto learned = load_constellation(options.out);
  ASSERT_TRUE(learned) << learned.message();
  EXPECT_EQ(learned->name, "wand");
  EXPECT_DOUBLE_EQ(learned->radius_m, 0.02);
  ASSERT_EQ(learned->p_balls.size(), 5u);

  const auto json = photographs.folder / "found.json";
  const Status detected = run_detect_balls({photographs.images, options.camera, {options.out}, {}, {}, json});
  ASSERT_TRUE(detected) << detected.message();
  const auto found = test::read_json(json);
  // Motions between photographs do not depend on the learned frame.
  std::vector<Pose> motions;
  std::vector<std::size_t> which;
  for (std::size_t i = 0; i < photographs.images.size(); ++i) {
    if (found["images"][i]["constellations"].empty()) continue;  // one ball before another
    const auto& node = found["images"][i]["constellations"][0]["poses"][0]["camera_from_constellation"];
    const auto q = node["rotation_wxyz"].get<std::vector<double>>();
    const auto t = node["translation_m"].get<std::vector<double>>();
    motions.emplace_back(Eigen::Quaterniond(q[0], q[1], q[2], q[3]), Eigen::Vector3d(t[0], t[1], t[2]));
    which.push_back(i);
  }
  ASSERT_GE(which.size(), 10u);
  for (std::size_t k = 1; k < which.size(); ++k) {
    const Pose expected =
        photographs.camera_from_body[which[k]] * photographs.camera_from_body[which[0]].inverse();
    EXPECT_TRUE(test::pose_near(motions[k] * motions[0].inverse(), expected, 0.1_deg, 1.5_mm)) << which[k];
  }
}

TEST(Balls, AConstellationLikeAnotherIsNotWritten) {
  const Photographs photographs(test::five_balls(), 10);
  LearnConstellationOptions options;
  options.images = photographs.images;
  options.camera = photographs.folder / "camera0.cameramodel";
  options.out = photographs.folder / "first.json";
  ASSERT_TRUE(run_learn_constellation(options));
  options.others = {options.out};
  options.out = photographs.folder / "second.json";
  const Status status = run_learn_constellation(options);
  ASSERT_FALSE(status);
  EXPECT_NE(status.message().find("'first' and 'second'"), std::string::npos) << status.message();
  EXPECT_FALSE(std::filesystem::exists(options.out));
}

TEST(Balls, MistakesAreNamed) {
  const auto folder = test::test_folder();
  LearnConstellationOptions options;
  options.images = {folder / "absent.png"};
  options.out = folder / "wand.json";
  EXPECT_TRUE(run_learn_constellation(options).error().wrong_usage);  // no camera
  options.camera = folder / "camera0.cameramodel";
  options.ball_mm = 0.04;
  EXPECT_NE(run_learn_constellation(options).message().find("0.04"), std::string::npos);
  options.ball_mm = 40;
  EXPECT_FALSE(run_learn_constellation(options).ok());  // no such camera file
  EXPECT_TRUE(run_detect_balls({{folder / "absent.png"}, {}, {folder / "wand.json"}, {}, {}, {}})
                  .error()
                  .wrong_usage);
}

}  // namespace
}  // namespace limn::apps
