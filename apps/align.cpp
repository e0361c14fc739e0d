#include "apps/align.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "core/file.h"
#include "core/log.h"
#include "core/print.h"

namespace limn::apps {

Status run_align(const AlignCommand& command) {
  LIMN_TRY(const wizard::MeshAligned aligned, wizard::align_scan(command));
  for (const std::string& warning : aligned.warnings) log_warning("align: {}", warning);
  if (command.json) {
    LIMN_TRY(const std::string json, read_file(command.out / "align.json"));
    print_out("{}", json);
    return {};
  }
  if (command.scan.empty()) {
    print_out("pose from {}; files in {}\n", aligned.how, command.out.string());
    return {};
  }
  const auto stddev = [&](int i) { return std::sqrt(aligned.registration.covariance(i, i)); };
  print_out(
      "{:.0f} % of the scan lies within {:.0f} mm of the CAD, and {:.0f} % of the CAD is covered by the "
      "scan\n"
      "{} of {} points fit within {:.3f} mm RMS; standard deviation {:.3f} mm, {:.4f} degrees; files in {}\n",
      100 * aligned.overlap.scan_share, 1e3 * aligned.overlap.near_m, 100 * aligned.overlap.mesh_share,
      aligned.registration.used, aligned.registration.near, 1e3 * aligned.registration.rms_m,
      1e3 * std::max({stddev(3), stddev(4), stddev(5)}),
      180 / M_PI * std::max({stddev(0), stddev(1), stddev(2)}), command.out.string());
  return {};
}

}  // namespace limn::apps
