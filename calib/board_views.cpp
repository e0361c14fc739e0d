#include "calib/board_views.h"

#include <algorithm>
#include <chrono>
#include <optional>

#include "calib/board/board_finder.h"
#include "core/image_io.h"
#include "core/log.h"
#include "core/names.h"
#include "core/parallel.h"

namespace limn::calib {
namespace {

namespace fs = std::filesystem;

constexpr size_t k_most_files = 8;  // photographs of one pose and camera; more are a series of patterns

// What the photographs of one pose and camera show.
struct BoardView {
  int width = 0, height = 0;  // 0: there is no photograph
  fs::path file;
  std::vector<BoardCorner> corners;
};

Result<BoardView> best_view(const Board& board, const std::vector<fs::path>& files) {
  if (files.size() > k_most_files)
    return error(
        "{}: expected one photograph of the board for each pose and camera, found {}. For series of patterns "
        "add "
        "--import opencv-gray --projector 1024x768.",
        files.front().parent_path().string(), files.size());
  BoardView best;
  for (const fs::path& file : files) {
    LIMN_TRY(const cv::Mat grey, read_grey_image(file));
    std::vector<BoardCorner> corners = find_board(board, grey);
    if (!best.file.empty() && corners.size() <= best.corners.size()) continue;
    best = {grey.cols, grey.rows, file, std::move(corners)};
  }
  return best;
}

// All views, by pose and then camera.
Result<std::vector<BoardView>> all_views(const BoardViews& views) {
  const auto cameras = static_cast<int>(views.cameras.size());
  const int count = static_cast<int>(views.poses.size()) * cameras;
  std::vector<std::optional<Result<BoardView>>> parts(static_cast<size_t>(count));
  parallel_for(count, [&](int i) {
    const auto& files = views.poses[static_cast<size_t>(i / cameras)].files[static_cast<size_t>(i % cameras)];
    parts[static_cast<size_t>(i)] = best_view(views.board, files);
  });
  std::vector<BoardView> seen;
  for (auto& part : parts) {
    if (!part->ok()) return part->error();
    seen.push_back(std::move(**part));
  }
  return seen;
}

// The camera's image size, which all its photographs must have.
Result<CapturedDevice> device_of(const BoardViews& views, const std::vector<BoardView>& seen, size_t camera) {
  CapturedDevice device{views.cameras[camera], 0, 0};
  for (size_t i = camera; i < seen.size(); i += views.cameras.size()) {
    const BoardView& view = seen[i];
    if (view.width == 0) continue;
    if (device.width == 0) device = {device.name, view.width, view.height};
    if (view.width != device.width || view.height != device.height)
      return error(
          "{}: expected {}x{} pixels, as the other photographs of {}, found {}x{}. A lens belongs to one "
          "size: "
          "leave photographs of other sizes or cameras out (--shots), and do not turn or crop any.",
          view.file.string(), device.width, device.height, device.name, view.width, view.height);
  }
  return device;
}

void warn_of_missing(const BoardViews& views, const std::vector<BoardView>& seen) {
  for (size_t camera = 0; camera < views.cameras.size(); ++camera) {
    std::vector<std::string> missing;
    size_t all = 0;
    for (size_t i = camera; i < seen.size(); i += views.cameras.size()) {
      if (seen[i].width == 0) continue;
      ++all;
      if (seen[i].corners.empty()) missing.push_back(seen[i].file.filename().string());
    }
    if (missing.empty()) continue;
    log_warning("{}: the board {} was found in {} of {} photographs; not in {}.", views.cameras[camera],
                views.board.text(), all - missing.size(), all, joined_names(missing));
  }
}

}  // namespace

BoardViews board_views(const CaptureSet& captures) {
  BoardViews views{captures.folder, captures.board, {}, {}};
  for (const CapturedDevice& camera : captures.cameras) views.cameras.push_back(camera.name);
  for (const CapturedPose& pose : captures.poses) {
    ShotPose view{pose.name, std::vector<std::vector<fs::path>>(captures.cameras.size())};
    for (size_t projector = 0; projector < captures.projectors.size(); ++projector) {
      const auto white = static_cast<size_t>(captures.patterns[projector].white());
      for (size_t camera = 0; camera < captures.cameras.size(); ++camera)
        view.files[camera].push_back(pose.images[projector][camera][white]);
    }
    views.poses.push_back(std::move(view));
  }
  return views;
}

Result<Observed> observe_board(const BoardViews& views) {
  const auto begun = std::chrono::steady_clock::now();
  LIMN_TRY(const std::vector<BoardView> seen, all_views(views));
  Observed observed;
  Observations& into = observed.observations;
  into.board = views.board;
  for (size_t camera = 0; camera < views.cameras.size(); ++camera) {
    LIMN_TRY(const CapturedDevice device, device_of(views, seen, camera));
    into.cameras.push_back(device);
  }
  for (size_t pose = 0; pose < views.poses.size(); ++pose) {
    const auto first = seen.begin() + static_cast<std::ptrdiff_t>(pose * views.cameras.size());
    const auto end = first + static_cast<std::ptrdiff_t>(views.cameras.size());
    if (std::all_of(first, end, [](const BoardView& view) { return view.corners.empty(); })) continue;
    for (auto view = first; view != end; ++view) {
      for (const BoardCorner& corner : view->corners)
        into.corners.push_back({static_cast<int>(view - first), static_cast<int>(into.poses.size()),
                                corner.id, corner.px, corner.stddev_px});
    }
    into.poses.push_back(views.poses[pose].name);
  }
  if (into.poses.empty())
    return error(
        "{}: expected the board {} in the photographs, found it in none of {} poses. Check --board "
        "(chessboards "
        "are counted in inner corners), the light and the focus; chessboards and circle grids must be "
        "completely "
        "visible.",
        views.folder.string(), views.board.text(), views.poses.size());
  warn_of_missing(views, seen);
  observed.seconds_board = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
  return observed;
}

}  // namespace limn::calib
