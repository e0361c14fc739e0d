#include "wizard/window/wizard_window.h"

#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <thread>

#include "core/config.h"
#include "core/file.h"
#include "core/rig.h"
#include "device/desktop.h"
#include "tests/gui/gui_canvas.h"
#include "tests/support/matchers.h"
#include "tests/wizard/board_room.h"
#include "tests/wizard/small_plan.h"
#include "wizard/window/wizard_panel.h"
// X's macros must come last.
#include "apps/calibrate.h"
#include "tests/gui/x_person.h"
#include "tests/support/display.h"
#include "wizard/capture/virtual_capture.h"

namespace limn::wizard {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector2d;
using State = WizardState;
using std::chrono::milliseconds;

const cv::Point2f k_use_button(1535, 760);

WizardView a_view() {
  WizardView view;
  view.steps = {
      {{State::done, "virtual rig: 2 cameras, 1 projector"},
       {State::done, "2 of 2 projectors seen"},
       {State::fails,
        "camera0: 12 % of the pixels that projector0 lights are saturated. Shorten the exposure to half."},
       {State::done, "projector0 33.1 ms, projector1 33.2 ms"},
       {State::runs, "pose04"},
       {},
       {}}};
  std::vector<Vector2d> seen, lit;
  for (int i = 0; i < 600; ++i) {
    seen.emplace_back(300 + i % 30 * 20, 200 + i / 30 * 20);
    lit.emplace_back(100 + i % 30 * 25, 100 + i / 30 * 30);
  }
  WizardView::Camera camera{"camera0", 1280, 1024, cv::Mat(1024, 1280, CV_8UC1, cv::Scalar(70))};
  camera.target = {{200, 300}, {760, 260}, {780, 700}, {220, 760}};
  for (int i = 0; i < 70; ++i) camera.corners.emplace_back(320 + i % 10 * 45, 330 + i / 10 * 45);
  camera.seen = cells_of(seen, 1280, 1024);
  view.cameras = {camera, camera};
  view.cameras[1].name = "camera1";
  view.projectors = {{"projector0", 1280, 800, cells_of(lit, 1280, 800)},
                     {"projector1", 1280, 800, cells_of(lit, 1280, 800)}};
  view.pose = 4;
  view.poses = 9;
  view.place = "left, low, near (1.12 m), tilted 25 degrees up, turned 40 degrees clockwise";
  view.is_capturing = true;
  view.images = 31;
  view.images_of = 144;
  view.judged = {{"pose00", {}, {}}, {"pose01", {}, {}}, {"pose02", 0.9, 4.2}, {"pose03", 0.31, 0.8}};
  view.advice = "More poses help: the predicted error is still falling.";
  view.faults = {
      {calib::FaultName::little_tilt, "boards were tilted by 11 degrees at most", "tilt the board more"}};
  return view;
}

TEST(WizardPanel, ShowsWhereTheBoardIsAndWhereItIsToGo) {
  for (const cv::Size size : {cv::Size(1600, 1000), cv::Size(1024, 700)}) {
    test::GuiCanvas canvas(size);
    BoardSizeInput board_size;
    WizardView view = a_view();
    view.cameras.pop_back();
    WizardWish wish = WizardWish::none;
    for (int i = 0; i < 2; ++i)
      canvas.draw([&](gui::Gui& gui) { wish = draw_wizard(gui, view, &board_size); });
    EXPECT_EQ(wish, WizardWish::none);
    canvas.keep(fmt::format("wizard-{}", size.width));
    const auto count = [&](const cv::Scalar& low, const cv::Scalar& high) {
      cv::Mat mask;
      cv::inRange(canvas.image()(cv::Rect(size.width / 4, 0, size.width / 2, size.height)), low, high, mask);
      return cv::countNonZero(mask);
    };
    const cv::Scalar amber(66, 182, 245), green(120, 211, 110), slack = cv::Scalar::all(4);
    EXPECT_GT(count(amber - slack, amber + slack), 800) << "the outline";
    EXPECT_GT(count(green - slack, green + slack), 70 * 6) << "the corners";
    view.cameras[0].corners.clear();
    view.cameras[0].target.clear();
    canvas.draw([&](gui::Gui& gui) { draw_wizard(gui, view, &board_size); });
    EXPECT_LT(count(amber - slack, amber + slack), 50);
    EXPECT_EQ(count(green - slack, green + slack), 0);
  }
  test::GuiCanvas canvas({1600, 1000});
  BoardSizeInput board_size;
  const WizardView two = a_view();
  for (int i = 0; i < 2; ++i) canvas.draw([&](gui::Gui& gui) { draw_wizard(gui, two, &board_size); });
  canvas.keep("wizard-two");
}

// A wrong unit is named, right lengths are taken.
TEST(WizardPanel, AsksHowLargeThePrintedBoardIs) {
  test::GuiCanvas canvas({1600, 1000});
  WizardView view = a_view();
  view.board = calib::Board::parse("charuco:11x8:25mm").value();
  view.asks_for_size = true;
  BoardSizeInput board_size;
  const auto draw = [&](gui::Gui& gui) { draw_wizard(gui, view, &board_size); };
  for (int i = 0; i < 2; ++i) canvas.draw(draw);
  canvas.keep("wizard-board-size");
  const auto enter = [&](const std::string& text) {
    std::copy_n(text.c_str(), text.size() + 1, board_size.text.begin());
    canvas.click(k_use_button, draw);
    canvas.draw(draw);
  };
  enter("22.52x14.99mm");
  EXPECT_NE(board_size.problem.find("in cm"), std::string::npos) << board_size.problem;
  canvas.keep("wizard-board-size-wrong");
  enter("225.2x149.9mm:0.05");
  EXPECT_EQ(board_size.problem, "");
  EXPECT_EQ(board_size.taken, "225.2x149.9mm:0.05");
  canvas.draw(draw);
  canvas.keep("wizard-board-size-taken");
}

// The view at the end, with an error map.
WizardView an_end() {
  WizardView view = a_view();
  view.is_over = view.has_rig = true;
  view.is_capturing = false;
  for (WizardView::Step& step : view.steps) step.state = State::done;
  view.worth = calib::Verdict::good;
  view.verdict =
      "good: predicted error 0.31 mm on projector1 (0.52 mm at worst, 1.60 m from camera0, upper left of its "
      "image); held-out error (poses that the solve has not used) 0.05 px, the worst (pose03) 0.07 px.";
  view.to_do = {"projector1: add poses near its left edge."};
  view.faults.clear();
  for (int projector = 0; projector < 2; ++projector) {
    calib::ErrorMap map;
    map.projector = projector;
    map.columns = 16;
    map.rows = 13;
    calib::ErrorMap::Plane plane{1.2, {}};
    for (int i = 0; i < 16 * 13; ++i)
      plane.p95_mm.push_back(i % 16 < 2 ? NAN : 0.02 * (i % 16) * (1 + projector));
    map.planes = {plane};
    view.maps.push_back(map);
  }
  return view;
}

TEST(WizardPanel, EndsWithAVerdictAndWhereLightIsSure) {
  test::GuiCanvas canvas({1600, 1000});
  BoardSizeInput board_size;
  const WizardView view = an_end();
  for (int i = 0; i < 2; ++i) canvas.draw([&](gui::Gui& gui) { draw_wizard(gui, view, &board_size); });
  canvas.keep("wizard-end");
  bool is_closed = false;
  const auto draw = [&](gui::Gui& gui) {
    is_closed |= draw_wizard(gui, view, &board_size) == WizardWish::leave;
  };
  canvas.click({360, 970}, draw);
  EXPECT_TRUE(is_closed);
}

TEST(WizardPanel, ScansThePrototypeWhenAsked) {
  test::GuiCanvas canvas({1600, 1000});
  BoardSizeInput board_size;
  WizardView view = an_end();
  view.is_over = false;
  view.awaits_prototype = true;
  for (WizardStep step : {WizardStep::scan, WizardStep::align, WizardStep::paint})
    view.steps[static_cast<std::size_t>(step)] = {WizardState::waits};
  view.steps[static_cast<std::size_t>(WizardStep::scan)] = {WizardState::runs, "waiting for the prototype"};
  for (int i = 0; i < 2; ++i) canvas.draw([&](gui::Gui& gui) { draw_wizard(gui, view, &board_size); });
  canvas.keep("wizard-prototype");
  std::vector<WizardWish> wishes;
  const auto draw = [&](gui::Gui& gui) {
    const WizardWish wish = draw_wizard(gui, view, &board_size);
    if (wish != WizardWish::none) wishes.push_back(wish);
  };
  canvas.click({360, 970}, draw);
  canvas.click({560, 970}, draw);
  EXPECT_EQ(wishes, (std::vector<WizardWish>{WizardWish::scan, WizardWish::skip}));
}

TEST(WizardCells, CountPointsWhereTheyLie) {
  const SeenCells cells = cells_of({{0, 0}, {0.4, 0.4}, {99, 49}, {100, 0}, {-1, 0}}, 100, 50, 10);
  EXPECT_EQ(cells.rows, 5);
  EXPECT_EQ(cells.counts.front(), 2);
  EXPECT_EQ(cells.counts.back(), 1);
  EXPECT_DOUBLE_EQ(cells.share(), 2 / 50.0);
}

// Clicks the last button at the bottom of the window.
void leave(test::XPerson* x) {
  x->move(980, 975);
  std::this_thread::sleep_for(milliseconds(500));
  x->button(980, 975, true);
  x->button(980, 975, false);
}

TEST(WizardWindow, IsLeftAndGoesOnUntilTheRigIsGood) {
  if (!test::has_x_server()) GTEST_SKIP() << "no display: WizardWindow.IsLeftAndGoesOnUntilTheRigIsGood";
  const fs::path folder = test::test_folder(), out = folder / "rig";
  const apps::CalibrateOptions options{.plan = test::small_plan(folder), .out = out};
  const auto with_person = [&](const std::function<void(test::XPerson*)>& acts) {
    std::thread person([&acts] {
      test::XPerson x;
      for (int i = 0; i < 300 && !x.finds("Limn calibration"); ++i)
        std::this_thread::sleep_for(milliseconds(100));
      acts(&x);
      x.close();
    });
    const Status done = apps::run_calibrate(options);
    person.join();
    return done;
  };
  const auto captured = [&](int poses) {
    return fs::exists(out / fmt::format("captures/pose{:02}/camera0/035.png", poses - 1));
  };
  const Status left = with_person([&](test::XPerson* x) {
    for (int i = 0; i < 600 && !captured(2); ++i) std::this_thread::sleep_for(milliseconds(50));
    leave(x);
  });
  ASSERT_FALSE(left.ok());
  EXPECT_NE(left.message().find("left in pose"), std::string::npos) << left.message();
  EXPECT_TRUE(captured(2));
  EXPECT_FALSE(fs::exists(out / "rig.json"));

  const auto is_good = [&] {  // the wizard also writes the reports of rigs that are not good yet
    const auto text = read_file(out / "report.json");
    const auto report = text ? nlohmann::json::parse(*text, nullptr, false) : nlohmann::json();
    return report.is_object() && report.at("verdict") == "good";
  };
  const Status done = with_person([&](test::XPerson*) {
    for (int i = 0; i < 2400 && !is_good(); ++i) std::this_thread::sleep_for(milliseconds(50));
    std::this_thread::sleep_for(milliseconds(2000));  // the result is visible
  });
  EXPECT_TRUE(done.ok()) << (done ? "" : done.message());
  EXPECT_TRUE(load_rig(out).ok());
}

// The same with real devices' backend: the devices are checked, and a person carries the board from place to
// place until three poses are captured; then a click leaves the wizard.
TEST(WizardWindow, TakesPosesOfDevicesAndIsLeft) {
  if (!test::has_x_server()) GTEST_SKIP() << "no display: WizardWindow.TakesPosesOfDevicesAndIsLeft";
  const fs::path folder = test::test_folder(), out = folder / "rig";
  test::BoardRoom room(load_plan(test::small_plan(folder)).value(), 0.02);
  const apps::CalibrateOptions options{.board = room.plan.board.text(), .out = out};
  const auto captured = [&](std::size_t pose) {
    return fs::exists(out / fmt::format("captures/pose{:02}/camera0/035.png", pose));
  };
  std::size_t held = 0;
  room.go(room.plan.world_from_board[0]);
  room.person = [&] {
    if (captured(held)) room.go(room.plan.world_from_board[++held]);
  };
  std::thread person([&] {
    test::XPerson x;
    for (int i = 0; i < 300 && !x.finds("Limn calibration"); ++i)
      std::this_thread::sleep_for(milliseconds(100));
    for (int i = 0; i < 1200 && !captured(2); ++i) std::this_thread::sleep_for(milliseconds(50));
    leave(&x);
    x.close();
  });
  const Status left = apps::calibrate_on(options, room.devices(), device::Desktop::open());
  person.join();
  ASSERT_FALSE(left.ok());
  EXPECT_NE(left.message().find("left in pose"), std::string::npos) << left.message();
  EXPECT_EQ(room.moved, 0) << "patterns shown while the board moved";
  EXPECT_TRUE(captured(2));
  EXPECT_FALSE(fs::exists(out / "rig.json"));
  const auto latency = test::read_json(out / "captures/latency.json");
  EXPECT_NEAR(latency["projectors"][0]["latency_ms"].get<double>(), 20, 2.5);
}

}  // namespace
}  // namespace limn::wizard
