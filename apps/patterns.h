#pragma once

#include <filesystem>
#include <string>

#include "calib/code/patterns.h"
#include "core/result.h"

namespace limn::apps {

struct PatternsOptions {
  std::string projector;  ///< Size in pixels, "1280x800".
  calib::PatternCode code = calib::PatternCode::gray;
  calib::CodeOptions code_options = calib::CodeOptions();
  std::filesystem::path linearise = {};  ///< With phase: response.json that the waves are corrected by.
  std::string name = {};                 ///< Projector in that file; may be empty if it holds only one.
  bool response = false;  ///< The images that measure the projector's response instead of a code.
  std::filesystem::path out;
};

/// `limn patterns`: writes the numbered PNGs of the code (or of the response) and patterns.json.
Status run_patterns(const PatternsOptions& options);

}  // namespace limn::apps
