#pragma once

#include <filesystem>

#include "core/result.h"

namespace limn::apps {

struct PlanRigOptions {
  std::filesystem::path described;
  std::filesystem::path out;  ///< folder for plan.html and plan.json; empty: none
  bool json = false;          ///< JSON on stdout instead of a table
};

/// `limn plan`: what a described rig would reach, as a table or JSON, and as files.
Status run_plan_rig(const PlanRigOptions& options);

}  // namespace limn::apps
