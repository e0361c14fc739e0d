#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn::apps {

/// Writes the ARToolKit template of the one black frame in the image (tracker/template_training.h) and
/// prints where the frame lay. `out` must end in .patt.
Status train_template(const std::filesystem::path& image, const std::filesystem::path& out);

/// Prints, and writes to `json` unless it is empty, how well the template files are told apart: every pair
/// and every one with itself turned, the most alike first.
Status compare_templates(const std::vector<std::filesystem::path>& files, const std::filesystem::path& json);

}  // namespace limn::apps
