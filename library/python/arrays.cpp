#include "library/python/arrays.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <limits>
#include <utility>

namespace limn::python {
namespace {

std::string text_of_type(py::handle found) { return py::str(py::type::handle_of(found).attr("__name__")); }

// The array's shape as numpy prints it.
std::string text_of_shape(const py::array& array) { return py::str(array.attr("shape")); }

bool is_numeric(const py::array& array) {
  return std::string("biuf").find(array.dtype().kind()) != std::string::npos;
}

constexpr py::ssize_t k_most_side = std::numeric_limits<int>::max() / 3;

}  // namespace

py::array owning(Image image) {
  std::vector<py::ssize_t> shape = {image.height, image.width};
  if (image.channels() > 1) shape.push_back(image.channels());
  return owning(std::move(image.pixels), std::move(shape));
}

std::string text_of_shape(std::initializer_list<int> sides) {
  return fmt::format("({}{})", fmt::join(sides, ", "), sides.size() == 1 ? "," : "");
}

void refuse_numbers(const std::string& shape, py::handle found) {
  PyErr_Clear();
  const auto array = py::array::ensure(found);
  if (!array || !is_numeric(array))
    throw py::type_error(fmt::format("expected an array of numbers of shape {}, found {} '{}'.", shape,
                                     text_of_type(found), std::string(py::str(found))));
  throw py::value_error(
      fmt::format("expected an array of shape {}, found shape {}.", shape, text_of_shape(array)));
}

namespace {

// Bytes from one row to the next.
std::ptrdiff_t stride_of(const py::array& array, int channels) {
  const auto width = array.shape(1);
  // numpy says nothing about the stride of a side of one.
  const bool are_pixels_together = width <= 1 || array.strides(1) == channels;
  const bool are_channels_together = channels == 1 || array.strides(2) == 1;
  const auto row = width * channels;
  if (array.size() == 0) return row;  // the library has a message
  if (array.shape(0) <= 1 && are_pixels_together && are_channels_together) return row;
  if (array.strides(0) >= row && are_pixels_together && are_channels_together) return array.strides(0);
  throw py::value_error(
      fmt::format("image: expected pixels side by side and rows one after the other (strides of at least {}, "
                  "{}{}), found strides {}. Use numpy.ascontiguousarray(image).",
                  row, channels, channels == 1 ? "" : " and 1", std::string(py::str(array.attr("strides")))));
}

struct Layout {
  int width, height;
  std::ptrdiff_t stride;
  PixelFormat format;
};

Layout layout_of(const py::array& array, PixelFormat format) {
  const auto sides = array.ndim();
  const bool is_colour = sides == 3 && array.shape(2) == 3;
  if (!(sides == 2 || is_colour) || array.shape(0) > k_most_side || array.shape(1) > k_most_side)
    throw py::value_error(fmt::format(
        "image: expected an array of shape (height, width) or (height, width, 3), found shape {}.",
        text_of_shape(array)));
  if (is_colour && format == PixelFormat::grey)
    throw py::value_error(
        fmt::format("image: expected an array of shape (height, width) for format 'grey', found shape {}.",
                    text_of_shape(array)));
  return {static_cast<int>(array.shape(1)), static_cast<int>(array.shape(0)),
          stride_of(array, is_colour ? 3 : 1), is_colour ? format : PixelFormat::grey};
}

}  // namespace

ImageView view_of(const ImageArray& image, PixelFormat format) {
  const Layout layout = layout_of(image.array, format);
  return {static_cast<const std::uint8_t*>(image.array.data()), layout.width, layout.height, layout.stride,
          layout.format};
}

MutableImageView mutable_view_of(const ImageArray& image, PixelFormat format) {
  const Layout layout = layout_of(image.array, format);
  if (!image.array.writeable())
    throw py::value_error("out: expected an array that can be written into, found one that is read-only.");
  auto* const data = static_cast<std::uint8_t*>(const_cast<void*>(image.array.data()));
  return {data, layout.width, layout.height, layout.stride, layout.format};
}

ImageArray new_image(int width, int height) { return {py::array_t<std::uint8_t>({height, width, 3})}; }

}  // namespace limn::python

namespace pybind11::detail {

bool type_caster<limn::python::ImageArray>::load(handle source, bool) {
  if (!isinstance<array>(source))
    throw type_error("image: expected a numpy array of uint8, found " +
                     std::string(str(type::handle_of(source).attr("__name__"))) + ".");
  auto found = reinterpret_borrow<array>(source);
  if (found.dtype().kind() != 'u' || found.itemsize() != 1)
    throw type_error("image: expected a numpy array of uint8, found one of " +
                     std::string(str(static_cast<handle>(found.dtype()))) +
                     ". Convert it yourself, so that its range is known.");
  value.array = std::move(found);
  return true;
}

}  // namespace pybind11::detail
