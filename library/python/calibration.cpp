#include "limn/calibration.h"

#include <utility>

#include "library/python/calls.h"
#include "library/python/record.h"

namespace limn::python {
namespace {

namespace fs = std::filesystem;
using Texts = std::vector<std::string>;

constexpr const char* k_progress =
    R"(progress(limn.Progress) is called by the calling thread when a stage begins and after its steps. If
it returns False, the call raises limn.Stopped, at latest when the stage ends; what it raises, and
KeyboardInterrupt, end the call in the same way. Nothing is written then, unless it was writing
already. Other threads of Python run meanwhile. )";

void add_results_of_solve(py::module_& module) {
  Record<DeviceQuality>(module, "DeviceQuality", "How well one camera or projector is known.")
      .field("name", &DeviceQuality::name, "Its name.")
      .field("rms_px", &DeviceQuality::rms_px, "Residuals of the fit, over inliers.")
      .field("points", &DeviceQuality::points, "Observations.")
      .field("outliers", &DeviceQuality::outliers, "Those that were left out.")
      .field("coverage", &DeviceQuality::coverage,
             "Share of the image, in 10 x 10 cells, with an observation.")
      .ended();
  Record<HeldOutPose>(module, "HeldOutPose", "A board pose as predicted by a solve without it.")
      .field("pose", &HeldOutPose::pose, "The pose's name.")
      .field("rms_px", &HeldOutPose::rms_px, "Its held-out error.")
      .ended();
  Record<Fault>(module, "Fault", "What is wrong with captures or a calibration.")
      .field("name", &Fault::name, "As docs/formats.md lists them, for programs.")
      .field("text", &Fault::text, "Evidence and advice, for people.")
      .ended();
  Record<Calibration>(module, "Calibration", "What solve() found.")
      .field("rig", &Calibration::rig, "The calibrated rig.")
      .field(
          "verdict", &Calibration::verdict,
          R"('good': within a pixel and a millimetre wherever the board was; 'usable': errors that a person at
arm's length does not mind; 'reject': rig and report are written, and should not be used.)")
      .field("explanation", &Calibration::explanation, "The verdict in words, with its reasons.")
      .field("advice", &Calibration::advice, "What to do, most useful first.")
      .field("faults", &Calibration::faults, "What is wrong, a tuple of Fault.")
      .field("devices", &Calibration::devices, "Cameras, then projectors; a tuple of DeviceQuality.")
      .field("held_out", &Calibration::held_out, "For each board pose; a tuple of HeldOutPose.")
      .field("held_out_rms_px", &Calibration::held_out_rms_px, "Over all poses.")
      .field("held_out_worst_px", &Calibration::held_out_worst_px, "The worst pose.")
      .field("predicted_error_mm", &Calibration::predicted_error_mm,
             "For each projector: 95 % of the light errs by less on the surface.")
      .field("report_html", &Calibration::report_html, "The page for people, a pathlib.Path.")
      .ended();
}

Calibration solve_with(const fs::path& captures,
                       const fs::path& out,
                       SolveOptions options,
                       const py::object& progress) {
  return stoppable(progress, [&](const ReportProgress& report) {
    options.progress = report;
    return solve(captures, out, options);
  });
}

void add_solve(py::module_& module) {
  const SolveOptions defaults;
  static const std::string k_doc =
      R"(Calibrates cameras and projectors from a captures folder (docs/formats.md; `limn capture`, or the
same files of your own program), as `limn solve` does: writes the rig folder `out` (rig.json,
.cameramodel files, report.json, report.html, observations.json). A rejected calibration is a
result, not an error. Takes seconds to minutes on all cores.

skip_poses: names of poses to leave out. camera_model, projector_model: a lens model; 'auto': by
held-out error, for each device. cameras_only: cameras alone, from photographs of a board. board:
for photographs: 'chessboard:9x6:25mm', 'charuco:8x6:40mm'; else the captures name it.
board_measured: the print's measured size, as --board-measured of `limn solve` takes it; '': that of
the captures, if any. scale_bars: 'apriltag_36h11:3 apriltag_36h11:7 250mm', beside those of the
captures. families: of markers that stand in the scene. pixels_not_square: images that were
stretched. Stages: images, response, decode, solve, assess, write.

)" + std::string(k_progress) +
      R"(Errors: captures that cannot be read or solved; the message names the faults that explain it.)";
  module.def(
      "solve",
      [](const fs::path& captures, const fs::path& out, Texts skip_poses, std::string camera_model,
         std::string projector_model, bool cameras_only, std::string board, std::string board_measured,
         Texts scale_bars, Texts families, bool pixels_not_square, const py::object& progress) {
        SolveOptions options;
        options.skip_poses = std::move(skip_poses);
        options.camera_model = std::move(camera_model);
        options.projector_model = std::move(projector_model);
        options.cameras_only = cameras_only;
        options.board = std::move(board);
        options.board_measured = std::move(board_measured);
        options.scale_bars = std::move(scale_bars);
        options.families = std::move(families);
        options.pixels_not_square = pixels_not_square;
        return solve_with(captures, out, std::move(options), progress);
      },
      py::arg("captures"), py::arg("out"), py::kw_only(), py::arg("skip_poses") = defaults.skip_poses,
      py::arg("camera_model") = defaults.camera_model, py::arg("projector_model") = defaults.projector_model,
      py::arg("cameras_only") = defaults.cameras_only, py::arg("board") = defaults.board,
      py::arg("board_measured") = defaults.board_measured, py::arg("scale_bars") = defaults.scale_bars,
      py::arg("families") = defaults.families, py::arg("pixels_not_square") = defaults.pixels_not_square,
      py::arg("progress") = py::none(), k_doc.c_str());
}

// An array of the surface's memory, `columns` numbers for each row.
template <class T, int columns = 0>
auto rows_of(std::span<const T> (Surface::*span)() const) {
  return [span](py::object self) {
    const auto values = (self.cast<const Surface&>().*span)();
    const auto count = static_cast<py::ssize_t>(values.size());
    if constexpr (columns == 0)
      return view_of(values.data(), {count}, self);
    else
      return view_of(values.data(), {count / columns, columns}, self);
  };
}

void add_scan(py::module_& module) {
  py::class_<Surface>(
      module, "Surface",
      R"(A measured surface. It does not change. The arrays are views of its memory, which they keep.)")
      .def_property_readonly("positions", rows_of<float, 3>(&Surface::positions),
                             "m, in the rig's world; float32, shape (n, 3).")
      .def_property_readonly("normals", rows_of<float, 3>(&Surface::normals),
                             "Unit, towards the side that measured; float32, shape (n, 3), or empty.")
      .def_property_readonly("stddevs", rows_of<float>(&Surface::stddevs),
                             "m, along the normal; float32, shape (n,), or empty.")
      .def_property_readonly(
          "triangles", rows_of<std::uint32_t, 3>(&Surface::triangles),
          R"(Indices of points, counter-clockwise from outside; uint32, shape (m, 3); may be empty.)")
      .def("__repr__", [](const Surface& surface) {
        return "<limn.Surface, " + std::to_string(surface.positions().size() / 3) + " points, " +
               std::to_string(surface.triangles().size() / 3) + " triangles>";
      });
  Record<Scan>(module, "Scan", "What scan() measured.")
      .field("points", &Scan::points, "All points.")
      .field("mesh", &Scan::mesh, "The surface as triangles.")
      .field("stddev_m", &Scan::stddev_m, "Median over the points.")
      .field("warnings", &Scan::warnings, "For people.")
      .ended();
  const ScanOptions defaults;
  static const std::string k_doc =
      R"(Measures a prototype's surface from captures of it with a calibrated rig, as `limn scan` does:
writes points.ply, mesh.ply, scan.json and images into `out`.

poses: names; none: all in which no board is seen. moved: the prototype stood in another place in
every pose. pieces: keeps this many of the largest pieces of each view; 0: all. near_m, far_m:
distances from the camera that count; far_m 0: no limit. voxel_m: the mesh's resolution; 0: one and
a half times the distance of points. smooth_px: smoothing of each view's depth. Stages: scan, merge,
write.

)" + std::string(k_progress) +
      R"(Errors: devices that the rig lacks, nothing measured, captures of another rig.)";
  module.def(
      "scan",
      [](const fs::path& captures, const Rig& rig, const fs::path& out, Texts poses, bool moved, int pieces,
         double near_m, double far_m, double voxel_m, int smooth_px, const py::object& progress) {
        ScanOptions options = {std::move(poses), moved, pieces, near_m, far_m, voxel_m, smooth_px, {}};
        return stoppable(progress, [&](const ReportProgress& report) {
          options.progress = report;
          return scan(captures, rig, out, options);
        });
      },
      py::arg("captures"), py::arg("rig"), py::arg("out"), py::kw_only(), py::arg("poses") = defaults.poses,
      py::arg("moved") = defaults.moved, py::arg("pieces") = defaults.pieces,
      py::arg("near_m") = defaults.near_m, py::arg("far_m") = defaults.far_m,
      py::arg("voxel_m") = defaults.voxel_m, py::arg("smooth_px") = defaults.smooth_px,
      py::arg("progress") = py::none(), k_doc.c_str());
}

void add_alignment(py::module_& module) {
  Record<Alignment>(module, "Alignment", "Where align() found a CAD mesh in a scan.")
      .field("world_from_prototype", &Alignment::world_from_prototype, "The mesh's pose in the scan's world.")
      .array<6, 6>(
          "covariance", &Alignment::covariance,
          R"(Of a small change (w, v): w (rad) is a rotation about the world's axes, R' = Exp(w) R; v (m) is
added to the translation. Shape (6, 6).)")
      .field("rms_m", &Alignment::rms_m, "Distance of the points in the fit, along the mesh's normals.")
      .field("used_points", &Alignment::used_points, "In the fit.")
      .field("scan_share", &Alignment::scan_share, "Share of the scan that lies on the mesh.")
      .field("mesh_share", &Alignment::mesh_share, "Share of the mesh that lies on the scan.")
      .field("free_directions", &Alignment::free_directions, "What the shape leaves open: 'slide along x'.")
      .field("how", &Alignment::how, "Where the start came from.")
      .field("warnings", &Alignment::warnings, "Symmetry, regions where scan and CAD differ.")
      .ended();
}

Alignment align_with(const fs::path& scan,
                     const fs::path& mesh,
                     const fs::path& out,
                     AlignOptions options,
                     const py::object& progress) {
  return stoppable(progress, [&](const ReportProgress& report) {
    options.progress = report;
    return align(scan, mesh, out, options);
  });
}

void add_align(py::module_& module) {
  const AlignOptions defaults;
  using Path = std::optional<fs::path>;
  static const std::string k_doc =
      R"(Finds the pose of a CAD mesh in a scan (a PLY, or the folder of scan()), as `limn align` does:
writes poses.json, align.json, residual.ply and images into `out`.

scan_unit, mesh_unit: 'metre', 'centimetre', 'millimetre', 'inch' or 'foot'; mesh_unit is needed
unless the file states it. start: POSES.json; without a start the whole scan is searched. points:
limn.picks/1: points on both. body: limn.body/1 on the scanned object: markers.json is written, too.
rig, frames: CAMERA=IMAGE of the object as it was scanned. least_mm: smaller differences are not
reported. Stages: read, align, compare, write.

)" + std::string(k_progress) +
      "Errors: hardly the same object, wrong units, files that cannot be read.";
  module.def(
      "align",
      [](const fs::path& scan, const fs::path& mesh, const fs::path& out, Unit scan_unit,
         std::optional<Unit> mesh_unit, const Path& start, const Path& points, const Path& body,
         const Path& rig, Texts frames, double least_mm, const py::object& progress) {
        AlignOptions options;
        options.scan_unit = scan_unit;
        options.mesh_unit = mesh_unit;
        options.start = start.value_or("");
        options.points = points.value_or("");
        options.body = body.value_or("");
        options.rig = rig.value_or("");
        options.frames = std::move(frames);
        options.least_mm = least_mm;
        return align_with(scan, mesh, out, std::move(options), progress);
      },
      py::arg("scan"), py::arg("mesh"), py::arg("out"), py::kw_only(),
      py::arg_v("scan_unit", defaults.scan_unit, "'metre'"), py::arg("mesh_unit") = py::none(),
      py::arg("start") = py::none(), py::arg("points") = py::none(), py::arg("body") = py::none(),
      py::arg("rig") = py::none(), py::arg("frames") = defaults.frames,
      py::arg("least_mm") = defaults.least_mm, py::arg("progress") = py::none(), k_doc.c_str());
}

}  // namespace

void add_calibration(py::module_& module) {
  add_results_of_solve(module);
  add_solve(module);
  add_scan(module);
  add_alignment(module);
  add_align(module);
}

}  // namespace limn::python
