#include "apps/solve.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sched.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <regex>

#include "calib/board/board.h"
#include "calib/capture.h"
#include "calib/code/patterns.h"
#include "calib/response/response_patterns.h"
#include "core/file.h"
#include "core/image_io.h"
#include "core/median.h"
#include "core/rig.h"
#include "tests/calib/true_rig.h"
#include "tests/support/json.h"
#include "tests/support/matchers.h"
#include "tracker/marker_image.h"

namespace limn::apps {
namespace {

namespace fs = std::filesystem;
using namespace test;
using Eigen::Vector2d;
using Eigen::Vector3d;

// A camera and a shifted projector in front of a ChArUco board; images are drawn by intersecting camera rays
// with the board and reading its texture and the pattern there.
struct BoardAndProjector {
  Imager camera{"camera0", 640, 480,
                Lens::create("LENSMODEL_OPENCV4", {800, 800, 322, 238, -0.1, 0.05, 0, 0}).value(), Pose()};
  Imager projector{
      "projector0", 256, 192, Lens::pinhole(330, 330, 128, 180),
      Pose(exp_rotation({0.25, 0, 0}), Vector3d::Zero()) * looking_at({-0.35, 0, 0}, {0, 0, 1}, {0, -1, 0})};
  calib::Board board = calib::Board::parse("charuco:8x6:40mm").value();
  calib::BoardSheet sheet = calib::draw_board(board, {.square_px = 48});
  static constexpr int k_samples = 2;  // along each axis of a pixel

  Pose world_from_board(int pose) const {
    const double around = 2.2 * pose, tilt = 0.45;
    return Pose(exp_rotation({tilt * std::cos(around), tilt * std::sin(around), 0.1 * pose}),
                Vector3d(0.03 * std::sin(around), 0, 1 + 0.05 * pose)) *
           Pose(Eigen::Quaterniond::Identity(), Vector3d(-board.width_m() / 2, -board.height_m() / 2, 0));
  }

  struct Sample {
    float albedo = 0;
    int column = -1, row = -1;
  };

  std::vector<Sample> samples(int pose, bool with_board) const { return samples(pose, with_board, sheet); }

  std::vector<Sample> samples(int pose, bool with_board, const calib::BoardSheet& shown) const {
    std::vector<Sample> all;
    const Pose board_from_camera = world_from_board(pose).inverse();
    for (int y = 0; y < camera.height * k_samples; ++y) {
      for (int x = 0; x < camera.width * k_samples; ++x) {
        const Vector2d px((x + 0.5) / k_samples - 0.5, (y + 0.5) / k_samples - 0.5);
        const Vector3d d = board_from_camera.rotation * *camera.lens.unproject(px);
        const Vector3d p = board_from_camera.translation - board_from_camera.translation.z() / d.z() * d;
        const Vector2d at = shown.px_board_origin + shown.pixels_per_metre * p.head<2>();
        const int u = static_cast<int>(std::lround(at.x())), v = static_cast<int>(std::lround(at.y()));
        const bool inside = u >= 0 && v >= 0 && u < shown.image.cols && v < shown.image.rows;
        Sample sample;
        sample.albedo = inside && with_board && shown.image.at<uchar>(v, u) == 0 ? 0.05F : 0.8F;
        if (const auto light = projector.project(world_from_board(pose) * p);
            light && projector.contains(*light)) {
          sample.column = static_cast<int>(std::lround(light->x()));
          sample.row = static_cast<int>(std::lround(light->y()));
        }
        all.push_back(sample);
      }
    }
    return all;
  }

  cv::Mat photograph(const std::vector<Sample>& samples, const cv::Mat& shown) const {
    cv::Mat light(camera.height, camera.width, CV_32F, cv::Scalar(0));
    for (int y = 0; y < camera.height * k_samples; ++y) {
      for (int x = 0; x < camera.width * k_samples; ++x) {
        const Sample& s = samples[static_cast<size_t>(y * camera.width * k_samples + x)];
        const bool lit = s.column >= 0 && shown.at<uchar>(s.row, s.column) != 0;
        light.at<float>(y / k_samples, x / k_samples) +=
            s.albedo * (lit ? 230.F : 25.F) / (k_samples * k_samples);
      }
    }
    cv::Mat photo;
    light.convertTo(photo, CV_8U);
    return photo;
  }

  // Two markers, 250 mm from centre to centre, on a sheet that replaces the board.
  calib::BoardSheet bar() const {
    calib::BoardSheet made{cv::Mat(160, 420, CV_8U, cv::Scalar(255)), 1000, {49.5, -40.5}};
    for (const int id : {3, 7}) {
      const cv::Mat marker = tracker::marker_image({"apriltag_36h11", std::to_string(id)}).value().image;
      cv::Mat grey;
      cv::resize(to_grey(marker), grey, {64, 64}, 0, 0, cv::INTER_NEAREST);
      grey.copyTo(made.image(cv::Rect(id == 3 ? 53 : 303, 48, 64, 64)));
    }
    return made;
  }

  calib::CaptureSet plan(const fs::path& folder) const {
    return calib::plan_captures(folder, {{camera.name, camera.width, camera.height}},
                                {{projector.name, projector.width, projector.height}}, board);
  }

  void capture_seen(const calib::CaptureSet& plan, int pose, const std::vector<Sample>& seen) const {
    cv::Mat photo;
    const Status status = calib::capture_pose(
        plan, pose,
        {.show = [&](int, const cv::Mat& shown) { return photo = photograph(seen, shown), Status(); },
         .grab = [&](int) { return Result<cv::Mat>(photo); }});
    ASSERT_TRUE(status.ok()) << status.message();
  }

  void capture_bar(const calib::CaptureSet& plan, int pose) const {
    capture_seen(plan, pose, samples(pose, true, bar()));
  }

  void capture(const fs::path& folder, int poses, bool with_board = true) const {
    const calib::CaptureSet plan = this->plan(folder);
    ASSERT_TRUE(calib::begin_captures(plan).ok());
    for (int pose = 0; pose < poses; ++pose) capture_seen(plan, pose, samples(pose, with_board));
  }
};

// The captures of six poses, made once for all tests of this file.
const fs::path& captured() {
  static const fs::path folder = [] {
    fs::path made = test_folder() / "captures";
    BoardAndProjector().capture(made, 6);
    return made;
  }();
  return folder;
}

// A copy of the captures that a test may damage.
fs::path own_captures() {
  const fs::path& original = captured();
  fs::path copy = original.parent_path() / "damaged";
  fs::remove_all(copy);
  fs::copy(original, copy, fs::copy_options::recursive);
  return copy;
}

TEST(SolveCommand, FindsTheRigThatTookTheCaptures) {
  const fs::path& captures = captured();
  const fs::path out = captures.parent_path() / "rig";
  const Status status = run_solve({.captures = captures, .out = out});
  ASSERT_TRUE(status.ok()) << status.message();
  const auto rig = load_rig(out);
  ASSERT_TRUE(rig.ok()) << rig.message();
  const BoardAndProjector truth;
  ASSERT_EQ(rig->projectors.size(), 1U);
  EXPECT_NEAR(rig->cameras[0].lens.fx(), truth.camera.lens.fx(), 4);
  EXPECT_NEAR(rig->projectors[0].lens.cy(), truth.projector.lens.cy(), 4);
  EXPECT_TRUE(
      pose_near(rig->projectors[0].imager_from_world, truth.projector.imager_from_world, 0.5_deg, 8_mm));
  for (const char* file :
       {"camera0.cameramodel", "projector0.cameramodel", "report.html", "observations.json"})
    EXPECT_TRUE(fs::exists(out / file)) << file;

  const auto report = test::read_json(out / "report.json");
  EXPECT_EQ(report["verdict"], "good");
  EXPECT_LT(report["held_out"]["rms_px"], 0.15);
  EXPECT_EQ(report["held_out"]["poses"].size(), 6U);
  EXPECT_GT(report["decode"]["share"], 0.9);
  EXPECT_GT(report["decode"]["share_of_contrasted"], 0.8);
  EXPECT_LE(report["decode"]["share_of_contrasted"], report["decode"]["share"]);
  EXPECT_EQ(report["scale_rests_on"], "board");
  EXPECT_NE(report["words"].get<std::string>().find("which nothing has checked"), std::string::npos);
  EXPECT_LT(report["predicted_error_mm"]["p95"], 0.5);
  EXPECT_EQ(report["devices"].size(), 2U);
  EXPECT_TRUE(report["seconds"].contains("total"));

  // Lens models were chosen, one for each device.
  int chosen = 0;
  for (const auto& trial : report["lens_models"]) chosen += trial["chosen"].get<bool>() ? 1 : 0;
  EXPECT_EQ(chosen, 2);
  EXPECT_GT(report["lens_models"].size(), 4U);

  // The error of light on a surface that was not captured agrees with the report's prediction.
  TrueRig known;
  known.rig.cameras = {truth.camera};
  known.rig.projectors = {truth.projector};
  known.world_from_prototype = Pose(Eigen::Quaterniond::Identity(), Vector3d(0, 0, 1.1));
  std::mt19937_64 rng = test_rng();
  const std::vector<double> missed_mm =
      landed(known, *rig, prototype_mesh(Prototype::panel), 0.03, 1000, &rng).pooled_mm();
  const double stated = report["predicted_error_mm"]["p95"];
  printf("[ truth    ] stated %.3f mm, p95 %.3f mm\n", stated, p95(missed_mm));
  EXPECT_LT(p95(missed_mm), 2 * stated);
}

// The text of every file, without times.
std::map<std::string, std::string> files_of(const fs::path& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (!entry.is_regular_file()) continue;
    std::string text = read_file(entry.path()).value();
    if (entry.path().filename() == "report.json") {
      auto json = nlohmann::ordered_json::parse(text);
      EXPECT_TRUE(json.contains("seconds"));
      for (const char* clock : {"seconds", "date"}) json.erase(clock);
      text = json.dump(2);
    }
    static const std::regex stamp(R"(\d{4}-\d\d-\d\d([T ]\d\d:\d\d(:\d\d)?)?)");
    files[fs::relative(entry.path(), folder).string()] = std::regex_replace(text, stamp, "DATE");
  }
  return files;
}

// As long as it lives, this thread and the threads that it starts run on one core.
class OnOneCore {
 public:
  OnOneCore() {
    sched_getaffinity(0, sizeof(before_), &before_);
    cpu_set_t one;
    CPU_ZERO(&one);
    for (int i = 0; i < CPU_SETSIZE && CPU_COUNT(&one) == 0; ++i) {
      if (CPU_ISSET(i, &before_)) CPU_SET(i, &one);
    }
    sched_setaffinity(0, sizeof(one), &one);
    cv::setNumThreads(1);
  }
  ~OnOneCore() {
    sched_setaffinity(0, sizeof(before_), &before_);
    cv::setNumThreads(-1);
  }
  OnOneCore(const OnOneCore&) = delete;
  OnOneCore& operator=(const OnOneCore&) = delete;

 private:
  cpu_set_t before_{};
};

TEST(SolveCommand, GivesTheSameBytesForTheSameCapturesOnOneCoreAndOnMany) {
  const fs::path& captures = captured();
  const fs::path folder = captures.parent_path();
  ASSERT_TRUE(run_solve({.captures = captures, .out = folder / "first"}).ok());
  {
    const OnOneCore alone;
    ASSERT_TRUE(run_solve({.captures = captures, .out = folder / "second"}).ok());
  }
  const auto first = files_of(folder / "first"), second = files_of(folder / "second");
  EXPECT_GE(first.size(), 6U);
  ASSERT_EQ(first.size(), second.size());
  for (const auto& [name, text] : first) EXPECT_TRUE(second.at(name) == text) << name << " differs";
}

TEST(SolveCommand, UsesASceneWithoutABoard) {
  const fs::path captures = own_captures();
  fs::remove_all(captures / "pose03");
  fs::remove_all(captures / "pose04");
  BoardAndProjector().capture(captures.parent_path() / "scene", 1, false);
  fs::rename(captures.parent_path() / "scene" / "pose00", captures / "pose03");
  fs::remove_all(captures.parent_path() / "scene");
  const auto report =
      wizard::solve_captures({.captures = captures, .out = captures.parent_path() / "scene rig"});
  ASSERT_TRUE(report.ok()) << report.message();
  const calib::Observations& seen = report->observed.observations;
  ASSERT_GT(seen.points.size(), 50U);
  EXPECT_EQ(seen.points.size(), seen.tie_observations.size()) << "one camera, one projector";
  // The part of the residual that depth cannot absorb, across the epipolar lines.
  std::vector<double> lengths;
  for (const Vector2d& r : report->solution.tie_point_residuals) lengths.push_back(r.norm());
  EXPECT_LT(median(std::move(lengths)), 0.2);
  EXPECT_EQ(report->assessment.held_out.poses.size(), 4U);
}

TEST(SolveCommand, ChangesNothingWhenCapturesAreDamaged) {
  const fs::path captures = own_captures(), out = captures.parent_path() / "old rig";
  ASSERT_TRUE(make_folder(out).ok());
  ASSERT_TRUE(write_file(out / "rig.json", "old").ok());
  const auto failure = [&] {
    const Status status = run_solve({.captures = captures, .out = out});
    EXPECT_FALSE(status.ok());
    EXPECT_EQ(read_file(out / "rig.json").value(), "old");
    EXPECT_FALSE(fs::exists(out / "report.json"));
    return status.ok() ? std::string() : status.message();
  };
  const fs::path shot = captures / "pose03" / "camera0" / "007.png";
  const std::string content = read_file(shot).value();
  ASSERT_TRUE(write_file(shot, content.substr(0, content.size() - 30)).ok());
  EXPECT_NE(failure().find("pose03/camera0/007.png"), std::string::npos);
  ASSERT_TRUE(write_png(shot, cv::Mat(100, 100, CV_8U, cv::Scalar(0))).ok());
  EXPECT_NE(failure().find("pose03/camera0/007.png"), std::string::npos);
  fs::remove(shot);
  EXPECT_NE(failure().find("pose03/camera0/007.png"), std::string::npos);
  EXPECT_TRUE(run_solve({.captures = captures, .out = out, .skip_poses = {"pose03"}}).ok());
}

// A linear camera in front of a wall, darker on its left, that a projector of gamma 1.8 lights inside a
// frame. Each camera pixel sees a mixture of the four projector pixels around it.
cv::Mat photograph_of_response(const cv::Mat& shown, int width, int height) {
  cv::Mat photo(height, width, CV_8U);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const double albedo = 0.4 + 0.6 * x / width;
      double light = 0.04;
      const int u = (x - 40) / 2, v = (y - 40) / 2;
      if (u >= 0 && v >= 0 && u + 1 < shown.cols && v + 1 < shown.rows)
        for (int i = 0; i < 4; ++i) {
          const auto& bgr = shown.at<cv::Vec3b>(v + i / 2, u + i % 2);
          const double share = 0.1 * (1 + (x * 7 + y * 3 + i) % 4);  // 0.1, 0.2, 0.3 and 0.4
          for (int c = 0; c < 3; ++c)
            light += albedo * share * 0.27 * (0.01 + 0.99 * std::pow(bgr[c] / 255.0, 1.8));
        }
      const int dither =
          (x * 37 + y * 101) % 64;  // replaces noise: without it, 8 bits cannot show parts of a level
      photo.at<uchar>(y, x) = cv::saturate_cast<uchar>(255 * light + dither / 64.0 - 0.5);
    }
  return photo;
}

TEST(SolveCommand, MeasuresTheResponseFromImagesBesideThePoses) {
  const fs::path captures = own_captures(), out = captures.parent_path() / "rig with response";
  const BoardAndProjector truth;
  const fs::path folder = captures / "response" / "projector0" / "camera0";
  ASSERT_TRUE(make_folder(folder).ok());
  for (int i = 0; i < static_cast<int>(calib::response_images().size()); ++i) {
    const cv::Mat shown = calib::draw_response(i, truth.projector.width, truth.projector.height);
    ASSERT_TRUE(write_png(folder / calib::image_name(i),
                          photograph_of_response(shown, truth.camera.width, truth.camera.height))
                    .ok());
  }
  const Status status = run_solve({.captures = captures, .out = out});
  ASSERT_TRUE(status.ok()) << status.message();
  const auto rig = load_rig(out);
  ASSERT_TRUE(rig.ok()) << rig.message();
  ASSERT_EQ(rig->responses.size(), 1U);
  double worst = 0;
  for (int v = 0; v < 256; ++v)
    worst = std::max(worst, std::abs(rig->responses[0].green[static_cast<size_t>(v)] -
                                     (0.01 + 0.99 * std::pow(v / 255.0, 1.8))));
  EXPECT_LT(worst, 0.01);
  EXPECT_EQ(rig->camera_responses.at(0).encoding, CameraEncoding::linear);
  EXPECT_TRUE(rig->responses[0].vignetting.has_value());
  EXPECT_TRUE(load_mixing(out / "response.json", "projector0", "camera0").ok());

  const std::string before = read_file(out / "response.json").value(),
                    old_rig = read_file(out / "rig.json").value();
  fs::remove(folder / "030.png");
  const Status broken = run_solve({.captures = captures, .out = out});
  ASSERT_FALSE(broken.ok());
  EXPECT_NE(broken.message().find("response/projector0/camera0/030.png"), std::string::npos)
      << broken.message();
  EXPECT_EQ(read_file(out / "response.json").value(), before);
  EXPECT_EQ(read_file(out / "rig.json").value(), old_rig);
}

TEST(SolveCommand, NamesCopiedImagesAndTheBoardThatWasReallyThere) {
  const fs::path captures = own_captures(), out = captures.parent_path() / "new rig";
  const auto failure = [&] {
    const Status status = run_solve({.captures = captures, .out = out});
    EXPECT_FALSE(status.ok());
    EXPECT_FALSE(fs::exists(out));
    return status.ok() ? std::string() : status.message();
  };
  const fs::path series = captures / "pose02" / "camera0";
  const std::string whole = read_file(series / "011.png").value();
  fs::copy_file(series / "004.png", series / "011.png", fs::copy_options::overwrite_existing);
  const std::string copied = failure();
  EXPECT_NE(copied.find("pose02/camera0/011.png"), std::string::npos) << copied;
  EXPECT_NE(copied.find("pose02/camera0/004.png"), std::string::npos) << copied;
  ASSERT_TRUE(write_file(series / "011.png", whole).ok());

  std::string plan = read_file(captures / "capture.json").value();
  plan.replace(plan.find("charuco:8x6:40mm"), 16, "charuco:7x5:40mm");
  ASSERT_TRUE(write_file(captures / "capture.json", plan).ok());
  const std::string other = failure();
  EXPECT_NE(other.find("8 squares across"), std::string::npos) << other;
  EXPECT_NE(other.find("charuco:7x5:40mm"), std::string::npos) << other;
}

// The board is described with squares of 39 mm instead of 40: no residual shows it, but the scale bar does.
TEST(SolveCommand, AKnownLengthTellsABoardOfTheWrongSize) {
  const fs::path captures = own_captures(), out = captures.parent_path() / "rig with bar";
  const BoardAndProjector truth;
  const calib::CaptureSet plan = truth.plan(captures);
  for (const int pose : {6, 7}) truth.capture_bar(plan, pose);
  wizard::SolveCommandOptions options{.captures = captures, .out = out};
  options.scale_bar_lengths = {"apriltag_36h11:3 apriltag_36h11:7 250mm", "apriltag_36h11:3 64mm"};
  const auto right = wizard::solve_captures(options);
  ASSERT_TRUE(right.ok()) << right.message();
  ASSERT_EQ(right->scale_bar_lengths.size(), 2U);
  const calib::ScaleBarCheck& side = right->scale_bar_lengths[1];
  EXPECT_EQ(side.views.size(), 2U);
  EXPECT_NEAR(side.measured_m, 0.064, 0.0005);
  EXPECT_LT(std::abs(side.measured_m - 0.064), 3.5 * side.stddev_m);
  EXPECT_LT(side.stddev_m, 0.0005);
  EXPECT_EQ(right->scale_rests_on, "known_length");
  EXPECT_EQ(right->explanation.verdict.find("nothing has checked"), std::string::npos);
  const calib::ScaleBarCheck& check = right->scale_bar_lengths[0];
  EXPECT_EQ(check.views.size(), 2U);
  EXPECT_NEAR(check.measured_m, 0.250, 0.0015);
  EXPECT_LT(std::abs(check.measured_m - 0.250), 3.5 * check.stddev_m);
  EXPECT_LT(check.stddev_m, 0.0015);
  EXPECT_TRUE(
      std::none_of(right->assessment.faults.begin(), right->assessment.faults.end(),
                   [](const calib::Fault& fault) { return fault.name == calib::FaultName::wrong_scale; }));

  std::string described = read_file(captures / "capture.json").value();
  described.replace(described.find("charuco:8x6:40mm\""), 17,
                    "charuco:8x6:39mm\", \"known_lengths\": [\"apriltag_36h11:3 apriltag_36h11:7 25cm\"]");
  ASSERT_TRUE(write_file(captures / "capture.json", described).ok());
  options.scale_bar_lengths.clear();
  const auto wrong = wizard::solve_captures(options);
  ASSERT_TRUE(wrong.ok()) << wrong.message();
  ASSERT_EQ(wrong->scale_bar_lengths.size(), 1U);
  EXPECT_NEAR(wrong->scale_bar_lengths[0].measured_m, 0.250 * 39 / 40, 0.0015);
  const auto fault =
      std::find_if(wrong->assessment.faults.begin(), wrong->assessment.faults.end(),
                   [](const calib::Fault& f) { return f.name == calib::FaultName::wrong_scale; });
  ASSERT_NE(fault, wrong->assessment.faults.end());
  EXPECT_NE(fault->advice.find("instead of 39 mm"), std::string::npos) << fault->advice;
  EXPECT_NE(fault->evidence.find("The rig keeps the board's size"), std::string::npos) << fault->evidence;
  EXPECT_NE(wrong->assessment.verdict, calib::Verdict::good);

  options.scale_bar_lengths = {"apriltag_36h11:3 apriltag_36h11:8 250mm"};
  const auto unseen = wizard::solve_captures(options);
  ASSERT_TRUE(unseen.ok()) << unseen.message();
  EXPECT_EQ(unseen->assessment.faults.back().name, calib::FaultName::scale_bar_not_seen);
  for (const char* length : {"250mm", "25cm", ".25m", "2.5e2mm", "250mm:0.05", "250.mm:.05mm"}) {
    const auto read = calib::parse_scale_bar(std::string("a:1 b:2 ") + length);
    ASSERT_TRUE(read.ok()) << read.message();
    EXPECT_NEAR(read->length_m, 0.25, 1e-12);
  }
  for (const char* nonsense :
       {"", "apriltag_36h11:3", "250mm", "a:1 b:2 250", "a:1 a:1 250mm", "a:1 b:2 -3mm", "a:1 b:2 30mm:0",
        "charuco:6x5", "charuco:6x5:30mm 40mm", "charuco:6x5:30mm 120x90mm x", "acircles:4x11:20mm"})
    EXPECT_FALSE(calib::parse_scale_bar(nonsense).ok()) << nonsense;
}

// Gives the board, charuco:8x6:40mm, another text.
void describe_board(const fs::path& captures, const std::string& text) {
  const std::string true_text = "charuco:8x6:40mm";
  std::string described = read_file(captures / "capture.json").value();
  described.replace(described.find(true_text), true_text.size(), text);
  ASSERT_TRUE(write_file(captures / "capture.json", described).ok());
}

// A rig's size: the distance between its camera and its projector.
double baseline_m(const Rig& rig) {
  return (rig.cameras[0].imager_from_world.inverse().translation -
          rig.projectors[0].imager_from_world.inverse().translation)
      .norm();
}

// The print is 0.38 % larger than its text says, as prints may be. Known lengths are believed then, and the
// rig gets their size; what the statement of the size is follows from them.
TEST(SolveCommand, AKnownLengthGivesTheRigItsSizeWhereThePrintIsALittleTooLarge) {
  const fs::path captures = own_captures(), out = captures.parent_path() / "rig of bar";
  const BoardAndProjector truth;
  const calib::CaptureSet plan = truth.plan(captures);
  for (const int pose : {6, 7, 8}) truth.capture_bar(plan, pose);
  wizard::SolveCommandOptions options{.captures = captures, .out = out};
  const auto exact = wizard::solve_captures(options);
  ASSERT_TRUE(exact.ok()) << exact.message();
  const double true_m = baseline_m(exact->solution.rig);

  describe_board(captures, "charuco:8x6:39.85mm");
  const auto blind = wizard::solve_captures(options);
  ASSERT_TRUE(blind.ok()) << blind.message();
  EXPECT_NEAR(baseline_m(blind->solution.rig) / true_m, 39.85 / 40, 2e-4);

  options.scale_bar_lengths = {"apriltag_36h11:3 apriltag_36h11:7 250mm:0.05"};
  const auto right = wizard::solve_captures(options);
  ASSERT_TRUE(right.ok()) << right.message();
  ASSERT_EQ(right->scale_bar_lengths.size(), 1U);
  const calib::ScaleBarCheck& check = right->scale_bar_lengths[0];
  EXPECT_NEAR(baseline_m(right->solution.rig) / true_m, 1, 3 * check.stddev_m / 0.25);
  EXPECT_LT(check.stddev_m, 0.25 * 0.001);
  EXPECT_TRUE(right->solution.print_is_measured);
  const auto note =
      std::ranges::find(right->assessment.faults, calib::FaultName::wrong_scale, &calib::Fault::name);
  ASSERT_NE(note, right->assessment.faults.end());
  EXPECT_EQ(note->severity, calib::Severity::note);
  EXPECT_NE(note->evidence.find("They are believed"), std::string::npos) << note->evidence;
}

// A chessboard that is known to be exact beside the board, whose text says 0.38 % less than is printed.
TEST(SolveCommand, ASecondBoardGivesTheRigItsSize) {
  const fs::path captures = own_captures(), out = captures.parent_path() / "rig of two boards";
  const BoardAndProjector truth;
  const calib::CaptureSet plan = truth.plan(captures);
  wizard::SolveCommandOptions options{.captures = captures, .out = out};
  const auto exact = wizard::solve_captures(options);
  ASSERT_TRUE(exact.ok()) << exact.message();
  const auto second = calib::draw_board(calib::Board::parse("chessboard:6x5:35mm").value());
  for (const int pose : {6, 7, 8}) truth.capture_seen(plan, pose, truth.samples(pose, true, second));
  describe_board(captures, "charuco:8x6:39.85mm");

  options.scale_bar_lengths = {"chessboard:6x5:35mm:exact"};
  const auto right = wizard::solve_captures(options);
  ASSERT_TRUE(right.ok()) << right.message();
  ASSERT_EQ(right->scale_bar_lengths.size(), 1U);
  EXPECT_EQ(right->scale_bar_lengths[0].views.size(), 3U);
  EXPECT_NEAR(baseline_m(right->solution.rig) / baseline_m(exact->solution.rig), 1, 1e-3);
  EXPECT_EQ(right->scale_rests_on, "known_length");
  EXPECT_EQ(right->explanation.verdict.find("nothing has checked"), std::string::npos);

  // Of two prints each is as uncertain as the other: the rig's size is the mean of both.
  options.scale_bar_lengths = {"chessboard:6x5:35mm"};
  const auto between = wizard::solve_captures(options);
  ASSERT_TRUE(between.ok()) << between.message();
  EXPECT_NEAR(baseline_m(between->solution.rig) / baseline_m(exact->solution.rig), 1 - 0.00375 / 2, 1e-3);

  options.scale_bar_lengths = {"charuco:8x6:30mm"};
  const auto same = wizard::solve_captures(options);
  ASSERT_FALSE(same.ok());
  EXPECT_NE(same.message().find("another dictionary"), std::string::npos) << same.message();
}

// Each pose has the stripes of another pose: nothing fits together.
TEST(SolveCommand, ContradictionsAreRejectedWithFiniteNumbers) {
  const fs::path captures = own_captures(), out = captures.parent_path() / "contradicted";
  const auto stripes = [&](int pose) { return captures / fmt::format("pose{:02d}", pose) / "camera0"; };
  const calib::Patterns patterns = calib::load_patterns(captures / "patterns.json").value();
  for (int i = 0; i < patterns.white(); ++i) {
    const std::string name = calib::image_name(i);
    fs::rename(stripes(0) / name, captures / "first.png");
    for (int pose = 0; pose + 1 < 6; ++pose) fs::rename(stripes(pose + 1) / name, stripes(pose) / name);
    fs::rename(captures / "first.png", stripes(5) / name);
  }
  const auto report = wizard::solve_captures({.captures = captures, .out = out});
  if (!report) {
    EXPECT_GT(report.message().size(), 40U);
    EXPECT_FALSE(fs::exists(out / "rig.json"));
    return;
  }
  EXPECT_EQ(report->assessment.verdict, calib::Verdict::reject) << report->explanation.verdict;
  EXPECT_FALSE(report->assessment.faults.empty());
  for (const char* file : {"rig.json", "report.json", "projector0.cameramodel"}) {
    const std::string text = read_file(out / file).value();
    static const std::regex broken(R"(\b(nan|inf|null)\b)");
    EXPECT_FALSE(std::regex_search(text, broken)) << file;
  }
}

TEST(SolveCommand, SaysThatNoBoardIsVisible) {
  const fs::path folder = test_folder();
  BoardAndProjector().capture(folder / "captures", 2, false);
  const Status status = run_solve({.captures = folder / "captures", .out = folder / "rig"});
  ASSERT_FALSE(status.ok());
  EXPECT_NE(status.message().find("camera0"), std::string::npos) << status.message();
  EXPECT_NE(status.message().find("board"), std::string::npos) << status.message();
  EXPECT_FALSE(fs::exists(folder / "rig"));
}

// The captures in one folder under another program's names: white and black first, then rows, then columns,
// each inverse before its pattern, numbers without zeros.
void store_as_others_do(const fs::path& folder, int poses) {
  ASSERT_TRUE(make_folder(folder).ok());
  constexpr int k_bits = 8;  // of columns and of rows
  std::vector<int> order = {4 * k_bits, 4 * k_bits + 1};
  for (const int first : {2 * k_bits, 0}) {
    for (int i = first; i < first + 2 * k_bits; ++i) order.push_back(i ^ 1);
  }
  for (int pose = 0; pose < poses; ++pose) {
    for (size_t i = 0; i < order.size(); ++i)
      fs::create_symlink(
          captured() / fmt::format("pose{:02}", pose) / "camera0" / calib::image_name(order[i]),
          folder / fmt::format("board{}_cam0_{}.png", pose, i));
  }
}

TEST(SolveCommand, ImportsOtherOrdersWithTheSameResult) {
  const fs::path out = test_folder();
  wizard::SolveCommandOptions own{.captures = captured(), .out = out / "own"};
  own.camera_model = own.projector_model = "LENSMODEL_OPENCV4";
  ASSERT_TRUE(run_solve(own).ok());
  store_as_others_do(out / "photos", 6);
  wizard::SolveCommandOptions foreign = own;
  foreign.captures = out / "photos";
  foreign.out = out / "foreign";
  foreign.foreign = {.import_format = wizard::ImportFormat::opencv_gray,
                     .projector = "256x192",
                     .board = "charuco:8x6:40mm"};
  const Status solved = run_solve(foreign);
  ASSERT_TRUE(solved.ok()) << solved.message();
  const auto mine = test::read_json(out / "own" / "report.json"),
             theirs = test::read_json(out / "foreign" / "report.json");
  EXPECT_NEAR(theirs["held_out"]["rms_px"].get<double>(), mine["held_out"]["rms_px"].get<double>(), 1e-6);
  EXPECT_EQ(theirs["held_out"]["poses"].size(), 6U);
  foreign.foreign.order = "columns-first";
  const Status wrong = run_solve(foreign);
  ASSERT_FALSE(wrong.ok());
  EXPECT_NE(wrong.message().find("--order columns-first does not fit"), std::string::npos) << wrong.message();
  EXPECT_EQ(wrong.message().find("mirrored"), std::string::npos) << wrong.message();
}

TEST(SolveCommand, RefusesColumnsWithoutRows) {
  const fs::path& all = captured();
  const fs::path out = all.parent_path();
  wizard::SolveCommandOptions options{.captures = out / "photos", .out = out / "rig"};
  options.foreign = {.import_format = wizard::ImportFormat::opencv_gray,
                     .projector = "256x192",
                     .board = "charuco:8x6:40mm"};
  for (int pose = 0; pose < 3; ++pose) {
    const fs::path to = options.captures / fmt::format("pose{}", pose);
    ASSERT_TRUE(make_folder(to).ok());
    for (int i = 0; i < 16; ++i)
      fs::create_symlink(all / fmt::format("pose{:02}", pose) / "camera0" / calib::image_name(i),
                         to / calib::image_name(i));
  }
  const Status status = run_solve(options);
  ASSERT_FALSE(status.ok());
  EXPECT_NE(status.message().find("columns of projector0 only"), std::string::npos) << status.message();
}

// Few poses in the middle of the image determine the lens too little: the verdict is reject, and all is
// written.
TEST(SolveCommand, SolvesTheCamerasOfCapturesAlone) {
  const fs::path& captures = captured();
  const fs::path out = captures.parent_path();
  const Status status = run_solve({.captures = captures, .out = out / "rig", .cameras_only = true});
  ASSERT_FALSE(status.ok());
  EXPECT_NE(status.message().find("rejected"), std::string::npos) << status.message();
  const auto rig = load_rig(out / "rig");
  ASSERT_TRUE(rig.ok()) << rig.message();
  EXPECT_TRUE(rig->projectors.empty());
  EXPECT_NEAR(rig->cameras[0].lens.fx(), 800, 4);
}

TEST(SolveCommand, CallsWrongOptionsWrongUsage) {
  const fs::path folder = test_folder();
  const auto usage = [](const wizard::SolveCommandOptions& options) {
    const Status status = run_solve(options);
    return !status.ok() && status.error().wrong_usage;
  };
  wizard::SolveCommandOptions described{.captures = folder, .out = folder / "rig"};
  described.foreign.import_format = wizard::ImportFormat::opencv_gray;
  EXPECT_TRUE(usage(described));
  described.foreign.projector = "1024x768";
  described.foreign.board = "chessboard:9x7";
  EXPECT_TRUE(usage(described));
  described.foreign.board = "chessboard:9x7:75mm";
  EXPECT_FALSE(usage(described)) << "the folder's emptiness is no wrong usage";
  EXPECT_TRUE(usage({.captures = folder, .out = folder / "rig", .camera_model = "LENSMODEL_NONE"}));
  wizard::SolveCommandOptions own{.captures = folder, .out = folder / "rig"};
  own.foreign.projector = "1024x768";
  EXPECT_TRUE(usage(own));
}

}  // namespace
}  // namespace limn::apps
