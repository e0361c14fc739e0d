#include "apps/markers.h"

#include <fmt/format.h>

#include <string>

#include "core/print.h"
#include "exchange/printing/marker_mount.h"
#include "exchange/printing/marker_sheet.h"
#include "exchange/printing/marker_templates.h"

namespace limn::apps {

Status run_markers(const MarkersOptions& options) {
  if (!options.compare.empty()) return exchange::compare_templates(options.compare, options.json);
  if (!options.train.empty())
    return exchange::train_template(options.train, options.pattern_ratio, options.out);
  const exchange::MarkerSheetOptions sheet_options{options.family, options.ids, options.size_mm, options.out};
  if (!options.mount.empty()) {
    if (!options.board.empty())
      return usage_error("--mount: expected a marker, found --board with it. Leave --board out.");
    LIMN_TRY(const double around_mm, exchange::around_mm(sheet_options));
    if (around_mm > 0)
      return usage_error(
          "--mount: expected a family whose markers end at their square, found {}: the holder's guides would "
          "cover the cells around it.",
          options.family);
    LIMN_TRY_STATUS(exchange::run_mount(
        {options.size_mm, exchange::margin_mm(options.size_mm), options.paper_mm, options.mount}));
    if (options.out.empty()) return {};
  }
  const std::string extension = options.out.extension().string();
  const bool for_board = !options.board.empty();
  if (extension != ".pdf" && extension != ".svg" && !(for_board && extension == ".png"))
    return usage_error("--out: expected a file that ends in .pdf or .svg (or .png for a board), found '{}'.",
                       options.out.string());
  if (for_board) {
    LIMN_TRY(const std::string board, exchange::write_board_sheet(options.board, options.out));
    print_out("{} in {}\n", board, options.out.string());
    return {};
  }
  LIMN_TRY(const exchange::MarkerSheet sheet, exchange::write_marker_sheet(sheet_options));
  print_out("{} markers on {} page{} in {}\n", sheet.markers, sheet.pages, sheet.pages == 1 ? "" : "s",
            options.out.string());
  return {};
}

}  // namespace limn::apps
