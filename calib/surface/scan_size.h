#pragma once

#include "calib/surface/registration.h"
#include "core/result.h"
#include "scene/meshes/mesh.h"
#include "scene/meshes/mesh_bvh.h"
#include "scene/meshes/scan_surface.h"

namespace limn::calib {

/// How many times as large as the mesh the scan is, by their shapes. A calibration with a board of another
/// size than its text says makes every scan too large or too small by the same factor.
struct ScanSize {
  double ratio = 1;
  /// From the residuals' scatter, summed over cells of 1/20 of the mesh (as Registration::covariance). Large
  /// where the shape does not show its size, as a plane does not.
  double stddev = 0;
};

/// Fits pose and size together, from the registration. Error: too few points near the mesh.
Result<ScanSize> scan_size(const scene::Mesh& mesh,
                           const scene::MeshBvh& index,
                           const scene::ScanSurface& scan,
                           const Registration& registration);

/// Whether the scan's size contradicts the mesh's: by more than 3 standard deviations and k_size_tolerance.
bool contradicts(const ScanSize& size);
constexpr double k_size_tolerance = 0.003;  // clay models are built to a millimetre or two

}  // namespace limn::calib
