// Tests `limn check`: the shipped checks pass; each measure misses its limit when the renderer knows
// something wrong; broken files are named.

#include "apps/check.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "core/file.h"
#include "core/image_io.h"
#include "device/gl_context.h"
#include "tests/support/json.h"
#include "tests/support/matchers.h"
#include "tests/support/run_limn.h"
#include "validate/check_judge.h"

namespace limn::validate {
namespace {

namespace fs = std::filesystem;
using test::Outcome;

const fs::path k_config = fs::path(LIMN_SOURCE_DIR) / "config";
constexpr const char* k_viewer =
    R"({"eye_m": [-0.2, -1.4, 0.7], "target_m": [0, 0, 0.4], "size": [640, 480], "fov_deg": 34})";

Outcome run(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), "check");
  return test::run_limn(std::move(arguments));
}

// A check file in `folder` on a world of config/worlds. `rest`: its members except schema, about and world.
fs::path written(const fs::path& folder, const std::string& world, const std::string& rest) {
  const fs::path file = folder / "small.json";
  const fs::path relative = fs::relative(k_config / "worlds" / (world + ".json"), folder);
  EXPECT_TRUE(
      write_file(file, fmt::format(R"({{"schema": "limn.check/1", "about": "a test's", "world": "{}", {}}})",
                                   relative.string(), rest)));
  return file;
}

TEST(Check, ShippedChecksHoldAndCoverEveryMeasure) {
  const fs::path out = test::test_folder();
  const Outcome outcome = run({"--json", "--out", out.string()});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  const auto json = nlohmann::json::parse(outcome.out);
  EXPECT_TRUE(json.at("passed").get<bool>());
  std::set<std::string> unseen;
  for (const CheckMeasure& measure : check_measures()) unseen.insert(measure.name);
  for (const auto& check : json.at("checks")) {
    for (const auto& reading : check.at("readings")) {
      EXPECT_TRUE(reading.at("passed").get<bool>()) << check.at("check") << " " << reading.dump();
      unseen.erase(reading.at("measure"));
    }
  }
  EXPECT_TRUE(unseen.empty()) << "no shipped check measures " << *unseen.begin();
  const std::string page = read_file(out / "check.html").value();
  EXPECT_EQ(page.find("src=\"http"), std::string::npos) << "the page needs no other file";
  EXPECT_NE(page.find("door-in-place"), std::string::npos);
  for (const char* what : {"actual", "expected", "difference"})
    EXPECT_TRUE(read_image(out / "door-in-place" / (std::string("shone-") + what + ".png"))) << what;
}

TEST(Check, AFileSaysWhatStandsWhereAndWhatTheRendererIsNotTold) {
  const auto loaded = load_check(written(test::test_folder(), "studio",
                                         fmt::format(R"("viewer": {}, "resolution": 0.5,
      "nudge": {{"projector1": [0.5, -0.25]}}, "limits": {{"mask_iou": 0.98}},
      "poses": {{"shown": ["mirror"], "world_from_prototype": {{"rotation_wxyz": [1, 0, 0, 0], "translation_m": [1, 2, 3]}},
        "slots": {{"mirror": {{"variant": "city",
          "prototype_from_part": {{"rotation_wxyz": [1, 0, 0, 0], "translation_m": [0.1, 0, 0]}}}}}}}})",
                                                     k_viewer)));
  ASSERT_TRUE(loaded) << loaded.message();
  EXPECT_EQ(loaded->name, "small");
  ASSERT_EQ(loaded->posed.parts.size(), 1u);
  EXPECT_EQ(loaded->posed.parts[0].slot, "mirror");
  EXPECT_EQ(loaded->posed.parts[0].variant, "city");
  EXPECT_TRUE(
      test::near(loaded->posed.parts[0].world_from_part.translation, Eigen::Vector3d(1.1, 2, 3), 1e-9));
  EXPECT_TRUE(test::near(loaded->truth.find("prototype")->world_from_object.translation,
                         Eigen::Vector3d(1, 2, 3), 1e-9));
  const Imager &true_projector = loaded->truth.rig.projectors[1],
               &given = loaded->renderer_input.rig.projectors[1];
  EXPECT_EQ(given.width, 640);
  EXPECT_EQ(loaded->renderer_input.rig.cameras[0].height, 540);
  EXPECT_NEAR(true_projector.lens.cx() - given.lens.cx(), 0.5, 1e-9);
  EXPECT_NEAR(true_projector.lens.cy() - given.lens.cy(), -0.25, 1e-9);
  EXPECT_EQ(loaded->truth.rig.projectors[0].lens.values,
            loaded->renderer_input.rig.projectors[0].lens.values);

  // Without poses everything is where the world has it.
  const auto plain = load_check(written(
      test::test_folder(), "studio", fmt::format(R"("viewer": {}, "limits": {{"mask_iou": 1}})", k_viewer)));
  ASSERT_TRUE(plain) << plain.message();
  ASSERT_EQ(plain->posed.parts.size(), 2u);
  EXPECT_TRUE(test::near(plain->posed.world_from_prototype->translation, Eigen::Vector3d(0, 0, 0.42), 1e-9));
}

TEST(Check, SeveralViewersShareAnEye) {
  const char* two =
      R"([{"eye_m": [-0.3, -1, 0.6], "target_m": [0, 0, 0.4], "size": [320, 240], "fov_deg": 50},
      {"eye_m": [0.3, -2, 0.6], "target_m": [0, 0, 0.4], "size": [640, 480], "fov_deg": 34, "weight": 3}])";
  const auto shared = load_check(written(test::test_folder(), "studio",
                                         fmt::format(R"("viewer": {}, "limits": {{"shared_mm": 1}})", two)));
  ASSERT_TRUE(shared) << shared.message();
  // The weight divided by the distance from the middle of the door.
  const Eigen::Vector3d p_middle = *scene::middle_of(*shared->truth.scene, shared->posed);
  const Eigen::Vector3d p_near(-0.3, -1, 0.6), p_far(0.3, -2, 0.6);
  const double near = 1 / (p_near - p_middle).norm(), far = 3 / (p_far - p_middle).norm();
  const Eigen::Vector3d p_shared = (near * p_near + far * p_far) / (near + far);
  const auto p_viewer = [](const Check& check) {
    return check.viewer.imager_from_world.inverse().translation;
  };
  EXPECT_TRUE(test::near(p_viewer(*shared), p_shared, 1e-9));
  EXPECT_EQ(shared->viewer.width, 320);
  EXPECT_NEAR(shared->viewer.lens.fx(), 160 / std::tan(25 * M_PI / 180), 1e-6);
  ASSERT_EQ(shared->shares.size(), 2u);
  EXPECT_NEAR(shared->shares[1].share, far / (near + far), 1e-9);

  // The scene's own viewers, one with a cap that is in the world.
  const fs::path folder = test::test_folder();
  fs::copy(k_config / "scenes/door", folder / "door");
  auto scene = test::read_json(folder / "door/scene.json");
  const auto fixed = scene.at("viewer");
  scene["viewer"] = {fixed, {{"marker", scene.at("slots")[0].at("marker")}, {"eye_mm", {0, 0, -900}}}};
  scene["slots"][0]["marker"] = "aruco_4x4_50:40";
  ASSERT_TRUE(write_file(folder / "door/scene.json", scene.dump()));
  const auto own = load_check(written(folder, "studio", R"("scene": "door", "limits": {"shared_mm": 1},
      "poses": {"shown": ["trim"]})"));
  ASSERT_TRUE(own) << own.message();
  ASSERT_EQ(own->shares.size(), 2u);
  const Eigen::Vector3d p_cap =
      *sim::world_from_marker(own->truth, *own->truth.scene->viewers[1].marker) * Eigen::Vector3d(0, 0, -0.9);
  EXPECT_TRUE(test::near(own->shares[1].p_world, p_cap, 1e-9));
  EXPECT_EQ(own->viewer.width, own->truth.scene->viewers[0].fixed->width);
}

class CheckJudge : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    context = std::make_unique<device::GlContext>(device::GlContext::create().value());
  }
  static void TearDownTestSuite() { context.reset(); }

  static Check check(const std::string& world, const std::string& rest) {
    auto loaded = load_check(written(test::test_folder(), world, rest));
    if (!loaded) throw std::runtime_error(loaded.message());
    return std::move(loaded).value();
  }
  // The values by measure.
  static std::map<std::string, CheckReading> readings(const Check& check) {
    auto result = judge_check(check);
    if (!result) throw std::runtime_error(result.message());
    std::map<std::string, CheckReading> by_name;
    for (const CheckReading& reading : result->readings) by_name.emplace(reading.limit.measure.name, reading);
    return by_name;
  }
  // Expects that every limit holds for `good` and is missed for `wrong`.
  static void expect_missed(const Check& good, const Check& wrong) {
    for (const auto& [name, reading] : readings(good))
      EXPECT_TRUE(reading.good()) << name << " " << reading.value;
    for (const auto& [name, reading] : readings(wrong)) {
      EXPECT_FALSE(reading.good()) << name << " " << reading.value;
      EXPECT_GT(reading.limit_share(), 1) << name;
    }
  }
  static std::unique_ptr<device::GlContext> context;
};

std::unique_ptr<device::GlContext> CheckJudge::context;

TEST_F(CheckJudge, LightTwoPixelsBesideMissesWhatTheLightIsJudgedBy) {
  const Check good = check("bench", fmt::format(R"("viewer": {}, "limits": {{"texture_mm": 0.3,
      "parallax_mm": 1, "shone_mean_255": 2, "shone_over4_share": 0.005, "spill_share": 0.005}})",
                                                k_viewer));
  Check wrong = good;
  wrong.renderer_input.rig.projectors[0].lens.values[2] += 2;
  expect_missed(good, wrong);
}

TEST_F(CheckJudge, AnotherColourMissesWhatTheLooksAreJudgedBy) {
  const Check good =
      check("bench", fmt::format(R"("viewer": {}, "resolution": 0.5, "poses": {{"shown": ["mirror"]}},
      "limits": {{"shone_mean_255": 2, "shone_inner_over4_share": 0.005, "drawn_mean_255": 4,
      "drawn_over4_share": 0.005, "drawn_inner_over4_share": 0.005}})",
                                 k_viewer));
  Check wrong = good;
  for (scene::Variant& variant : wrong.renderer_input.scene.slots[0].variants)
    for (scene::Material& material : variant.mesh.materials) material.base_colour *= 0.9F;
  expect_missed(good, wrong);
}

TEST_F(CheckJudge, AMapLeftOutOrAnotherLightMissesWhatTheLooksAreJudgedBy) {
  const fs::path scene = fs::relative(k_config / "scenes/finishes", test::test_folder());
  const Check good = check("studio", fmt::format(R"("scene": "{}", "viewer": {}, "resolution": 0.5,
      "poses": {{"shown": ["emblem"], "slots": {{"emblem": {{"prototype_from_part":
      {{"rotation_wxyz": [1, 0, 0, 0], "translation_m": [-0.03, 0.06, 0.02]}}}}}}}},
      "limits": {{"drawn_inner_over4_share": 0.005}})",
                                                 scene.string(), k_viewer));
  const auto share = [](const Check& which) { return readings(which).at("drawn_inner_over4_share"); };
  EXPECT_TRUE(share(good).good()) << share(good).value;
  using Maps = scene::SurfaceMaps;
  for (const auto map : {&Maps::metallic_roughness, &Maps::normals, &Maps::occlusion, &Maps::emission}) {
    Check wrong = good;
    (wrong.renderer_input.scene.slots[0].variants[0].mesh.materials[0].maps.*map).image.release();
    EXPECT_FALSE(share(wrong).good());
  }
  Check wrong = good;
  wrong.renderer_input.scene.light->lamps[0].d_world = Eigen::Vector3d(0.5, -0.7, 0.6).normalized();
  EXPECT_FALSE(share(wrong).good());
}

TEST_F(CheckJudge, APartElsewhereMissesWhatItsPlaceIsJudgedBy) {
  const Check good =
      check("bench", fmt::format(R"("viewer": {}, "resolution": 0.5, "poses": {{"slots": {{"mirror":
      {{"prototype_from_part": {{"rotation_wxyz": [1, 0, 0, 0], "translation_m": [-0.05, -0.06, -0.01]}}}}}}}},
      "limits": {{"mask_iou": 0.97, "composite_px": 1, "depth_order_share": 0.99}})",
                                 k_viewer));
  Check wrong = good;
  for (scene::PosedPart& part : wrong.renderer_input.posed.parts)
    part.world_from_part.translation.x() += 0.006;
  expect_missed(good, wrong);
}

TEST_F(CheckJudge, LightThatEndsEarlyLeavesAGapBesideTheScreenAndLightTooBrightShowsTwice) {
  const Check good = check("studio", fmt::format(R"("viewer": {}, "resolution": 0.5,
      "poses": {{"shown": ["mirror"], "slots": {{"mirror": {{"variant": "city"}}}}}},
      "limits": {{"edge_gap_share": 0.12, "edge_double_share": 0.05}})",
                                                 k_viewer));
  Check aside = good, bright = good;
  for (Imager& projector : aside.renderer_input.rig.projectors) projector.lens.values[3] += 6;
  for (scene::Variant& variant : bright.renderer_input.scene.slots[0].variants)
    for (scene::Material& material : variant.mesh.materials) material.base_colour *= 1.2F;
  for (const auto& [name, reading] : readings(good))
    EXPECT_TRUE(reading.good()) << name << " " << reading.value;
  EXPECT_FALSE(readings(aside).at("edge_gap_share").good());
  EXPECT_FALSE(readings(bright).at("edge_double_share").good());
}

// If the parts are drawn for one viewer alone, the other sees twice the error.
TEST_F(CheckJudge, AnEyeThatIsNotBetweenItsViewersMissesWhatTheyAreJudgedBy) {
  const Check good = check("studio", R"("resolution": 0.5, "limits": {"shared_mm": 15.5}, "viewer": [
      {"eye_m": [-0.35, -1.3, 0.7], "target_m": [0, 0, 0.4], "size": [320, 240], "fov_deg": 44},
      {"eye_m": [0.35, -1.3, 0.7], "target_m": [0, 0, 0.4], "size": [320, 240], "fov_deg": 44}])");
  Check wrong = good;
  wrong.viewer.imager_from_world = looking_at(good.shares[0].p_world, {0, 0, 0.42}, Eigen::Vector3d::UnitZ());
  expect_missed(good, wrong);
}

TEST_F(CheckJudge, AWrongResponseShowsAtTheSeams) {
  const Check good = check("halves", fmt::format(R"("viewer": {}, "resolution": 0.5,
      "limits": {{"seam_step_p95": 0.01, "seam_step_max": 0.02}})",
                                                 k_viewer));
  Check wrong = good;
  for (const Imager& projector : wrong.renderer_input.rig.projectors) {
    ProjectorResponse response;
    response.projector = projector.name;
    for (int i = 0; i < 256; ++i) response.red.push_back(std::pow(i / 255.0, 1.8));
    response.green = response.blue = response.red;
    wrong.renderer_input.rig.responses.push_back(response);
  }
  expect_missed(good, wrong);
}

TEST_F(CheckJudge, ABlackThatNobodyMeasuredShowsAtTheSeams) {
  const auto measured = [](const std::string& world) {
    return check(
        world,
        fmt::format(R"("viewer": {}, "resolution": 0.5, "limits": {{"black_step_share": 0.1}})", k_viewer));
  };
  const Check good = measured("halves");
  Check wrong = good;
  for (const Imager& projector : wrong.renderer_input.rig.projectors) {
    ProjectorResponse response;  // without a black level
    response.projector = projector.name;
    for (int i = 0; i < 256; ++i) response.red.push_back(std::pow(i / 255.0, 2.2));
    response.green = response.blue = response.red;
    wrong.renderer_input.rig.responses.push_back(response);
  }
  EXPECT_LT(readings(good).at("black_step_share").value, 0.2) << "half the resolution: pixels twice as wide";
  EXPECT_GT(readings(wrong).at("black_step_share").value, 0.8);
  const auto one = judge_check(measured("bench"));
  ASSERT_FALSE(one) << "a projector alone has no seam but at its own light's end";
  EXPECT_NE(one.message().find("a seam of projectors"), std::string::npos) << one.message();
}

TEST(Check, ALimitThatCannotHoldFailsAndIsNamed) {
  const fs::path folder = test::test_folder();
  const fs::path file =
      written(folder, "bench",
              fmt::format(R"("viewer": {}, "resolution": 0.25, "limits": {{"mask_iou": 1}})", k_viewer));
  const Outcome outcome = run({file.string(), "--out", (folder / "out").string()});
  EXPECT_EQ(outcome.code, 1);
  EXPECT_NE(outcome.out.find("MISSED"), std::string::npos) << outcome.out;
  EXPECT_NE(outcome.err.find("small"), std::string::npos) << outcome.err;
  EXPECT_NE(read_file(folder / "out" / "check.html").value().find("1 of 1 failed"), std::string::npos);
  EXPECT_FALSE(test::read_json(folder / "out" / "check.json").at("passed").get<bool>());
}

TEST(Check, AnotherRunsImagesAreComparedWith) {
  const fs::path folder = test::test_folder(), there = folder / "there", here = folder / "here";
  const std::string file =
      written(folder, "bench",
              fmt::format(R"("viewer": {}, "resolution": 0.25, "limits": {{"mask_iou": 0.5}})", k_viewer))
          .string();
  ASSERT_EQ(run({file, "--out", there.string()}).code, 0);
  const auto compared = [&] { return run({file, "--out", here.string(), "--against", there.string()}); };
  const Outcome same = compared();
  EXPECT_EQ(same.code, 0) << same.err;
  EXPECT_NE(same.out.find("apart_share"), std::string::npos) << same.out;

  const fs::path theirs = there / "small" / "mask-actual.png";
  const cv::Mat drawn = read_image(theirs).value();
  const int side = static_cast<int>(std::sqrt(0.0015 * static_cast<double>(drawn.total()))) + 1;
  const auto other = [&](int levels) {
    cv::Mat changed = drawn.clone();
    changed(cv::Rect(0, 0, side, side)) += cv::Scalar::all(levels);
    EXPECT_TRUE(write_png(theirs, changed));
    return compared();
  };
  EXPECT_EQ(other(2).code, 0);
  const Outcome apart = other(3);
  EXPECT_EQ(apart.code, 1);
  EXPECT_NE(apart.out.find("MISSED"), std::string::npos) << apart.out;
  EXPECT_TRUE(write_png(theirs, drawn(cv::Rect(0, 0, 8, 8))));
  EXPECT_NE(compared().err.find("Run the same checks"), std::string::npos);
  fs::remove(theirs);
  EXPECT_NE(compared().err.find("mask-actual.png"), std::string::npos);
  fs::remove_all(there);
  EXPECT_NE(compared().err.find("another run"), std::string::npos);
}

TEST(Check, WhatCannotBeJudgedFailsAloneAndTheOthersAreJudged) {
  const fs::path folder = test::test_folder(), other = folder / "other";
  fs::create_directories(other);
  const fs::path away = other / "away.json";  // looks away from the door
  fs::rename(
      written(other, "bench",
              R"("viewer": {"eye_m": [0, 3, 1], "target_m": [0, 9, 0], "size": [64, 48], "fov_deg": 40},
                        "limits": {"mask_iou": 0.98})"),
      away);
  const fs::path sound =
      written(folder, "bench",
              fmt::format(R"("viewer": {}, "resolution": 0.5, "limits": {{"mask_iou": 0.9}})", k_viewer));
  const Outcome outcome = run({away.string(), sound.string(), "--out", (folder / "out").string(), "--json"});
  EXPECT_EQ(outcome.code, 1);
  const auto json = nlohmann::json::parse(outcome.out);
  EXPECT_FALSE(json.at("checks")[0].at("passed").get<bool>());
  EXPECT_NE(json.at("checks")[0].at("problem").get<std::string>().find("mask_iou"), std::string::npos);
  EXPECT_TRUE(json.at("checks")[1].at("passed").get<bool>());
  EXPECT_NE(read_file(folder / "out" / "check.html").value().find("FAILED"), std::string::npos);
}

TEST(Check, BrokenFilesAreNamedWithThePlaceInThem) {
  struct Broken {
    std::string rest;
    std::vector<std::string> parts;
  };
  const std::string viewer = fmt::format("\"viewer\": {}", k_viewer),
                    limits = R"("limits": {"mask_iou": 0.98})";
  const std::vector<Broken> all = {
      {viewer + R"(, "limits": {"mask_iuo": 0.98})", {"limits", "mask_iuo", "mask_iou"}},
      {viewer + R"(, "limits": {"mask_iou": NaN})", {"small.json"}},
      {viewer + R"(, "limits": {"mask_iou": "high"})", {"limits.mask_iou", "finite number", "high"}},
      {viewer + R"(, "limits": {"composite_px": -1})", {"limits.composite_px", "negative"}},
      {viewer + R"(, "limits": {})", {"limits", "at least one"}},
      {viewer, {"limits", "missing"}},
      {viewer + R"(, "scene": "nowhere", )" + limits, {"nowhere"}},
      {viewer + R"(, "poses": "nowhere.json", )" + limits, {"nowhere.json"}},
      {viewer + R"(, "poses": {"slots": {"miror": {}}}, )" + limits, {"poses.slots.miror", "mirror, trim"}},
      {viewer + R"(, "poses": {"slots": {"mirror": {"variant": "jumbo"}}}, )" + limits,
       {"poses.slots.mirror.variant", "jumbo"}},
      {viewer + R"(, "poses": {"shown": ["grille"]}, )" + limits, {"poses.shown[0]", "grille"}},
      {viewer + R"(, "nudge": {"projector7": [1, 0]}, )" + limits, {"nudge.projector7", "projector0"}},
      {viewer + R"(, "resolution": 2, )" + limits, {"resolution", "at most 1"}},
      {R"("viewer": {"eye_m": [0, 0, 1], "target_m": [0, 0, 0], "size": [64, 48], "fov_deg": 40}, )" + limits,
       {"viewer.target_m"}},
      {R"("viewer": {"eye_m": [0, -1, 1], "target_m": [0, 0, 0], "size": [64, 48], "fov_deg": 200}, )" +
           limits,
       {"viewer.fov_deg", "180"}},
      {R"("viewer": {"eye_m": [0, -1, 1], "target_m": [0, 0, 0], "size": [0, 48], "fov_deg": 40}, )" + limits,
       {"viewer.size"}},
  };
  const fs::path folder = test::test_folder();
  for (const Broken& broken : all) {
    const Outcome outcome =
        run({written(folder, "bench", broken.rest).string(), "--out", (folder / "out").string()});
    EXPECT_EQ(outcome.code, 1) << broken.rest;
    for (const std::string& part : broken.parts)
      EXPECT_NE(outcome.err.find(part), std::string::npos)
          << "expected \"" << part << "\" in: " << outcome.err;
    EXPECT_EQ(outcome.err.find("bug in Limn"), std::string::npos) << outcome.err;
  }
  const Outcome absent = run({(folder / "absent.json").string()});
  EXPECT_EQ(absent.code, 1);
  EXPECT_NE(absent.err.find("absent.json"), std::string::npos) << absent.err;
}

// Replaces every value of a check file by something else: each time there must be a message or a success,
// never an exception.
TEST(Check, FilesWithAnyValueSpoiledNeverCrash) {
  using Json = nlohmann::json;
  const fs::path folder = test::test_folder();
  const fs::path file = written(folder, "bench",
                                fmt::format(R"("viewer": {}, "resolution": 0.5,
      "nudge": {{"projector0": [0.5, -0.25]}}, "limits": {{"mask_iou": 0.98}},
      "poses": {{"shown": ["mirror"], "world_from_prototype": {{"rotation_wxyz": [1, 0, 0, 0], "translation_m": [1, 2, 3]}},
        "slots": {{"mirror": {{"variant": "city",
          "prototype_from_part": {{"rotation_wxyz": [1, 0, 0, 0], "translation_m": [0.1, 0, 0]}}}}}}}})",
                                            k_viewer));
  const Json whole = Json::parse(read_file(file).value());
  ASSERT_TRUE(load_check(file));
  const std::vector<Json> wrong = {nullptr, "x", -1, 1e18, Json::array(), Json{{"a", 1}}};
  const Json leaves = whole.flatten();  // by JSON pointer
  std::set<std::string> places;
  for (const auto& [pointer, value] : leaves.items())
    for (Json::json_pointer place(pointer); !place.empty(); place = place.parent_pointer())
      places.insert(place.to_string());
  int refused = 0;
  for (const std::string& place : places) {
    for (const Json& bad : wrong) {
      Json spoiled = whole;
      spoiled[Json::json_pointer(place)] = bad;
      ASSERT_TRUE(write_file(file, spoiled.dump()));
      std::optional<Result<Check>> loaded;
      ASSERT_NO_THROW(loaded = load_check(file)) << place << " " << bad.dump();
      if (*loaded) continue;
      ++refused;
      EXPECT_NE(loaded->message().find(folder.filename().string()),
                std::string::npos)  // this file or one that it names
          << place << " " << loaded->message();
    }
  }
  EXPECT_GT(refused, 150);
}

TEST(Check, WrongUsageExitsWithTwo) {
  EXPECT_EQ(run({"--nonsense"}).code, 2);
  const fs::path a = test::test_folder() / "a", b = test::test_folder() / "b";
  fs::create_directories(a);
  fs::create_directories(b);
  const std::string rest = fmt::format(R"("viewer": {}, "limits": {{"mask_iou": 0.98}})", k_viewer);
  const Outcome same = run({written(a, "bench", rest).string(), written(b, "bench", rest).string()});
  EXPECT_EQ(same.code, 2);
  EXPECT_NE(same.err.find("different file names"), std::string::npos) << same.err;
}

// Starts a new program (this one, with one test only) where EGL finds no driver.
TEST(Check, WithoutEglTheErrorSaysWhatToDo) {
  if (std::getenv("LIMN_TEST_WITHOUT_EGL")) {
    const fs::path folder = test::test_folder();
    const auto file =
        written(folder, "bench", fmt::format(R"("viewer": {}, "limits": {{"mask_iou": 0.98}})", k_viewer));
    const Outcome outcome = run({file.string(), "--out", (folder / "out").string()});
    EXPECT_EQ(outcome.code, 1);
    EXPECT_NE(outcome.err.find("libegl1"), std::string::npos) << outcome.err;
    return;
  }
  const pid_t child = fork();
  if (child == 0) {
    setenv("LIMN_TEST_WITHOUT_EGL", "1", 1);
    setenv("__EGL_VENDOR_LIBRARY_FILENAMES", "/nowhere.json", 1);
    execl("/proc/self/exe", "apps_check_test", "--gtest_filter=Check.WithoutEglTheErrorSaysWhatToDo",
          nullptr);
    _exit(99);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
}

}  // namespace
}  // namespace limn::validate
