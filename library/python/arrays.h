#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <array>
#include <cstddef>
#include <initializer_list>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "limn/image.h"
#include "limn/pose.h"

/// numpy's arrays as the library's types. What comes in is read where it is, and nothing of it is kept after
/// the call; what goes out is a view of memory that its owner keeps alive.
namespace limn::python {
namespace py = pybind11;

// ---- out ----

/// A view that cannot be written into; `owner` lives as long as the view.
template <class T>
py::array view_of(const T* data, std::vector<py::ssize_t> shape, py::handle owner) {
  py::array view(py::dtype::of<T>(), std::move(shape), data, owner);
  py::detail::array_proxy(view.ptr())->flags &= ~py::detail::npy_api::NPY_ARRAY_WRITEABLE_;
  return view;
}

/// An array with the values' memory.
template <class T>
py::array owning(std::vector<T> values, std::vector<py::ssize_t> shape) {
  auto owned = std::make_unique<std::vector<T>>(std::move(values));
  T* const data = owned->data();
  const py::capsule owner(owned.get(), [](void* memory) { delete static_cast<std::vector<T>*>(memory); });
  owned.release();
  return py::array(py::dtype::of<T>(), std::move(shape), data, owner);
}

/// (height, width) or (height, width, 3), with the image's memory.
py::array owning(Image image);

// ---- numbers in ----

/// An argument of fixed shape: anything that numpy makes such an array of.
template <class T, int... sides>
struct Numbers {
  static constexpr std::size_t k_size = static_cast<std::size_t>((sides * ... * 1));
  std::array<T, k_size> values = {};
};

/// `shape` is for the message.
[[noreturn]] void refuse_numbers(const std::string& shape, py::handle found);
std::string text_of_shape(std::initializer_list<int> sides);

/// Points or pixels: one (N,) or many (n, N), as doubles one after the other.
template <std::size_t N>
struct Points {
  py::array_t<double, py::array::c_style | py::array::forcecast> array;  ///< the caller's if it is already so

  bool is_one() const { return array.ndim() == 1; }
  std::size_t size() const { return is_one() ? 1 : static_cast<std::size_t>(array.shape(0)); }
  /// Lives as long as `array`. An array of N doubles has no gaps.
  std::span<const std::array<double, N>> span() const {
    return {reinterpret_cast<const std::array<double, N>*>(array.data()), size()};
  }
  /// A new array for M doubles for each point.
  template <std::size_t M>
  py::array_t<double> results() const {
    constexpr auto k_columns = static_cast<py::ssize_t>(M);
    return is_one() ? py::array_t<double>(k_columns) : py::array_t<double>({array.shape(0), k_columns});
  }
};
template <std::size_t M>
std::span<std::array<double, M>> span_of(py::array_t<double>& results) {
  return {reinterpret_cast<std::array<double, M>*>(results.mutable_data()),
          static_cast<std::size_t>(results.size()) / M};
}

// ---- images in ----

/// A numpy array of uint8.
struct ImageArray {
  py::array array;
};

/// Where its pixels are: (height, width) is grey, (height, width, 3) is `format`. ValueError: another shape,
/// pixels that do not lie side by side, rows that do not follow each other.
ImageView view_of(const ImageArray& image, PixelFormat format);
/// The same to write into. ValueError also: an array that is read-only.
MutableImageView mutable_view_of(const ImageArray& image, PixelFormat format);
/// A new array (height, width, 3).
ImageArray new_image(int width, int height);

}  // namespace limn::python

namespace pybind11::detail {

template <class T, int... sides>
struct type_caster<limn::python::Numbers<T, sides...>> {
  using Value = limn::python::Numbers<T, sides...>;
  PYBIND11_TYPE_CASTER(Value, const_name("numpy.ndarray"));

  bool load(handle source, bool) {
    const auto array = array_t<T, array::c_style | array::forcecast>::ensure(source);
    const std::array<ssize_t, sizeof...(sides)> shape = {sides...};
    if (!array || !std::equal(shape.begin(), shape.end(), array.shape(), array.shape() + array.ndim()))
      limn::python::refuse_numbers(limn::python::text_of_shape({sides...}), source);
    std::copy_n(array.data(), Value::k_size, value.values.begin());
    return true;
  }
};

template <std::size_t N>
struct type_caster<limn::python::Points<N>> {
  PYBIND11_TYPE_CASTER(limn::python::Points<N>, const_name("numpy.ndarray"));

  bool load(handle source, bool) {
    value.array = decltype(value.array)::ensure(source);
    const auto last = value.array ? value.array.ndim() - 1 : -1;
    if (last < 0 || last > 1 || value.array.shape(last) != static_cast<ssize_t>(N))
      limn::python::refuse_numbers("(" + std::to_string(N) + ",) or (n, " + std::to_string(N) + ")", source);
    return true;
  }
};

template <>
struct type_caster<limn::python::ImageArray> {
  PYBIND11_TYPE_CASTER(limn::python::ImageArray, const_name("numpy.ndarray[numpy.uint8]"));

  /// TypeError: no array of uint8. Nothing is converted.
  bool load(handle source, bool);
};

}  // namespace pybind11::detail
