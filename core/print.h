#pragma once

#include <fmt/format.h>

#include <string>
#include <utility>

#include "core/result.h"

namespace limn {

/// Writes text to standard output. It never throws: flush_output() reports what could not be written.
void print_text(const std::string& text);

/// print_text() with fmt's format.
template <class... Values>
void print_out(fmt::format_string<Values...> format, Values&&... values) {
  print_text(fmt::format(format, std::forward<Values>(values)...));
}

/// Writes everything that was printed so far, also through std::cout. Error: some of it could not be written,
/// now or before.
Status flush_output();

}  // namespace limn
