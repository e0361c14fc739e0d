#include <pybind11/operators.h>

#include "library/python/calls.h"
#include "library/python/record.h"
#include "limn/error.h"
#include "limn/image.h"
#include "limn/pose.h"

namespace limn::python {
namespace {

py::array_t<double> moved(const Pose& pose, const Points<3>& points) {
  auto results = points.results<3>();
  const auto p_a = span_of<3>(results);
  const auto p_b = points.span();
  for (std::size_t i = 0; i < p_b.size(); ++i) p_a[i] = pose * p_b[i];
  return results;
}

void add_pose(py::module_& module) {
  Record<Pose> record(
      module, "Pose",
      R"(A rigid motion, named a_from_b: it takes coordinates in b to coordinates in a, p_a = a_from_b * p_b,
and a_from_c = a_from_b * b_from_c.

rotation_wxyz: unit quaternion; one with fewer digits is normalised. translation: m.)");
  record.array<4>("rotation_wxyz", &Pose::rotation_wxyz, "Unit quaternion (w, x, y, z), shape (4,).")
      .array<3>("translation", &Pose::translation, "b's origin in a: m, shape (3,).")
      .init(
          [](const Numbers<double, 4>& rotation, const Numbers<double, 3>& translation) {
            return Pose{rotation.values, translation.values};
          },
          py::arg_v("rotation_wxyz", py::make_tuple(1, 0, 0, 0), "(1, 0, 0, 0)"),
          py::arg_v("translation", py::make_tuple(0, 0, 0), "(0, 0, 0)"));
  auto& type = record.ended();
  type.def_static(
          "from_matrix", [](const Numbers<double, 4, 4>& matrix) { return Pose::from_matrix(matrix.values); },
          py::arg("matrix"),
          R"(From 4 x 4 for column vectors. Error: the upper left 3 x 3 is no rotation within 1e-6, or the last
row is not 0 0 0 1.)")
      .def(
          "matrix",
          [](const Pose& pose) {
            const auto rows = pose.matrix();
            return owning(std::vector<double>(rows.begin(), rows.end()), {4, 4});
          },
          "4 x 4, for column vectors.")
      .def("inverse", &Pose::inverse, "b_from_a.")
      .def(
          "__mul__", [](const Pose& pose, const Pose& other) { return pose * other; }, py::is_operator(),
          "a_from_b * b_from_c is a_from_c.")
      .def("__mul__", &moved, py::is_operator(), "Points in b, (3,) or (n, 3), as points in a: m.")
      .def(py::self == py::self);
  type.attr("__array_ufunc__") = py::none();  // array * pose is an error, not an array of poses
}

void add_images(py::module_& module) {
  module.def(
      "read_image",
      [](const std::filesystem::path& path, PixelFormat format) {
        return owning(without_gil([&] { return read_image(path, format); }));
      },
      py::arg("path"), py::arg_v("format", PixelFormat::rgb, "'rgb'"),
      R"(Reads PNG, JPEG, PBM, PGM, PPM, BMP, TIFF, WebP or TGA as uint8: (height, width, 3) in 'rgb' or
'bgr', or (height, width) in 'grey'. Transparent parts are shown on white. Error: no such file,
damaged, of another format, larger than 32767 pixels a side.)");
  module.def(
      "write_png",
      [](const std::filesystem::path& path, const ImageArray& image, PixelFormat format) {
        const ImageView view = view_of(image, format);
        without_gil([&] { write_png(path, view); });
      },
      py::arg("path"), py::arg("image"), py::kw_only(), py::arg_v("format", PixelFormat::rgb, "'rgb'"),
      R"(Writes a PNG of uint8: (height, width), or (height, width, 3) in `format` 'rgb' or 'bgr'. When
writing fails, `path` keeps its old content.)");
}

}  // namespace

void add_basics(py::module_& module) {
  Record<Progress>(module, "Progress", "How far a long call is.")
      .field("stage", &Progress::stage, "One word, such as 'decode'.")
      .field("done", &Progress::done, "Steps of the stage that are done.")
      .field("total", &Progress::total, "All steps of the stage; 0: not known.")
      .ended();
  add_pose(module);
  module.def(
      "looking_at",
      [](const Numbers<double, 3>& p_eye, const Numbers<double, 3>& p_target,
         const Numbers<double, 3>& d_up) { return looking_at(p_eye.values, p_target.values, d_up.values); },
      py::arg("p_eye"), py::arg("p_target"), py::arg("d_up"),
      R"(camera_from_world of a camera at `p_eye` that looks at `p_target`, where `d_up` points up in its
image as far as possible. Frames of cameras and projectors: x right, y down, z forward.)");
  add_images(module);
}

}  // namespace limn::python
