#include "exchange/cad_curves.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>

#include "core/file.h"
#include "core/log.h"
#include "exchange/curves/curve_list.h"
#include "scene/files/source_file.h"

namespace limn::exchange {

namespace fs = std::filesystem;

Result<std::vector<NamedCurve>> read_cad_curves(const fs::path& file,
                                                const CurveReading& options,
                                                const std::stop_token& stop) {
  LIMN_TRY_STATUS(scene::check_regular_file(file));
  std::vector<std::string> arguments = {"--curves", "--chord-mm", fmt::format("{}", options.chord_mm)};
  if (options.with_edges) arguments.emplace_back("--edges");
  LIMN_TRY(const std::string text, scene::run_limn_cad(file, arguments, options.limits, stop));
  LIMN_TRY(CurveList list, decode_curve_list(text, file.string()));
  for (const std::string& warning : list.warnings) log_warning("{}: {}.", file.string(), warning);
  return std::move(list.curves);
}

Status write_step_curves(std::span<const NamedCurve> curves,
                         const fs::path& file,
                         CurveForm form,
                         const scene::CadLimits& limits,
                         const std::stop_token& stop) {
  if (curves.empty())
    return error("{}: expected curves to write, found none. Draw a line first.", file.string());
  for (const NamedCurve& curve : curves) LIMN_TRY_STATUS(check_curve(curve, file.string()));
  std::string name = (file.parent_path() / fmt::format(".{}.XXXXXX.json", file.filename().string())).string();
  constexpr int k_end = 5;                              // ".json"
  const int descriptor = mkstemps(name.data(), k_end);  // a name that nobody has
  if (descriptor < 0)
    return error("{}: expected to write here, found: {}. Check that the folder exists and can be written.",
                 file.string(), std::strerror(errno));
  close(descriptor);
  const fs::path list = name;
  std::error_code none;
  const Status listed =
      write_file(list, encode_curve_list({.curves = {curves.begin(), curves.end()}, .form = form}));
  if (!listed) {
    fs::remove(list, none);
    return listed;
  }
  const auto written = scene::run_limn_cad(list, {"--out", file.string()}, limits, stop);
  fs::remove(list, none);
  return written ? Status() : written.error();
}

}  // namespace limn::exchange
