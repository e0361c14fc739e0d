#pragma once

#include <filesystem>

#include "core/result.h"

namespace limn::apps {

struct PlanRigOptions {
  std::filesystem::path described;
  std::filesystem::path out;  ///< Folder for plan.html and plan.json; empty: none.
  bool json = false;          ///< Prints JSON instead of a table.
};

/// `limn plan`: prints the predicted accuracy of a described rig as a table or JSON, and writes it as files.
Status run_plan_rig(const PlanRigOptions& options);

}  // namespace limn::apps
