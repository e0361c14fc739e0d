#pragma once

#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <array>
#include <string>
#include <type_traits>
#include <vector>

#include "library/python/arrays.h"
#include "library/python/words.h"

namespace limn::python {

/// "Name(field=value, …)", with the words of Python.
std::string text_of_record(py::handle record, const std::vector<std::string>& fields);
/// What pickle and copy need: the class and the arguments of its constructor.
py::tuple reduced(py::handle record, const std::vector<std::string>& fields);

/// The class of a plain struct. It does not change in Python: a list in it would be a copy, and a change of a
/// copy would be lost. Arrays are views of the struct.
template <class T>
class Record {
 public:
  Record(py::module_& module, const char* name, const char* doc) : type_(module, name, doc) {}

  template <class Member>
  Record& field(const char* name, Member T::*member, const char* doc) {
    fields_.emplace_back(name);
    if constexpr (is_vector<Member>::value)
      type_.def_property_readonly(
          name,
          [member](py::object self) {
            return py::tuple(
                py::cast(self.cast<const T&>().*member, py::return_value_policy::reference_internal, self));
          },
          doc);
    else
      type_.def_readonly(name, member, doc);
    return *this;
  }

  /// An array of this shape.
  template <int... sides, class Member>
  Record& array(const char* name, Member T::*member, const char* doc) {
    fields_.emplace_back(name);
    type_.def_property_readonly(
        name,
        [member](py::object self) {
          const auto* first = &(self.cast<const T&>().*member)[0];
          if constexpr (std::is_class_v<std::remove_pointer_t<decltype(first)>>)
            return view_of(first->data(), {sides...}, self);
          else
            return view_of(first, {sides...}, self);
        },
        doc);
    return *this;
  }

  template <class Init, class... Extra>
  Record& init(Init&& function, const Extra&... extra) {
    type_.def(py::init(std::forward<Init>(function)), extra...);
    type_.def("__reduce__", [fields = fields_](py::handle self) { return reduced(self, fields); });
    return *this;
  }

  /// After all fields.
  py::class_<T>& ended() {
    type_.def("__repr__", [fields = fields_](py::handle self) { return text_of_record(self, fields); });
    return type_;
  }

 private:
  template <class M>
  struct is_vector : std::false_type {};
  template <class E>
  struct is_vector<std::vector<E>> : std::true_type {};

  py::class_<T> type_;
  std::vector<std::string> fields_;
};

/// One for each header.
void add_basics(py::module_& module);
void add_rig(py::module_& module);
void add_markers(py::module_& module);
void add_bodies(py::module_& module);
void add_calibration(py::module_& module);
void add_renderer(py::module_& module);

}  // namespace limn::python
