#include "apps/plan_rig.h"

#include <fmt/format.h>

#include "core/file.h"
#include "core/print.h"
#include "wizard/design/design_report.h"
#include "wizard/design/plan_page.h"
#include "wizard/design/rig_design.h"

namespace limn::apps {

Status run_plan_rig(const PlanRigOptions& options) {
  LIMN_TRY(const design::DescribedRig described, design::load_described(options.described));
  auto predicted_accuracy = design::predict_accuracy(described);
  if (!predicted_accuracy)
    return error("{}: this rig cannot be calibrated: {}", options.described.string(),
                 predicted_accuracy.message());
  if (options.json) {
    print_out("{}\n", design::design_json(*predicted_accuracy));
  } else {
    print_out("{}", design::design_table(*predicted_accuracy, described));
  }
  if (!options.out.empty()) {
    LIMN_TRY_STATUS(make_folder(options.out));
    LIMN_TRY_STATUS(write_file(options.out / "plan.json", design::design_json(*predicted_accuracy) + "\n"));
    LIMN_TRY_STATUS(write_file(options.out / "plan.html", design::plan_page(described, *predicted_accuracy)));
  }
  return {};
}

}  // namespace limn::apps
