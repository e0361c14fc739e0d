#include "scene/lines/line_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

#include "core/file.h"
#include "core/log.h"
#include "exchange/curves/csv_curves.h"
#include "exchange/curves/curve_list.h"
#include "exchange/curves/dxf_curves.h"

namespace limn::scene {
namespace {

namespace fs = std::filesystem;
using exchange::NamedCurve;

constexpr std::uintmax_t k_most_bytes = 64 << 20;

std::string ending_of(const fs::path& path) {
  std::string ending = path.extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return ending;
}

Error other_ending(const fs::path& path) {
  return error("{}: expected a file of curves ({}), found another ending.", path.string(),
               line_file_endings());
}

Result<exchange::CurveList> read_any(const fs::path& path, bool with_edges) {
  const std::string ending = ending_of(path);
  if (with_edges && (ending == ".csv" || ending == ".dxf"))
    return error("{}: expected a STEP or IGES file, because edges of surfaces are asked for, found {}.",
                 path.string(), ending);
  if (ending == ".csv") {
    LIMN_TRY(const std::string text, read_file(path));
    LIMN_TRY(std::vector<NamedCurve> curves, exchange::decode_csv_curves(text, path.string()));
    return exchange::CurveList{.curves = std::move(curves)};
  }
  if (ending == ".dxf") {
    LIMN_TRY(const std::string text, read_file(path));
    return exchange::decode_dxf_curves(text, path.string());
  }
  if (ending == ".step" || ending == ".stp" || ending == ".iges" || ending == ".igs") {
    std::vector<std::string> arguments = {"--curves", "--chord-mm", "0.01"};
    if (with_edges) arguments.emplace_back("--edges");
    LIMN_TRY(const std::string text, run_limn_cad(path, arguments));
    LIMN_TRY(exchange::CurveList list, exchange::decode_curve_list(text, path.string()));
    for (std::string& warning : list.warnings) warning = fmt::format("{}: {}.", path.string(), warning);
    return list;
  }
  return other_ending(path);
}

}  // namespace

const std::string& line_file_endings() {
  static const std::string endings = ".csv, .dxf, .step, .stp, .iges, .igs";
  return endings;
}

Result<std::vector<NamedCurve>> read_line_file(const fs::path& path, bool with_edges) {
  std::error_code code;
  if (const auto bytes = fs::file_size(path, code); !code && bytes > k_most_bytes)
    return error("{}: expected a file of at most {} MB, found {} MB.", path.string(), k_most_bytes >> 20,
                 bytes >> 20);
  LIMN_TRY(exchange::CurveList list, read_any(path, with_edges));
  for (const std::string& warning : list.warnings) log_warning("{}", warning);
  return std::move(list.curves);
}

Status write_line_file(const std::vector<NamedCurve>& curves,
                       const fs::path& path,
                       exchange::CurveForm form,
                       const CadLimits& limits) {
  if (curves.empty())
    return error("{}: expected curves to write, found none. Draw a line first.", path.string());
  const std::string ending = ending_of(path);
  if (form == exchange::CurveForm::spline && (ending == ".csv" || ending == ".dxf"))
    return error("{}: expected .step or .stp, because splines are asked for, found {}.", path.string(),
                 ending);
  if (ending == ".csv") return write_file(path, exchange::encode_csv_curves(curves));
  if (ending == ".dxf") return write_file(path, exchange::encode_dxf_curves(curves));
  if (ending != ".step" && ending != ".stp")
    return error("{}: expected .csv, .dxf, .step or .stp, found another ending.", path.string());
  for (const NamedCurve& curve : curves) LIMN_TRY_STATUS(exchange::check_curve(curve, path.string()));
  const fs::path list = path.parent_path() / fmt::format(".{}.curves.json", path.filename().string());
  LIMN_TRY_STATUS(write_file(list, exchange::encode_curve_list({.curves = curves, .form = form})));
  const auto written = run_limn_cad(list, {"--out", path.string()}, limits);
  std::error_code code;
  fs::remove(list, code);
  return written ? Status() : written.error();
}

}  // namespace limn::scene
