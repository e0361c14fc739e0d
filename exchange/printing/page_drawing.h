#pragma once

#include <memory>
#include <opencv2/core/types.hpp>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn::exchange {

/// Draws pages of vectors with cairo. Lengths are in millimetres, the origin is at the top left; a grey is
/// from 0 (black) to 1. The implementation is in a shared library of its own (exchange/printing/cairo/),
/// because cairo and what it needs would lengthen every start of the program.
class PageDrawing {
 public:
  using Points = std::vector<cv::Point2d>;

  virtual ~PageDrawing() = default;

  /// Fills rectangles as one path, so that there are no seams between neighbours.
  virtual void fill(const std::vector<cv::Rect2d>& rectangles, double grey) = 0;
  virtual void fill(const Points& polygon, double grey) = 0;
  /// Draws open lines.
  virtual void stroke(const std::vector<Points>& lines, double width, double grey) = 0;
  virtual void stroke(const cv::Rect2d& rectangle, double width, double grey) = 0;
  /// Writes a black text with its foot line at `at`, of that height, or smaller so that it is at most `room`
  /// wide.
  virtual void write(const std::string& text, cv::Point2d at, double height, double room) = 0;
  /// Ends the page and begins another one. An SVG has only one.
  virtual void add_page() = 0;
  /// Ends the drawing and returns the file's content. Error: cairo's.
  virtual Result<std::string> finish() = 0;
};

enum class PageFormat { pdf, svg };

/// Error: the shared library is not there, or a library that it needs is not installed.
Result<std::unique_ptr<PageDrawing>> make_page_drawing(PageFormat format, cv::Size2d size_mm);

}  // namespace limn::exchange
