#include <cairo-pdf.h>
#include <cairo-svg.h>

#include <memory>

#include "core/program_library.h"
#include "exchange/printing/page_drawing.h"

namespace limn::exchange {
namespace {

constexpr double k_points_per_mm = 72 / 25.4;

class CairoDrawing : public PageDrawing {
 public:
  CairoDrawing(PageFormat format, cv::Size2d size_mm) {
    const double width = size_mm.width * k_points_per_mm, height = size_mm.height * k_points_per_mm;
    surface_.reset(format == PageFormat::svg
                       ? cairo_svg_surface_create_for_stream(append, &bytes_, width, height)
                       : cairo_pdf_surface_create_for_stream(append, &bytes_, width, height));
    cairo_.reset(cairo_create(surface_.get()));
    cairo_scale(cairo_.get(), k_points_per_mm, k_points_per_mm);
  }

  void fill(const std::vector<cv::Rect2d>& rectangles, double grey) override {
    for (const cv::Rect2d& r : rectangles) cairo_rectangle(cairo_.get(), r.x, r.y, r.width, r.height);
    set_grey(grey);
    cairo_fill(cairo_.get());
  }
  void fill(const Points& polygon, double grey) override {
    add_path(polygon);
    cairo_close_path(cairo_.get());
    set_grey(grey);
    cairo_fill(cairo_.get());
  }
  void stroke(const std::vector<Points>& lines, double width, double grey) override {
    for (const Points& line : lines) add_path(line);
    stroke_path(width, grey);
  }
  void stroke(const cv::Rect2d& r, double width, double grey) override {
    cairo_rectangle(cairo_.get(), r.x, r.y, r.width, r.height);
    stroke_path(width, grey);
  }
  void write(const std::string& text, cv::Point2d at, double height, double room) override {
    cairo_select_font_face(cairo_.get(), "sans-serif", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
    cairo_set_font_size(cairo_.get(), height);
    cairo_text_extents_t extents;
    cairo_text_extents(cairo_.get(), text.c_str(), &extents);
    if (extents.x_advance > room) cairo_set_font_size(cairo_.get(), height * room / extents.x_advance);
    set_grey(0);
    cairo_move_to(cairo_.get(), at.x, at.y);
    cairo_show_text(cairo_.get(), text.c_str());
  }
  void add_page() override { cairo_show_page(cairo_.get()); }
  Result<std::string> finish() override {
    cairo_show_page(cairo_.get());
    cairo_surface_finish(surface_.get());
    const cairo_status_t status = cairo_surface_status(surface_.get());
    if (status != CAIRO_STATUS_SUCCESS) return error("{}", cairo_status_to_string(status));
    return std::move(bytes_);
  }

 private:
  static cairo_status_t append(void* bytes, const unsigned char* data, unsigned int length) {
    static_cast<std::string*>(bytes)->append(reinterpret_cast<const char*>(data), length);
    return CAIRO_STATUS_SUCCESS;
  }
  void set_grey(double level) { cairo_set_source_rgb(cairo_.get(), level, level, level); }
  void add_path(const Points& points) {
    cairo_new_sub_path(cairo_.get());
    for (const cv::Point2d& p : points) cairo_line_to(cairo_.get(), p.x, p.y);
  }
  void stroke_path(double width, double grey) {
    set_grey(grey);
    cairo_set_line_width(cairo_.get(), width);
    cairo_stroke(cairo_.get());
  }

  struct Destroy {
    void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
    void operator()(cairo_t* cairo) const { cairo_destroy(cairo); }
  };
  std::string bytes_;
  std::unique_ptr<cairo_surface_t, Destroy> surface_;
  std::unique_ptr<cairo_t, Destroy> cairo_;
};

}  // namespace
}  // namespace limn::exchange

LIMN_LIBRARY_VERSION(LIMN_VERSION)

extern "C" __attribute__((visibility("default"))) limn::exchange::PageDrawing* limn_make_page_drawing(
    limn::exchange::PageFormat format, cv::Size2d size_mm) {
  return new limn::exchange::CairoDrawing(format, size_mm);
}
