#pragma once

#include <gtest/gtest.h>

#include <string>

namespace limn::test {

/// Expects a part in a message. A failure is reported at the caller's line: `file` and `line` are left out.
/// (clang 14 has no std::source_location.)
inline void expect_contains(const std::string& message,
                            const std::string& part,
                            const char* file = __builtin_FILE(),
                            int line = __builtin_LINE()) {
  if (message.find(part) == std::string::npos) ADD_FAILURE_AT(file, line) << part << " in: " << message;
}

}  // namespace limn::test
