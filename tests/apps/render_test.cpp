#include "apps/render.h"

#include <fmt/format.h>

#include <array>
#include <nlohmann/json.hpp>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "core/camera_files/imager_file.h"
#include "core/config.h"
#include "core/file.h"
#include "core/image_io.h"
#include "core/rig.h"
#include "scene/posed_scene.h"
#include "scene/scene.h"
#include "sim/car_door.h"
#include "tests/support/json.h"
#include "tests/support/matchers.h"
#include "tracker/family.h"

namespace limn::apps {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using nlohmann::json;
namespace fs = std::filesystem;

// An arrow that stands on its marker: a post with 40 mm sides, 120 mm high (towards -z), with a flag at its
// top that points to the marker's right.
std::string flag_obj() {
  return "v -20 -20 0\nv 20 -20 0\nv 20 20 0\nv -20 20 0\nv -20 -20 -120\nv 20 -20 -120\nv 20 20 -120\nv -20 "
         "20 -120\n"
         "f 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\nf 5 6 7 8\n"
         "v 20 0 -120\nv 20 0 -80\nv 70 0 -100\nf 9 10 11\n";
}

json slot_on(const std::string& name, const std::string& marker) {
  return {{"name", name},
          {"marker", marker},
          {"size_mm", 50},
          {"marker_from_part", to_json(Pose())},
          {"variants", {{{"name", "a"}, {"mesh", "flag.obj"}, {"units", "mm"}}}}};
}

// A classic augmented-reality scene: no prototype.
fs::path flag_scene(const fs::path& folder, const std::string& marker) {
  const json scene = {{"schema", "limn.scene/1"}, {"slots", {slot_on("flag", marker)}}};
  EXPECT_TRUE(make_folder(folder));
  EXPECT_TRUE(write_file(folder / "flag.obj", flag_obj()));
  EXPECT_TRUE(write_file(folder / "scene.json", scene.dump()));
  return folder;
}

Imager test_camera() {
  Imager camera{"camera0", 800, 600, {}, Pose()};
  camera.lens = Lens::create("LENSMODEL_OPENCV4", {900, 900, 400, 310, -0.15, 0.05, 0.001, 0}).value();
  return camera;
}

// A photograph of a marker of 50 mm on white paper, with 16 rays per pixel onto its plane.
cv::Mat photographed(const MarkerName& name, const Imager& camera, const Pose& camera_from_marker) {
  const cv::Mat marker = tracker::draw_marker(name, 40).value();
  const Pose marker_from_camera = camera_from_marker.inverse();
  cv::Mat image(camera.height, camera.width, CV_8U);
  for (int row = 0; row < image.rows; ++row) {
    for (int column = 0; column < image.cols; ++column) {
      int sum = 0;
      for (int k = 0; k < 16; ++k) {
        const Vector2d px(column + (k % 4 + 0.5) / 4 - 0.5, row + (k / 4 + 0.5) / 4 - 0.5);
        const Vector3d d = marker_from_camera.rotation * *camera.lens.unproject(px);
        const Vector3d p = marker_from_camera.translation - d * (marker_from_camera.translation.z() / d.z());
        const int x = static_cast<int>(std::floor((p.x() / 0.05 + 0.5) * marker.cols));
        const int y = static_cast<int>(std::floor((p.y() / 0.05 + 0.5) * marker.rows));
        const bool inside = x >= 0 && y >= 0 && x < marker.cols && y < marker.rows;
        sum += inside ? marker.at<std::uint8_t>(y, x) : 220;
      }
      image.at<std::uint8_t>(row, column) = static_cast<std::uint8_t>(sum / 16);
    }
  }
  return image;
}

TEST(Render, StandsAPartOnAMarkerOfAnImage) {
  const fs::path folder = test::test_folder();
  Rig rig;
  rig.cameras = {test_camera()};
  ASSERT_TRUE(save_rig(rig, folder / "rig"));
  const Pose camera_from_marker(exp_rotation({0.7, 0.2, 0.3}), {0.03, 0.05, 0.5});
  const MarkerName name{"aruco_6x6_250", "40"};
  ASSERT_TRUE(write_png(folder / "picture.png", photographed(name, rig.cameras[0], camera_from_marker)));

  RenderOptions options;
  options.rig = folder / "rig";
  options.scene = flag_scene(folder / "scene", name.text());
  options.frames = {"camera0=" + (folder / "picture.png").string()};
  options.out = folder / "out";
  const Status status = run_render(options);
  ASSERT_TRUE(status) << status.message();

  const cv::Mat out = read_image(folder / "out" / "composite-camera0.png").value();
  ASSERT_EQ(out.size(), cv::Size(800, 600));
  RenderOptions again = options;  // the frame is not replaced by the composite
  again.frames = {"camera0=" + (folder / "out" / "composite-camera0.png").string()};
  EXPECT_TRUE(run_render(again).error().wrong_usage);
  // The flag's true tip: the flag on one side of it, paper on the other.
  const auto at = [&](const Vector3d& p_marker) {
    const Vector2d px = *rig.cameras[0].project(camera_from_marker * p_marker);
    return out.at<cv::Vec3b>(static_cast<int>(std::lround(px.y())), static_cast<int>(std::lround(px.x())));
  };
  const auto is_paper = [](const cv::Vec3b& c) { return c == cv::Vec3b(220, 220, 220); };
  EXPECT_FALSE(is_paper(at({0.066, 0, -0.1})));
  EXPECT_TRUE(is_paper(at({0.074, 0, -0.1})));
  EXPECT_FALSE(is_paper(at({0, 0, -0.118})));
  EXPECT_TRUE(is_paper(at({-0.03, 0, -0.1})));
  const json coverage = test::read_json(folder / "out" / "coverage.json");
  EXPECT_EQ(coverage["parts"][0]["part"], "flag");
  EXPECT_EQ(coverage["parts"][0]["off_surface"], 1);
  EXPECT_GT(coverage["parts"][0]["viewer_pixels"], 5000);
  const cv::Mat mask = read_image(folder / "out" / "mask-flag.png").value();
  EXPECT_EQ(cv::countNonZero(mask == 128), coverage["parts"][0]["viewer_pixels"].get<int>());
}

class RenderDoor : public testing::Test {
 protected:
  void SetUp() override {
    folder = test::test_folder();
    Rig rig;
    rig.cameras = {test_camera()};
    rig.cameras[0].imager_from_world = looking_at({0.1, 0.1, 1.2}, {0, 0, 0}, {0, 1, 0});
    Imager projector = rig.cameras[0];
    projector.name = "projector0";
    projector.imager_from_world = looking_at({-0.3, 0.2, 1.1}, {0, 0, 0}, {0, 1, 0});
    rig.projectors = {projector};
    ASSERT_TRUE(save_rig(rig, folder / "rig"));
    ASSERT_TRUE(write_file(folder / "poses.json", poses().dump()));
    options.rig = folder / "rig" / "rig.json";
    options.scene = fs::path(LIMN_SOURCE_DIR) / "config/scenes/door";
    options.poses = folder / "poses.json";
    options.out = folder / "out";
  }
  // The parts on the door as in the virtual rig's worlds.
  static json poses() {
    const scene::Scene scene = sim::car_door_scene();
    const auto places = sim::car_door_slot_places();
    const auto part = [&](const std::string& slot) {
      return to_json(places.at(slot) * scene.find_slot(slot)->marker_from_part);
    };
    return {{"world_from_prototype", to_json(Pose())},
            {"slots",
             {{"mirror", {{"world_from_part", part("mirror")}, {"variant", "sport"}}},
              {"trim", {{"world_from_part", part("trim")}}}}}};
  }
  fs::path folder;
  RenderOptions options;
};

TEST_F(RenderDoor, PosesPlaceEverythingAndEveryImageIsWritten) {
  const Status status = run_render(options);
  ASSERT_TRUE(status) << status.message();
  const cv::Mat light = read_image(folder / "out/projector-projector0.png").value();
  EXPECT_EQ(light.size(), cv::Size(800, 600));
  EXPECT_GT(cv::countNonZero(light.reshape(1)), 1000);
  EXPECT_GT(cv::countNonZero(read_image(folder / "out/composite-camera0.png").value().reshape(1)), 1000);
  const json coverage = test::read_json(folder / "out/coverage.json");
  ASSERT_EQ(coverage["parts"].size(), 2u);
  for (const auto& part : coverage["parts"]) {
    const double on = part["on_surface"], off = part["off_surface"];
    if (part["viewer_pixels"] > 0) {
      EXPECT_NEAR(on + off, 1, 1e-9);
    }
    const cv::Mat mask = read_image(folder / "out" / part["mask"].get<std::string>()).value();
    EXPECT_EQ(mask.size(), cv::Size(1280, 800));  // the scene's own viewer
  }
  const json viewer = {
      {"world_from_viewer", to_json(looking_at({0.2, 0, 1}, {0, 0, 0}, {0, 1, 0}).inverse())},
      {"size", {320, 200}},
      {"fov_deg", 45}};
  ASSERT_TRUE(write_file(folder / "viewer.json", viewer.dump()));
  options.viewers = {folder / "viewer.json"};
  ASSERT_TRUE(run_render(options));
  EXPECT_EQ(read_image(folder / "out/mask-mirror.png").value().size(), cv::Size(320, 200));
}

TEST_F(RenderDoor, SeveralViewersShareTheEyeOfThoseOnTheNearestOnesSide) {
  const auto viewer_at = [&](const std::string& name, const Pose& world_from_viewer, double fov_deg) {
    const json viewer = {
        {"world_from_viewer", to_json(world_from_viewer)}, {"size", {1280, 800}}, {"fov_deg", fov_deg}};
    EXPECT_TRUE(write_file(folder / name, viewer.dump()));
    return folder / name;
  };
  const auto light = [&](const std::vector<fs::path>& viewers) {
    options.viewers = viewers;
    const Status status = run_render(options);
    EXPECT_TRUE(status) << status.message();
    return read_image(folder / "out/projector-projector0.png").value();
  };
  const Vector3d p_near(0.2, 0, 1), p_beside(-0.1, 0, 1.4), p_aside(-3, 0, 0.2);
  std::vector<fs::path> files;
  for (const Vector3d& p_eye : {p_near, p_beside, p_aside})
    files.push_back(viewer_at(fmt::format("viewer{}.json", files.size()),
                              looking_at(p_eye, {0, 0, 0}, {0, 1, 0}).inverse(), 45));
  const cv::Mat shared = light(files), near_alone = light({files[0]});
  EXPECT_EQ(cv::norm(shared, light({files[0], files[1]}), cv::NORM_INF), 0)
      << "a viewer on another side does not count";
  EXPECT_GT(cv::norm(shared, near_alone, cv::NORM_INF), 20);

  const scene::Scene scene = scene::load_scene(options.scene).value();
  const scene::PosedScene posed = scene::load_poses(options.poses, scene).value();
  const Vector3d p_middle = *scene::middle_of(scene, posed);
  const double near = 1 / (p_near - p_middle).norm(), beside = 1 / (p_beside - p_middle).norm();
  const Vector3d d_up =
      load_rig(options.rig).value().cameras[0].imager_from_world.rotation.inverse() * Vector3d(0, -1, 0);
  const auto eye =
      scene::viewer_at((near * p_near + beside * p_beside) / (near + beside), scene, posed, d_up);
  const cv::Mat expected = light({viewer_at("eye.json", eye->imager_from_world.inverse(), 40)});
  EXPECT_LT(cv::countNonZero(cv::Mat(shared != expected).reshape(1)), 30) << "but for rounding";
}

TEST_F(RenderDoor, SparesOrLightsTheMarkers) {
  const auto light_on_marker = [&](tracker::MarkerLight how) {
    options.marker_light = how;
    EXPECT_TRUE(run_render(options));
    const cv::Mat light = read_image(folder / "out/projector-projector0.png").value();
    const Rig rig = load_rig(options.rig).value();
    const Pose world_from_marker = sim::car_door_slot_places().at("mirror");
    const Vector2d px = *rig.projectors[0].project(world_from_marker.translation);
    const cv::Vec3b c =
        light.at<cv::Vec3b>(static_cast<int>(std::lround(px.y())), static_cast<int>(std::lround(px.x())));
    return std::array<int, 3>{c[0], c[1], c[2]};
  };
  EXPECT_EQ(light_on_marker(tracker::MarkerLight::spotlight), (std::array{255, 255, 255}));
  EXPECT_EQ(light_on_marker(tracker::MarkerLight::keep_out), (std::array{0, 0, 0}));
  EXPECT_NE(light_on_marker(tracker::MarkerLight::as_is), (std::array{255, 255, 255}));
}

// A plate of 200 x 160 mm whose left side is red and whose right side is blue, linear light, not shaded.
std::string two_coloured_gltf() {
  const float numbers[] = {-0.1F, -0.08F, 0, 0.1F, -0.08F, 0, 0.1F, 0.08F, 0, -0.1F, 0.08F, 0,   // positions
                           1,     0,      0, 0,    0,      1, 0,    0,     1, 1,     0,     0};  // colours
  std::string bytes;
  for (const char c : std::string(reinterpret_cast<const char*>(numbers), sizeof(numbers)))
    bytes += fmt::format("%{:02x}", static_cast<unsigned char>(c));
  return R"({"asset":{"version":"2.0"},"nodes":[{"mesh":0}],"extensionsUsed":["KHR_materials_unlit"],
"meshes":[{"primitives":[{"attributes":{"POSITION":0,"COLOR_0":1},"mode":6,"material":0}]}],
"materials":[{"extensions":{"KHR_materials_unlit":{}}}],
"accessors":[{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"},{"bufferView":1,"componentType":5126,"count":4,"type":"VEC3"}],
"bufferViews":[{"buffer":0,"byteLength":48},{"buffer":0,"byteOffset":48,"byteLength":48}],
"buffers":[{"byteLength":96,"uri":"data:application/octet-stream,)" +
         bytes + R"("}]})";
}

// A scene without a prototype whose slot has these variants, seen by a camera 1 m in front of the part.
RenderOptions seen_part(const fs::path& folder, const json& variants, const json& pose) {
  Rig rig;
  rig.cameras = {test_camera()};
  EXPECT_TRUE(save_rig(rig, folder / "rig"));
  json slot = slot_on("flag", "aruco_6x6_250:40");
  slot["variants"] = variants;
  EXPECT_TRUE(make_folder(folder / "scene"));
  EXPECT_TRUE(write_file(folder / "scene/flag.obj", flag_obj()));
  EXPECT_TRUE(write_file(folder / "scene/plate.gltf", two_coloured_gltf()));
  EXPECT_TRUE(write_file(folder / "scene/broken.ply", "ply\nformat ascii 1.0\n"));
  EXPECT_TRUE(
      write_file(folder / "scene/scene.json", json({{"schema", "limn.scene/1"}, {"slots", {slot}}}).dump()));
  EXPECT_TRUE(write_file(folder / "poses.json", json({{"slots", {{"flag", pose}}}}).dump()));
  const json view = {{"world_from_viewer", to_json(Pose())}, {"size", {400, 300}}, {"fov_deg", 30}};
  EXPECT_TRUE(write_file(folder / "view.json", view.dump()));
  RenderOptions options;
  options.rig = folder / "rig";
  options.scene = folder / "scene";
  options.poses = folder / "poses.json";
  options.view = folder / "view.json";
  options.out = folder / "out";
  return options;
}

// Colours are interpolated in linear light: half red and half blue in the middle is level 188 of both.
TEST(Render, ColoursOfVerticesAreShown) {
  const fs::path folder = test::test_folder();
  const json pose = {{"world_from_part", to_json(Pose(Eigen::Quaterniond::Identity(), Vector3d(0, 0, 1)))}};
  const RenderOptions options = seen_part(folder, {{{"name", "a"}, {"mesh", "plate.gltf"}}}, pose);
  const Status status = run_render(options);
  ASSERT_TRUE(status) << status.message();
  const cv::Mat view = read_image(folder / "out/view.png").value();
  const double px_per_m = 200 / std::tan(15 * std::numbers::pi / 180);
  for (const double x : {-0.08, -0.05, 0.0, 0.05, 0.08}) {
    const cv::Vec3b c = view.at<cv::Vec3b>(150, static_cast<int>(std::lround(199.5 + px_per_m * x)));
    const auto level = [](double linear) { return 255 * (1.055 * std::pow(linear, 1 / 2.4) - 0.055); };
    EXPECT_NEAR(c[2], level(0.5 - x / 0.2), 2) << x;
    EXPECT_NEAR(c[0], level(0.5 + x / 0.2), 2) << x;
    EXPECT_LT(c[1], 2) << x;
  }
}

TEST(Render, ABrokenVariantStopsOnlyWhatShowsIt) {
  const fs::path folder = test::test_folder();
  const json broken = {{"name", "broken"}, {"mesh", "broken.ply"}, {"units", "mm"}};
  const json whole = {{"name", "whole"}, {"mesh", "flag.obj"}, {"units", "mm"}};
  const json pose = to_json(Pose(Eigen::Quaterniond::Identity(), Vector3d(0, 0, 1)));
  testing::internal::CaptureStderr();
  const Status beside = run_render(seen_part(folder, {whole, broken}, {{"world_from_part", pose}}));
  const std::string messages = testing::internal::GetCapturedStderr();
  ASSERT_TRUE(beside) << beside.message();
  EXPECT_NE(messages.find("broken of slot flag is left out"), std::string::npos) << messages;
  for (const json& shows_it :
       {json{{"world_from_part", pose}, {"variant", "broken"}}, {{"world_from_part", pose}}}) {
    const json variants = shows_it.contains("variant") ? json{whole, broken} : json{broken, whole};
    const Status shown = run_render(seen_part(folder, variants, shows_it));
    ASSERT_FALSE(shown);
    EXPECT_NE(shown.message().find("broken.ply: expected a PLY file"), std::string::npos) << shown.message();
  }
  const Status other =
      run_render(seen_part(folder, {broken, whole}, {{"world_from_part", pose}, {"variant", "whole"}}));
  EXPECT_TRUE(other) << other.message();
}

TEST_F(RenderDoor, BalancesLightAndSaysWhatItCannotGive) {
  ASSERT_TRUE(run_render(options));
  const cv::Mat as_it_is = read_image(folder / "out/projector-projector0.png").value();
  EXPECT_FALSE(fs::exists(folder / "out/clipped-projector0.png"));
  options.light.compensation = projector::Compensation::geometry;
  options.light.level = 1e6;
  ASSERT_TRUE(run_render(options));
  const cv::Mat clipped = read_image(folder / "out/clipped-projector0.png").value();
  EXPECT_GT(cv::countNonZero(clipped == 255), 1000) << "nothing is a million times as bright";
  const json light = test::read_json(folder / "out/coverage.json")["light"];
  EXPECT_EQ(light["compensation"], "geometry");
  EXPECT_GT(light["projectors"][0]["too_bright_wanted"], 0.001);
  options.light.level = {};
  ASSERT_TRUE(run_render(options));
  const cv::Mat balanced = read_image(folder / "out/projector-projector0.png").value();
  EXPECT_GT(cv::norm(as_it_is, balanced, cv::NORM_INF), 5);

  options.light.compensation = projector::Compensation::measured;
  const Status status = run_render(options);
  ASSERT_FALSE(status);
  EXPECT_NE(status.message().find("response.json"), std::string::npos) << status.message();
  EXPECT_NE(status.message().find("limn patterns --response"), std::string::npos) << status.message();
  options.light.level = -1;
  EXPECT_TRUE(run_render(options).error().wrong_usage);
}

TEST_F(RenderDoor, CompositesMayBeUndistorted) {
  ASSERT_TRUE(run_render(options));
  const cv::Mat raw = read_image(folder / "out/composite-camera0.png").value();
  options.undistorted = true;
  ASSERT_TRUE(run_render(options));
  const cv::Mat straight = read_image(folder / "out/composite-camera0.png").value();
  const Imager camera = load_rig(options.rig).value().cameras[0];
  const Lens pinhole =
      Lens::pinhole(camera.lens.fx(), camera.lens.fy(), (camera.width - 1) / 2.0, (camera.height - 1) / 2.0);
  int compared = 0;
  for (int row = 60; row < raw.rows - 60; row += 20)
    for (int column = 60; column < raw.cols - 60; column += 20) {
      const Vector2d at = *pinhole.project(*camera.lens.unproject(Vector2d(column, row)));
      const cv::Rect around(column - 2, row - 2, 5, 5);
      double smallest = 0, largest = 0;
      cv::minMaxLoc(raw(around).clone().reshape(1), &smallest, &largest);
      if (largest - smallest > 6) continue;  // an edge
      const cv::Point there(cvRound(at.x()), cvRound(at.y()));
      if (!cv::Rect({}, straight.size()).contains(there)) continue;
      EXPECT_LT(cv::norm(raw.at<cv::Vec3b>(row, column), straight.at<cv::Vec3b>(there), cv::NORM_INF), 9);
      ++compared;
    }
  EXPECT_GT(compared, 200);
  EXPECT_GT(cv::norm(raw, straight, cv::NORM_INF), 30) << "the lens bends something";
}

TEST_F(RenderDoor, AVirtualCameraSeesPrototypeAndPartsWithOneEyeOrTwo) {
  const json viewer = {
      {"world_from_viewer", to_json(looking_at({0.2, 0.1, 1.2}, {0, 0, 0}, {0, 1, 0}).inverse())},
      {"size", {400, 300}},
      {"fov_deg", 40}};
  ASSERT_TRUE(write_file(folder / "view.json", viewer.dump()));
  options.view = folder / "view.json";
  ASSERT_TRUE(run_render(options));
  const cv::Mat one = read_image(folder / "out/view.png").value();
  ASSERT_EQ(one.size(), cv::Size(400, 300));
  EXPECT_GT(cv::norm(one.at<cv::Vec3b>(150, 200), one.at<cv::Vec3b>(2, 2), cv::NORM_INF),
            20);  // the door, not the room
  options.stereo_mm = 60;
  ASSERT_TRUE(run_render(options));
  const cv::Mat two = read_image(folder / "out/view.png").value();
  ASSERT_EQ(two.size(), cv::Size(800, 300));
  // The door, 1.2 m away, is further right in the left camera's image, by focal length x base line /
  // distance.
  const double expected_px = 200 / std::tan(20 * std::numbers::pi / 180) * 0.06 / 1.17;
  cv::Mat grey;
  cv::cvtColor(two, grey, cv::COLOR_BGR2GRAY);
  cv::Mat left, right;
  grey.colRange(0, 400).convertTo(left, CV_32F);
  grey.colRange(400, 800).convertTo(right, CV_32F);
  EXPECT_NEAR(-cv::phaseCorrelate(left, right).x, expected_px, 3);
  options.view.clear();
  EXPECT_TRUE(run_render(options).error().wrong_usage);
}

TEST_F(RenderDoor, MistakesAreErrors) {
  const auto failed = [](const RenderOptions& wrong, bool usage, const std::string& says) {
    const Status status = run_render(wrong);
    ASSERT_FALSE(status) << says;
    EXPECT_NE(status.message().find(says), std::string::npos) << status.message();
    EXPECT_EQ(status.error().wrong_usage, usage) << status.message();
  };
  RenderOptions wrong = options;
  wrong.poses.clear();
  failed(wrong, true, "--poses");
  wrong.frames = {"camera0"};
  failed(wrong, true, "CAMERA=");
  wrong.frames = {"camera7=x.png"};
  failed(wrong, true, "camera0");
  wrong.frames = {"camera0=" + (folder / "nowhere.png").string()};
  failed(wrong, false, "nowhere.png");
  ASSERT_TRUE(write_png(folder / "grey.png", cv::Mat(600, 800, CV_8U, cv::Scalar(90))));
  ASSERT_TRUE(write_png(folder / "small.png", cv::Mat(60, 80, CV_8U, cv::Scalar(90))));
  wrong.frames = {"camera0=" + (folder / "small.png").string()};
  failed(wrong, false, "800x600");
  wrong.frames = {"camera0=" + (folder / "grey.png").string()};
  failed(wrong, false, "marker");
  wrong = options;
  wrong.scene = folder / "no-scene";
  failed(wrong, false, "no-scene");
  wrong = options;
  wrong.rig = folder / "no-rig";
  failed(wrong, false, "no-rig");
}

// A box from `lower` to `upper` (mm) with a material, as OBJ; `first` is the number of earlier vertices.
std::string box_obj(const Vector3d& lower, const Vector3d& upper, const std::string& material, int first) {
  std::string text = "usemtl " + material + "\n";
  for (int k = 0; k < 8; ++k) {
    text += "v";
    for (int axis = 0; axis < 3; ++axis) text += fmt::format(" {}", (k >> axis & 1 ? upper : lower)[axis]);
    text += "\n";
  }
  for (const auto& face :
       {std::array{1, 3, 4, 2}, {5, 6, 8, 7}, {1, 2, 6, 5}, {3, 7, 8, 4}, {1, 5, 7, 3}, {2, 4, 8, 6}}) {
    text +=
        fmt::format("f {} {} {} {}\n", first + face[0], first + face[1], first + face[2], first + face[3]);
  }
  return text;
}

// A mirror on a stand, y up from the table, z towards the viewer: a foot as large as the marker, a post at
// its back, a frame with a glass.
void write_standing_mirror(const fs::path& folder) {
  EXPECT_TRUE(write_file(
      folder / "mirror.mtl",
      "newmtl shell\nKd 0.05 0.12 0.3\nnewmtl foot\nKd 0.6 0.05 0.03\nnewmtl glass\nKd 0.6 0.7 0.75\n"));
  EXPECT_TRUE(write_file(folder / "mirror.obj", "mtllib mirror.mtl\n" +
                                                    box_obj({-25, 0, -25}, {25, 2, 25}, "foot", 0) +
                                                    box_obj({-5, 2, -25}, {5, 50, -15}, "shell", 8) +
                                                    box_obj({-45, 50, -25}, {45, 100, -10}, "shell", 16) +
                                                    box_obj({-41, 54, -11}, {41, 96, -9}, "glass", 24)));
}

// A person judged the appearance. The test keeps that the foot covers the marker of the photograph, and
// nothing else.
TEST(RenderPhotograph, StandsAMirrorOnAMarker) {
  const auto data = test::real_data("markers/opencv");
  if (!data) GTEST_SKIP() << "no photographs: markers/opencv";
  const fs::path folder = test::test_folder();
  auto camera = load_imager(*data / "tutorial_camera_params.yml");
  ASSERT_TRUE(camera) << camera.message();
  camera->name = "camera0";
  camera->width = 640;
  camera->height = 480;
  Rig rig;
  rig.cameras = {*camera};
  ASSERT_TRUE(save_rig(rig, folder / "rig"));
  ASSERT_TRUE(make_folder(folder / "scene"));
  write_standing_mirror(folder / "scene");
  // Marker: x right, y down the paper, z into it. Part: y up from the paper, z down the paper.
  const Pose marker_from_part(exp_rotation({-std::numbers::pi / 2, 0, 0}), {0, 0, 0});
  json scene = {{"schema", "limn.scene/1"}, {"slots", json::array()}};
  for (const char* id : {"40", "23"}) {
    scene["slots"].push_back(
        {{"name", std::string("mirror") + id},
         {"marker", std::string("aruco_6x6_250:") + id},
         {"size_mm", 50},
         {"marker_from_part", to_json(marker_from_part)},
         {"variants", {{{"name", "classic"}, {"mesh", "mirror.obj"}, {"units", "mm"}}}}});
  }
  ASSERT_TRUE(write_file(folder / "scene/scene.json", scene.dump()));
  RenderOptions options;
  options.rig = folder / "rig";
  options.scene = folder / "scene";
  options.frames = {"camera0=" + (*data / "singlemarkersoriginal.jpg").string()};
  options.out = folder / "out";
  const Status status = run_render(options);
  ASSERT_TRUE(status) << status.message();
  const cv::Mat mask = read_image(folder / "out/mask-mirror40.png").value();
  // Corners of marker 40 from opencv_singlemarkers_6x6_250.csv.
  const std::vector<cv::Point> marker = {{359, 310}, {404, 310}, {410, 350}, {362, 350}};
  cv::Mat inside = cv::Mat::zeros(mask.size(), CV_8U);
  cv::fillConvexPoly(inside, marker, 255);
  cv::erode(inside, inside, cv::Mat(), {-1, -1}, 2);
  EXPECT_EQ(cv::countNonZero(inside & (mask == 0)), 0);
  EXPECT_EQ(cv::countNonZero(mask.rowRange(354, 480)), 0);  // nothing below the marker's lower edge
  const cv::Rect box = cv::boundingRect(mask);
  EXPECT_LT(box.y, 270) << box;                       // and 100 mm up from it, about 80 px
  EXPECT_NEAR(box.x + box.width / 2, 392, 8) << box;  // above the foot at 383, tilted outwards by perspective
}

}  // namespace
}  // namespace limn::apps
