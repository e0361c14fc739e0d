#include "validate/hardware_report/board_captures.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "calib/board/board_finder.h"
#include "calib/capture.h"
#include "core/file.h"
#include "core/image_io.h"
#include "core/print.h"

namespace limn::validate {
namespace {

namespace fs = std::filesystem;

constexpr int k_least_placements = 3;  // calib/solve.h needs the board in so many

fs::path pose_folder(const calib::CaptureSet& captures, int pose) {
  fs::path folder = calib::image_path(captures, pose, 0, 0, 0);
  while (folder.parent_path() != captures.folder) folder = folder.parent_path();
  return folder;
}

// Whether the captures that are there are of devices with these names and sizes.
bool fits(const calib::CaptureSet& captures) {
  const auto text = read_file(captures.folder / "capture.json");
  const auto json = nlohmann::ordered_json::parse(text ? *text : "", nullptr, false);
  if (!json.is_object()) return false;
  const auto same = [&json](const char* key, const std::vector<calib::CapturedDevice>& devices) {
    nlohmann::ordered_json names, there;
    for (const calib::CapturedDevice& device : devices)
      names.push_back({device.name, device.width, device.height});
    if (!json.contains(key) || !json[key].is_array()) return false;
    for (const auto& one : json[key])
      if (one.is_object() && one.contains("size") && one["size"].is_array() && one["size"].size() == 2)
        there.push_back({one.value("name", ""), one["size"][0], one["size"][1]});
    return names == there;
  };
  return same("cameras", captures.cameras) && same("projectors", captures.projectors);
}

bool is_complete(const calib::CaptureSet& captures, int pose) {
  for (int projector = 0; projector < std::ssize(captures.projectors); ++projector)
    for (int camera = 0; camera < std::ssize(captures.cameras); ++camera)
      for (int pattern = 0; pattern < captures.patterns[static_cast<std::size_t>(projector)].count();
           ++pattern)
        if (!fs::exists(calib::image_path(captures, pose, projector, camera, pattern))) return false;
  return true;
}

// How many placements are complete. What is behind them is removed.
Result<int> keep_complete(const calib::CaptureSet& captures) {
  int complete = 0;
  if (fits(captures))
    while (is_complete(captures, complete)) ++complete;
  std::error_code failure;
  if (complete == 0) fs::remove_all(captures.folder, failure);
  for (int pose = complete; complete > 0 && fs::exists(pose_folder(captures, pose)); ++pose)
    fs::remove_all(pose_folder(captures, pose), failure);
  if (failure)
    return error("{}: expected to remove an incomplete capture: {}.", captures.folder.string(),
                 failure.message());
  return complete;
}

// How the board is held, so that the poses determine lens and distance.
const char* how_to_hold(int placement) {
  constexpr const char* k_ways[] = {
      "upright, facing the camera, near the middle of the image",
      "its left side turned away by about 30 degrees", "its right side turned away by about 30 degrees",
      "its upper edge turned away by about 30 degrees, nearer to the camera",
      "its lower edge turned away by about 30 degrees, farther from the camera"};
  return k_ways[static_cast<std::size_t>(placement) % std::size(k_ways)];
}

// The image of a placement that the first projector lights most.
fs::path white_image(const calib::CaptureSet& captures, int pose, int camera) {
  return calib::image_path(captures, pose, 0, camera, captures.patterns.front().white());
}

int corners_in(const calib::CaptureSet& captures, const cv::Mat& image) {
  return static_cast<int>(calib::find_board(captures.board, image).size());
}

}  // namespace

Status capture_board(const OpenDevices& devices, int placements, Questions* questions) {
  const calib::CaptureSet& captures = devices.captures();
  LIMN_TRY(const int complete, keep_complete(captures));
  if (complete == 0) LIMN_TRY_STATUS(calib::begin_captures(captures));
  for (int pose = complete; pose < placements; ++pose) {
    if (questions) {
      LIMN_TRY(const std::string answer,
               questions->ask(
                   fmt::format("Placement {} of {}: hold the board ({}) into the projector's light, {}. "
                               "Keep it still until the next line (lean it on something); then press enter",
                               pose + 1, placements, captures.board.text(), how_to_hold(pose)),
                   "now"));
    } else {
      LIMN_TRY_STATUS(devices.backend().wait_for_board(pose, [](int, const cv::Mat&, const auto&) {}));
    }
    const Status captured = calib::capture_pose(captures, pose, devices.backend().capture);
    LIMN_TRY_STATUS(devices.backend().wait_for_files());
    if (!captured) return captured;
    for (int camera = 0; questions && camera < std::ssize(captures.cameras); ++camera) {
      LIMN_TRY(const cv::Mat image, read_grey_image(white_image(captures, pose, camera)));
      print_out("  {}: {} corners of the board\n", captures.cameras[static_cast<std::size_t>(camera)].name,
                corners_in(captures, image));
    }
  }
  return {};
}

Result<std::vector<BoardInCamera>> find_captured_board(const calib::CaptureSet& captures, int placements) {
  std::vector<BoardInCamera> found;
  for (int camera = 0; camera < std::ssize(captures.cameras); ++camera) {
    found.push_back(
        {.camera = captures.cameras[static_cast<std::size_t>(camera)].name, .corners = {}, .images = {}});
    for (int pose = 0; pose < placements; ++pose) {
      const fs::path white = white_image(captures, pose, camera);
      LIMN_TRY(const cv::Mat image, read_grey_image(white));
      found.back().corners.push_back(corners_in(captures, image));
      found.back().images.push_back(fs::relative(white, captures.folder).string());
    }
  }
  return found;
}

std::vector<std::string> odd_in(const std::vector<BoardInCamera>& cameras) {
  std::vector<std::string> odd;
  for (const BoardInCamera& camera : cameras) {
    const auto seen = std::ranges::count_if(camera.corners, [](int corners) { return corners > 0; });
    if (seen == std::ssize(camera.corners)) continue;
    odd.push_back(fmt::format(
        "Capture: {} shows the board in {} of {} placements{}. Hold it flat into the light, near the middle "
        "of the "
        "image, and check that it is the board that was named.",
        camera.camera, seen, camera.corners.size(),
        seen < k_least_placements ? fmt::format("; limn solve needs {}", k_least_placements) : ""));
  }
  return odd;
}

}  // namespace limn::validate
