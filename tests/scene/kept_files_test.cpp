// Where sessions keep looks, pairings and comments of a scene that this user may not change.
#include "scene/kept_files.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>

#include "core/file.h"
#include "tests/support/matchers.h"

namespace limn::scene {
namespace {

namespace fs = std::filesystem;

class KeptFiles : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(make_folder(scene_ / "looks"));
    ASSERT_TRUE(make_folder(own_ / "looks"));
    ::setenv("XDG_DATA_HOME", (folder_ / "data").c_str(), 1);
    for (const fs::path& look :
         {scene_ / "looks/calm.json", scene_ / "looks/bold.json", own_ / "looks/bold.json"})
      ASSERT_TRUE(write_file(look, "{}"));
  }
  void TearDown() override {
    ::unsetenv("XDG_DATA_HOME");
    fs::permissions(scene_, fs::perms::owner_write, fs::perm_options::add);
  }
  // Makes the scene's folder read-only. The test runs as root in some places, who may write everywhere.
  void become_a_reader() const {
    fs::permissions(scene_, fs::perms(0555));
    if (::geteuid() == 0 && ::setuid(65534) != 0) std::exit(2);
  }
  fs::path folder_ = test::test_folder(), scene_ = fs::canonical(folder_) / "scene";
  fs::path own_ = folder_ / "data/limn/scenes" / scene_.relative_path();
};

TEST_F(KeptFiles, AreInTheSceneIfItCanBeWritten) {
  EXPECT_EQ(kept_folder(scene_), scene_);
  EXPECT_EQ(kept_file(scene_, "looks/bold.json"), scene_ / "looks/bold.json");
  EXPECT_EQ(look_files(scene_),
            (std::vector<fs::path>{scene_ / "looks/bold.json", scene_ / "looks/calm.json"}));
}

TEST_F(KeptFiles, AreInTheUsersFolderIfTheSceneIsReadOnly) {
  const auto is_right = [&] {
    become_a_reader();
    return kept_folder(scene_) == own_ && kept_file(scene_, "looks/bold.json") == own_ / "looks/bold.json" &&
           kept_file(scene_, "looks/calm.json") == scene_ / "looks/calm.json" &&
           look_files(scene_) == std::vector<fs::path>{own_ / "looks/bold.json", scene_ / "looks/calm.json"};
  };
  EXPECT_EXIT(std::exit(is_right() ? 0 : 1), testing::ExitedWithCode(0), "");
}

TEST_F(KeptFiles, StayInTheSceneWithoutAHome) {
  const auto is_right = [&] {
    become_a_reader();
    ::unsetenv("XDG_DATA_HOME");
    ::unsetenv("HOME");
    const Status is_kept = check_kept_folder(scene_);
    return kept_folder(scene_) == scene_ && !is_kept &&
           is_kept.message().find("neither XDG_DATA_HOME nor HOME") != std::string::npos;
  };
  EXPECT_EXIT(std::exit(is_right() ? 0 : 1), testing::ExitedWithCode(0), "");
}

TEST_F(KeptFiles, ThatCanBeKeptNowhereAreNamed) {
  EXPECT_TRUE(check_kept_folder(scene_));
  fs::permissions(folder_ / "data", fs::perms(0555));
  fs::remove_all(folder_ / "data/limn");
  const auto is_right = [&] {
    become_a_reader();
    const Status is_kept = check_kept_folder(scene_);
    return !is_kept &&
           is_kept.message().starts_with((folder_ / "data").string() + ": expected to write here");
  };
  EXPECT_EXIT(std::exit(is_right() ? 0 : 1), testing::ExitedWithCode(0), "");
  fs::permissions(folder_ / "data", fs::perms(0755));
}

}  // namespace
}  // namespace limn::scene
