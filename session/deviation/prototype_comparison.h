#pragma once

#include <Eigen/Geometry>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "calib/report/deviation_report.h"
#include "core/marker.h"
#include "core/result.h"
#include "core/rig.h"
#include "core/track.h"
#include "scene/deviation_layer.h"
#include "scene/meshes/mesh.h"
#include "scene/meshes/scan_surface.h"
#include "wizard/capture/backend.h"

namespace limn::session {

/// What the comparison of a prototype with its CAD depends on, besides the scan.
struct ComparisonInput {
  std::shared_ptr<const scene::Mesh> cad;  ///< The prototype's mesh.
  std::string cad_name;                    ///< For the report.
  double tolerance_m = 0.5e-3;
  /// The alignment is refined on the scan inside this box (prototype's frame, m): a local best fit.
  std::optional<Eigen::AlignedBox3d> fit_box = {};
  /// An earlier alignment that is kept: the scan is not fitted.
  std::optional<calib::Registration> held = {};
  int number = 1;  ///< DeviationLayer::number of the result.
};

/// A square marker where the tracker saw it.
struct SeenMarker {
  Pose world_from_marker;
  double size_m = 0;
};
/// Those of the bodies that are measured now.
std::vector<SeenMarker> seen_markers(std::span<const Body> bodies, std::span<const Track> tracks);

/// A prototype that was scanned in place.
struct ScannedPrototype {
  std::shared_ptr<const scene::ScanSurface> surface;  ///< Triangles in the world frame, m.
  Pose world_from_tracked;                            ///< Where the tracker saw the prototype then.
  /// Markers on it during the scan. Their plates are no part of the CAD: what they cover is not compared.
  std::vector<SeenMarker> markers;
  std::vector<std::string> warnings;  ///< Those of the scan.
};

/// The result of a comparison.
struct PrototypeComparison {
  ScannedPrototype scanned;
  calib::DeviationReport report;
  /// The registration of the whole scan. It is that of the report unless that was fitted in a box.
  calib::Registration whole;
  std::shared_ptr<const scene::DeviationLayer> layer;  ///< The result as light shows it.
};

using ShouldContinue = std::function<bool()>;

/// Scans whatever stands at `world_from_tracked` with patterns of all projectors: captures into `folder`,
/// which the caller removes; measures the surface within the surroundings of the CAD. The devices of
/// `backend` have the rig's names and order; only capture, wait_for_files and use_latency are needed. Errors:
/// no camera for visible light, a device that fails, nothing measured, a prototype that moved;
/// `should_continue`, which is called from time to time, returns false.
Result<ScannedPrototype> scanned_in_place(const Rig& rig,
                                          const scene::Mesh& cad,
                                          const Pose& world_from_tracked,
                                          const std::vector<SeenMarker>& markers,
                                          const wizard::WizardBackend& backend,
                                          const std::filesystem::path& folder,
                                          const ShouldContinue& should_continue);

/// Aligns the scan with the CAD, starting from the tracked pose, and compares them. Errors: the scan hardly
/// overlaps the CAD, a box without scan, `should_continue` returns false.
Result<PrototypeComparison> compared_with_cad(const ScannedPrototype& scanned,
                                              const ComparisonInput& input,
                                              const ShouldContinue& should_continue);

/// The number of images that scanned_in_place() shows.
int scan_images(const Rig& rig);

}  // namespace limn::session
