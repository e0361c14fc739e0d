#include "calib/capture_set.h"

#include <algorithm>
#include <set>

#include "core/config.h"
#include "core/image_io.h"
#include "core/names.h"

namespace limn::calib {
namespace {

namespace fs = std::filesystem;

bool matches(const char* pattern, const char* text) {
  if (*pattern == '*') return matches(pattern + 1, text) || (*text != '\0' && matches(pattern, text + 1));
  if (*text == '\0') return *pattern == '\0';
  return (*pattern == '?' || *pattern == *text) && matches(pattern + 1, text + 1);
}

// Names of directories or files in `folder` that match the pattern, sorted.
std::vector<std::string> names_in(const fs::path& folder, const std::string& pattern, bool directories) {
  std::vector<std::string> names;
  std::error_code problem;
  for (const auto& entry : fs::directory_iterator(folder, problem)) {
    std::string name = entry.path().filename().string();
    if (entry.is_directory() == directories && matches(pattern.c_str(), name.c_str()))
      names.push_back(std::move(name));
  }
  // 2 comes before 10 when numbers have no leading zeros: fewer digits first within the same stem.
  std::sort(names.begin(), names.end(), [](const std::string& a, const std::string& b) {
    const auto stem = [](const std::string& s) { return s.substr(0, s.find_last_not_of("0123456789") + 1); };
    if (stem(a) == stem(b) && a.size() != b.size()) return a.size() < b.size();
    return a < b;
  });
  return names;
}

// Pose directories that match, without those in `skip`.
Result<std::vector<std::string>> pose_names(const fs::path& folder,
                                            const std::string& pattern,
                                            const std::vector<std::string>& skip) {
  std::vector<std::string> names = names_in(folder, pattern, true);
  if (names.empty())
    return error(
        "{}: expected pose directories '{}', found none. Capture some board poses first, or check --poses.",
        folder.string(), pattern);
  for (const std::string& name : skip) {
    const auto found = std::find(names.begin(), names.end(), name);
    if (found == names.end())
      return error("--skip-poses: there is no pose '{}' in {}. Poses: {}.", name, folder.string(),
                   joined_names(names));
    names.erase(found);
  }
  return names;
}

// pose00 or pose00/projector0: the directory that contains the cameras' directories.
fs::path level_of(const CaptureSet& captures, const std::string& pose, size_t projector) {
  const fs::path folder = captures.folder / pose;
  return captures.projectors.size() > 1 ? folder / captures.projectors[projector].name : folder;
}

// Checks for folders in `folder` that belong to no device of these captures.
Status check_strangers(const fs::path& folder,
                       const std::vector<CapturedDevice>& devices,
                       const std::string& pose) {
  for (const std::string& name : names_in(folder, "*", true)) {
    if (name.starts_with(".") || find_named(devices, name)) continue;
    return error(
        "{}: expected folders of the devices in capture.json ({}), found '{}'. Captures of different rigs "
        "are mixed: move {} to its own captures folder, or leave it out with --skip-poses {}.",
        folder.string(), joined_names(devices), name, pose, pose);
  }
  return {};
}

// Checks for numbered images beyond the patterns' count.
Status check_surplus(const fs::path& folder, const Patterns& patterns, const std::string& pose) {
  const fs::path next = find_image(folder / image_name(patterns.count()));
  if (!fs::exists(next)) return {};
  return error(
      "{}: expected {} images, {} to {}, as patterns.json says, found more. Other patterns were shown: "
      "capture {} again, or leave it out with --skip-poses {}.",
      next.string(), patterns.count(), image_name(0), image_name(patterns.count() - 1), pose, pose);
}

Result<CapturedPose> read_pose(const CaptureSet& captures, const std::string& name) {
  CapturedPose pose{name, {}};
  if (captures.projectors.size() > 1)
    LIMN_TRY_STATUS(check_strangers(captures.folder / name, captures.projectors, name));
  for (size_t i = 0; i < captures.projectors.size(); ++i) {
    pose.images.emplace_back();
    LIMN_TRY_STATUS(check_strangers(level_of(captures, name, i), captures.cameras, name));
    for (const CapturedDevice& camera : captures.cameras) {
      std::vector<fs::path> files;
      const fs::path folder = level_of(captures, name, i) / camera.name;
      LIMN_TRY_STATUS(check_surplus(folder, captures.patterns[i], name));
      for (int k = 0; k < captures.patterns[i].count(); ++k) {
        files.push_back(find_image(folder / image_name(k)));
        if (!fs::exists(files.back()))
          return error(
              "{}: missing; pose {} needs {} images of {} by {}. Capture the pose again, or leave it out "
              "with --skip-poses {}.",
              files.back().string(), name, captures.patterns[i].count(), captures.projectors[i].name,
              camera.name, name);
      }
      pose.images.back().push_back(std::move(files));
    }
  }
  return pose;
}

std::vector<CapturedDevice> read_devices(const ConfigNode& list, const std::set<std::string>& keys) {
  std::vector<CapturedDevice> devices;
  std::set<std::string> names;
  for (const ConfigNode& node : list.items()) {
    node.only(keys);
    const std::string name = node.at("name").text();
    const std::vector<double> size = node.at("size").numbers(2);
    const bool sound =
        size.size() == 2 && size[0] >= 2 && size[1] >= 2 && size[0] <= 65535 && size[1] <= 65535;
    if (!sound) node.problem("expected a size of 2 to 65535 pixels a side.");
    if (name.empty() || name.find('/') != std::string::npos || name == ".." || !names.insert(name).second)
      node.problem("expected a name of its own, without slashes, found '" + name + "'.");
    devices.push_back({name, sound ? static_cast<int>(size[0]) : 2, sound ? static_cast<int>(size[1]) : 2});
  }
  if (devices.empty()) list.problem("expected at least one device, found none.");
  return devices;
}

// A patterns file that is named but missing is an error in capture.json.
fs::path patterns_path(const ConfigNode& node) {
  fs::path path = node.path_inside();
  std::error_code ignored;
  if (!path.empty() && !fs::is_regular_file(path, ignored))
    node.problem("expected a patterns file, found no " + path.string() + ".");
  return path;
}

Status read_patterns(const Config& config, CaptureSet* captures) {
  const fs::path common = patterns_path(config.root().at("patterns"));
  std::vector<fs::path> paths;
  for (const ConfigNode& node : config.root().at("projectors").items()) {
    const auto own = node.find("patterns");
    paths.push_back(own ? patterns_path(*own) : common);
  }
  LIMN_TRY_STATUS(config.status());
  for (size_t i = 0; i < captures->projectors.size(); ++i) {
    LIMN_TRY(const Patterns patterns, load_patterns(paths[i]));
    const CapturedDevice& projector = captures->projectors[i];
    if (patterns.width != projector.width || patterns.height != projector.height)
      return error("{}: projectors[{}].size: expected the patterns' {}x{}, found {}x{}.",
                   (captures->folder / "capture.json").string(), i, patterns.width, patterns.height,
                   projector.width, projector.height);
    captures->patterns.push_back(patterns);
  }
  return {};
}

}  // namespace

CaptureSet plan_captures(const fs::path& folder,
                         std::vector<CapturedDevice> cameras,
                         std::vector<CapturedDevice> projectors,
                         const Board& board,
                         PatternCode code,
                         const CodeOptions& options) {
  CaptureSet plan{folder, std::move(cameras), std::move(projectors), {}, board, {}};
  for (const CapturedDevice& projector : plan.projectors)
    plan.patterns.push_back(Patterns::create(code, projector.width, projector.height, options).value());
  return plan;
}

fs::path image_path(const CaptureSet& captures, int pose, int projector, int camera, int pattern) {
  return level_of(captures, fmt::format("pose{:02d}", pose), static_cast<size_t>(projector)) /
         captures.cameras[static_cast<size_t>(camera)].name / image_name(pattern);
}

Result<CaptureSet> load_captures(const fs::path& folder, const std::vector<std::string>& skip) {
  const fs::path path = folder / "capture.json";
  LIMN_TRY(const Config config, Config::load(path, "limn.capture/1"));
  const ConfigNode root = config.root();
  root.only({"schema", "cameras", "projectors", "board", "patterns", "known_lengths"});
  CaptureSet captures;
  captures.folder = folder;
  captures.cameras = read_devices(root.at("cameras"), {"name", "size"});
  captures.projectors = read_devices(root.at("projectors"), {"name", "size", "patterns"});
  const std::string board = root.at("board").text();
  if (const auto lengths = root.find("known_lengths")) {
    for (const ConfigNode& length : lengths->items()) captures.scale_bar_lengths.push_back(length.text());
  }
  LIMN_TRY_STATUS(config.status());
  auto parsed = Board::parse(board);
  if (!parsed) return error("{}: board: {}", path.string(), parsed.message());
  captures.board = *parsed;
  LIMN_TRY_STATUS(read_patterns(config, &captures));
  LIMN_TRY(const auto names, pose_names(folder, "pose*", skip));
  for (const std::string& name : names) {
    LIMN_TRY(CapturedPose pose, read_pose(captures, name));
    captures.poses.push_back(std::move(pose));
  }
  return captures;
}

Result<CaptureSet> import_opencv_gray(const ForeignCaptureSet& foreign) {
  if (!fs::is_directory(foreign.folder))
    return error("{}: expected a folder of captures, found none.", foreign.folder.string());
  LIMN_TRY(const Patterns patterns,
           Patterns::create(PatternCode::gray, foreign.projector_width, foreign.projector_height));
  CaptureSet captures{foreign.folder, {{"camera0", 0, 0}}, {{"projector0", patterns.width, patterns.height}},
                      {patterns},     foreign.board,       {}};
  LIMN_TRY(const auto names, pose_names(foreign.folder, foreign.poses, foreign.skip));
  for (const std::string& name : names) {
    std::vector<fs::path> files;
    for (const std::string& file : names_in(foreign.folder / name, foreign.shots, false))
      files.push_back(foreign.folder / name / file);
    if (static_cast<int>(files.size()) != patterns.count())
      return error(
          "{}: expected {} images '{}' ({}x{} Gray code with inverses, white and black), found {}. Leave "
          "the pose out with --skip-poses, or check --projector and --shots.",
          (foreign.folder / name).string(), patterns.count(), foreign.shots, patterns.width, patterns.height,
          files.size());
    captures.poses.push_back({name, {{std::move(files)}}});
  }
  if (captures.poses.empty()) return error("{}: all poses are skipped.", foreign.folder.string());
  LIMN_TRY(const cv::Mat first, read_image(captures.poses[0].images[0][0][0]));
  captures.cameras[0].width = first.cols;
  captures.cameras[0].height = first.rows;
  return captures;
}

}  // namespace limn::calib
