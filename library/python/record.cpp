#include "library/python/record.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace limn::python {
namespace {

constexpr py::ssize_t k_most_numbers = 8;

std::string text_of_value(py::handle value) {
  if (!py::isinstance<py::array>(value)) return py::repr(value);
  const auto array = py::reinterpret_borrow<py::array>(value);
  if (array.size() <= k_most_numbers) return py::repr(array.attr("tolist")());
  std::vector<std::string> sides;
  for (py::ssize_t i = 0; i < array.ndim(); ++i) sides.push_back(std::to_string(array.shape(i)));
  return fmt::format("<{}>", fmt::join(sides, " x "));
}

}  // namespace

std::string text_of_record(py::handle record, const std::vector<std::string>& fields) {
  std::vector<std::string> texts;
  for (const std::string& field : fields)
    texts.push_back(fmt::format("{}={}", field, text_of_value(record.attr(field.c_str()))));
  const std::string name = py::str(py::type::handle_of(record).attr("__name__"));
  return fmt::format("{}({})", name, fmt::join(texts, ", "));
}

py::tuple reduced(py::handle record, const std::vector<std::string>& fields) {
  py::tuple arguments(fields.size());
  for (std::size_t i = 0; i < fields.size(); ++i) arguments[i] = record.attr(fields[i].c_str());
  return py::make_tuple(py::type::of(record), arguments);
}

}  // namespace limn::python
