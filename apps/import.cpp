#include "apps/import.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <string>

#include "core/json_text.h"
#include "core/log.h"
#include "core/print.h"
#include "core/rig.h"
#include "exchange/mpcdi_reader.h"
#include "exchange/mpcdi_report.h"
#include "exchange/mpcdi_rig.h"

namespace limn::apps {
namespace {

using nlohmann::ordered_json;

std::string sentence_of(const ordered_json& region) {
  std::string text = fmt::format("{}: {}x{}", region["id"].get<std::string>(), region["size"][0].get<int>(),
                                 region["size"][1].get<int>());
  const auto size = [](const ordered_json& map) {
    return fmt::format("{}x{}", map["size"][0].get<int>(), map["size"][1].get<int>());
  };
  if (region.contains("eye_m"))
    text += fmt::format(", at ({:.3f}, {:.3f}, {:.3f}) m", region["eye_m"][0].get<double>(),
                        region["eye_m"][1].get<double>(), region["eye_m"][2].get<double>());
  if (region.contains("warp"))
    text += fmt::format(", warp {} ({:.1f} % known)", size(region["warp"]),
                        100 * region["warp"]["known_share"].get<double>());
  for (const char* name : {"alpha", "beta"}) {
    if (!region.contains(name)) continue;
    const auto& map = region[name];
    text += fmt::format(", {} {} bits ({:.3f} … {:.3f})", name, map["bits"].get<int>(),
                        map["range"][0].get<double>(), map["range"][1].get<double>());
  }
  if (region.contains("distortion")) text += ", distortion " + size(region["distortion"]);
  return text;
}

}  // namespace

Status run_import(const ImportOptions& options) {
  LIMN_TRY(const exchange::Mpcdi mpcdi, exchange::read_mpcdi(options.file));
  if (!options.out.empty()) {
    LIMN_TRY(const Rig rig, exchange::mpcdi_rig(mpcdi, options.file.string()));
    LIMN_TRY_STATUS(save_rig(rig, options.out));
  }
  for (const std::string& remark : mpcdi.remarks) log_warning("import: {}", remark);
  const ordered_json report = exchange::mpcdi_report(mpcdi);
  if (options.json) {
    print_out("{}\n", json_text(report, 2));
    return {};
  }
  print_out("MPCDI {}, profile {}, {} region{}{}\n", mpcdi.version,
            exchange::k_mpcdi_profiles.text(mpcdi.profile), mpcdi.regions.size(),
            mpcdi.regions.size() == 1 ? "" : "s", mpcdi.made_by.empty() ? "" : ", made by " + mpcdi.made_by);
  for (const auto& region : report["regions"]) print_out("{}\n", sentence_of(region));
  return {};
}

}  // namespace limn::apps
