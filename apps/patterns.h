#pragma once

#include <filesystem>
#include <string>

#include "calib/code/patterns.h"
#include "core/result.h"

namespace limn::apps {

struct PatternsOptions {
  std::string projector;  ///< its size, "1280x800"
  std::string code = "gray";
  calib::CodeOptions code_options = calib::CodeOptions();
  std::filesystem::path linearise = {};  ///< phase: the response.json that the waves are drawn by
  std::string name = {};                 ///< of the projector in it; may be left out where it holds one alone
  bool response = false;  ///< the images that measure the projector's response instead of a code
  std::filesystem::path out;
};

/// `limn patterns`: the code's (or the response's) numbered PNGs and patterns.json.
Status run_patterns(const PatternsOptions& options);

}  // namespace limn::apps
