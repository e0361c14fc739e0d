// Tests the dependencies in docs/architecture.md: which room may include which, and that no folders include
// each other in a circle. Also the sizes and words of docs/style.md.

#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

namespace limn {
namespace {

namespace fs = std::filesystem;
using Names = std::set<std::string>;

// Each room and the rooms that it may include. Folders with a library of their own (exchange/poses) count as
// rooms.
const std::map<std::string, Names>& allowed() {
  static const Names k_libraries = {
      "core", "scene", "scene/meshes", "scene/volumes", "device", "calib", "tracker", "projector", "sim"};
  static const auto with = [](const Names& more) {
    Names all = k_libraries;
    all.insert(more.begin(), more.end());
    return all;
  };
  static const std::map<std::string, Names> arrows = {
      {"core", {}},
      {"core/camera_files", {"core"}},
      {"scene/files", {"core"}},
      {"scene/meshes", {"core", "scene/files"}},
      {"scene/volumes", {"core"}},
      {"scene", {"core", "scene/files", "scene/meshes", "scene/volumes", "scene/lines"}},
      {"scene/lines", {"core", "scene/files", "scene/meshes", "exchange/curves"}},
      {"device", {"core"}},
      {"calib", {"core", "scene", "scene/meshes"}},
      {"tracker", {"core"}},
      {"projector", {"core", "scene", "scene/meshes"}},
      {"sim", {"core", "scene", "scene/meshes", "scene/volumes", "device"}},
      {"device/gui", {"core", "device"}},
      {"exchange",
       {"core", "core/camera_files", "scene/files", "scene", "scene/meshes", "scene/lines", "projector",
        "exchange/curves"}},
      {"exchange/cad", {"core", "scene/files", "exchange/curves"}},
      {"exchange/curves", {"core"}},
      {"exchange/poses", {"core"}},
      {"exchange/printing", {"core", "calib", "tracker"}},
      {"wizard/design", {"core", "calib", "tracker"}},
      {"wizard/measure", {"core", "scene", "scene/meshes", "calib", "tracker"}},
      {"wizard", with({"device/gui", "wizard/measure"})},
      {"session/deviation",
       {"core", "scene", "scene/meshes", "calib", "projector", "wizard", "wizard/measure"}},
      {"session/drawing", {"core", "scene", "scene/meshes", "tracker", "projector"}},
      {"session/pen", {"core", "scene", "scene/lines"}},
      {"session/requests", {"core", "scene", "scene/meshes", "sim", "exchange/poses"}},
      {"session", with({"device/gui", "exchange/poses", "wizard", "wizard/measure", "session/deviation",
                        "session/drawing", "session/pen", "session/requests"})},
      {"remote", with({"scene/lines", "exchange/curves", "device/gui", "session", "session/drawing",
                       "session/requests"})},
      {"nodes/timing", {"core"}},
      {"nodes", with({"nodes/timing", "device/gui", "exchange/poses", "wizard", "session", "session/drawing",
                      "session/requests", "remote"})},
      {"validate", with({"wizard", "wizard/measure", "session", "session/drawing", "session/requests",
                         "session/deviation", "scene/lines"})},
      {"validate/hardware_report", {"core", "device", "calib", "tracker", "sim", "wizard", "nodes"}},
      {"library",
       {"core", "core/camera_files", "scene", "scene/meshes", "device", "calib", "tracker", "projector",
        "exchange", "wizard/measure"}},
      {"library/python", {}},  // the public headers alone
      {"apps", with({"core/camera_files", "device/gui", "exchange", "exchange/printing", "wizard",
                     "wizard/design", "wizard/measure", "session", "session/drawing", "session/requests",
                     "remote", "nodes", "validate", "validate/hardware_report"})},
  };
  return arrows;
}

// The folders inside a room and their levels: a folder may include only folders of lower levels.
const std::map<std::string, std::map<std::string, int>>& inner_order() {
  static const std::map<std::string, std::map<std::string, int>> order = {
      {"calib",
       {{"calib/board", 0},
        {"calib/code", 0},
        {"calib", 1},
        {"calib/surface", 2},
        {"calib/response", 2},
        {"calib/judge", 3},
        {"calib/report", 4}}},
      {"wizard", {{"wizard/capture", 0}, {"wizard", 1}, {"wizard/window", 2}}},
      {"remote",
       {{"remote/http", 0}, {"remote/tablet", 0}, {"remote/glasses", 0}, {"remote/api", 1}, {"remote", 2}}},
      {"tracker", {{"tracker", 0}, {"tracker/balls", 1}, {"tracker/feeds", 1}, {"tracker/cameras", 2}}},
  };
  return order;
}

// Third parties that only some rooms may include: include prefix -> rooms.
const std::map<std::string, Names>& guests() {
  static const std::map<std::string, Names> homes = {
      {"mrcal/", {"core"}},
      {"core/mrcal.h", {"core", "core/camera_files", "calib"}},
      {"ceres/", {"calib"}},
      {"assimp/", {"scene/meshes"}},
      {"meshoptimizer", {"scene/meshes", "scene/files"}},
      {"draco/", {"scene/meshes"}},
      {"nifti/", {"scene/volumes"}},
      {"dcmtk/", {"scene/volumes"}},
      {"opencascade/", {"exchange/cad"}},  // a program of its own, in an optional package
      {"embree3/", {"sim"}},
      {"embree4/", {"sim"}},
      {"GLFW/", {"device", "device/gui", "session"}},
      {"epoxy/", {"device", "projector", "device/gui", "session", "library"}},
      {"EGL/", {"device"}},
      {"CLI/", {"apps"}},
      {"imgui", {"device/gui", "wizard", "session"}},
      {"boost/", {"remote", "nodes"}},
      {"dds/", {"nodes"}},
      {"openssl/", {"remote", "nodes"}},
      {"qrencode", {"device/gui"}},
      {"turbojpeg", {"core", "device"}},
      {"jpeglib", {"core"}},
      {"png.h", {"core"}},
      {"tiffio", {"core"}},
      {"webp/", {"core"}},
      {"zip.h", {"scene/meshes", "exchange"}},
      {"lo/", {"exchange/poses"}},
      {"pugixml", {"core", "scene/meshes", "exchange"}},
      {"yaml-cpp/", {"core"}},
      {"OpenEXR/", {"scene/files"}},
      {"cairo", {"exchange/printing"}},
      {"opencv2/calib3d", {"calib"}},
      {"opencv2/aruco", {"core"}},
      {"opencv2/objdetect", {"core"}},
      {"core/opencv_markers.h", {"core", "calib", "tracker"}},
      {"opencv2/imgcodecs", {}},  // its libraries would double the time of the program's start
      {"opencv2/videoio", {"device"}},
      {"apriltag/", {"tracker"}},
      {"pybind11/", {"library/python"}},
  };
  return homes;
}

// One #include in a file.
struct Include {
  fs::path file;
  std::string folder;  // folder of the file, from the root
  std::string what;
};

const fs::path& root() {
  static const fs::path path = LIMN_SOURCE_DIR;
  return path;
}

std::string folder_of(const std::string& path) {
  const std::size_t slash = path.rfind('/');
  return slash == std::string::npos ? "" : path.substr(0, slash);
}

// The room that a folder belongs to; empty if there is none.
std::string room_of(std::string folder) {
  while (!folder.empty() && !allowed().contains(folder)) folder = folder_of(folder);
  return folder;
}

bool is_code(const fs::path& path) { return path.extension() == ".h" || path.extension() == ".cpp"; }

std::vector<fs::path> code_in(const fs::path& folder) {
  std::vector<fs::path> files;
  if (!fs::exists(folder)) return files;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (entry.is_regular_file() && is_code(entry.path())) files.push_back(entry.path());
  return files;
}

std::vector<Include> includes_in(const fs::path& folder) {
  static const std::regex pattern(R"(^\s*#\s*include\s*[<"]([^>"]+)[>"])");
  std::vector<Include> found;
  for (const fs::path& file : code_in(folder)) {
    const std::string from = fs::relative(file, root()).parent_path().generic_string();
    std::ifstream in(file);
    for (std::string line; std::getline(in, line);) {
      std::smatch match;
      if (std::regex_search(line, match, pattern)) found.push_back({file, from, match[1]});
    }
  }
  return found;
}

// The includes of all rooms.
const std::vector<Include>& includes() {
  static const std::vector<Include> all = [] {
    std::vector<Include> found;
    for (const auto& [room, may] : allowed()) {
      if (room.find('/') != std::string::npos) continue;  // its files belong to the room around it
      const auto more = includes_in(root() / room);
      found.insert(found.end(), more.begin(), more.end());
    }
    return found;
  }();
  return all;
}

TEST(House, RoomsIncludeOnlyWhatTheArrowsAllow) {
  int seen = 0;
  for (const Include& include : includes()) {
    const std::string from = room_of(include.folder), to = room_of(folder_of(include.what));
    if (to.empty() || from == to) continue;
    ++seen;
    EXPECT_TRUE(allowed().at(from).contains(to)) << include.file << " includes " << include.what;
  }
  EXPECT_GT(seen, 500) << "the sources were not found";
}

TEST(House, EveryRoomIsThere) {
  for (const auto& [room, may] : allowed()) EXPECT_FALSE(code_in(root() / room).empty()) << room;
}

TEST(House, FoldersOfARoomIncludeOnlyThoseBefore) {
  int seen = 0;
  for (const Include& include : includes()) {
    const std::string room = room_of(include.folder), to = folder_of(include.what);
    if (!inner_order().contains(room) || room_of(to) != room) continue;
    const auto& order = inner_order().at(room);
    ASSERT_TRUE(order.contains(include.folder)) << include.folder << ": add this folder to inner_order()";
    ASSERT_TRUE(order.contains(to)) << include.file << " includes " << include.what;
    ++seen;
    EXPECT_TRUE(include.folder == to || order.at(to) < order.at(include.folder))
        << include.file << " includes " << include.what;
  }
  EXPECT_GT(seen, 100) << "the sources were not found";
}

// folder -> the folders that it includes, each with one include as an example.
using Graph = std::map<std::string, std::map<std::string, std::string>>;

// The first circle that is found from `folder`, as lines for people; empty if there is none.
std::string circle_from(const std::string& folder,
                        const Graph& graph,
                        std::vector<std::string>* way,
                        Names* done) {
  const auto met = std::find(way->begin(), way->end(), folder);
  if (met != way->end()) {
    std::string circle;
    for (auto at = met; at != way->end(); ++at) {
      const std::string& to = at + 1 == way->end() ? folder : *(at + 1);
      circle += "\n  " + *at + " -> " + to + ": " + graph.at(*at).at(to);
    }
    return circle;
  }
  if (done->contains(folder) || !graph.contains(folder)) return "";
  way->push_back(folder);
  for (const auto& [to, example] : graph.at(folder)) {
    const std::string circle = circle_from(to, graph, way, done);
    if (!circle.empty()) return circle;
  }
  way->pop_back();
  done->insert(folder);
  return "";
}

std::string circle_in(const Graph& graph) {
  Names done;
  for (const auto& [folder, others] : graph) {
    std::vector<std::string> way;
    const std::string circle = circle_from(folder, graph, &way, &done);
    if (!circle.empty()) return circle;
  }
  return "";
}

Graph graph_of(const std::vector<Include>& all) {
  Graph graph;
  for (const Include& include : all) {
    const std::string to = folder_of(include.what);
    if (to.empty() || to == include.folder || !fs::exists(root() / include.what)) continue;
    graph[include.folder].emplace(
        to, fs::relative(include.file, root()).generic_string() + " includes " + include.what);
  }
  return graph;
}

TEST(House, ACircleIsFound) {
  const Graph circle = {{"a", {{"b", ""}}}, {"b", {{"c", ""}}}, {"c", {{"b", ""}}}};
  EXPECT_EQ(circle_in(circle), "\n  b -> c: \n  c -> b: ");
  EXPECT_EQ(circle_in({{"a", {{"b", ""}, {"c", ""}}}, {"b", {{"c", ""}}}}), "");
}

// Includes the tests, because a folder of tests may use another one's worlds.
TEST(House, NoFolderIncludesAnotherInACircle) {
  std::vector<Include> all = includes();
  const auto tests = includes_in(root() / "tests");
  all.insert(all.end(), tests.begin(), tests.end());
  const Graph graph = graph_of(all);
  EXPECT_GT(graph.size(), 20u) << "the sources were not found";
  EXPECT_EQ(circle_in(graph), "");
}

// The lines of a folder and its folders. Rooms inside it are counted by themselves.
int lines_in(const fs::path& folder) {
  const std::string room = room_of(fs::relative(folder, root()).generic_string());
  int lines = 0;
  for (const fs::path& file : code_in(folder)) {
    if (room_of(fs::relative(file, root()).parent_path().generic_string()) != room) continue;
    std::ifstream in(file);
    for (std::string line; std::getline(in, line);) ++lines;
  }
  return lines;
}

TEST(House, NoRoomIsTooLargeToKnow) {
  constexpr int k_most = 9000, k_most_commands = 6000;
  const Names larger = {"calib", "tracker"};  // calib is divided into folders, tracker has only one task
  for (const auto& [room, may] : allowed()) {
    if (larger.contains(room) || room == "apps") continue;
    EXPECT_LE(lines_in(root() / room), k_most) << room;
  }
  // The table of commands and the pages that are made from it are apart from what the commands do.
  const int table = lines_in(root() / "apps/commands") + lines_in(root() / "apps/documents");
  EXPECT_LE(lines_in(root() / "apps") - table, k_most_commands);
}

// Debian's tools expect `debian`, and people from elsewhere `examples`, in the root.
TEST(House, TheRootIsReadable) {
  constexpr int k_most = 20;
  static const Names k_not_counted = {"build", "out", "debian", "examples"};
  int folders = 0;
  std::string names;
  for (const auto& entry : fs::directory_iterator(root())) {
    const std::string name = entry.path().filename().string();
    if (!entry.is_directory() || name.starts_with('.') || k_not_counted.contains(name)) continue;
    ++folders;
    names += " " + name;
  }
  EXPECT_LE(folders, k_most) << names;
}

TEST(House, ThirdPartiesStayInTheirRooms) {
  int seen = 0;
  for (const Include& include : includes()) {
    for (const auto& [prefix, homes] : guests()) {
      if (!include.what.starts_with(prefix)) continue;
      ++seen;
      EXPECT_TRUE(homes.contains(room_of(include.folder))) << include.file << " includes " << include.what;
    }
  }
  EXPECT_GT(seen, 20) << "the sources were not found";
}

// core/json_text.h is a template over JSON; no other header may include it.
TEST(House, HeadersKeepSlowThirdPartiesOut) {
  for (const Include& include : includes()) {
    if (include.file.extension() != ".h" || include.file.filename() == "json_text.h") continue;
    EXPECT_NE(include.what, "core/json_text.h") << include.file;
    for (const char* slow :
         {"nlohmann/json.hpp", "opencv2/opencv.hpp", "CLI/", "boost/", "ceres/", "assimp/"})
      EXPECT_FALSE(include.what.starts_with(slow)) << include.file << " includes " << include.what;
  }
}

// What differs between the versions of a library that Debian's releases have is in one header, through which
// all other files use the library. No header of Limn's includes one of them.
TEST(House, LibrariesOfSeveralVersionsAreIncludedByOneHeader) {
  const std::map<std::string, fs::path> headers = {{"mrcal/", "core/mrcal.h"},
                                                   {"opencv2/aruco", "core/opencv_aruco.h"},
                                                   {"opencv2/objdetect", "core/opencv_aruco.h"},
                                                   {"embree3/", "sim/embree/embree.h"},
                                                   {"embree4/", "sim/embree/embree.h"}};
  int found = 0;
  for (const Include& include : includes()) {
    const fs::path file = fs::relative(include.file, root());
    for (const auto& [library, header] : headers) {
      if (include.what.starts_with(library)) {
        ++found;
        EXPECT_EQ(file, header) << "includes " << include.what;
      }
      if (include.what == header) {
        EXPECT_NE(file.extension(), ".h") << file << " includes " << include.what;
      }
    }
  }
  EXPECT_GE(found, 4);
}

// ---- tests ----

// The lines of each TEST in a file, from its name to the brace that ends it.
std::map<std::string, int> lines_of_tests(std::istream& file) {
  static const std::regex begin(R"(^(TEST(?:_F|_P)?\([^)]*).*)");
  std::map<std::string, int> lines;
  std::string test;
  for (std::string line; std::getline(file, line);) {
    std::smatch match;
    if (std::regex_match(line, match, begin)) test = match[1].str() + ")";
    if (!test.empty()) ++lines[test];
    if (line == "}" || line.ends_with(") {}")) test.clear();
  }
  return lines;
}

TEST(House, TheLinesOfATestAreCounted) {
  std::istringstream file("int a() {\n}\n\nTEST(A, B) {\n  a();\n}\n\n// c\nTEST_F(D, E) {}\n");
  EXPECT_EQ(lines_of_tests(file), (std::map<std::string, int>{{"TEST(A, B)", 3}, {"TEST_F(D, E)", 1}}));
}

TEST(House, NoTestIsLongerThanAScreen) {
  constexpr int k_most = 80;  // docs/style.md
  std::size_t seen = 0;
  for (const fs::path& path : code_in(root() / "tests")) {
    std::ifstream file(path);
    const auto tests = lines_of_tests(file);
    seen += tests.size();
    for (const auto& [test, lines] : tests)
      EXPECT_LE(lines, k_most) << fs::relative(path, root()) << ": cut " << test << " at its scenarios";
  }
  EXPECT_GT(seen, 1000u) << "the tests were not found";
}

// ---- words ----

// Reads the glossary's list under the heading "Do not use": lines "- picture, in words (a remark) -> what to
// use instead". Words with a remark have another, right meaning and are not searched; several words are
// searched joined by "_".
Names words_not_to_use() {
  std::ifstream in(root() / "docs/glossary.md");
  static const std::regex heading(R"(^#+\s.*[Dd]o not use.*)"), item(R"(^-\s+(.*?)\s*->.*)"),
      separator(R"(\s*[,/]\s*)");
  Names words;
  bool is_inside = false;
  for (std::string line; std::getline(in, line);) {
    std::smatch match;
    if (line.starts_with("#")) is_inside = std::regex_match(line, heading);
    if (!is_inside || !std::regex_match(line, match, item)) continue;
    std::string list = match[1];
    std::erase(list, '`');
    for (std::sregex_token_iterator at(list.begin(), list.end(), separator, -1), end; at != end; ++at) {
      std::string word = *at;
      if (word.empty() || word.find('(') != std::string::npos || word.find(')') != std::string::npos)
        continue;
      std::replace(word.begin(), word.end(), ' ', '_');
      words.insert(word);
    }
  }
  return words;
}

// C++ without its strings, characters and comments.
std::string code_alone(const std::string& text) {
  static const std::string k_raw = "R\"";
  std::string code;
  for (std::size_t i = 0; i < text.size();) {
    const auto skip_to = [&](const std::string& end, std::size_t from) {
      const std::size_t at = text.find(end, from);
      i = at == std::string::npos ? text.size() : at + end.size();
      code += ' ';
    };
    if (text.compare(i, 2, "//") == 0) {
      skip_to("\n", i);
      code += '\n';
    } else if (text.compare(i, 2, "/*") == 0) {
      skip_to("*/", i + 2);
    } else if (text.compare(i, 2, k_raw) == 0) {
      const std::size_t open = text.find('(', i);
      skip_to(")" + text.substr(i + 2, open - i - 2) + "\"", open);
    } else if (text[i] == '"' ||
               (text[i] == '\'' && (i == 0 || !std::isalnum(static_cast<unsigned char>(text[i - 1]))))) {
      const char quote = text[i];
      for (++i; i < text.size() && text[i] != quote && text[i] != '\n'; ++i)
        if (text[i] == '\\') ++i;
      ++i;
      code += ' ';
    } else {
      code += text[i++];
    }
  }
  return code;
}

TEST(House, StringsAndCommentsAreNoCode) {
  EXPECT_EQ(code_alone("a = \"b\"; // c\nd = 1'000 + 'e'; /* f */ g"), "a =  ;  \nd = 1'000 +  ;   g");
  EXPECT_EQ(code_alone("R\"x(one \" two)x\" three"), "  three");
}

// An identifier as lower-case words, each between "_": "PictureWriter" and "picture_writer_" are
// "_picture_writer_".
std::string as_words(const std::string& identifier) {
  std::string words = "_";
  for (std::size_t i = 0; i < identifier.size(); ++i) {
    const auto c = static_cast<unsigned char>(identifier[i]);
    const bool begins =
        std::isupper(c) && i > 0 && std::islower(static_cast<unsigned char>(identifier[i - 1]));
    if (begins) words += '_';
    if (c == '_' && words.back() == '_') continue;
    words += static_cast<char>(std::tolower(c));
  }
  return words.back() == '_' ? words : words + "_";
}

TEST(House, AnIdentifierIsItsWords) {
  EXPECT_EQ(as_words("PictureWriter"), "_picture_writer_");
  EXPECT_EQ(as_words("k_picture_side"), "_k_picture_side_");
  EXPECT_EQ(as_words("pictured"), "_pictured_");
}

TEST(House, IdentifiersKeepToTheGlossary) {
  const Names forbidden = words_not_to_use();
  ASSERT_FALSE(forbidden.empty()) << "docs/glossary.md: expected a list under a heading \"Do not use\"";
  static const std::regex identifier(R"([A-Za-z_]\w*)"),
      preprocessor(R"(^\s*#[^\n]*)", std::regex::multiline);
  int seen = 0;
  for (const auto& [room, may] : allowed()) {
    for (const fs::path& file : code_in(root() / room)) {
      std::ifstream in(file);
      std::string code = code_alone({std::istreambuf_iterator<char>(in), {}});
      code = std::regex_replace(code, preprocessor, "");
      Names reported;
      for (std::sregex_iterator at(code.begin(), code.end(), identifier), end; at != end; ++at) {
        ++seen;
        const std::string name = at->str();
        if (reported.contains(name)) continue;
        const std::string words = as_words(name);
        for (const std::string& word : forbidden) {
          if (words.find("_" + word + "_") == std::string::npos) continue;
          reported.insert(name);
          ADD_FAILURE() << fs::relative(file, root()) << ": " << name << " (docs/glossary.md: do not use "
                        << word << ")";
        }
      }
    }
  }
  EXPECT_GT(seen, 10000) << "the sources were not found";
}

// Names of functions that a piece of code declares or defines and that are only a verb of perception, which
// does not say what is done to what.
std::vector<std::string> vague_functions(const std::string& code) {
  static const std::regex function(
      R"([\w>&*]\s+[&*]?((?:\w+::)?(?:see|hear|tell|know|look|take))\([^;{}]*\)[^;{}()]*[;{])"),
      keyword(R"(^(?:return|else|co_return)\b)");
  std::vector<std::string> names;
  for (std::sregex_iterator at(code.begin(), code.end(), function), end; at != end; ++at) {
    const auto line = code.rfind('\n', static_cast<std::size_t>(at->position(1))) + 1;
    const auto text = code.find_first_not_of(' ', line);
    if (!std::regex_search(code.substr(text, 10), keyword)) names.push_back((*at)[1]);
  }
  return names;
}

TEST(House, AFunctionIsFoundByItsDeclaration) {
  EXPECT_EQ(vague_functions("void tell(int at);\nbool Eye::see(const Frame& frame) {"),
            (std::vector<std::string>{"tell", "Eye::see"}));
  EXPECT_EQ(vague_functions("  return see(1);\n  a.take(b);\n  take_frames(c);\nvoid look_up(int a);"),
            std::vector<std::string>());
}

TEST(House, FunctionsSayWhatTheyDoToWhat) {
  int seen = 0;
  for (const auto& [room, may] : allowed()) {
    for (const fs::path& file : code_in(root() / room)) {
      std::ifstream in(file);
      ++seen;
      for (const std::string& name : vague_functions(code_alone({std::istreambuf_iterator<char>(in), {}})))
        ADD_FAILURE() << fs::relative(file, root()) << ": " << name
                      << "() (docs/style.md: no function of this name)";
    }
  }
  EXPECT_GT(seen, 400) << "the sources were not found";
}

// nlohmann's dump() throws on bytes that are not UTF-8, which names of files and devices may have.
TEST(House, JsonIsWrittenByJsonText) {
  const Names may = {"core/json_text.h", "tracker/opencv_file.cpp"};  // the latter writes numbers only
  for (const auto& [room, rooms] : allowed()) {
    for (const fs::path& file : code_in(root() / room)) {
      std::ifstream in(file);
      const std::string code = code_alone({std::istreambuf_iterator<char>(in), {}});
      const std::string name = fs::relative(file, root()).generic_string();
      EXPECT_TRUE(may.contains(name) || code.find(".dump(") == std::string::npos)
          << name << ": use json_text() of core/json_text.h";
    }
  }
}

// Lines on which a comment begins with "of", which says what it belongs to but not what it is. Lines that
// continue a comment do not count.
std::vector<int> comments_without_subject(const std::string& text) {
  static const std::regex begins(R"((^|.*[^:])//+<?\s*[Oo]f\b.*)"), comment(R"(\s*//.*)");
  std::vector<int> lines;
  std::istringstream in(text);
  bool was_comment = false;
  int number = 0;
  for (std::string line; std::getline(in, line);) {
    ++number;
    const bool is_comment = std::regex_match(line, comment);
    if (!(is_comment && was_comment) && std::regex_match(line, begins)) lines.push_back(number);
    was_comment = is_comment;
  }
  return lines;
}

TEST(House, CommentsHaveASubject) {
  EXPECT_EQ(
      comments_without_subject("int a;  ///< of the image\n// Of two poses\n// the median\n// of all\n"),
      (std::vector<int>{1, 2}));
  for (const auto& [room, may] : allowed()) {
    for (const fs::path& file : code_in(root() / room)) {
      std::ifstream in(file);
      for (const int line : comments_without_subject({std::istreambuf_iterator<char>(in), {}}))
        ADD_FAILURE() << fs::relative(file, root()) << ":" << line << ": the comment begins with \"of\"";
    }
  }
}

}  // namespace
}  // namespace limn
