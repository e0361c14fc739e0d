#include "validate/check_judge.h"

#include <algorithm>
#include <chrono>
#include <string>
#include <vector>

#include "validate/check_measures.h"
#include "validate/check_run.h"

namespace limn::validate {
namespace {

struct Measures {
  std::vector<std::string> names;  // names of check_measures()
  Status (*judge)(CheckRun& run);
};

const std::vector<Measures>& all_measures() {
  static const std::vector<Measures> all = {
      {{"texture_mm"}, judge_texture},
      {{"parallax_mm"}, judge_parallax},
      {{"shared_mm"}, judge_shared},
      {{"shone_mean_255", "shone_over4_share", "shone_inner_over4_share"}, judge_shone},
      {{"spill_share"}, judge_spill},
      {{"drawn_mean_255", "drawn_over4_share", "drawn_inner_over4_share"}, judge_drawn},
      {{"mask_iou"}, judge_mask},
      {{"composite_px"}, judge_composite},
      {{"edge_gap_share", "edge_double_share"}, judge_edge},
      {{"depth_order_share"}, judge_depth_order},
      {{"seam_step_p95", "seam_step_max"}, judge_seams},
      {{"black_step_share"}, judge_black},
      {{"refill_share", "refill_flash_share", "refill_still_255"}, judge_refill},
      {{"rerun_worst_255"}, judge_rerun},
  };
  return all;
}

}  // namespace

Result<CheckResult> judge_check(const Check& check) {
  if (check.truth.rig.projectors.empty())
    return error("{}: expected a world with a projector, found none.", check.name);
  const auto begun = std::chrono::steady_clock::now();
  CheckRun run(check);
  LIMN_TRY_STATUS(run.open());
  for (const Measures& measures : all_measures()) {
    const bool is_asked = std::any_of(measures.names.begin(), measures.names.end(),
                                      [&](const std::string& name) { return run.asks_for(name); });
    if (is_asked) LIMN_TRY_STATUS(measures.judge(run));
  }
  CheckResult result = std::move(run).result();
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
  return result;
}

}  // namespace limn::validate
