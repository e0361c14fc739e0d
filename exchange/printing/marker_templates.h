#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn::exchange {

/// Writes the ARToolKit template of the one black frame in the image (tracker/template_training.h) and prints
/// where the frame was found. `out` must end in .patt. `pattern_ratio`: width of the pattern as share of the
/// frame's.
Status train_template(const std::filesystem::path& image,
                      double pattern_ratio,
                      const std::filesystem::path& out);

/// Prints how well the template files can be distinguished: every pair, and every template with itself
/// turned, the most similar first. Also writes this to `json` unless that is empty.
Status compare_templates(const std::vector<std::filesystem::path>& files, const std::filesystem::path& json);

}  // namespace limn::exchange
