#pragma once

#include <gtest/gtest.h>

#include <source_location>
#include <string>

namespace limn::test {

/// Expects a part in a message. A failure is reported at the caller's line.
inline void expect_contains(const std::string& message,
                            const std::string& part,
                            const std::source_location& caller = std::source_location::current()) {
  if (message.find(part) == std::string::npos)
    ADD_FAILURE_AT(caller.file_name(), static_cast<int>(caller.line())) << part << " in: " << message;
}

}  // namespace limn::test
