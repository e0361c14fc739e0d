#include "apps/plan_rig.h"

#include <fmt/format.h>

#include "apps/design/design_report.h"
#include "apps/design/rig_design.h"
#include "apps/plan_page.h"
#include "core/file.h"

namespace limn::apps {

Status run_plan_rig(const PlanRigOptions& options) {
  LIMN_TRY(const Described described, load_described(options.described));
  auto foreseen = foresee(described);
  if (!foreseen)
    return error("{}: no calibration comes of this rig: {}", options.described.string(), foreseen.message());
  if (options.json) {
    fmt::print("{}\n", design_json(*foreseen));
  } else {
    fmt::print("{}", design_table(*foreseen, described));
  }
  if (!options.out.empty()) {
    LIMN_TRY_STATUS(make_folder(options.out));
    LIMN_TRY_STATUS(write_file(options.out / "plan.json", design_json(*foreseen) + "\n"));
    LIMN_TRY_STATUS(write_file(options.out / "plan.html", plan_page(described, *foreseen)));
  }
  return {};
}

}  // namespace limn::apps
