#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <opencv2/core.hpp>
#include <set>
#include <thread>

#include "apps/live.h"
#include "core/file.h"
#include "device/gui/qr_code.h"
#include "session/operator_console.h"
#include "session/operator_panel.h"
#include "sim/virtual_rig.h"
#include "tests/gui/gui_canvas.h"
#include "tests/support/matchers.h"
// X defines macros; include it last.
#include "tests/gui/x_person.h"
#include "tests/support/display.h"
#include "tests/support/worlds.h"

namespace limn::session {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;

const cv::Scalar k_orange(30, 120, 230), k_violet(200, 60, 140), k_teal(140, 160, 40);

// A view of a session: one camera failed, one body is lost, a look was saved.
OperatorView a_view() {
  OperatorView view;
  view.at_s = 754;
  view.cameras = {{"camera0",
                   cv::Mat(720, 1280, CV_8UC3, k_orange),
                   {{"0", {Eigen::Vector2d(400, 200), {700, 200}, {700, 500}, {400, 500}}}}},
                  {"camera1", cv::Mat(1024, 1280, CV_8UC1, cv::Scalar(90))}};
  view.projectors = {{"projector0", cv::Mat(800, 1280, CV_8UC3, k_violet)},
                     {"projector1", cv::Mat(800, 1280, CV_8UC3, cv::Scalar(20, 30, 20))}};
  view.screen = {"screen", cv::Mat(720, 1280, CV_8UC3, k_teal)};
  const std::string why =
      "camera1: expected frames from v4l2:/dev/video0, found none for 0.5 s. Look at its cable.";
  view.devices = {{{"camera0", "camera", true, "", 900}, 30},
                  {{"camera1", "camera", false, why, 12}, 0},
                  {{"projector0", "projector", true, "", 900}, 60},
                  {{"projector1", "projector", true, "", 900}, 60}};
  Track track;
  track.body = "prototype";
  track.marker_count = 4;
  track.rms_px = 0.11;
  view.bodies.push_back({"prototype", "aruco_4x4_50:10, aruco_4x4_50:11", track});
  track.tracking = TrackingState::lost;
  view.bodies.push_back({"mirror", "aruco_4x4_50:0", track});
  track.tracking = TrackingState::extrapolated;
  view.bodies.push_back({"grille", "aruco_4x4_50:1", track});
  view.bodies.push_back({"trim", "aruco_4x4_50:2", std::nullopt});
  view.slots = {{"mirror", {"classic", "sport", "camera pod"}, true, true},
                {"grille", {"bars", "honeycomb"}, false, false}};
  view.show_state.slots.resize(2);
  view.show_state.slots[0].variant = "sport";
  view.show_state.slots[1].variant = "bars";
  view.show_state.looks = {{"look-01", {}}, {"sport and bars", {}}};
  view.show_state.look = "look-01";
  for (int i = 0; i < 400; ++i) {
    ShownFrame frame{.captured_at = shifted(Stamp{}, i / 30.0),
                     .shown_at = shifted(Stamp{}, i / 30.0 + 0.060 + 0.004 * std::sin(0.3 * i)),
                     .detect_ms = 2.1,
                     .filter_ms = 0.3,
                     .paint_ms = 11.4,
                     .screen_ms = 6.0,
                     .record_ms = -1};
    frame.missed = i % 90 == 30;
    frame.lost = i > 200 && i < 230;
    view.recent.push_back(frame);
  }
  view.notices = {{12, "next_variant mirror (key)"},
                  {733, "camera1 is gone; the session goes on without it: " + why},
                  {741, "save_look (operator)"}};
  return view;
}

const cv::Point2f k_material(885, 102), k_light(820, 286);  // their buttons

cv::Vec3b around(const cv::Mat& image, int x, int y) { return image.at<cv::Vec3b>(y, x); }

// The bounding box of the pixels of a colour; empty if there are none.
cv::Rect box_of(const cv::Mat& image, const cv::Scalar& colour) {
  cv::Mat mask;
  cv::inRange(image, colour - cv::Scalar::all(3), colour + cv::Scalar::all(3), mask);
  std::vector<cv::Point> found;
  cv::findNonZero(mask, found);
  if (found.empty()) return {};
  cv::Rect box(found[0], cv::Size(1, 1));
  for (const cv::Point& p : found) box |= cv::Rect(p, cv::Size(1, 1));
  return box;
}

TEST(OperatorPanel, ShowsImagesUndistortedWithTheirMarkers) {
  for (const cv::Size size : {cv::Size(1600, 1000), cv::Size(1000, 640)}) {
    test::GuiCanvas canvas(size);
    OperatorPanel panel;
    const OperatorView view = a_view();
    for (int i = 0; i < 2; ++i) canvas.draw([&](gui::Gui& gui) { panel.draw(gui, view); });
    canvas.keep(fmt::format("operator-{}", size.width));
    const cv::Mat image = canvas.image();
    for (const cv::Scalar& colour : {k_violet, k_teal}) {
      const cv::Rect box = box_of(image, colour);
      ASSERT_GT(box.width, size.width / 12) << size;
      EXPECT_NEAR(1.0 * box.width / box.height, colour == k_violet ? 1.6 : 16.0 / 9, 0.05) << size;
    }
    // The large image is the first camera's; the outline of the marker is drawn at the marker.
    const cv::Rect camera = box_of(image(cv::Rect(0, 0, size.width, size.height / 2)), k_orange);
    ASSERT_GT(camera.width, size.width / 2) << size;
    const double scale = camera.width / 1280.0;
    const cv::Vec3b edge = around(image, camera.x + cvRound(scale * 550), camera.y + cvRound(scale * 200.5));
    const cv::Vec3b left = around(image, camera.x + cvRound(scale * 400.5), camera.y + cvRound(scale * 350));
    EXPECT_GT(edge[1], edge[2]) << "green on orange";
    EXPECT_GT(left[1], left[2]) << "green on orange";
    const cv::Vec3b inside = around(image, camera.x + cvRound(scale * 550), camera.y + cvRound(scale * 300));
    EXPECT_EQ(inside, cv::Vec3b(30, 120, 230));
  }
}

// All edits that can be requested by clicks in this area. A box that a click opened is closed by a click
// beside it, for versions of ImGui differ in what else that click does.
std::set<std::string> reachable(const OperatorView& view, cv::Size size, const cv::Rect& area, int columns) {
  test::GuiCanvas canvas(size);
  std::set<std::string> all;
  for (int y = area.y; y < area.br().y; y += 18) {
    for (int x = area.x; x < area.br().x; x += area.width / columns) {
      OperatorPanel panel;
      bool is_box_open = false;
      canvas.click(cv::Point2f(static_cast<float>(x), static_cast<float>(y)), [&](gui::Gui& gui) {
        for (const scene::Edit& edit : panel.draw(gui, view).edits)
          all.insert(edit.action + (edit.slot.empty() ? "" : " " + edit.slot) +
                     (edit.value.empty() ? "" : " " + edit.value));
        is_box_open = ImGui::IsPopupOpen("", ImGuiPopupFlags_AnyPopup);
      });
      if (is_box_open) canvas.click({2, 2}, [&](gui::Gui& gui) { panel.draw(gui, view); });
    }
  }
  return all;
}

TEST(OperatorPanel, EditsAreAClickAway) {
  OperatorView view = a_view();
  for (auto* images : {&view.cameras, &view.projectors}) images->clear();
  const std::set<std::string> bar = reachable(view, {1000, 640}, {20, 20, 420, 12}, 12);
  EXPECT_TRUE(bar.contains("blackout"));
  EXPECT_TRUE(bar.contains("freeze"));
  EXPECT_TRUE(bar.contains("marker_states"));
  EXPECT_FALSE(bar.contains("repair"));
  view.moved = "projector1";
  EXPECT_TRUE(reachable(view, {1000, 640}, {420, 25, 60, 10}, 3).contains("repair"));
  view.recalibration_progress = "12 of 44 patterns";  // is shown in place of the button
  EXPECT_FALSE(reachable(view, {1000, 640}, {420, 25, 60, 10}, 3).contains("repair"));
  view.recalibration_progress.clear();
  view.moved.clear();
  EXPECT_FALSE(reachable(view, {1000, 640}, {420, 25, 60, 10}, 3).contains("deviation toggle"));
  view.has_prototype = true;
  EXPECT_TRUE(reachable(view, {1000, 640}, {420, 25, 60, 10}, 3).contains("deviation toggle"));
  view.deviation_progress = "12 of 44 patterns";
  EXPECT_FALSE(reachable(view, {1000, 640}, {420, 25, 60, 10}, 3).contains("deviation toggle"));
  view.deviation_progress.clear();
  std::set<std::string> column = reachable(view, {1000, 640}, {730, 60, 220, 400}, 1);
  column.merge(reachable(view, {1000, 640}, {950, 60, 10, 400}, 1));
  for (const char* edit : {"next_variant mirror", "previous_variant mirror", "next_variant grille",
                           "release mirror", "save_look", "restore_look sport and bars"})
    EXPECT_TRUE(column.contains(edit)) << edit;
  EXPECT_FALSE(column.contains("release grille")) << "only its marker determines its pose";
}

// Two looks were shown, one was deleted, a loose marker is seen, and another marker carries the grille.
TEST(OperatorPanel, PairsAndComparesByClicks) {
  OperatorView view = a_view();
  view.waiting = {"aruco_4x4_50:7"};
  view.show_state.other_look = "sport and bars";
  view.show_state.deleted_look = scene::Look{"evening", {}};
  view.show_state.slots[1].marker = MarkerName{"aruco_4x4_50", "30"};
  view.show_state.split = true;
  view.has_prototype = true;
  test::GuiCanvas canvas({1600, 1000});
  OperatorPanel panel;
  for (int i = 0; i < 2; ++i) canvas.draw([&](gui::Gui& gui) { panel.draw(gui, view); });
  canvas.keep("operator-compares");
  for (auto* images : {&view.cameras, &view.projectors}) images->clear();
  const std::set<std::string> column = reachable(view, {1600, 1000}, {1290, 60, 280, 660}, 2);
  for (const char* edit : {"pair mirror aruco_4x4_50:7", "pair grille aruco_4x4_50:7", "unpair grille",
                           "flip", "split", "undelete_look"})
    EXPECT_TRUE(column.contains(edit)) << edit;
  EXPECT_FALSE(column.contains("unpair mirror"))
      << "its own marker carries it, so there is nothing to unpair";
}

TEST(OperatorPanel, AnImageGrowsWhenClicked) {
  test::GuiCanvas canvas({1000, 640});
  OperatorPanel panel;
  const OperatorView view = a_view();
  const auto draw = [&](gui::Gui& gui) { panel.draw(gui, view); };
  for (int i = 0; i < 2; ++i) canvas.draw(draw);
  const cv::Rect before = box_of(canvas.image(), k_violet);
  canvas.click((before.tl() + before.br()) / 2, draw);
  canvas.draw(draw);
  canvas.keep("operator-large");
  EXPECT_GT(box_of(canvas.image(), k_violet).width, 2 * before.width);
}

// Whether the window shows the QR code of this text.
bool shows_code(const cv::Mat& image, const std::string& text) {
  const cv::Rect box = box_of(image(cv::Rect(0, 50, 720, 720)), cv::Scalar::all(255)) + cv::Point(0, 50);
  const cv::Mat code = gui::qr_code(text);
  if (box.width < 8 * code.cols) return false;
  for (int row = 0; row < code.rows; ++row)
    for (int column = 0; column < code.cols; ++column) {
      const cv::Vec3b seen = around(image, box.x + cvRound((column + 0.5) * box.width / code.cols),
                                    box.y + cvRound((row + 0.5) * box.height / code.rows));
      if ((seen[1] > 127) != (code.at<std::uint8_t>(row, column) > 127)) return false;
    }
  return true;
}

TEST(OperatorPanel, InvitesGuestsByACodeOrByPin) {
  OperatorView view = a_view();
  test::GuiCanvas canvas({1600, 1000});
  OperatorPanel panel;
  const auto draw = [&](gui::Gui& gui) { panel.draw(gui, view); };
  for (int i = 0; i < 2; ++i) canvas.draw(draw);
  const std::string page = "https://192.168.7.2:8443/#pin=";
  EXPECT_FALSE(shows_code(canvas.image(), page + "234567"));
  const Invitation invitation{"https://192.168.7.2:8443/",
                              "0F:1E:2D:3C:4B:5A:69:78:87:96:A5:B4:C3:D2:E1:F0:"
                              "0F:1E:2D:3C:4B:5A:69:78:87:96:A5:B4:C3:D2:E1:F0",
                              "1F:2E:3D:4C:5B:6A:79:88:97:A6:B5:C4:D3:E2:F1:00:"
                              "1F:2E:3D:4C:5B:6A:79:88:97:A6:B5:C4:D3:E2:F1:00",
                              {"123456", "234567", "345678"}};
  view.remote = remote_view(invitation);
  canvas.click({435, 25}, draw);  // Remote
  canvas.draw(draw);
  canvas.keep("operator-remote");
  EXPECT_TRUE(shows_code(canvas.image(), page + "234567"));
  canvas.click({800, 257}, draw);  // operate
  canvas.draw(draw);
  canvas.keep("operator-remote-operate");
  EXPECT_TRUE(shows_code(canvas.image(), page + "345678"));

  // Below: the projector that shows the code, and the viewpoint for `view` parts.
  view.windows = {"Ann", "Ben"};
  view.show_state.viewer = "Ann";
  view.follows = "Ann";
  view.remote->projector = view.projectors[0].name;
  for (int i = 0; i < 2; ++i) canvas.draw(draw);
  canvas.keep("operator-remote-viewers");
  std::set<std::string> asked;
  for (int y = 280; y < 900; y += 18)
    canvas.click({800, static_cast<float>(y)}, [&](gui::Gui& gui) {
      const OperatorAsked now = panel.draw(gui, view);
      for (const scene::Edit& edit : now.edits) asked.insert(edit.action + " " + edit.value);
      if (now.code) asked.insert("code " + name_of(now.code->role) + " " + now.code->projector);
    });
  EXPECT_TRUE(asked.contains("viewer ")) << "the scene's own viewer";
  EXPECT_TRUE(asked.contains("viewer Ann"));
  EXPECT_TRUE(asked.contains("viewer Ben"));
  EXPECT_TRUE(asked.contains("code operate " + view.projectors[0].name));
}

// A popup opens where its button is clicked; clicks on its sliders request edits.
TEST(OperatorPanel, MaterialsAndLightAreSetInABox) {
  OperatorView view = a_view();
  test::GuiCanvas canvas({1000, 640});
  const auto asked_in = [&](cv::Point2f button, const std::string& image) {
    OperatorPanel panel;
    std::set<std::string> asked;
    const auto draw = [&](gui::Gui& gui) {
      for (const scene::Edit& edit : panel.draw(gui, view).edits)
        asked.insert(fmt::format("{}|{}|{}", edit.action, edit.slot, edit.value));
    };
    canvas.click(button, draw);
    for (int i = 0; i < 2; ++i) canvas.draw(draw);
    canvas.keep(image);
    for (float y = button.y + 14; y < button.y + 224; y += 12) canvas.click({750, y}, draw);
    canvas.click({5, 635}, draw);  // a click elsewhere closes it
    return asked;
  };
  const auto has = [](const std::set<std::string>& asked, const std::string& begin) {
    return std::any_of(asked.begin(), asked.end(),
                       [&](const std::string& a) { return a.starts_with(begin); });
  };
  const std::set<std::string> material = asked_in(k_material, "operator-material");
  EXPECT_TRUE(has(material, "material|mirror|- 0.")) << "metal";
  EXPECT_TRUE(has(material, "material|mirror|- - 0.")) << "rough";
  EXPECT_TRUE(material.contains("material|mirror|")) << "reset to the file";
  view.show_state.slots[0].material = {Eigen::Vector3d(1, 0, 0), std::nullopt, 0.5};
  EXPECT_TRUE(has(asked_in(k_material, "operator-material-red"), "material|mirror|#ff0000 0."))
      << "the other values stay";
  const std::set<std::string> light = asked_in(k_light, "operator-light");
  EXPECT_TRUE(light.contains("light||")) << "reset to the scene";
  int lights = 0;
  for (const std::string& edit : light) {
    if (edit == "light||" || !edit.starts_with("light||")) continue;
    EXPECT_TRUE(scene::light_numbers_of(edit.substr(7))) << edit;
    ++lights;
  }
  EXPECT_GE(lights, 4) << "sliders";
}

TEST(OperatorPanel, AsksBeforeItEnds) {
  test::GuiCanvas canvas({1000, 640});
  OperatorPanel panel;
  const OperatorView view = a_view();
  bool ends = false;
  const auto draw = [&](gui::Gui& gui) { ends |= panel.draw(gui, view).ends; };
  panel.ask_to_end();
  for (int i = 0; i < 3; ++i) canvas.draw(draw);
  canvas.keep("operator-question");
  EXPECT_FALSE(ends);
  panel.ask_to_end();  // Escape again
  for (int i = 0; i < 3; ++i) canvas.draw(draw);
  canvas.click({30, 25}, draw);  // the question is closed: this click is on the window again
  EXPECT_FALSE(ends);
}

// A person uses a session's window while it runs: does `acts` once the window exists, then closes it.
std::string session_with(apps::LiveOptions options,
                         const fs::path& out,
                         const std::function<void(test::XPerson*)>& acts) {
  options.window = true;
  options.out = out;
  std::thread person([&acts] {
    test::XPerson x;
    for (int i = 0; i < 300 && !x.finds("Limn"); ++i) std::this_thread::sleep_for(milliseconds(100));
    std::this_thread::sleep_for(milliseconds(2000));
    acts(&x);
    std::this_thread::sleep_for(milliseconds(3000));  // long enough for one image on a busy machine
    x.close();
  });
  const Status played = apps::run_live(options);
  person.join();
  EXPECT_TRUE(played.ok()) << (played ? "" : played.message());
  return read_file(options.out / "session.html").value();
}

void press_keys(test::XPerson* x) {
  for (const KeySym key : {XK_n, XK_b, XK_b}) {
    x->press(key);
    std::this_thread::sleep_for(milliseconds(300));
  }
}

TEST(OperatorWindow, KeysAndClicksReachAVirtualSession) {
  if (!test::has_x_server()) GTEST_SKIP() << "no display: OperatorWindow.KeysAndClicksReachAVirtualSession";
  apps::LiveOptions options;
  options.resolution = 0.25;
  options.seconds = 100000;
  const std::string page = session_with(options, test::test_folder(), [](test::XPerson* x) {
    press_keys(x);
    x->move(30, 25);  // Blackout
    std::this_thread::sleep_for(milliseconds(1000));
    x->button(30, 25, true);
    std::this_thread::sleep_for(milliseconds(1000));
    x->button(30, 25, false);
  });
  EXPECT_NE(page.find("next_variant mirror (key)"), std::string::npos);
  EXPECT_NE(page.find("blackout (key)"), std::string::npos);
  EXPECT_NE(page.find("blackout (operator)"), std::string::npos);
}

TEST(OperatorWindow, KeysReachASessionOnDevices) {
  if (!test::has_x_server()) GTEST_SKIP() << "no display: OperatorWindow.KeysReachASessionOnDevices";
  const fs::path folder = test::test_folder();
  sim::World world = test::studio_world();
  const Rig rig = world.rig;
  const fs::path scene = world.scene->folder;
  ASSERT_TRUE(save_rig(rig, folder / "rig").ok());
  sim::VirtualRig room(std::move(world), {.grab_waits_for_light = false});
  std::string cameras, displays;
  for (std::size_t i = 0; i < rig.cameras.size(); ++i) {
    const std::string& name = rig.cameras[i].name;
    ASSERT_TRUE(make_folder(folder / name).ok());
    ASSERT_TRUE(write_png(folder / name / "0.png", room.camera(static_cast<int>(i)).next()->image).ok());
    cameras += fmt::format("{}{{\"name\": \"{}\", \"source\": \"{}\"}}", i ? "," : "", name, name);
  }
  for (const Imager& projector : rig.projectors)
    displays += fmt::format("{}{{\"name\": \"{}\", \"monitor\": \"offscreen\"}}", displays.empty() ? "" : ",",
                            projector.name);
  ASSERT_TRUE(
      write_file(folder / "devices.json",
                 fmt::format("{{\"schema\": \"limn.devices/1\", \"cameras\": [{}], \"displays\": [{}]}}",
                             cameras, displays)));
  apps::LiveOptions options;
  options.rig = folder / "rig";
  options.scene = scene;
  options.devices = folder / "devices.json";
  options.seconds = 100;
  const std::string page = session_with(options, folder / "out", press_keys);
  EXPECT_NE(page.find("next_variant mirror (key)"), std::string::npos);
  EXPECT_NE(page.find("blackout (key)"), std::string::npos);
}

}  // namespace
}  // namespace limn::session
