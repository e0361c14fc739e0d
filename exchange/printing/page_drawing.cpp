#include "exchange/printing/page_drawing.h"

#include "core/program_library.h"

namespace limn::exchange {

Result<std::unique_ptr<PageDrawing>> make_page_drawing(PageFormat format, cv::Size2d size_mm) {
  LIMN_TRY(void* function, library_function({.file = "liblimn_printing.so",
                                             .variable = "LIMN_PRINTING",
                                             .purpose = "the drawing of sheets to print",
                                             .build_package = "libcairo2-dev"},
                                            "limn_make_page_drawing"));
  return std::unique_ptr<PageDrawing>(
      reinterpret_cast<PageDrawing* (*)(PageFormat, cv::Size2d)>(function)(format, size_mm));
}

}  // namespace limn::exchange
