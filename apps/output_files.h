#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn::apps {

/// A path from the command line, and the option that it was given with ("" for arguments without one).
struct NamedFile {
  std::string option;
  std::filesystem::path path;
};

/// Wrong usage if writing one of the outputs would replace an input file or another output, also through
/// links. Folders are no files: nothing is replaced by writing into them.
Status check_outputs(const std::vector<NamedFile>& outputs, const std::vector<NamedFile>& inputs);

/// The files that the drawings of these images are written to: `folder`/STEM.png; where two images have one
/// stem, the folders of the path are part of the name (left-000.png). No two drawings share a file, and none
/// is one of the images: it is then called STEM-drawn.png.
std::vector<std::filesystem::path> drawing_files(const std::vector<std::filesystem::path>& images,
                                                 const std::filesystem::path& folder);

/// How results name these images: by the base name, or by the path as given if two have one base name.
std::vector<std::string> names_in_results(const std::vector<std::filesystem::path>& images);

}  // namespace limn::apps
