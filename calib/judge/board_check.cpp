#include "calib/judge/board_check.h"

#include <algorithm>
#include <array>
#include <map>
#include <opencv2/calib3d.hpp>

#include "calib/code/decode.h"
#include "core/log.h"
#include "core/opencv_markers.h"
#include "core/predefined_family.h"

namespace limn::calib {
namespace {

constexpr int k_least_markers = 6;  // fewer markers fit many boards
constexpr double k_near = 0.4;      // in squares; lens distortion over the board stays below
constexpr double k_most_fit = 0.8;  // share of the markers that the right dictionary explains
// Share of the corners; a board with so many detected is the described one.
constexpr double k_described = 0.5;
constexpr int k_widest = 30;  // in squares
constexpr int k_images = 4;   // number of images to search, a second each

struct Marker {
  int id = 0;
  cv::Point2f px;  // its centre
};

std::vector<Marker> markers_of(const cv::Mat& grey, const OpencvDictionary& dictionary) {
  const auto [quads, ids] = find_opencv_markers(grey, dictionary);
  std::vector<Marker> markers;
  for (size_t i = 0; i < ids.size(); ++i)
    markers.push_back({ids[i], (quads[i][0] + quads[i][1] + quads[i][2] + quads[i][3]) / 4});
  return markers;
}

// Row and column of each marker on a board `columns` wide, ids counted row by row over its white squares.
cv::Point2f square_of(int id, int columns, bool white_first) {
  int row = 0;
  for (int left = id;; ++row) {
    const int skipped = (row % 2 == 0) == white_first ? 0 : 1;  // skip to the row's first white square
    const int in_row = (columns - skipped + 1) / 2;
    if (left < in_row) return {static_cast<float>(skipped + 2 * left), static_cast<float>(row)};
    left -= in_row;
  }
}

// Number of markers that a flat board of that layout explains.
int explained(const std::vector<Marker>& markers, int columns, bool white_first, int* rows) {
  std::vector<cv::Point2f> px, squares;
  for (const Marker& marker : markers) {
    px.push_back(marker.px);
    squares.push_back(square_of(marker.id, columns, white_first));
  }
  cv::Mat good;
  if (cv::findHomography(px, squares, cv::RANSAC, k_near, good).empty()) return 0;
  *rows = 0;
  for (size_t i = 0; i < squares.size(); ++i) {
    if (good.at<uchar>(static_cast<int>(i)) != 0) *rows = std::max(*rows, static_cast<int>(squares[i].y) + 1);
  }
  return *rows >= 3 ? cv::countNonZero(good) : 0;  // a row or two fit any width
}

std::optional<DetectedBoard> identify_charuco(const cv::Mat& grey) {
  DetectedBoard best;
  for (const PredefinedFamily& family : predefined_families()) {
    const auto dictionary = opencv_dictionary(family.opencv_dictionary);
    if (!dictionary) return std::nullopt;
    const std::vector<Marker> markers = markers_of(grey, *dictionary);
    if (static_cast<int>(markers.size()) < k_least_markers) continue;
    for (int columns = 3; columns <= k_widest; ++columns) {
      for (const bool white_first : {false, true}) {
        int rows = 0;
        const int fit = explained(markers, columns, white_first, &rows);
        if (fit <= best.markers || fit < k_most_fit * static_cast<double>(markers.size())) continue;
        best = {BoardKind::charuco, columns, rows, std::string(family.name), fit, white_first};
      }
    }
  }
  if (best.markers < k_least_markers) return std::nullopt;
  return best;
}

std::optional<DetectedBoard> identify_chessboard(const cv::Mat& grey) {
  cv::Mat corners, found;
  try {
    if (!cv::findChessboardCornersSB(grey, {3, 3}, corners,
                                     cv::CALIB_CB_LARGER | cv::CALIB_CB_NORMALIZE_IMAGE, found))
      return std::nullopt;
  } catch (const cv::Exception&) {
    return std::nullopt;
  }
  return DetectedBoard{BoardKind::chessboard, found.cols + 1, found.rows + 1, "", 0, false};
}

// aruco_5x5_50 is the beginning of aruco_5x5_100: a marker of the first is a marker of the second.
std::string table_of(const std::string& dictionary) {
  return dictionary.starts_with("aruco_") ? dictionary.substr(0, dictionary.rfind('_')) : dictionary;
}

bool agrees(const Board& board, const DetectedBoard& seen) {
  if (board.kind != seen.kind) return false;
  if (board.kind == BoardKind::charuco)
    return !seen.white_first && board.columns == seen.columns &&
           table_of(board.dictionary) == table_of(seen.dictionary);
  const bool as_is = board.columns == seen.columns && board.rows == seen.rows;
  return as_is || (board.columns == seen.rows && board.rows == seen.columns);  // it may lie on its side
}

// The largest share of the board's corners in one image.
double best_view(const Board& board, const Observations& observations) {
  std::map<std::pair<int, int>, int> corners;
  int most = 0;
  for (const CornerObservation& seen : observations.corners)
    most = std::max(most, ++corners[{seen.camera, seen.pose}]);
  return static_cast<double>(most) / board.corner_count();
}

}  // namespace

std::string DetectedBoard::description() const {
  if (kind == BoardKind::chessboard)
    return fmt::format("a chessboard of {}x{} inner corners", columns - 1, rows - 1);
  return fmt::format("a charuco board {} squares across and at least {} down with markers of {}{}", columns,
                     rows, dictionary,
                     white_first ? ", whose top-left square is white (Limn prints it black)" : "");
}

std::optional<DetectedBoard> identify_board(const cv::Mat& grey) {
  if (auto charuco = identify_charuco(grey)) return charuco;
  return identify_chessboard(grey);
}

Status check_board(const CaptureSet& captures, const Observations& observations) {
  if (best_view(captures.board, observations) >= k_described) return {};
  log_info("the described board is hardly visible; searching for another board (takes seconds)");
  int images = 0;
  for (size_t pose = 0; pose < captures.poses.size(); ++pose) {
    for (size_t camera = 0; camera < captures.cameras.size(); ++camera) {
      for (size_t projector = 0; projector < captures.projectors.size(); ++projector) {
        if (++images > k_images) return {};
        const auto& files = captures.poses[pose].images[projector][camera];
        const auto& file = files[static_cast<size_t>(captures.patterns[projector].white())];
        const CapturedDevice& device = captures.cameras[camera];
        LIMN_TRY(const cv::Mat white, read_shot(file, device.width, device.height));
        const auto seen = identify_board(white);
        if (!seen || agrees(captures.board, *seen)) continue;
        return error(
            "board: expected {}, but {} shows {}. Describe the board that was captured (\"board\" in "
            "capture.json, or --board).",
            captures.board.text(), file.string(), seen->description());
      }
    }
  }
  return {};
}

}  // namespace limn::calib
