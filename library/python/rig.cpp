#include "limn/rig.h"

#include <fmt/format.h>

#include "library/python/calls.h"
#include "library/python/record.h"

namespace limn::python {
namespace {

std::string text_of(const Imager& imager) {
  return fmt::format("<limn.Imager '{}', {} x {} pixels, {}>", imager.name(), imager.width(), imager.height(),
                     imager.parts().lens_model);
}

py::array_t<double> projected(const Imager& imager, const Points<3>& points) {
  auto results = points.results<2>();
  const auto px = span_of<2>(results);
  const auto p_world = points.span();
  without_gil([&] { imager.project(p_world, px); });
  return results;
}

py::array_t<double> unprojected(const Imager& imager, const Points<2>& pixels) {
  auto results = pixels.results<3>();
  const auto d_world = span_of<3>(results);
  const auto px = pixels.span();
  without_gil([&] { imager.unproject(px, d_world); });
  return results;
}

void add_properties(py::class_<Imager>& type) {
  type.def_property_readonly("name", &Imager::name, "Its name, which is unique in a rig.")
      .def_property_readonly("width", &Imager::width, "Pixels; 0: not known.")
      .def_property_readonly("height", &Imager::height, "Pixels; 0: not known.")
      .def_property_readonly(
          "lens_model", [](const Imager& imager) { return imager.parts().lens_model; },
          "One of mrcal's lens models.")
      .def_property_readonly(
          "lens_values",
          [](const Imager& imager) {
            auto values = imager.parts().lens_values;
            const auto count = static_cast<py::ssize_t>(values.size());
            return owning(std::move(values), {count});
          },
          "fx, fy, cx, cy (pixels), then the model's own: a new array.")
      .def_property_readonly("imager_from_world", &Imager::imager_from_world, "Where it stands.")
      .def_property_readonly(
          "sees_infrared", [](const Imager& imager) { return imager.parts().sees_infrared; },
          "A camera behind a filter that blocks projected light.");
}

void add_imager(py::module_& module) {
  py::class_<Imager> type(
      module, "Imager",
      R"(A camera or a projector: both have the same geometry; only the direction of light differs. Frame: x
right, y down, z forward. Pixel (0, 0) is the centre of the top-left pixel. It does not change, and
several threads may use it.)");
  type.def(py::init([](std::string name, int width, int height, std::string lens_model,
                       std::vector<double> lens_values, const Pose& imager_from_world, bool sees_infrared) {
             return Imager({std::move(name), width, height, std::move(lens_model), std::move(lens_values),
                            imager_from_world, sees_infrared});
           }),
           py::arg("name"), py::arg("width"), py::arg("height"),
           py::arg("lens_model") = ImagerParts{}.lens_model,
           py::arg_v("lens_values", py::make_tuple(1, 1, 0, 0), "(1, 1, 0, 0)"),
           py::arg_v("imager_from_world", Pose{}, "Pose()"), py::arg("sees_infrared") = false,
           R"(From its parts: at most 16384 pixels a side (0: not known); `lens_model` is one of mrcal's:
LENSMODEL_PINHOLE, LENSMODEL_OPENCV4/5/8/12, LENSMODEL_SPLINED_STEREOGRAPHIC_order=… and so on;
`lens_values` are fx, fy, cx, cy (pixels), then the model's own. Error: an unknown lens model, a
wrong number of values, values or a size that no imager has.)")
      .def_static(
          "load", released(&Imager::load), py::arg("path"),
          R"(Reads a camera file: .cameramodel and .cahvor of mrcal; OpenCV (YAML, XML, JSON), ROS camera_info,
Kalibr, PhotonVision, ORB-SLAM; ARToolKit camera_para.dat. `path` may be FILE:NAME for one of
several cameras in a file. Without a pose in the file it stands at the world's origin. Error: the
message names what is not understood.)")
      .def_static(
          "pinhole", &Imager::pinhole, py::arg("name"), py::arg("width"), py::arg("height"),
          py::arg("fov_deg"), py::arg("imager_from_world"),
          R"(Without distortion, with this horizontal field of view (degrees, between 0 and 180) and the
principal point in the middle.)")
      .def(
          "save",
          [](const Imager& imager, const std::filesystem::path& path, CameraFile format) {
            without_gil([&] { imager.save(path, format); });
          },
          py::arg("path"), py::arg_v("format", CameraFile::mrcal, "'mrcal'"),
          R"(Writes 'mrcal' (.cameramodel: any lens, with the pose), 'opencv' (YAML of cv::FileStorage, with the
pose) or 'ros' (YAML of camera_info, without the pose). Error: a lens that the format cannot hold
within 0.1 px, or a file that cannot be written, whose old content stays.)")
      .def("placed", &Imager::placed, py::arg("imager_from_world"), "The same imager in another place.")
      .def(
          "project", &projected, py::arg("p_world"),
          R"(Pixels (2,) or (n, 2) of points in the world (3,) or (n, 3), m. They may lie outside the image; NaN
for a point without one (behind). A C-contiguous array of float64 is read where it is.)")
      .def(
          "unproject", &unprojected, py::arg("px"),
          R"(Unit directions in the world, (3,) or (n, 3), from the imager's position, of pixels (2,) or (n, 2);
NaN outside the lens's domain.)")
      .def(
          "ray",
          [](const Imager& imager, const Numbers<double, 2>& px) { return imager.unproject(px.values); },
          py::arg("px"), R"(The ray of a pixel in the world; None for a pixel outside the lens's domain.)")
      .def("__repr__", &text_of);
  add_properties(type);
  module.def(
      "save_kalibr",
      [](const std::vector<Imager>& cameras, const std::filesystem::path& path) {
        without_gil([&] { save_kalibr(cameras, path); });
      },
      py::arg("cameras"), py::arg("path"),
      R"(Writes a camchain.yaml of Kalibr: the cameras as cam0, cam1 … in this order, each with its pose
relative to the one before. Error: as of Imager.save.)");
}

}  // namespace

void add_rig(py::module_& module) {
  Record<Ray>(module, "Ray", "A half-line.")
      .array<3>("p_origin", &Ray::p_origin, "Its origin: m, shape (3,).")
      .array<3>("d", &Ray::d, "Its unit direction, shape (3,).")
      .ended();
  add_imager(module);
  py::class_<Rig>(
      module, "Rig",
      R"(Calibrated cameras and projectors in one world frame, with what was measured of their light. The
world is camera 0, until the rig is put on the table. It does not change.

    rig = limn.Rig.load("rig")
    projector = rig.find("projector0"))")
      .def(py::init([](const std::vector<Imager>& cameras, const std::vector<Imager>& projectors) {
             return Rig(cameras, projectors);
           }),
           py::arg("cameras"), py::arg("projectors"), "Error: two devices of one name.")
      .def_static(
          "load", released(&Rig::load), py::arg("path"),
          R"(Reads a rig folder (rig.json, response.json), a rig.json, or a folder of .cameramodel files, of
which those whose names begin with "projector" are projectors. Error: files that cannot be read.)")
      .def(
          "save",
          [](const Rig& rig, const std::filesystem::path& folder) { without_gil([&] { rig.save(folder); }); },
          py::arg("folder"),
          R"(Writes rig.json and one NAME.cameramodel for each device; each replaces its old version when it is
complete. What was measured of the light is not written. Error: a folder that cannot be written.)")
      .def_property_readonly(
          "cameras", [](const Rig& rig) { return py::tuple(py::cast(rig.cameras())); }, "Its cameras.")
      .def_property_readonly(
          "projectors", [](const Rig& rig) { return py::tuple(py::cast(rig.projectors())); },
          "Its projectors.")
      .def("find", &Rig::find, py::arg("name"),
           R"(A camera or projector by its name. Error: there is none; the message lists the names.)")
      .def("__repr__", [](const Rig& rig) {
        std::string text = "<limn.Rig";
        for (const auto& devices : {rig.cameras(), rig.projectors()})
          for (const Imager& device : devices) text += " '" + device.name() + "'";
        return text + ">";
      });
}

}  // namespace limn::python
