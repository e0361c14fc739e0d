#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "apps/command_line.h"

namespace limn::test {

struct Outcome {
  int code = 0;          ///< exit code
  std::string out, err;  ///< what was printed
};

/// Runs the program in this process: run_limn({"check", "--json"}).
inline Outcome run_limn(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), "limn");
  std::vector<char*> argv;
  for (std::string& argument : arguments) argv.push_back(argument.data());
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  Outcome outcome;
  outcome.code = apps::run_command_line(static_cast<int>(argv.size()), argv.data());
  outcome.err = testing::internal::GetCapturedStderr();
  outcome.out = testing::internal::GetCapturedStdout();
  return outcome;
}

}  // namespace limn::test
