#include "apps/capture.h"

#include <fmt/format.h>

#include "core/print.h"
#include "sim/virtual_rig.h"
#include "tracker/marker_image.h"
#include "wizard/capture/capture_plan.h"
#include "wizard/capture/virtual_capture.h"

namespace limn::apps {

Status run_capture(const CaptureOptions& options) {
  LIMN_TRY(const wizard::Plan plan, wizard::load_plan(options.plan));
  LIMN_TRY(sim::World world, sim::load_world(plan.world, tracker::marker_image));
  sim::VirtualRig rig(std::move(world));
  LIMN_TRY_STATUS(wizard::capture_virtually(plan, &rig, options.out));
  print_out("{} poses in {}\n", plan.world_from_board.size(), options.out.string());
  return {};
}

}  // namespace limn::apps
