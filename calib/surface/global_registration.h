#pragma once

#include <optional>

#include "calib/surface/registration.h"

namespace limn::calib {

/// The result of a registration without a start.
struct GlobalRegistration {
  Registration registration;
  /// The next best pose that is a different one, and its points in the fit as a share of the best pose's.
  /// Near 1 the shape is symmetric.
  std::optional<Pose> rival;
  double rival_share = 0;
};

/// Tries evenly spread rotations (Alexa 2022, super-Fibonacci spirals). For each, the middle of the mesh's
/// side that would face the scanner is placed on the middle of each of the scan's larger connected pieces and
/// beside it. The best by a truncated distance field get short fits, the best of these
/// `refined_registration`. Takes some seconds. Error: in no pose does a fair share of any piece lie on the
/// mesh.
Result<GlobalRegistration> global_registration(const scene::Mesh& mesh,
                                               const scene::MeshBvh& index,
                                               const scene::ScanSurface& scan,
                                               const RegistrationOptions& options = {});

}  // namespace limn::calib
