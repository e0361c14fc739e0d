#pragma once

#include <string>

namespace limn {

/// Prints the line that says why the program ends, as log_line() does; systemd's journal gets it as an error.
void log_error_line(const std::string& line);

}  // namespace limn
