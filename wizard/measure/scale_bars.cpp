#include "wizard/measure/scale_bars.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <set>
#include <utility>

#include "calib/board/board_finder.h"
#include "calib/code/decode.h"
#include "core/marker.h"
#include "tracker/detector.h"

namespace limn::wizard {
namespace {

calib::DetectedMark mark_of(const tracker::Detection& detection) {
  calib::DetectedMark mark{.name = detection.marker.text(), .corners_px = detection.corners_px};
  double variance = 0;
  for (const Eigen::Matrix2d& covariance : detection.corner_covariance) variance += covariance.trace() / 8;
  mark.stddev_px = std::sqrt(variance);
  return mark;
}

// The quadrilateral of the board's outermost corners; none unless all four are seen.
std::optional<calib::DetectedMark> mark_of(const calib::Board& board, const cv::Mat& grey) {
  const std::vector<calib::BoardCorner> seen = calib::find_board(board, grey);
  const int last = board.corner_count() - 1, across = board.columns - 2;
  calib::DetectedMark mark{.name = board.text(), .corners_px = {}, .stddev_px = 0};
  const std::array ids{0, across, last, last - across};  // in order around the board
  for (size_t i = 0; i < 4; ++i) {
    const auto corner = std::ranges::find(seen, ids[i], &calib::BoardCorner::id);
    if (corner == seen.end()) return std::nullopt;
    mark.corners_px[i] = corner->px;
    mark.stddev_px = std::max(mark.stddev_px, corner->stddev_px);
  }
  return mark;
}

// Finds the marks of known lengths in images.
class MarkFinder {
 public:
  static Result<MarkFinder> make(const calib::CaptureSet& captures,
                                 const std::vector<calib::ScaleBar>& lengths) {
    MarkFinder finder;
    std::set<std::string> families;
    for (const calib::ScaleBar& known : lengths) {
      if (known.board) {
        if (have_same_marks(*known.board, captures.board))
          return usage_error(
              "known length '{}': expected a board that differs from {}, found the same kind of board. Use "
              "another dictionary, or another number of corners.",
              known.from, captures.board.text());
        finder.boards_.push_back(*known.board);
        continue;
      }
      for (const std::string& name : {known.from, known.to}) {
        LIMN_TRY(const MarkerName marker, MarkerName::parse(name));
        finder.wanted_.insert(name);
        families.insert(marker.family);
      }
    }
    if (families.empty()) return finder;
    const std::vector<std::string> names(families.begin(), families.end());
    LIMN_TRY(tracker::Families loaded, tracker::Families::load(names, captures.folder));
    finder.detector_.emplace(std::move(loaded));
    return finder;
  }

  // Without the marks' camera and pose.
  std::vector<calib::DetectedMark> find(const cv::Mat& grey, const Lens& lens) {
    std::vector<calib::DetectedMark> marks;
    for (const calib::Board& board : boards_) {
      if (auto mark = mark_of(board, grey)) marks.push_back(std::move(*mark));
    }
    if (!detector_) return marks;
    for (const tracker::Detection& detection : detector_->detect(grey, &lens)) {
      if (wanted_.contains(detection.marker.text())) marks.push_back(mark_of(detection));
    }
    return marks;
  }

 private:
  static bool have_same_marks(const calib::Board& a, const calib::Board& b) {
    const bool has_markers = a.kind == calib::BoardKind::charuco || a.kind == calib::BoardKind::aprilgrid;
    if (a.kind != b.kind) return false;
    return has_markers ? a.dictionary == b.dictionary : a.columns == b.columns && a.rows == b.rows;
  }

  std::set<std::string> wanted_;
  std::vector<calib::Board> boards_;
  std::optional<tracker::Detector> detector_;
};

}  // namespace

Result<std::vector<calib::DetectedMark>> scale_bar_marks(const calib::CaptureSet& captures,
                                                         const Rig& rig,
                                                         const std::vector<calib::ScaleBar>& lengths) {
  LIMN_TRY(MarkFinder finder, MarkFinder::make(captures, lengths));
  std::vector<calib::DetectedMark> marks;
  for (size_t pose = 0; pose < captures.poses.size(); ++pose) {
    for (size_t camera = 0; camera < captures.cameras.size(); ++camera) {
      std::set<std::string> found;
      for (size_t projector = 0; projector < captures.projectors.size(); ++projector) {
        const auto& files = captures.poses[pose].images[projector][camera];
        const calib::CapturedDevice& device = captures.cameras[camera];
        LIMN_TRY(const cv::Mat white,
                 calib::read_shot(files[static_cast<size_t>(captures.patterns[projector].white())],
                                  device.width, device.height));
        for (calib::DetectedMark& mark : finder.find(white, rig.cameras[camera].lens)) {
          mark.camera = static_cast<int>(camera);
          mark.pose = static_cast<int>(pose);
          if (found.insert(mark.name).second) marks.push_back(std::move(mark));
        }
      }
    }
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
