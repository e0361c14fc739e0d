#include "exchange/line_report.h"

#include <nlohmann/json.hpp>

#include "core/json_text.h"
#include "core/print.h"
#include "core/utf8.h"

namespace limn::exchange {
namespace {

using nlohmann::ordered_json;

double length_m(const NamedCurve& curve) {
  double length = 0;
  for (std::size_t i = 1; i < curve.points.size(); ++i)
    length += (curve.points[i] - curve.points[i - 1]).norm();
  if (curve.is_closed) length += (curve.points.front() - curve.points.back()).norm();
  return length;
}

}  // namespace

void print_lines(const std::vector<LineRow>& lines, const std::filesystem::path& file, bool is_json) {
  ordered_json report = {
      {"schema", "limn.lines/1"}, {"file", as_utf8(file.string())}, {"lines", ordered_json::array()}};
  for (const LineRow& line : lines) {
    std::size_t points = 0;
    double length = 0;
    for (const NamedCurve& curve : line.curves) {
      points += curve.points.size();
      length += length_m(curve);
    }
    report["lines"].push_back({{"name", line.name},
                               {"from", line.from},
                               {"curves", line.curves.size()},
                               {"points", points},
                               {"length_mm", 1e3 * length}});
    if (!is_json)
      print_out("{} ({}): {} curve{}, {} points, {:.1f} mm\n", line.name, line.from, line.curves.size(),
                line.curves.size() == 1 ? "" : "s", points, 1e3 * length);
  }
  if (is_json)
    print_out("{}\n", json_text(report, 2));
  else
    print_out("wrote {}\n", file.string());
}

}  // namespace limn::exchange
