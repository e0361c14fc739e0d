#include "wizard/measure/scale_bars.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <set>

#include "calib/board/board_finder.h"
#include "calib/code/decode.h"
#include "core/marker.h"
#include "tracker/detector.h"

namespace limn::wizard {
namespace {

calib::DetectedMark mark_of(const tracker::Detection& detection, int camera, int pose) {
  calib::DetectedMark mark{camera, pose, detection.marker.text(), detection.corners_px, 0};
  double variance = 0;
  for (const Eigen::Matrix2d& covariance : detection.corner_covariance) variance += covariance.trace() / 8;
  mark.stddev_px = std::sqrt(variance);
  return mark;
}

bool is_on_board(const calib::Board& board, const MarkerName& marker) {
  const bool is_grid = board.kind == calib::BoardKind::aprilgrid;
  if (marker.family != (is_grid ? "apriltag_36h11" : board.dictionary)) return false;
  int id = 0;
  const auto read = std::from_chars(marker.id.data(), marker.id.data() + marker.id.size(), id);
  return read.ec == std::errc() && id < board.columns * board.rows;
}

// The quadrilateral of the board's outermost corners; none unless all four are seen.
std::optional<calib::DetectedMark> mark_of(const calib::Board& board,
                                           const cv::Mat& grey,
                                           int camera,
                                           int pose) {
  const std::vector<calib::BoardCorner> seen = calib::find_board(board, grey);
  const int last = board.corner_count() - 1, across = board.columns - 2;
  calib::DetectedMark mark{camera, pose, board.text(), {}, 0};
  const std::array ids{0, across, last, last - across};  // in order around the board
  for (size_t i = 0; i < 4; ++i) {
    const auto corner = std::ranges::find(seen, ids[i], &calib::BoardCorner::id);
    if (corner == seen.end()) return std::nullopt;
    mark.corners_px[i] = corner->px;
    mark.stddev_px = std::max(mark.stddev_px, corner->stddev_px);
  }
  return mark;
}

bool have_same_marks(const calib::Board& a, const calib::Board& b) {
  const bool has_markers = a.kind == calib::BoardKind::charuco || a.kind == calib::BoardKind::aprilgrid;
  if (a.kind != b.kind) return false;
  return has_markers ? a.dictionary == b.dictionary : a.columns == b.columns && a.rows == b.rows;
}

// The white image of a projector.
Result<cv::Mat> white_image(const calib::CaptureSet& captures, size_t pose, size_t camera, size_t projector) {
  const calib::CapturedDevice& device = captures.cameras[camera];
  const auto white = static_cast<size_t>(captures.patterns[projector].white());
  return calib::read_shot(captures.poses[pose].images[projector][camera][white], device.width, device.height);
}

// A second board, in every pose and camera that shows it.
Status add_board_marks(const calib::CaptureSet& captures,
                       const calib::Board& board,
                       std::vector<calib::DetectedMark>* marks) {
  if (have_same_marks(board, captures.board))
    return usage_error(
        "known length '{}': expected a board that differs from {}, found the same kind of board. Use another "
        "dictionary, or another number of corners.",
        board.text(), captures.board.text());
  for (size_t pose = 0; pose < captures.poses.size(); ++pose) {
    for (size_t camera = 0; camera < captures.cameras.size(); ++camera) {
      std::optional<calib::DetectedMark> mark;
      for (size_t projector = 0; !mark && projector < captures.projectors.size(); ++projector) {
        LIMN_TRY(const cv::Mat white, white_image(captures, pose, camera, projector));
        mark = mark_of(board, white, static_cast<int>(camera), static_cast<int>(pose));
      }
      if (mark) marks->push_back(*mark);
    }
  }
  return {};
}

// The markers in the images of one pose of one camera.
Status add_marks(const calib::CaptureSet& captures,
                 size_t pose,
                 size_t camera,
                 const Lens* lens,
                 tracker::Detector* detector,
                 std::vector<calib::DetectedMark>* marks) {
  std::set<std::string> found;
  for (size_t projector = 0; projector < captures.projectors.size(); ++projector) {
    LIMN_TRY(const cv::Mat white, white_image(captures, pose, camera, projector));
    for (const tracker::Detection& detection : detector->detect(white, lens)) {
      if (!is_on_board(captures.board, detection.marker) && found.insert(detection.marker.text()).second)
        marks->push_back(mark_of(detection, static_cast<int>(camera), static_cast<int>(pose)));
    }
  }
  return {};
}

}  // namespace

Result<std::vector<calib::DetectedMark>> marks_of(const calib::CaptureSet& captures,
                                                  const std::vector<std::string>& families,
                                                  const Rig* rig) {
  LIMN_TRY(tracker::Families loaded, tracker::Families::load(families, captures.folder));
  tracker::Detector detector(std::move(loaded));
  std::vector<calib::DetectedMark> marks;
  for (size_t pose = 0; pose < captures.poses.size(); ++pose) {
    for (size_t camera = 0; camera < captures.cameras.size(); ++camera)
      LIMN_TRY_STATUS(
          add_marks(captures, pose, camera, rig ? &rig->cameras[camera].lens : nullptr, &detector, &marks));
  }
  return marks;
}

std::vector<std::string> families_of(const std::vector<calib::ScaleBar>& lengths) {
  std::set<std::string> families;
  for (const calib::ScaleBar& known : lengths) {
    if (known.board) continue;
    for (const std::string& name : {known.from, known.to}) {
      if (const auto marker = MarkerName::parse(name)) families.insert(marker->family);
    }
  }
  return {families.begin(), families.end()};
}

Result<std::vector<calib::DetectedMark>> scale_bar_marks(const calib::CaptureSet& captures,
                                                         const Rig& rig,
                                                         const std::vector<calib::ScaleBar>& lengths) {
  std::set<std::string> wanted;
  std::vector<calib::DetectedMark> marks;
  for (const calib::ScaleBar& known : lengths) {
    if (known.board) {
      LIMN_TRY_STATUS(add_board_marks(captures, *known.board, &marks));
      continue;
    }
    for (const std::string& name : {known.from, known.to}) {
      LIMN_TRY([[maybe_unused]] const MarkerName marker, MarkerName::parse(name));
      wanted.insert(name);
    }
  }
  if (wanted.empty()) return marks;
  LIMN_TRY(const auto markers, marks_of(captures, families_of(lengths), &rig));
  for (const calib::DetectedMark& mark : markers) {
    if (wanted.contains(mark.name)) marks.push_back(mark);
  }
  return marks;
}

Result<std::vector<calib::ScaleBar>> scale_bar_lengths(const calib::CaptureSet& captures,
                                                       const std::vector<std::string>& options) {
  std::vector<calib::ScaleBar> lengths;
  for (const std::string& text : captures.scale_bar_lengths) {
    auto known = calib::parse_scale_bar(text);
    if (!known) return error("{}: {}", (captures.folder / "capture.json").string(), known.message());
    lengths.push_back(*known);
  }
  for (const std::string& text : options) {
    auto known = calib::parse_scale_bar(text);
    if (!known) return usage_error("--known-length: {}", known.message());
    lengths.push_back(*known);
  }
  return lengths;
}

}  // namespace limn::wizard
