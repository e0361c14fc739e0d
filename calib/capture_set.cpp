#include "calib/capture_set.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <map>
#include <set>

#include "calib/code/shot_order.h"
#include "calib/code/white_black.h"
#include "calib/shot_files.h"
#include "calib/temporary_folder.h"
#include "core/config.h"
#include "core/file.h"
#include "core/image_io.h"
#include "core/log.h"
#include "core/names.h"

namespace limn::calib {
namespace {

namespace fs = std::filesystem;

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
    const auto [width, height] = node.at("size").image_size(2);
    if (name.empty() || name.find('/') != std::string::npos || name == ".." || !names.insert(name).second)
      node.problem("expected a name of its own, without slashes, found '" + name + "'.");
    devices.push_back({name, width, height});
    if (const auto sees = keys.contains("sees") ? node.find("sees") : std::nullopt)
      devices.back().sees = k_spectra.read(*sees);
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

// Every series of every camera and pose.
std::vector<std::vector<fs::path>> all_series(const ShotFiles& shots) {
  std::vector<std::vector<fs::path>> series;
  for (const ShotPose& pose : shots.poses) series.insert(series.end(), pose.files.begin(), pose.files.end());
  return series;
}

// The number of images that most series have.
int usual_count(const ShotFiles& shots) {
  std::map<int, int> series;
  for (const std::vector<fs::path>& files : all_series(shots)) ++series[static_cast<int>(files.size())];
  return std::max_element(series.begin(), series.end(),
                          [](const auto& a, const auto& b) { return a.second < b.second; })
      ->first;
}

// Checks that every series has the same number of images, and one that a Gray code can have.
Status check_counts(const ForeignCaptureSet& foreign,
                    const Patterns& whole,
                    const ShotFiles& shots,
                    const std::vector<int>& counts) {
  const int usual = usual_count(shots);
  const bool is_possible = std::find(counts.begin(), counts.end(), usual) != counts.end();
  for (const ShotPose& pose : shots.poses) {
    for (size_t camera = 0; camera < pose.files.size(); ++camera) {
      const int count = static_cast<int>(pose.files[camera].size());
      if (is_possible && count == usual) continue;
      const std::string where = fmt::format("{}: {}", (foreign.folder / pose.name).string(),
                                            shots.cameras.size() > 1 ? shots.cameras[camera] + ": " : "");
      if (is_possible)
        return error(
            "{}expected {} images '{}', as in the other poses, found {}. Leave the pose out with "
            "--skip-poses, or check --shots.",
            where, usual, foreign.shots, count);
      return error(
          "{}expected {} images '{}' ({}x{} Gray code with inverses, white and black), or {} of other "
          "orders{}, "
          "found {}. Leave the pose out with --skip-poses, or check --projector and --shots.",
          where, counts.empty() ? whole.count() : counts[0], foreign.shots, whole.width, whole.height,
          fmt::join(counts.begin() + std::min<std::ptrdiff_t>(1, std::ssize(counts)), counts.end(), ", "),
          foreign.order.empty() ? "" : fmt::format(" that --order {} allows", foreign.order), count);
    }
  }
  return {};
}

void report_order(const FoundOrder& found, const KnownOrder& known) {
  const std::string order = to_text(found.order);
  if (found.is_assumed)
    log_warning("order: {} (assumed: the images show too little light of the projector to find it)", order);
  else
    log_info("order: {} (found in the images{})", order,
             known.text.empty() ? "" : fmt::format(" with --order {}", known.text));
  if (found.is_step_assumed)
    log_warning(
        "order: stripes of {} pixels explain the number of images, but other widths do, too. If the "
        "projected "
        "stripes are wider, say so with --step.",
        found.order.step_px);
}

std::vector<fs::path> in_order(const std::vector<fs::path>& files, const FoundOrder& found) {
  std::vector<fs::path> ordered;
  for (const int shot : found.shots)
    ordered.push_back(shot < 0 ? fs::path() : files[static_cast<size_t>(shot)]);
  return ordered;
}

// Computes white and black of every series and stores them in a temporary folder.
Status make_white_and_black(CaptureSet* captures) {
  LIMN_TRY(TemporaryFolder made, TemporaryFolder::create());
  const auto folder = std::make_shared<const TemporaryFolder>(std::move(made));
  captures->made_images = folder;
  for (CapturedPose& pose : captures->poses) {
    for (size_t camera = 0; camera < captures->cameras.size(); ++camera) {
      std::vector<fs::path>& files = pose.images[0][camera];
      const bool inverses = captures->patterns[0].options.inverses;
      LIMN_TRY(const WhiteBlack images, white_black_of({files.begin(), files.end() - 2}, inverses));
      const fs::path into = folder->path() / pose.name / captures->cameras[camera].name;
      LIMN_TRY_STATUS(make_folder(into));
      files.end()[-2] = into / "white.png";
      files.end()[-1] = into / "black.png";
      LIMN_TRY_STATUS(write_png(files.end()[-2], images.white, {.compression = 1}));
      LIMN_TRY_STATUS(write_png(files.end()[-1], images.black, {.compression = 1}));
    }
  }
  return {};
}

}  // namespace

std::optional<BoardMeasured> read_board_measured(const ConfigNode& root) {
  const auto lengths = root.find("board_measured_mm"), stddev = root.find("board_measured_stddev_mm");
  if (!lengths && stddev)
    stddev->problem("expected it beside board_measured_mm, [width, height], found it alone.");
  if (!lengths) return std::nullopt;
  const std::vector<double> mm = lengths->numbers(2);
  if (mm.size() != 2) return std::nullopt;
  for (const double length : mm) {
    if (!(length > 0)) lengths->problem("expected two lengths above 0 mm, [width, height].");
  }
  constexpr double k_most_stddev_mm = 5;
  return BoardMeasured{1e-3 * mm[0], 1e-3 * mm[1],
                       1e-3 * (stddev ? stddev->positive(k_most_stddev_mm) : 0.1)};
}

Status check_spectra(const CaptureSet& captures) {
  const CapturedDevice& first = captures.cameras.front();
  if (first.sees == Spectrum::visible) return {};
  return error(
      "{}: expected a first camera that sees visible light, and with it the projected patterns, found "
      "\"sees\": "
      "\"infrared\". Name a camera for visible light first; this one is then calibrated with it, by the "
      "board "
      "alone. (Cameras without projectors: limn solve --cameras-only, with the board in their own light.)",
      first.name);
}

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
  root.only({"schema", "cameras", "projectors", "board", "patterns", "known_lengths", "board_measured_mm",
             "board_measured_stddev_mm"});
  CaptureSet captures;
  captures.folder = folder;
  captures.cameras = read_devices(root.at("cameras"), {"name", "size", "sees"});
  captures.projectors = read_devices(root.at("projectors"), {"name", "size", "patterns"});
  const std::string board = root.at("board").text();
  if (const auto lengths = root.find("known_lengths")) {
    for (const ConfigNode& length : lengths->items()) captures.scale_bar_lengths.push_back(length.text());
  }
  captures.board_measured = read_board_measured(root);
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
  LIMN_TRY(KnownOrder known, KnownOrder::parse(foreign.order));
  if (foreign.step_px > 0) known.step_px = foreign.step_px;
  LIMN_TRY(const Patterns whole,
           Patterns::create(PatternCode::gray, foreign.projector_width, foreign.projector_height,
                            {.step_px = known.step_px.value_or(1)}));
  const std::vector<int> counts = gray_code_counts(whole.width, whole.height, known);
  LIMN_TRY(const ShotFiles shots,
           find_shots({foreign.folder, foreign.poses, foreign.shots, foreign.skip}, [&](int count) {
             return std::find(counts.begin(), counts.end(), count) != counts.end();
           }));
  LIMN_TRY_STATUS(check_counts(foreign, whole, shots, counts));
  LIMN_TRY(const FoundOrder found, find_shot_order(all_series(shots), whole.width, whole.height, known));
  report_order(found, known);
  CaptureSet captures{foreign.folder, {}, {{"projector0", whole.width, whole.height}}, {found.patterns},
                      foreign.board,  {}};
  for (size_t i = 0; i < shots.cameras.size(); ++i) {
    LIMN_TRY(const cv::Mat first, read_image(shots.poses[0].files[i][0]));
    captures.cameras.push_back({shots.cameras[i], first.cols, first.rows});
  }
  for (const ShotPose& pose : shots.poses) {
    captures.poses.push_back({pose.name, {}});
    captures.poses.back().images.emplace_back();
    for (const std::vector<fs::path>& files : pose.files)
      captures.poses.back().images[0].push_back(in_order(files, found));
  }
  if (!found.order.has_white()) LIMN_TRY_STATUS(make_white_and_black(&captures));
  return captures;
}

}  // namespace limn::calib
