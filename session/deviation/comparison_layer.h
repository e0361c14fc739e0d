#pragma once

#include "calib/report/deviation_report.h"
#include "core/result.h"
#include "scene/deviation_layer.h"
#include "scene/meshes/mesh.h"

namespace limn::session {

/// The result of a comparison as light shows it, on a grid over the CAD's triangles that is as fine as the
/// comparison's points, or coarser where these would be more than 4 million.
scene::DeviationLayer comparison_layer(const scene::Mesh& cad,
                                       const calib::DeviationReport& report,
                                       int number);

}  // namespace limn::session
