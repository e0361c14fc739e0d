// Tests the program's answers to bad input: exit code 1 if the work failed, 2 for wrong usage, and a message
// that names the place of the problem.

#include "apps/command_line.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <sstream>

#include "core/file.h"
#include "core/image_io.h"
#include "core/rig.h"
#include "core/version.h"
#include "tests/support/matchers.h"
#include "tests/support/run_limn.h"

namespace limn::apps {
namespace {

namespace fs = std::filesystem;
using test::Outcome;
using test::run_limn;

class CommandLine : public testing::Test {
 protected:
  // Expects this exit code, and each of these parts in the message.
  void expect(const std::vector<std::string>& arguments, int code, const std::vector<std::string>& parts) {
    const Outcome outcome = run_limn(arguments);
    EXPECT_EQ(outcome.code, code) << outcome.err << outcome.out;
    for (const std::string& part : parts) {
      EXPECT_NE((outcome.err + outcome.out).find(part), std::string::npos)
          << "expected \"" << part << "\" in: " << outcome.err << outcome.out;
    }
    EXPECT_EQ(outcome.err.find("bug in Limn"), std::string::npos) << outcome.err;
  }
  std::string path(const std::string& name) const { return (folder_ / name).string(); }
  void write(const std::string& name, const std::string& content) {
    fs::create_directories((folder_ / name).parent_path());
    ASSERT_TRUE(write_file(folder_ / name, content));
  }
  // A rig of one 640x480 camera and one 320x200 projector.
  void write_rig() {
    Rig rig;
    rig.cameras = {{"camera0", 640, 480, Lens::pinhole(600, 600, 319.5, 239.5), Pose()}};
    rig.projectors = {{"projector0", 320, 200, Lens::pinhole(400, 400, 159.5, 99.5), Pose()}};
    ASSERT_TRUE(save_rig(rig, folder_ / "rig"));
  }
  // A scene with one triangle as the prototype and one slot; tests may damage its scene.json.
  nlohmann::json scene() {
    write("scene/tri.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    return nlohmann::json::parse(R"({
      "schema": "limn.scene/1",
      "prototype": {"mesh": "tri.obj", "units": "m", "markers": [], "albedo": 0.8},
      "slots": [{"name": "mirror", "marker": "aruco_4x4_50:0", "size_mm": 40, "mode": "view", "stick_to_surface": false,
                 "marker_from_part": {"rotation_wxyz": [1, 0, 0, 0], "translation_m": [0, 0, 0]},
                 "variants": [{"name": "a", "mesh": "tri.obj", "units": "m"}]}]})");
  }
  // The poses show the slot's part, for a damaged part that is not shown is only a warning.
  void expect_scene_error(const nlohmann::json& spoiled, const std::vector<std::string>& parts) {
    write_rig();
    write("scene/scene.json", spoiled.dump());
    write("poses.json", R"({"slots": {"mirror": {"world_from_part":
        {"rotation_wxyz": [1, 0, 0, 0], "translation_m": [0, 0, 1]}, "variant": "a"}}})");
    expect({"render", "--rig", path("rig"), "--scene", path("scene"), "--poses", path("poses.json"), "--out",
            path("out")},
           1, parts);
    EXPECT_FALSE(fs::exists(folder_ / "out" / "coverage.json"));
  }
  fs::path folder_ = test::test_folder();
};

// The names of all commands, as the program's own help lists them.
std::vector<std::string> listed_commands() {
  const std::string help = run_limn({"--help"}).out;
  std::istringstream lines(help.substr(std::min(help.size(), help.find("Subcommands:"))));
  std::vector<std::string> names;
  std::string line, name;
  std::getline(lines, line);
  while (std::getline(lines, line))
    if (line.starts_with("  ") && std::istringstream(line) >> name && line[2] != ' ') names.push_back(name);
  return names;
}

TEST_F(CommandLine, HelpIsNoErrorAndShowsAnExample) {
  EXPECT_EQ(run_limn({"--help"}).code, 0);
  const std::vector<std::string> commands = listed_commands();
  EXPECT_GE(commands.size(), 20u);
  for (const std::string& command : commands) {
    const Outcome help = run_limn({command, "--help"});
    EXPECT_EQ(help.code, 0);
    EXPECT_NE(help.out.find("Example: limn " + command), std::string::npos) << help.out;
  }
}

TEST_F(CommandLine, PrintsItsVersion) {
  const Outcome outcome = run_limn({"--version"});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_EQ(outcome.out, fmt::format("limn {}\n", version()));
  EXPECT_EQ(std::count(outcome.out.begin(), outcome.out.end(), '.'), 2);
}

TEST_F(CommandLine, PrintsItsCommandsWhenNoneIsGiven) { expect({}, 2, {"demo", "solve", "live", "doctor"}); }

TEST_F(CommandLine, UnknownCommandsAndOptionsAreWrongUsage) {
  expect({"levitate"}, 2, {"levitate"});
  expect({"detect", "--shiny", "x.png"}, 2, {"--shiny"});
  expect({"detect"}, 2, {"images"});
}

TEST_F(CommandLine, UnknownFamiliesAndCodesAreWrongUsageAndListWhatExists) {
  cv::Mat grey(480, 640, CV_8U, cv::Scalar(128));
  ASSERT_TRUE(write_png(folder_ / "a.png", grey));
  expect({"detect", path("a.png"), "--family", "aruco_9x9_50"}, 2, {"aruco_9x9_50", "apriltag_36h11"});
  expect({"markers", "--family", "aruco_9x9_50", "--out", path("a.pdf")}, 2, {"aruco_9x9_50"});
  expect({"patterns", "--projector", "1280x800", "--code", "morse", "--out", path("p")}, 2,
         {"morse", "gray"});
  expect({"patterns", "--projector", "1280", "--out", path("p")}, 2, {"1280"});
}

TEST_F(CommandLine, WordsOutsideAClosedSetAreWrongUsageAndListTheSet) {
  const std::vector<std::string> render = {"render",           "--rig",       path("rig"),
                                           "--scene",          path("scene"), "--poses",
                                           path("poses.json"), "--out",       path("out")};
  const auto with = [](std::vector<std::string> words, const char* option, const char* word) {
    words.insert(words.end(), {option, word});
    return words;
  };
  expect(with(render, "--composite", "half"), 2, {"--composite: expected one of rest, full, found 'half'"});
  expect(with(render, "--contact-shadow", "maybe"), 2, {"--contact-shadow", "on", "off"});
  expect(with(render, "--marker-light", "dim"), 2, {"--marker-light", "keep-out"});
  expect(with(render, "--compensation", "all"), 2, {"--compensation", "geometry"});
  expect(with(render, "--black", "odd"), 2, {"--black", "even"});
  expect({"detect", "x.png", "--pose", "guess"}, 2, {"--pose", "ippe"});
  expect({"detect", "x.png", "--encoding", "log"}, 2, {"--encoding", "srgb"});
  const std::vector<std::string> exporting = {"export",      "--warp",    path("warps"),
                                              "--rig",       path("rig"), "--scene",
                                              path("scene"), "--poses",   path("poses.json")};
  expect(with(exporting, "--format", "tiff"), 2, {"--format", "pfm"});
  expect(with(exporting, "--profile", "2d"), 2, {"--profile", "a3"});
  const std::vector<std::string> align = {"align",       "--scan", path("s.ply"), "--mesh",
                                          path("m.stl"), "--out",  path("out")};
  expect(with(align, "--units", "parsec"), 2, {"--units", "parsec", "mm"});
  expect(with(align, "--scan-units", "parsec"), 2, {"--scan-units", "parsec", "mm"});
}

TEST_F(CommandLine, MissingAndTruncatedImagesAreNamed) {
  expect({"detect", path("nowhere.png")}, 1, {"nowhere.png"});
  cv::Mat grey(480, 640, CV_8U, cv::Scalar(128));
  ASSERT_TRUE(write_png(folder_ / "a.png", grey));
  const std::string whole = read_file(folder_ / "a.png").value();
  write("a.png", whole.substr(0, whole.size() / 2));
  expect({"detect", path("a.png")}, 1, {"a.png", "truncated"});
}

TEST_F(CommandLine, AnImageOfTheWrongSizeForItsCameraIsNamedWithBothSizes) {
  write_rig();
  cv::Mat grey(100, 100, CV_8U, cv::Scalar(128));
  ASSERT_TRUE(write_png(folder_ / "a.png", grey));
  expect({"detect", path("a.png"), "--camera", path("rig/camera0.cameramodel"), "--size-mm", "40"}, 1,
         {"640x480", "100x100"});
  write("scene/scene.json", scene().dump());
  expect({"render", "--rig", path("rig"), "--scene", path("scene"), "--frame", "camera0=" + path("a.png"),
          "--out", path("out")},
         1, {"640x480", "100x100"});
}

TEST_F(CommandLine, ABrokenRigIsNamed) {
  write("scene/scene.json", scene().dump());
  write("poses.json", "{}");
  const auto render = [&](const std::string& rig) {
    return std::vector<std::string>{"render",           "--rig",       rig,
                                    "--scene",          path("scene"), "--poses",
                                    path("poses.json"), "--out",       path("out")};
  };
  expect(render(path("nowhere")), 1, {"nowhere", "found nothing"});
  write("rig/rig.json", "{\"schema\": \"limn.rig/1\", \"cameras\": [");
  expect(render(path("rig")), 1, {"rig.json:1", "truncated"});
  write("rig/rig.json", R"({"schema": "limn.rig/1", "cameras": 7, "projectors": []})");
  expect(render(path("rig")), 1, {"cameras: expected a list, found number 7"});
}

TEST_F(CommandLine, SpoiledScenesAreNamedWithTheirPath) {
  auto spoiled = scene();
  spoiled["prototype"].erase("units");
  expect_scene_error(spoiled, {"prototype.units", "missing"});
  spoiled = scene();
  spoiled["slots"][0]["variants"][0]["units"] = "furlong";
  expect_scene_error(spoiled, {"furlong"});
  spoiled = scene();
  spoiled["slots"][0]["size_mm"] = "forty";
  expect_scene_error(spoiled, {"slots[0].size_mm", "forty"});
  spoiled = scene();
  spoiled["slots"][0]["colour"] = "red";
  expect_scene_error(spoiled, {"slots[0]", "unknown key \"colour\""});
  spoiled = scene();
  spoiled["slots"][0]["variants"][0]["mesh"] = "absent.glb";
  expect_scene_error(spoiled, {"absent.glb"});
  spoiled = scene();
  spoiled["slots"][0]["variants"][0]["mesh"] = "../../etc/passwd";
  expect_scene_error(spoiled, {"relative path"});
}

TEST_F(CommandLine, SpoiledMeshesAreNamed) {
  const auto spoiled = [&](const std::string& content) {
    auto with_mesh = scene();
    with_mesh["slots"][0]["variants"][0]["mesh"] = "bad.obj";
    write("scene/bad.obj", content);
    return with_mesh;
  };
  expect_scene_error(spoiled("v 0 0 0\nv 1 0 0\nv 0 1 0\n"), {"bad.obj", "triangles"});
  expect_scene_error(spoiled("v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), {"bad.obj"});
  expect_scene_error(spoiled(""), {"bad.obj"});
}

TEST_F(CommandLine, UnknownSlotsAndDevicesAreNamed) {
  write_rig();
  write("scene/scene.json", scene().dump());
  write("poses.json", R"({"slots": {"wing": {"world_from_part":
      {"rotation_wxyz": [1, 0, 0, 0], "translation_m": [0, 0, 1]}, "variant": "a"}}})");
  expect({"render", "--rig", path("rig"), "--scene", path("scene"), "--poses", path("poses.json"), "--out",
          path("out")},
         1, {"wing"});
  expect({"render", "--rig", path("rig"), "--scene", path("scene"), "--frame", "camera7=a.png", "--out",
          path("out")},
         2, {"camera7", "camera0"});
}

TEST_F(CommandLine, AnOutputFolderThatCannotBeMadeIsNamedAndWhatWasThereStays) {
  write("taken", "old");
  expect({"patterns", "--projector", "64x32", "--out", path("taken")}, 1, {"taken"});
  expect({"patterns", "--projector", "64x32", "--out", path("taken/inside")}, 1, {"taken"});
  EXPECT_EQ(read_file(folder_ / "taken").value(), "old");
}

TEST_F(CommandLine, BrokenPlansAndWorldsAreNamed) {
  expect({"capture", "--plan", path("none.json"), "--out", path("c")}, 1, {"none.json"});
  write("plan.json", R"({"schema": "limn.plan/1", "world": "w.json", "board": "charuco:1x1", "code": "gray",
                         "world_from_board": []})");
  expect({"capture", "--plan", path("plan.json"), "--out", path("c")}, 1, {"plan.json: board"});
  write("world.json", R"({"schema": "limn.world/1", "cameras": [{"name": "camera0", "size": [0, 4]}]})");
  expect({"simulate", path("world.json"), "--out", path("s")}, 1, {"world.json"});
  EXPECT_FALSE(fs::exists(folder_ / "c"));
}

TEST_F(CommandLine, AnEmptyOrForeignCapturesFolderIsNamed) {
  expect({"solve", path("none"), "--out", path("rig")}, 1, {"none"});
  write("captures/capture.json", R"({"schema": "limn.capture/1", "cameras": []})");
  expect({"solve", path("captures"), "--out", path("rig")}, 1, {"capture.json"});
  expect({"solve", path("captures"), "--out", path("rig"), "--import", "cuneiform"}, 2, {"cuneiform"});
  EXPECT_FALSE(fs::exists(folder_ / "rig"));
}

TEST_F(CommandLine, AbsurdNumbersAreWrongUsage) {
  expect({"detect", "a.png", "--repeat", "-1"}, 2, {"--repeat"});
  expect({"detect", "a.png", "--threads", "0"}, 2, {"--threads"});
  expect({"detect", "a.png", "--size-mm", "nan"}, 2, {"--size-mm"});
  expect({"patterns", "--projector", "99999x99999", "--out", path("p")}, 2, {"16384"});
  for (const char* board : {"charuco:1000x1000:1mm", "charuco:100x100:1mm", "charuco:5x4:1e300m",
                            "chessboard:5x4:0mm", "chessboard:5x4:nanmm"})
    expect({"markers", "--board", board, "--out", path("b.pdf")}, 2, {board, "expected"});
  for (const char* ids : {"5-1", "0-999999", "0-99999999999", "-1", ",,"})
    expect({"markers", "--ids", ids, "--out", path("b.pdf")}, 2, {"--ids"});
  EXPECT_FALSE(fs::exists(folder_ / "b.pdf"));
}

TEST_F(CommandLine, PathsThatCannotBeLookedAtAreNoBugs) {
  const std::string longest(5000, 'x');
  expect({"detect", longest}, 1, {"File name too long"});
  expect({"simulate", longest, "--out", path("s")}, 1, {"File name too long"});
  expect({"solve", longest, "--out", path("rig")}, 1, {"File name too long"});
}

TEST_F(CommandLine, CamerasOfImpossibleSizeAreNamed) {
  write_rig();
  cv::Mat grey(480, 640, CV_8U, cv::Scalar(128));
  ASSERT_TRUE(write_png(folder_ / "a.png", grey));
  std::string model = read_file(folder_ / "rig/camera0.cameramodel").value();
  model.replace(model.find("640"), 3, "99999999999");
  write("huge.cameramodel", model);
  expect({"detect", path("a.png"), "--camera", path("huge.cameramodel"), "--size-mm", "40"}, 1,
         {"huge.cameramodel: imagersize", "16384"});
  for (const char* width : {"-640", "foo", "1e30", "0.5"}) {
    write("a.yml", std::string("%YAML:1.0\n---\nimage_width: ") + width +
                       "\nimage_height: 480\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: "
                       "d\n   data: [ 600., 0., 320., 0., 600., 240., 0., 0., 1. ]\n");
    expect({"detect", path("a.png"), "--camera", path("a.yml"), "--size-mm", "40"}, 1,
           {"a.yml: image_width"});
  }
}

TEST_F(CommandLine, BrokenDictionariesAndTemplatesAreNamed) {
  cv::Mat grey(480, 640, CV_8U, cv::Scalar(128));
  ASSERT_TRUE(write_png(folder_ / "a.png", grey));
  write("cut.yml", "%YAML:1.0\nnmarkers: 2\nmarkersize: 3\nmarker_0: \"010101010\"\n");
  expect({"detect", path("a.png"), "--family", "aruco:" + path("cut.yml")}, 2, {"cut.yml", "marker_1"});
  write("open.xml", "<opencv_storage><nmarkers>1</nmarkers");
  expect({"detect", path("a.png"), "--family", "aruco:" + path("open.xml")}, 2, {"open.xml", "closing tag"});
  std::string numbers;
  for (int i = 0; i < 3071; ++i) numbers += fmt::format(" {}", i % 256);
  write("few.patt", numbers);
  expect({"detect", path("a.png"), "--family", "artoolkit:" + path("few.patt")}, 2, {"few.patt", "3071"});
}

TEST_F(CommandLine, LensesThatAreNoNumbersAreNamed) {
  cv::Mat grey(480, 640, CV_8U, cv::Scalar(128));
  ASSERT_TRUE(write_png(folder_ / "a.png", grey));
  const auto expect_named = [&](const std::string& name, const std::string& content,
                                const std::string& part) {
    write(name, content);
    expect({"detect", path("a.png"), "--camera", path(name), "--size-mm", "40"}, 1, {name, part});
  };
  for (const char* bad : {".Nan", ".Inf", "1e999"})
    expect_named(
        "a.yml",
        std::string("%YAML:1.0\n---\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
                    "   data: [ 600., 0., ") +
            bad + ", 0., 600., 240., 0., 0., 1. ]\n",
        bad[0] == '.' ? "finite" : "numbers");
  for (const char* bad : {"nan", "inf"})
    expect_named("b.cameramodel",
                 std::string("{'lensmodel': 'LENSMODEL_PINHOLE', 'intrinsics': [600, ") + bad +
                     ", 320, 240], 'extrinsics': [0,0,0,0,0,0], 'imagersize': [640, 480]}",
                 "finite");
  write("scene/scene.json", scene().dump());
  write("poses.json", "{}");
  write("rig/rig.json",
        R"({"schema": "limn.rig/1", "projectors": [], "cameras": [{"name": "c", "size": [640, 480],
            "lens": {"model": "LENSMODEL_PINHOLE", "values": [600, null, 320, 240]},
            "imager_from_world": {"rotation_wxyz": [1, 0, 0, 0], "translation_m": [0, 0, 0]}}]})");
  expect({"render", "--rig", path("rig"), "--scene", path("scene"), "--poses", path("poses.json"), "--out",
          path("out")},
         1, {"rig.json", "finite number"});
}

TEST_F(CommandLine, NamesInAWorldCannotLeaveTheOutputFolder) {
  for (const char* name : {"../x", "", "..", "a/b"}) {
    write("world.json", nlohmann::json{{"schema", "limn.world/1"}, {"cameras", {{{"name", name}}}}}.dump());
    expect({"simulate", path("world.json"), "--out", path("s")}, 1, {"cameras[0].name", "without slashes"});
  }
}

// Replaces every value of a rig and a scene by something else: each time there must be a message or a
// success, never an exception. The output folder cannot be created, so that a valid scene is not drawn.
TEST_F(CommandLine, ConfigsWithAnyValueSpoiledNeverCrash) {
  using Json = nlohmann::json;
  write_rig();
  write("poses.json", "{}");
  write("taken", "");
  Json nested = 1;
  for (int level = 0; level < 200; ++level) nested = Json::array({nested});
  const std::vector<Json> wrong = {nullptr,
                                   true,
                                   "",
                                   "x",
                                   "../../x",
                                   -1,
                                   0,
                                   0.5,
                                   1e18,
                                   -1e308,
                                   Json::array(),
                                   Json::object(),
                                   Json{1, 2},
                                   Json{{"a", 1}},
                                   nested,
                                   std::string(5000, 'a')};
  const std::vector<std::pair<std::string, Json>> files = {
      {"scene/scene.json", scene()},
      {"rig/rig.json", Json::parse(read_file(folder_ / "rig/rig.json").value())}};
  write("scene/scene.json", scene().dump());
  for (const auto& [name, whole] : files) {
    const Json leaves = whole.flatten();  // by JSON pointer
    for (const auto& [pointer, value] : leaves.items()) {
      for (Json::json_pointer place(pointer); !place.empty(); place = place.parent_pointer()) {
        for (const Json& bad : wrong) {
          Json spoiled = whole;
          spoiled[place] = bad;
          write(name, spoiled.dump());
          const Outcome outcome = run_limn({"render", "--rig", path("rig"), "--scene", path("scene"),
                                            "--poses", path("poses.json"), "--out", path("taken/out")});
          ASSERT_TRUE(outcome.code == 1 || outcome.code == 2)
              << outcome.code << name << place.to_string() << " " << bad.dump().substr(0, 80);
          ASSERT_EQ(outcome.err.find("bug in Limn"), std::string::npos)
              << name << place.to_string() << " " << bad.dump().substr(0, 80) << outcome.err;
        }
      }
    }
    write(name, whole.dump());
  }
}

TEST_F(CommandLine, BenchNamesTheBenchesThereAre) {
  expect({"bench", "tracking"}, 2,
         {"tracking", "tracker, id, calib, solve, projector, live, prediction, remote, tablet"});
}

TEST_F(CommandLine, BenchSaysWhichProgramIsMissing) {  // there is none beside the test program
  expect({"bench", "tracker", "--frames", "1"}, 1, {"tests/bench/tracker_bench", "libapriltag-dev"});
}

}  // namespace
}  // namespace limn::apps
