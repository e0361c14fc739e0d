#include "exchange/printing/marker_sheet.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <memory>
#include <opencv2/core.hpp>
#include <vector>

#include "calib/board/board.h"
#include "core/file.h"
#include "core/image_io.h"
#include "exchange/printing/page_drawing.h"
#include "tracker/family.h"

namespace limn::exchange {
namespace {

constexpr double k_page_width = 210, k_page_height = 297;  // mm, A4
constexpr double k_edge = 10;                              // mm that printers leave white at the edges
constexpr double k_foot = 16;                              // mm at the bottom, for the bar
constexpr double k_label = 6;                              // mm below a marker, for its name
constexpr double k_bar = 100;                              // mm

Status write_sheet(PageDrawing& sheet, const std::filesystem::path& path) {
  const auto bytes = sheet.finish();
  if (!bytes) return error("{}: cannot draw the sheet: {}", path.string(), bytes.message());
  return write_file(path, *bytes);
}

PageFormat format_of(const std::filesystem::path& path) {
  return path.extension() == ".svg" ? PageFormat::svg : PageFormat::pdf;
}

// Draws an image as vectors: all pixels of a grey level are rectangles of one path.
void draw_cells(PageDrawing& page, const cv::Mat& image, double x_mm, double y_mm, double mm_per_pixel) {
  std::map<std::uint8_t, std::vector<cv::Rect2d>> levels;
  for (int y = 0; y < image.rows;) {
    int below = y + 1;
    while (below < image.rows && std::equal(image.ptr(y), image.ptr(y) + image.cols, image.ptr(below)))
      ++below;
    for (int x = 0; x < image.cols;) {
      const std::uint8_t level = image.at<std::uint8_t>(y, x);
      int right = x + 1;
      while (right < image.cols && image.at<std::uint8_t>(y, right) == level) ++right;
      if (level != 255)
        levels[level].emplace_back(x_mm + x * mm_per_pixel, y_mm + y * mm_per_pixel,
                                   (right - x) * mm_per_pixel, (below - y) * mm_per_pixel);
      x = right;
    }
    y = below;
  }
  for (const auto& [level, rectangles] : levels) page.fill(rectangles, level / 255.0);
}

void draw_bar(PageDrawing& page, double x_mm, double y_mm) {
  std::vector<PageDrawing::Points> lines = {{{x_mm, y_mm}, {x_mm + k_bar, y_mm}}};
  for (int i = 0; i <= 10; ++i) {
    const double tick = i % 5 == 0 ? 3 : 1.5, x = x_mm + i * k_bar / 10;
    lines.push_back({{x, y_mm - tick}, {x, y_mm}});
  }
  page.stroke(lines, 0.25, 0);
  page.write("100 mm: measure it; print at 100 %, not \"fit to page\"", {x_mm, y_mm + 4}, 3, 150);
}

struct Grid {
  double margin, pitch_x, pitch_y;
  int columns, rows;
};

// `square_share`: the marker's square / the whole marker.
Result<Grid> grid_for(double size_mm, double square_share) {
  Grid grid{};
  grid.margin = margin_mm(size_mm);
  grid.pitch_x = size_mm / square_share + 2 * grid.margin;
  grid.pitch_y = grid.pitch_x + k_label;
  grid.columns = static_cast<int>((k_page_width - 2 * k_edge) / grid.pitch_x);
  grid.rows = static_cast<int>((k_page_height - 2 * k_edge - k_foot) / grid.pitch_y);
  if (grid.columns < 1 || grid.rows < 1)
    return error("--size-mm: expected at most {:.0f} mm, the largest marker on A4, found {}.",
                 std::floor((k_page_width - 2 * k_edge) / (1 / square_share + 0.25)), size_mm);
  return grid;
}

// Draws the frame to cut along with its mark at the top left, the marker, and its name.
void draw_marker_cell(PageDrawing& page,
                      const cv::Mat& cells,
                      const std::string& label,
                      double x,
                      double y,
                      double size,
                      double margin) {
  const double side = size + 2 * margin;
  page.stroke(cv::Rect2d(x, y, side, side), 0.1, 0.75);
  const double mark = std::min(2.0, 0.5 * margin);  // a triangle in the frame's top-left corner
  page.fill({{x, y}, {x + mark, y}, {x, y + mark}}, 0.35);
  draw_cells(page, cells, x + margin, y + margin, size / cells.cols);
  page.write(label, {x, y + side + 3.6}, 3, side);
}

Result<std::vector<std::string>> parse_ids(const std::string& text) {
  std::vector<std::string> ids;
  const char* at = text.data();
  const char* end = at + text.size();
  while (at < end) {
    int from = 0;
    auto read = std::from_chars(at, end, from);
    int to = from;
    if (read.ec == std::errc{} && read.ptr < end && *read.ptr == '-') {
      read = std::from_chars(read.ptr + 1, end, to);
    }
    const bool ends = read.ptr == end || *read.ptr == ',';
    if (read.ec != std::errc{} || !ends || from < 0 || to < from || to - from > 10000)
      return usage_error("--ids: expected numbers and ranges such as 0-11,15, found '{}'.", text);
    for (int id = from; id <= to; ++id) ids.push_back(std::to_string(id));
    at = read.ptr == end ? end : read.ptr + 1;
  }
  if (ids.empty()) return usage_error("--ids: expected numbers and ranges such as 0-11,15, found none.");
  return ids;
}

struct Drawing {
  std::string label;
  MarkerDrawing marker;
};

Result<std::vector<Drawing>> drawings_of(const MarkerSheetOptions& options) {
  std::vector<MarkerName> names;
  if (options.family.starts_with("artoolkit:") || options.family.starts_with("artoolkit_inverted:")) {
    const std::size_t colon = options.family.find(':');
    names.push_back({options.family.substr(0, colon), options.family.substr(colon + 1)});
  } else {
    LIMN_TRY(const std::vector<std::string> ids, parse_ids(options.ids));
    for (const std::string& id : ids) names.push_back({options.family, id});
  }
  std::vector<Drawing> drawings;
  for (const MarkerName& name : names) {
    auto marker = tracker::draw_whole_marker(name, 1);
    if (!marker) return usage_error("limn markers: {}", marker.message());
    const std::string square = marker->around_px > 0 ? " (the white square)" : "";
    const std::string label = fmt::format("{}   {:g} mm{}", name.text(), options.size_mm, square);
    drawings.push_back({label, std::move(*marker)});
  }
  return drawings;
}

std::filesystem::path page_path(const std::filesystem::path& out, int page) {
  if (page == 0) return out;
  return out.parent_path() / fmt::format("{}-{}{}", out.stem().string(), page + 1, out.extension().string());
}

}  // namespace

// An eighth of the side, which is at least one cell for every family with white paper next to its square.
double margin_mm(double size_mm) { return std::max(3.0, size_mm / 8); }

Result<double> around_mm(const MarkerSheetOptions& options) {
  LIMN_TRY(const std::vector<Drawing> drawings, drawings_of(options));
  return 0.5 * options.size_mm * (1 / drawings.front().marker.square_share() - 1);
}

Result<MarkerSheet> write_marker_sheet(const MarkerSheetOptions& options) {
  const PageFormat format = format_of(options.out);
  const cv::Size2d page_size(k_page_width, k_page_height);
  if (!std::isfinite(options.size_mm) || options.size_mm < 3)
    return usage_error("--size-mm: expected at least 3, found {}.", options.size_mm);
  LIMN_TRY(const std::vector<Drawing> drawings, drawings_of(options));
  const double square_share = drawings.front().marker.square_share();
  const auto fitted = grid_for(options.size_mm, square_share);
  if (!fitted) return usage_error("{}", fitted.message());
  const Grid& grid = *fitted;
  const int per_page = grid.columns * grid.rows;
  const int count = static_cast<int>(drawings.size());
  const int pages = (count + per_page - 1) / per_page;
  LIMN_TRY(std::unique_ptr<PageDrawing> sheet, make_page_drawing(format, page_size));
  for (int page = 0; page < pages; ++page) {
    draw_bar(*sheet, k_edge, k_page_height - k_edge - 5);
    for (int i = page * per_page; i < std::min(count, (page + 1) * per_page); ++i) {
      const int place = i - page * per_page;
      const Drawing& drawing = drawings[static_cast<std::size_t>(i)];
      draw_marker_cell(
          *sheet, drawing.marker.image, drawing.label, k_edge + place % grid.columns * grid.pitch_x,
          k_edge + place / grid.columns * grid.pitch_y, options.size_mm / square_share, grid.margin);
    }
    if (page + 1 == pages) break;
    if (format == PageFormat::svg) {
      LIMN_TRY_STATUS(write_sheet(*sheet, page_path(options.out, page)));
      LIMN_TRY(sheet, make_page_drawing(format, page_size));
    } else {
      sheet->add_page();
    }
  }
  LIMN_TRY_STATUS(
      write_sheet(*sheet, format == PageFormat::svg ? page_path(options.out, pages - 1) : options.out));
  return MarkerSheet{count, pages};
}

Result<std::string> write_board_sheet(const std::string& text, const std::filesystem::path& out) {
  const std::string extension = out.extension().string();
  const auto board = calib::Board::parse(text);
  if (!board) return usage_error("--board: {}", board.message());
  const calib::BoardSheet drawing = calib::draw_board(*board);
  if (extension == ".png") LIMN_TRY_STATUS(write_png(out, drawing.image, {9, drawing.pixels_per_metre}));
  if (extension != ".png") {
    const double mm_per_pixel = 1000 / drawing.pixels_per_metre;
    const double width = drawing.image.cols * mm_per_pixel;
    const double height = drawing.image.rows * mm_per_pixel;
    const double page_width = std::max(width, k_bar + 2 * k_edge);
    LIMN_TRY(const std::unique_ptr<PageDrawing> sheet,
             make_page_drawing(format_of(out), {page_width, height + k_foot}));
    draw_cells(*sheet, drawing.image, 0.5 * (page_width - width), 0, mm_per_pixel);
    draw_bar(*sheet, k_edge, height + 5);
    sheet->write(board->text(), {k_edge, height + 13}, 3, page_width - 2 * k_edge);
    LIMN_TRY_STATUS(write_sheet(*sheet, out));
  }
  return board->text();
}

}  // namespace limn::exchange
