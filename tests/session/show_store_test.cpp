// Looks, pairings and units are written to the disk without delaying the caller.
#include "session/show_store.h"

#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <opencv2/core.hpp>
#include <thread>

#include "core/file.h"
#include "core/file_writer.h"
#include "core/image_io.h"
#include "scene/kept_files.h"
#include "scene/scene.h"
#include "scene/show_state.h"
#include "tests/support/matchers.h"
#include "tests/support/small_disk.h"

namespace limn::session {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

// A copy of the door's scene in a folder of its own.
scene::Scene door_in(const fs::path& folder) {
  fs::copy(fs::path(LIMN_SOURCE_DIR) / "config/scenes/door", folder / "door", fs::copy_options::recursive);
  fs::remove_all(folder / "door/looks");
  return scene::load_scene(folder / "door").value();
}

scene::ShowState edited(const scene::Scene& scene,
                        const scene::ShowState& show_state,
                        const scene::Edit& edit) {
  return scene::apply_edit(scene, show_state, {}, edit).value();
}

TEST(FileWriter, DoesEverythingInOrderBeforeItGoes) {
  std::vector<int> done;
  {
    FileWriter writer;
    const auto begun = std::chrono::steady_clock::now();
    for (int i = 0; i < 20; ++i)
      writer.add([&done, i]() -> Status {
        std::this_thread::sleep_for(5ms);
        done.push_back(i);
        return {};
      });
    EXPECT_LT(std::chrono::steady_clock::now() - begun, 80ms) << "the caller does not wait for the disk";
    EXPECT_TRUE(writer.is_busy());
  }
  ASSERT_EQ(done.size(), 20u);
  EXPECT_TRUE(std::is_sorted(done.begin(), done.end()));
}

TEST(FileWriter, TellsEachFailureOnceAndGoesOn) {
  FileWriter writer;
  bool is_done = false;
  writer.add([]() -> Status { return error("the disk is full."); });
  writer.add([&]() -> Status {
    is_done = true;
    return {};
  });
  writer.finish();
  EXPECT_FALSE(writer.is_busy());
  EXPECT_TRUE(is_done);
  EXPECT_EQ(writer.failures(), std::vector<std::string>{"the disk is full."});
  EXPECT_TRUE(writer.failures().empty());
}

// A look that is saved, deleted and restored at once exists at the end, with its image, also for the next
// session.
TEST(ShowStore, KeepsLooksInTheOrderOfEdits) {
  const fs::path folder = test::test_folder();
  const scene::Scene scene = door_in(folder);
  const cv::Mat image(120, 160, CV_8UC3, cv::Scalar(10, 20, 30));
  {
    ShowStore store(true);
    scene::ShowState now = scene::initial_show_state(scene);
    for (const scene::Edit& edit : {scene::Edit{"save_look", "", "calm"},
                                    {"save_look", "", "bold"},
                                    {"delete_look", "", "bold"},
                                    {"delete_look", "", "calm"},
                                    {"undelete_look", "", ""}}) {
      const scene::ShowState before = now;
      now = edited(scene, before, edit);
      store.keep(scene, before, now, scene::command_of(scene, edit).value(), [&] { return image; });
    }
  }
  const fs::path looks = scene.folder / "looks";
  EXPECT_TRUE(fs::exists(looks / "calm.json"));
  EXPECT_TRUE(test::image_near(read_image(looks / "calm.png").value(), image, 0, 0, "look"));
  EXPECT_FALSE(fs::exists(looks / "bold.json"));
  EXPECT_TRUE(fs::exists(looks / "deleted/bold.png"));
  const std::string page = read_file(looks / "looks.html").value();
  EXPECT_NE(page.find("<b>calm</b>"), std::string::npos);
  EXPECT_EQ(page.find("<b>bold</b>"), std::string::npos);
  const scene::ShowState next = ShowStore::loaded(scene, scene::initial_show_state(scene));
  ASSERT_EQ(next.looks.size(), 1u);
  EXPECT_EQ(next.looks[0].name, "calm");
}

// On a full disk the JSON file would fit, and the image would not.
TEST(ShowStore, ALookAndItsImageAreWrittenTogetherOrNotAtAll) {
  const fs::path folder = test::test_folder();
  const scene::Scene scene = door_in(folder);
  const fs::path looks = scene.folder / "looks";
  cv::Mat noise(240, 320, CV_8UC3);
  cv::randu(noise, 0, 256);
  const scene::Edit edit{"save_look", "", "calm"};
  const scene::ShowState before = scene::initial_show_state(scene);
  const auto keep = [&] {
    ShowStore store(true);
    store.keep(scene, before, edited(scene, before, edit), scene::command_of(scene, edit).value(),
               [&] { return noise; });
    store.finish();
    return store.failures();
  };
  {
    const test::SmallDisk disk(20'000);
    EXPECT_FALSE(keep().empty());
  }
  EXPECT_FALSE(fs::exists(looks / "calm.json"));
  EXPECT_FALSE(fs::exists(looks / "calm.png"));
  EXPECT_TRUE(keep().empty());
  EXPECT_TRUE(fs::exists(looks / "calm.json"));
  EXPECT_TRUE(test::image_near(read_image(looks / "calm.png").value(), noise, 0, 0, "look"));
}

TEST(ShowStore, TellsWhatCannotBeWritten) {
  const fs::path folder = test::test_folder();
  const scene::Scene scene = door_in(folder);
  ASSERT_TRUE(write_file(scene.folder / "looks", "a file where the folder should be"));
  ShowStore store(true);
  const scene::Edit edit{"save_look", "", "calm"};
  const scene::ShowState before = scene::initial_show_state(scene);
  store.keep(scene, before, edited(scene, before, edit), scene::command_of(scene, edit).value(),
             [] { return cv::Mat(); });
  store.finish();
  const std::vector<std::string> failures = store.failures();
  ASSERT_FALSE(failures.empty());
  EXPECT_NE(failures[0].find("looks"), std::string::npos) << failures[0];
}

TEST(ShowStore, WritesNothingWhereItOnlyReads) {
  const fs::path folder = test::test_folder();
  const scene::Scene scene = door_in(folder);
  ShowStore store(false);
  const scene::Edit edit{"save_look", "", "calm"};
  const scene::ShowState before = scene::initial_show_state(scene);
  store.keep(scene, before, edited(scene, before, edit), scene::command_of(scene, edit).value(),
             [] { return cv::Mat(); });
  store.finish();
  EXPECT_FALSE(fs::exists(scene.folder / "looks"));
}

// A stroke comes in many edits; the file has all of it, and the next session begins with it.
TEST(ShowStore, DrawnLinesAreThereInTheNextSession) {
  const fs::path folder = test::test_folder(), file = folder / "door" / scene::k_drawn_lines_file;
  const scene::Scene scene = door_in(folder);
  scene::ShowState now = scene::initial_show_state(scene);
  const auto keep = [&](ShowStore* store, const scene::Edit& edit) {
    const scene::ShowState before = now;
    now = edited(scene, before, edit);
    store->keep(scene, before, now, scene::command_of(scene, edit).value(), [] { return cv::Mat(); });
  };
  const auto next = [&] { return ShowStore::loaded(scene, scene::initial_show_state(scene)); };
  {
    ShowStore store(true);
    for (int i = 0; i < 50; ++i)
      keep(&store, {"draw_line", "sill", fmt::format("points {} 20 30 {} 20 30", 2 * i, 2 * i + 2)});
    store.finish();
    EXPECT_TRUE(fs::exists(file)) << "also before the session ends";
    keep(&store, {"draw_line", "trim", "points 0 0 30 30 0 30"});
    keep(&store, {"line", "trim", "off"});
  }
  scene::ShowState again = next();
  ASSERT_EQ(again.drawn.size(), 2u);
  ASSERT_EQ(again.drawn[0].curve.points.size(), now.drawn[0].curve.points.size());
  for (std::size_t i = 0; i < now.drawn[0].curve.points.size(); ++i)
    EXPECT_LT((again.drawn[0].curve.points[i].p - now.drawn[0].curve.points[i].p).norm(), 2e-6);  // 0.001 mm
  EXPECT_EQ(again.lines, (std::vector<std::string>{"sill"}));
  // What is damaged is reported, not used, and not lost.
  const std::string whole = read_file(file).value();
  ASSERT_TRUE(write_file(file, whole.substr(0, whole.size() / 2)));
  EXPECT_TRUE(next().drawn.empty());
  {
    ShowStore store(true);
    keep(&store, {"erase_line", "trim", ""});
  }
  EXPECT_EQ(read_file(folder / "door/drawn-damaged.json").value(), whole.substr(0, whole.size() / 2));
  EXPECT_EQ(next().drawn.size(), 1u);
  {
    ShowStore store(true);
    keep(&store, {"erase_line", "sill", ""});
  }
  EXPECT_FALSE(fs::exists(file));
}

}  // namespace
}  // namespace limn::session
