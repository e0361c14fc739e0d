#include "core/data_folder.h"

#include <gtest/gtest.h>

#include "core/file.h"
#include "tests/support/matchers.h"

namespace limn {
namespace {

namespace fs = std::filesystem;

bool names(const std::string& message, const std::string& text) {
  return message.find(text) != std::string::npos;
}

void write(const fs::path& file, const std::string& content) {
  fs::create_directories(file.parent_path());
  ASSERT_TRUE(write_file(file, content));
}

DataPlaces installed_in(const fs::path& root) { return {.program = root / "bin/limn", .version = "1.2.3"}; }

TEST(DataFolder, AProgramInABuildFolderReadsTheSourceTree) {
  EXPECT_TRUE(is_development_build());
  const auto world = data_file("config/worlds/studio.json");
  ASSERT_TRUE(world) << world.message();
  EXPECT_EQ(*world, fs::path(LIMN_SOURCE_DIR) / "config/worlds/studio.json");
  EXPECT_EQ(private_library("libsome.so").filename(), "libsome.so");
  EXPECT_TRUE(fs::exists(private_library("libsome.so").parent_path() / "limn-source-tree"));
}

TEST(DataFolder, AnInstalledProgramReadsTheFolderBesideIt) {
  const fs::path root = test::test_folder() / "moved here";
  write(root / "share/limn/version", "1.2.3\n");
  const auto folder = find_data_folder(installed_in(root));
  ASSERT_TRUE(folder) << folder.message();
  EXPECT_EQ(*folder, root / "share/limn");
}

TEST(DataFolder, TheEnvironmentComesFirst) {
  const fs::path root = test::test_folder();
  write(root / "share/limn/version", "1.2.3\n");
  write(root / "own/version", "1.2.3");
  DataPlaces places = installed_in(root);
  places.chosen = (root / "own").string();
  const auto folder = find_data_folder(places);
  ASSERT_TRUE(folder) << folder.message();
  EXPECT_EQ(*folder, root / "own");
}

TEST(DataFolder, MissingDataIsSaidWithTheWayToGetIt) {
  const fs::path root = test::test_folder();
  const auto folder = find_data_folder(installed_in(root));
  ASSERT_FALSE(folder);
  EXPECT_TRUE(names(folder.message(), (root / "share/limn").string())) << folder.message();
  EXPECT_TRUE(names(folder.message(), "LIMN_DATA")) << folder.message();
}

TEST(DataFolder, DataOfAnotherVersionIsNamed) {
  const fs::path root = test::test_folder();
  write(root / "share/limn/version", "1.3.0\n");
  DataPlaces places = installed_in(root);
  const auto folder = find_data_folder(places);
  ASSERT_FALSE(folder);
  EXPECT_TRUE(names(folder.message(), "expected the data of Limn 1.2.3")) << folder.message();
  EXPECT_TRUE(names(folder.message(), "found data of '1.3.0'")) << folder.message();
  places.chosen = (root / "share/limn").string();
  const auto chosen = find_data_folder(places);
  ASSERT_FALSE(chosen);
  EXPECT_TRUE(names(chosen.message(), "remove LIMN_DATA from the environment")) << chosen.message();
}

TEST(DataFolder, ASourceTreeThatHasGoneIsNamed) {
  const fs::path root = test::test_folder();
  write(root / "build/limn-source-tree", "/nowhere/limn\n");
  const auto folder = find_data_folder({.program = root / "build/tests/core/some_test", .version = "1.2.3"});
  ASSERT_FALSE(folder);
  EXPECT_TRUE(names(folder.message(), "/nowhere/limn: expected the source tree")) << folder.message();
}

}  // namespace
}  // namespace limn
