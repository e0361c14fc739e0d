// The order of the layers (docs/architecture.md): which room may include which.

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <vector>

namespace limn {
namespace {

namespace fs = std::filesystem;
using Rooms = std::set<std::string>;

const std::map<std::string, Rooms>& allowed() {
  static const std::map<std::string, Rooms> arrows = {
      {"core", {}},
      {"scene", {"core"}},
      {"device", {"core"}},
      {"calib", {"core", "scene"}},
      {"tracker", {"core"}},
      {"projector", {"core", "scene"}},
      {"sim", {"core", "scene", "device"}},
      {"apps", {"core", "scene", "device", "calib", "tracker", "projector", "sim"}},
  };
  return arrows;
}

// Third parties that stay private to some rooms: include prefix -> rooms.
const std::map<std::string, Rooms>& guests() {
  static const std::map<std::string, Rooms> homes = {
      {"mrcal/", {"core", "calib"}},
      {"ceres/", {"calib"}},
      {"assimp/", {"scene"}},
      {"meshoptimizer", {"scene"}},
      {"embree3/", {"sim"}},
      {"GLFW/", {"device", "apps"}},
      {"epoxy/", {"device", "projector", "apps"}},
      {"EGL/", {"device"}},
      {"CLI/", {"apps"}},
      {"imgui", {"apps"}},
      {"boost/", {"apps"}},
      {"openssl/", {"apps"}},
      {"qrencode", {"apps"}},
      {"turbojpeg", {"device"}},
      {"zip.h", {"apps"}},
      {"lo/", {"apps"}},
      {"pugixml", {"apps"}},
      {"OpenEXR/", {"apps"}},
      {"opencv2/calib3d", {"calib"}},
      {"opencv2/aruco", {"core", "calib", "tracker"}},
      {"opencv2/videoio", {"device"}},
  };
  return homes;
}

struct Include {
  fs::path file;
  std::string what;
};

std::vector<Include> includes_of(const fs::path& folder) {
  static const std::regex pattern(R"(^\s*#\s*include\s*[<"]([^>"]+)[>"])");
  std::vector<Include> found;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    const auto extension = entry.path().extension();
    if (extension != ".h" && extension != ".cpp") continue;
    std::ifstream in(entry.path());
    for (std::string line; std::getline(in, line);) {
      std::smatch match;
      if (std::regex_search(line, match, pattern)) found.push_back({entry.path(), match[1]});
    }
  }
  return found;
}

std::string room_of(const std::string& include) { return include.substr(0, include.find('/')); }

TEST(House, RoomsIncludeOnlyWhatTheArrowsAllow) {
  int seen = 0;
  for (const auto& [room, may] : allowed()) {
    for (const Include& include : includes_of(fs::path(LIMN_SOURCE_DIR) / room)) {
      const std::string other = room_of(include.what);
      if (other == room || !allowed().contains(other) || include.what.find('/') == std::string::npos)
        continue;
      ++seen;
      EXPECT_TRUE(may.contains(other)) << include.file << " includes " << include.what;
    }
  }
  EXPECT_GT(seen, 50) << "the sources were not found";
}

// A calib file's folder: "calib/judge", or "calib" itself.
std::string calib_folder(const std::string& path) {
  const size_t slash = path.find('/', std::string("calib/").size());
  return slash == std::string::npos ? "calib" : path.substr(0, slash);
}

TEST(House, CalibsFoldersIncludeOnlyThoseBefore) {
  const std::map<std::string, int> order = {{"calib/board", 0},   {"calib/code", 0},     {"calib", 1},
                                            {"calib/surface", 2}, {"calib/response", 2}, {"calib/judge", 3},
                                            {"calib/report", 4}};
  int seen = 0;
  for (const Include& include : includes_of(fs::path(LIMN_SOURCE_DIR) / "calib")) {
    if (!include.what.starts_with("calib/")) continue;
    const std::string from = calib_folder(fs::relative(include.file, LIMN_SOURCE_DIR).generic_string());
    const std::string to = calib_folder(include.what);
    ASSERT_TRUE(order.contains(from)) << from << ": give this folder its place";
    ASSERT_TRUE(order.contains(to)) << include.file << " includes " << include.what;
    ++seen;
    EXPECT_TRUE(from == to || order.at(to) < order.at(from)) << include.file << " includes " << include.what;
  }
  EXPECT_GT(seen, 50) << "the sources were not found";
}

TEST(House, ThirdPartiesStayInTheirRooms) {
  int seen = 0;
  for (const auto& [room, may] : allowed()) {
    for (const Include& include : includes_of(fs::path(LIMN_SOURCE_DIR) / room)) {
      for (const auto& [prefix, homes] : guests()) {
        if (!include.what.starts_with(prefix)) continue;
        ++seen;
        EXPECT_TRUE(homes.contains(room)) << include.file << " includes " << include.what;
      }
    }
  }
  EXPECT_GT(seen, 5) << "the sources were not found";
}

TEST(House, HeadersKeepSlowThirdPartiesOut) {
  for (const auto& [room, may] : allowed()) {
    for (const Include& include : includes_of(fs::path(LIMN_SOURCE_DIR) / room)) {
      if (include.file.extension() != ".h") continue;
      for (const char* slow : {"nlohmann/json.hpp", "opencv2/opencv.hpp", "CLI/", "boost/", "ceres/",
                               "assimp/", "embree3/", "mrcal/"}) {
        EXPECT_FALSE(include.what.starts_with(slow)) << include.file << " includes " << include.what;
      }
    }
  }
}

}  // namespace
}  // namespace limn
