#pragma once

// From captures on disk to a calibrated rig, a measured surface, and the pose of a CAD mesh in it.
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "limn/error.h"
#include "limn/export.h"
#include "limn/pose.h"
#include "limn/rig.h"

namespace limn::LIMN_VERSIONED {

struct SolveOptions {
  /// Names of poses to leave out.
  std::vector<std::string> skip_poses = {};
  /// A lens model of ImagerParts for all cameras; `auto`: by held-out error, for each camera.
  std::string camera_model = "auto";
  /// The same for projectors.
  std::string projector_model = "auto";
  /// Cameras alone, from photographs of a board: `captures` is the folder of the images, or has a folder of
  /// them for each camera.
  bool cameras_only = false;
  /// For photographs: `chessboard:9x6:25mm`, `charuco:8x6:40mm`; captures of Limn name theirs.
  std::string board = {};
  /// The print's measured size, as --board-measured of `limn solve` takes it; empty: that of the captures, if
  /// any.
  std::string board_measured = {};
  /// Lengths between markers in the scene, beside those of the captures: `apriltag_36h11:3 apriltag_36h11:7
  /// 250mm`.
  std::vector<std::string> scale_bars = {};
  /// Families of markers that stand in the scene.
  std::vector<std::string> families = {"apriltag_36h11"};
  /// Images were stretched, so that pixels are not square.
  bool pixels_not_square = false;
  /// Stages: images, response, decode, solve, assess, write; of cameras alone: decode, solve, assess, write.
  ReportProgress progress = {};
};

enum class Verdict {
  /// Within a pixel and a millimetre wherever the board was.
  good,
  /// Errors that a person at arm's length does not mind.
  usable,
  /// Rig and report are written, and should not be used.
  reject
};

/// How well one camera or projector is known.
struct DeviceQuality {
  std::string name = {};
  /// Residuals of the fit, over inliers.
  double rms_px = 0;
  int points = 0, outliers = 0;
  /// Share of the image, in 10 x 10 cells, with an observation.
  double coverage = 0;
};

/// A board pose as predicted by a solve without it.
struct HeldOutPose {
  std::string pose = {};
  double rms_px = 0;
};

/// Something that is wrong with the captures or the devices.
struct Fault {
  /// As docs/formats.md lists them, for programs.
  std::string name = {};
  /// Evidence and advice, for people.
  std::string text = {};
};

struct Calibration {
  Rig rig;
  Verdict verdict = Verdict::reject;
  /// The verdict in words, with its reasons.
  std::string explanation = {};
  /// What to do, most useful first.
  std::vector<std::string> advice = {};
  std::vector<Fault> faults = {};
  /// Cameras, then projectors.
  std::vector<DeviceQuality> devices = {};
  std::vector<HeldOutPose> held_out = {};
  double held_out_rms_px = 0, held_out_worst_px = 0;
  /// For each projector: 95 % of the light errs by less on the surface.
  std::vector<double> predicted_error_mm = {};
  /// The page for people.
  std::filesystem::path report_html = {};
};

/// Calibrates cameras and projectors from a captures folder (docs/formats.md; made by `limn capture`, or the
/// same files of your own program), as `limn solve` does. Writes the rig folder `out`: rig.json, .cameramodel
/// files, report.json, report.html, observations.json. A rejected calibration is a result, not an error.
/// Takes seconds to minutes on all cores. Errors: captures that cannot be read or solved; the message names
/// the faults that explain it, and nothing is written.
///
///     const limn::Calibration found = limn::solve("captures", "rig");
///     if (found.verdict == limn::Verdict::reject) std::cerr << found.explanation;
LIMN_API Calibration solve(const std::filesystem::path& captures,
                           const std::filesystem::path& out,
                           const SolveOptions& options = {});

/// A measured surface, in the rig's world. It does not change, and a copy costs nothing. The spans live as
/// long as a copy of it.
class LIMN_API Surface {
 public:
  /// m; x y z of each point.
  std::span<const float> positions() const;
  /// Unit, towards the side that measured; in the order of the positions, or empty.
  std::span<const float> normals() const;
  /// Standard deviation along the normal, m; one for each point, or empty.
  std::span<const float> stddevs() const;
  /// Three points each, counter-clockwise from outside; may be empty.
  std::span<const std::uint32_t> triangles() const;

  struct Impl;
  explicit Surface(std::shared_ptr<const Impl> impl);  ///< for the library itself

 private:
  std::shared_ptr<const Impl> impl_;
};

struct ScanOptions {
  /// Names of poses; empty: all in which no board is seen.
  std::vector<std::string> poses = {};
  /// The prototype stood in another place in every pose.
  bool moved = false;
  /// Keeps this many of the largest pieces of each view; 0: all.
  int pieces = 0;
  /// Distances from the camera that count; far_m of 0: no limit.
  double near_m = 0, far_m = 0;
  /// The mesh's resolution; 0: one and a half times the distance of points.
  double voxel_m = 0;
  /// Half the side of the window that smooths each view's depth, camera pixels.
  int smooth_px = 3;
  /// Stages: scan (a step for each view), merge, write.
  ReportProgress progress = {};
};

struct Scan {
  Surface points, mesh;
  /// Median over the points.
  double stddev_m = 0;
  /// For people.
  std::vector<std::string> warnings = {};
};

/// Measures a prototype's surface from captures of it with a calibrated rig, as `limn scan` does. Writes
/// points.ply, mesh.ply, scan.json and images into `out`. Errors: devices that the rig lacks, nothing
/// measured, captures of another rig; nothing is written then.
LIMN_API Scan scan(const std::filesystem::path& captures,
                   const Rig& rig,
                   const std::filesystem::path& out,
                   const ScanOptions& options = {});

/// Lengths of files.
enum class Unit { metre, centimetre, millimetre, inch, foot };

struct AlignOptions {
  Unit scan_unit = Unit::metre;
  /// Needed unless the file states it.
  std::optional<Unit> mesh_unit = {};
  /// POSES.json with the pose to begin at. Without one, and without points or frames, the whole scan is
  /// searched.
  std::filesystem::path start = {};
  /// limn.picks/1: points on both.
  std::filesystem::path points = {};
  /// limn.body/1 on the scanned object: markers.json is written, too.
  std::filesystem::path body = {};
  /// A rig folder, for `frames`.
  std::filesystem::path rig = {};
  /// CAMERA=IMAGE of the object as it was scanned.
  std::vector<std::string> frames = {};
  /// Smaller differences are not reported.
  double least_mm = 1;
  /// Stages: read, align, compare, write.
  ReportProgress progress = {};
};

struct Alignment {
  /// Prototype frame: that of the mesh file, in metres. World: that of the scan.
  Pose world_from_prototype = {};
  Covariance6 covariance = {};
  /// Distance of the points in the fit, along the mesh's normals.
  double rms_m = 0;
  /// Number of points in the fit.
  int used_points = 0;
  /// Shares of the scan and of the mesh that lie on each other.
  double scan_share = 0, mesh_share = 0;
  /// What the shape leaves open: "slide along x".
  std::vector<std::string> free_directions = {};
  /// Where the start came from.
  std::string how = {};
  /// Symmetry, regions where scan and CAD differ; for people.
  std::vector<std::string> warnings = {};
};

/// Finds the pose of a CAD mesh in a scan (a PLY, or the folder of scan()), as `limn align` does. Writes
/// poses.json, align.json, residual.ply and images into `out`. Errors: wrong units, files that cannot be
/// read, no pose; nothing is written then. One more error: scan and mesh are hardly the same object. Then the
/// files are written all the same, because they show it; its message names them.
LIMN_API Alignment align(const std::filesystem::path& scan,
                         const std::filesystem::path& mesh,
                         const std::filesystem::path& out,
                         const AlignOptions& options = {});

}  // namespace limn::LIMN_VERSIONED
