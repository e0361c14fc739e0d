#include "calib/report/failed_report.h"

#include <nlohmann/json.hpp>

#include "core/file.h"
#include "core/json_text.h"

namespace limn::calib {

Status write_failed_report(const std::string& failure,
                           const std::vector<Fault>& faults,
                           const std::filesystem::path& folder) {
  if (std::filesystem::exists(folder / "rig.json")) return {};
  auto list = nlohmann::ordered_json::array();
  for (const Fault& fault : merged(faults))
    list.push_back({{"name", to_text(fault.name)},
                    {"poses", fault.poses},
                    {"evidence", fault.evidence},
                    {"advice", fault.advice}});
  const nlohmann::ordered_json json = {
      {"schema", "limn.report/1"}, {"verdict", "reject"}, {"failure", failure}, {"faults", list}};
  LIMN_TRY_STATUS(make_folder(folder));
  return write_file(folder / "report.json", json_text(json, 2) + "\n");
}

}  // namespace limn::calib
