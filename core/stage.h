#pragma once

#include <functional>
#include <string>

#include "core/result.h"

namespace limn {

/// Where a long computation is, for people who wait for it.
struct Stage {
  std::string name;  ///< one word: `decode`, `solve`
  int done = 0;      ///< steps of this stage that are done
  int total = 0;     ///< all steps of this stage; 0: not known
};

/// Is called when a stage begins and after its steps, by one thread at a time, perhaps not the caller's.
/// Returns false to stop the computation, which then ends with an error and has written nothing.
using ReportStage = std::function<bool(const Stage&)>;

/// Reports a stage; an absent function wants everything. Error: it asks to stop.
inline Status reported(const ReportStage& report, const Stage& stage) {
  if (!report || report(stage)) return {};
  return error("{}: stopped, as was asked for. Nothing was written.", stage.name);
}

}  // namespace limn
