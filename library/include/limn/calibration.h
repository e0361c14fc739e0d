#pragma once

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
  std::vector<std::string> skip_poses = {};  ///< names of poses to leave out
  std::string camera_model =
      "auto";  ///< a lens model of ImagerParts; auto: by held-out error, for each camera
  std::string projector_model = "auto";
  bool cameras_only = false;  ///< cameras alone, from photographs of a board
  std::string board =
      {};  ///< for photographs: `chessboard:9x6:25mm`, `charuco:8x6:40mm`; else the captures name it
  /// The print's measured size, as --board-measured of `limn solve` takes it; empty: that of the captures,
  /// if any.
  std::string board_measured = {};
  std::vector<std::string> scale_bars =
      {};  ///< `apriltag_36h11:3 apriltag_36h11:7 250mm`, beside those of the captures
  std::vector<std::string> families = {"apriltag_36h11"};  ///< families of markers that stand in the scene
  bool pixels_not_square = false;                          ///< images that were stretched
  ReportProgress progress = {};  ///< stages: images, response, decode, solve, assess, write
};

enum class Verdict {
  good,    ///< within a pixel and a millimetre wherever the board was
  usable,  ///< errors that a person at arm's length does not mind
  reject   ///< rig and report are written, and should not be used
};

/// How well one camera or projector is known.
struct DeviceQuality {
  std::string name = {};
  double rms_px = 0;  ///< residuals of the fit, over inliers
  int points = 0, outliers = 0;
  double coverage = 0;  ///< share of the image, in 10 x 10 cells, with an observation
};

/// A board pose as predicted by a solve without it.
struct HeldOutPose {
  std::string pose = {};
  double rms_px = 0;
};

struct Fault {
  std::string name = {};  ///< as docs/formats.md lists them, for programs
  std::string text = {};  ///< evidence and advice, for people
};

struct Calibration {
  Rig rig;
  Verdict verdict = Verdict::reject;
  std::string explanation = {};          ///< the verdict in words, with its reasons
  std::vector<std::string> advice = {};  ///< what to do, most useful first
  std::vector<Fault> faults = {};
  std::vector<DeviceQuality> devices = {};  ///< cameras, then projectors
  std::vector<HeldOutPose> held_out = {};
  double held_out_rms_px = 0, held_out_worst_px = 0;
  std::vector<double> predicted_error_mm =
      {};  ///< for each projector: 95 % of the light errs by less on the surface
  std::filesystem::path report_html = {};  ///< the page for people
};

/// Calibrates cameras and projectors from a captures folder (docs/formats.md; `limn capture`, or the same
/// files of your own program), as `limn solve` does: writes the rig folder `out` (rig.json, .cameramodel
/// files, report.json, report.html, observations.json). A rejected calibration is a result, not an error.
/// Takes seconds to minutes on all cores. Errors: captures that cannot be read or solved; the message names
/// the faults that explain it.
LIMN_API Calibration solve(const std::filesystem::path& captures,
                           const std::filesystem::path& out,
                           const SolveOptions& options = {});

/// A measured surface. It does not change, and a copy costs nothing. The spans live as long as a copy of
/// it.
class LIMN_API Surface {
 public:
  std::span<const float> positions() const;  ///< m, in the rig's world; x y z of each point
  std::span<const float> normals() const;    ///< unit, towards the side that measured; as positions, or empty
  std::span<const float> stddevs() const;    ///< m, along the normal; one for each point, or empty
  std::span<const std::uint32_t> triangles()
      const;  ///< three points each, counter-clockwise from outside; may be empty

  struct Impl;
  explicit Surface(std::shared_ptr<const Impl> impl);  ///< for the library itself

 private:
  std::shared_ptr<const Impl> impl_;
};

struct ScanOptions {
  std::vector<std::string> poses = {};  ///< names; empty: all in which no board is seen
  bool moved = false;                   ///< the prototype stood in another place in every pose
  int pieces = 0;                       ///< keeps this many of the largest pieces of each view; 0: all
  double near_m = 0, far_m = 0;         ///< distances from the camera that count; far_m 0: no limit
  double voxel_m = 0;            ///< the mesh's resolution; 0: one and a half times the distance of points
  int smooth_px = 3;             ///< smoothing of each view's depth
  ReportProgress progress = {};  ///< stages: scan, merge, write
};

struct Scan {
  Surface points, mesh;
  double stddev_m = 0;                     ///< median over the points
  std::vector<std::string> warnings = {};  ///< for people
};

/// Measures a prototype's surface from captures of it with a calibrated rig, as `limn scan` does: writes
/// points.ply, mesh.ply, scan.json and images into `out`. Errors: devices that the rig lacks, nothing
/// measured, captures of another rig.
LIMN_API Scan scan(const std::filesystem::path& captures,
                   const Rig& rig,
                   const std::filesystem::path& out,
                   const ScanOptions& options = {});

/// Lengths of files.
enum class Unit { metre, centimetre, millimetre, inch, foot };

struct AlignOptions {
  Unit scan_unit = Unit::metre;
  std::optional<Unit> mesh_unit = {};    ///< needed unless the file states it
  std::filesystem::path start = {};      ///< POSES.json; without a start the whole scan is searched
  std::filesystem::path points = {};     ///< limn.picks/1: points on both
  std::filesystem::path body = {};       ///< limn.body/1 on the scanned object: markers.json is written, too
  std::filesystem::path rig = {};        ///< with `frames`
  std::vector<std::string> frames = {};  ///< CAMERA=IMAGE of the object as it was scanned
  double least_mm = 1;                   ///< smaller differences are not reported
  ReportProgress progress = {};          ///< stages: read, align, compare, write
};

struct Alignment {
  Pose world_from_prototype = {};
  Covariance6 covariance = {};
  double rms_m = 0;                       ///< distance of the points in the fit, along the mesh's normals
  int used_points = 0;                    ///< in the fit
  double scan_share = 0, mesh_share = 0;  ///< shares of the scan and of the mesh that lie on each other
  std::vector<std::string> free_directions = {};  ///< what the shape leaves open: "slide along x"
  std::string how = {};                           ///< where the start came from
  std::vector<std::string> warnings = {};         ///< symmetry, regions where scan and CAD differ
};

/// Finds the pose of a CAD mesh in a scan (a PLY, or the folder of scan()), as `limn align` does: writes
/// poses.json, align.json, residual.ply and images into `out`. Errors: hardly the same object, wrong units,
/// files that cannot be read.
LIMN_API Alignment align(const std::filesystem::path& scan,
                         const std::filesystem::path& mesh,
                         const std::filesystem::path& out,
                         const AlignOptions& options = {});

}  // namespace limn::LIMN_VERSIONED
