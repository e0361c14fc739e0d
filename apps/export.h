#pragma once

#include "core/result.h"
#include "exchange/exporter.h"

namespace limn::apps {

/// `limn export`: warp and blend maps of every projector, or the rig's lenses as camera files, for other
/// programs. At least one output (exchange::exporters) must be asked for. All points of maps are in the frame
/// of the prototype's mesh, in metres. `is_json`: prints JSON instead of a line for each projector.
Status run_export(const exchange::ExportOptions& options, bool is_json = false);

}  // namespace limn::apps
