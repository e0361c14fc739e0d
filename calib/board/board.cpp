#include "calib/board/board.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <numeric>
#include <opencv2/core.hpp>
#include <optional>

#include "calib/board/board_dictionary.h"
#include "core/predefined_family.h"

namespace limn::calib {
namespace {

// Boards without markers, by their names.
const std::map<std::string, BoardKind> k_plain_kinds = {{"chessboard", BoardKind::chessboard},
                                                        {"circles", BoardKind::circles},
                                                        {"acircles", BoardKind::asymmetric_circles}};

constexpr std::string_view k_exact = ":exact";

// Radius of printed circles, as a share of the spacing.
constexpr double k_circle_radius = 0.25, k_shifted_radius = 0.45;

std::vector<std::string> split(const std::string& text, char at) {
  std::vector<std::string> parts(1);
  for (char c : text) {
    if (c == at) {
      parts.emplace_back();
    } else {
      parts.back() += c;
    }
  }
  return parts;
}

// Parses the whole of `text` as a number.
template <class T>
bool read_number(const std::string& text, T* value) {
  const char* end = text.data() + text.size();
  const auto [rest, problem] = std::from_chars(text.data(), end, *value);
  return problem == std::errc() && rest == end;
}

bool read_size(const std::string& text, int* columns, int* rows) {
  const auto parts = split(text, 'x');
  return parts.size() == 2 && read_number(parts[0], columns) && read_number(parts[1], rows);
}

bool read_length(const std::string& text, double* metres) {
  for (const auto& [unit, factor] : {std::pair{"mm", 1e-3}, std::pair{"cm", 1e-2}, std::pair{"m", 1.0}}) {
    const std::string name = unit;
    if (!text.ends_with(name)) continue;
    if (!read_number(text.substr(0, text.size() - name.size()), metres)) return false;
    *metres *= factor;
    return *metres >= 1e-4 && *metres <= 10;  // smaller boards cannot be printed, larger ones do not exist
  }
  return false;
}

int marker_count(const Board& board) { return board.columns * board.rows / 2; }

std::string default_dictionary(int markers) {
  for (int count : {50, 100, 250, 1000}) {
    if (markers <= count) return fmt::format("aruco_4x4_{}", count);
  }
  return {};
}

Status read_charuco_fields(const std::string& text, const std::vector<std::string>& parts, Board* board) {
  const int markers = marker_count(*board);
  board->dictionary = parts.size() > 3 ? parts[3] : default_dictionary(markers);
  if (board->dictionary.empty())
    return error(
        "board '{}': expected at most 1000 markers, the largest dictionary, found {}. Use fewer squares.",
        text, markers);
  if (!find_predefined_family(board->dictionary))
    return error("board '{}': expected a dictionary such as aruco_4x4_50 or aruco_5x5_250, found '{}'.", text,
                 board->dictionary);
  LIMN_TRY(const OpencvDictionary dictionary, dictionary_of(*board));
  if (std::ssize(dictionary.codes) < markers)
    return error("board '{}': needs {} markers, but {} has {}. Use a larger dictionary.", text, markers,
                 board->dictionary, dictionary.codes.size());
  board->marker_share = 0.75;
  if (parts.size() > 4 && (!read_number(parts[4], &board->marker_share) || !(board->marker_share >= 0.4) ||
                           !(board->marker_share <= 0.9)))
    return error("board '{}': expected the marker's share of the square, 0.4 to 0.9, found '{}'.", text,
                 parts[4]);
  return {};
}

bool near_whole(double v) { return std::abs(v - std::round(v)) < 1e-6; }

Status read_aprilgrid_fields(const std::string& text, const std::string& gap, Board* board) {
  constexpr double k_least_gap = 0.05, k_most_gap = 1;
  if (!read_number(gap, &board->gap_share) || !(board->gap_share >= k_least_gap) ||
      !(board->gap_share <= k_most_gap))
    return error("board '{}': expected the gap between tags as share of a tag's side, {} to {}, found '{}'.",
                 text, k_least_gap, k_most_gap, gap);
  const int tags = board->columns * board->rows;
  board->columns = 2 * board->columns + 1;
  board->rows = 2 * board->rows + 1;
  board->dictionary = "apriltag_36h11";
  LIMN_TRY(const OpencvDictionary dictionary, dictionary_of(*board));
  if (std::ssize(dictionary.codes) < tags)
    return error("board '{}': needs {} tags, but {} has {}.", text, tags, board->dictionary,
                 dictionary.codes.size());
  return {};
}

std::string grid_text(const Board& board) {
  const double mm = board.square_m * 1e3;
  for (const auto& [name, plain] : k_plain_kinds)
    if (plain == board.kind)
      return fmt::format("{}:{}x{}:{:.10g}mm", name, board.columns - 1, board.rows - 1, mm);
  if (board.kind == BoardKind::aprilgrid)
    return fmt::format("aprilgrid:{}x{}:{:.10g}mm:{:.10g}", board.columns / 2, board.rows / 2, mm,
                       board.gap_share);
  std::string base = fmt::format("charuco:{}x{}:{:.10g}mm", board.columns, board.rows, mm);
  const bool plain_share = board.marker_share == 0.75;
  if (!plain_share || board.dictionary != default_dictionary(marker_count(board)))
    base += ":" + board.dictionary;
  if (!plain_share) base += fmt::format(":{:.10g}", board.marker_share);
  return base;
}

// Pixels of a square and of a marker's cell: whole cells, equal margins, and if possible a whole number of
// pixels per metre, because a PNG's pHYs is a whole number.
struct PixelGrid {
  int square = 0;
  int cell = 0;
};
PixelGrid pixel_grid(const Board& board, int least) {
  if (board.kind == BoardKind::aprilgrid) {
    const int cells = aprilgrid_tag_cells(board);
    const int first = (least + cells - 1) / cells;
    for (int cell = first; cell < 4 * first; ++cell)
      if (near_whole(cell * cells * board.gap_share)) return {cell * cells, cell};
    return {first * cells, first};  // the gaps are rounded to whole pixels
  }
  if (board.kind != BoardKind::charuco) {
    int square = least;
    while (square < 2 * least && !near_whole(square / board.square_m)) ++square;
    return {square < 2 * least ? square : least, 0};
  }
  const int cells = dictionary_of(board)->cells + 2;
  auto fits = [&](int square) {
    const double cell = square * board.marker_share / cells;
    return near_whole(cell) && (square - cells * std::lround(cell)) % 2 == 0;
  };
  PixelGrid found;
  for (int square = least; square < 4 * least; ++square) {
    if (!fits(square)) continue;
    const PixelGrid grid{square, static_cast<int>(std::lround(square * board.marker_share / cells))};
    if (near_whole(square / board.square_m)) return grid;
    if (found.square == 0) found = grid;
  }
  if (found.square > 0) return found;
  // No whole cells for this share: the nearest ones are used. The corners keep their positions.
  int square = least + least % 2;
  int cell = std::max(1, static_cast<int>(std::lround(square * board.marker_share / cells)));
  if ((square - cells * cell) % 2 != 0) ++square;
  return {square, cell};
}

}  // namespace

std::optional<int> aprilgrid_tag(const Board& board, int column, int row) {
  if (board.kind != BoardKind::aprilgrid || column % 2 == 0 || row % 2 == 0) return std::nullopt;
  return (board.rows / 2 - 1 - row / 2) * (board.columns / 2) + column / 2;
}

int aprilgrid_tag_cells(const Board& board) { return dictionary_of(board)->cells + 2 * k_aprilgrid_border; }

Result<OpencvDictionary> dictionary_of(const Board& board) {
  const PredefinedFamily* family = find_predefined_family(board.dictionary);
  LIMN_CHECK(family != nullptr);
  return opencv_dictionary(family->opencv_dictionary);
}

Result<Board> Board::parse(const std::string& text) {
  if (text.ends_with(k_exact)) {
    LIMN_TRY(Board board, parse(text.substr(0, text.size() - k_exact.size())));
    board.is_exact = true;
    return board;
  }
  constexpr auto k_forms =
      "charuco:11x8:25mm, charuco:11x8:25mm:aruco_5x5_100:0.7, chessboard:9x7:75mm, aprilgrid:6x6:88mm:0.3, "
      "circles:11x7:20mm or acircles:4x11:20mm";
  const auto parts = split(text, ':');
  Board board;
  const bool charuco = parts[0] == "charuco", aprilgrid = parts[0] == "aprilgrid";
  const auto plain = k_plain_kinds.find(parts[0]);
  if (!charuco && !aprilgrid && plain == k_plain_kinds.end())
    return error("board '{}': expected {}.", text, k_forms);
  const std::size_t most_parts = charuco ? 5 : aprilgrid ? 4 : 3;
  if (parts.size() < (aprilgrid ? 4 : 3) || parts.size() > most_parts)
    return error("board '{}': expected {}.", text, k_forms);
  board.kind = charuco ? BoardKind::charuco : aprilgrid ? BoardKind::aprilgrid : plain->second;
  const int least = charuco ? 3 : aprilgrid ? 1 : 2;
  if (!read_size(parts[1], &board.columns, &board.rows) || board.columns < least || board.rows < least ||
      board.columns > 100 || board.rows > 100)
    return error("board '{}': expected {}, such as 11x8, found '{}'.", text,
                 charuco              ? "the number of squares (3 to 100)"
                 : aprilgrid          ? "the number of tags (1 to 100)"
                 : board.is_circles() ? "the number of circles (2 to 100)"
                                      : "the number of inner corners (2 to 100)",
                 parts[1]);
  if (!read_length(parts[2], &board.square_m))
    return error(
        "board '{}': expected the square's side with its unit (mm, cm or m), 0.1mm to 10m, such as 25mm, "
        "found '{}'.",
        text, parts[2]);
  if (aprilgrid) {
    LIMN_TRY_STATUS(read_aprilgrid_fields(text, parts[3], &board));
    return board;
  }
  if (!charuco) {
    ++board.columns;
    ++board.rows;
    return board;
  }
  LIMN_TRY_STATUS(read_charuco_fields(text, parts, &board));
  return board;
}

std::string Board::text() const { return grid_text(*this) + (is_exact ? std::string(k_exact) : ""); }

Eigen::Vector3d Board::p_corner(int id) const {
  const int column = id % (columns - 1), row = id / (columns - 1);
  const int across = is_shifted() ? 2 * column + row % 2 : column;
  return {p_line(across + 1), p_line(row + 1), 0};
}

bool Board::is_ambiguous() const {
  if (kind == BoardKind::chessboard) return (columns + rows) % 2 == 0;
  return kind == BoardKind::circles || (is_shifted() && (rows - 1) % 2 == 0);
}

namespace {

// Draws an AprilGrid's tag into its black square. OpenCV's table is turned by 180 degrees against AprilTag's.
void draw_tag(const Board& board, int id, int cell_px, cv::Mat square) {
  const OpencvDictionary dictionary = dictionary_of(board).value();
  cv::Mat tag = opencv_marker_image(dictionary, id, (dictionary.cells + 2) * cell_px);
  cv::rotate(tag, tag, cv::ROTATE_180);
  const int border = (square.cols - tag.cols) / 2;
  tag.copyTo(square(cv::Rect(border, border, tag.cols, tag.rows)));
}

// Draws the circles; pixels on an edge are as dark as their share of the circle.
void draw_circles(const Board& board, BoardSheet* sheet) {
  const double radius = board.square_m * (board.is_shifted() ? k_shifted_radius : k_circle_radius);
  const double radius_px = radius * sheet->pixels_per_metre;
  for (int id = 0; id < board.corner_count(); ++id) {
    const Eigen::Vector2d px =
        sheet->px_board_origin + sheet->pixels_per_metre * board.p_corner(id).head<2>();
    const int reach = static_cast<int>(radius_px) + 2;
    const int x0 = static_cast<int>(px.x()), y0 = static_cast<int>(px.y());
    for (int y = y0 - reach; y <= y0 + reach; ++y) {
      for (int x = x0 - reach; x <= x0 + reach; ++x) {
        const double share = std::clamp(radius_px - (Eigen::Vector2d(x, y) - px).norm() + 0.5, 0.0, 1.0);
        if (share > 0) sheet->image.at<uchar>(y, x) = static_cast<uchar>(std::lround(255 * (1 - share)));
      }
    }
  }
}

}  // namespace

BoardSheet draw_board(const Board& board, const DrawOptions& options) {
  const PixelGrid grid = pixel_grid(board, std::max(options.square_px, 8));
  const int margin = options.margin_px >= 0 ? options.margin_px : grid.square;
  BoardSheet sheet;
  sheet.pixels_per_metre = grid.square / board.square_m;
  sheet.px_board_origin = Eigen::Vector2d::Constant(margin - 0.5);
  const auto px = [&](int line) {
    return static_cast<int>(std::lround(sheet.pixels_per_metre * board.p_line(line)));
  };
  const int across = board.is_shifted() ? 2 * board.columns - 1 : board.columns;
  sheet.image = cv::Mat(2 * margin + px(board.rows), 2 * margin + px(across), CV_8U, cv::Scalar(255));
  if (board.is_circles()) {
    draw_circles(board, &sheet);
    return sheet;
  }
  std::optional<OpencvDictionary> dictionary;
  if (board.kind == BoardKind::charuco) dictionary = dictionary_of(board).value();
  int id = 0;
  for (int row = 0; row < board.rows; ++row) {
    for (int column = 0; column < board.columns; ++column) {
      cv::Mat square = sheet.image(cv::Rect(margin + px(column), margin + px(row),
                                            px(column + 1) - px(column), px(row + 1) - px(row)));
      if (board.is_black(column, row)) {
        square.setTo(0);
        if (const auto tag = aprilgrid_tag(board, column, row)) draw_tag(board, *tag, grid.cell, square);
      } else if (dictionary) {
        const int side = grid.cell * (dictionary->cells + 2), gap = (grid.square - side) / 2;
        opencv_marker_image(*dictionary, id++, side).copyTo(square(cv::Rect(gap, gap, side, side)));
      }
    }
  }
  return sheet;
}

}  // namespace limn::calib
