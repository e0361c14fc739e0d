#pragma once

#include <filesystem>

#include "core/result.h"
#include "validate/hardware_report/private_words.h"

namespace limn::validate {

/// Removes what a report does not need from its folder: what people made of the scene (comments, pairings,
/// looks), keys and certificates, links to other places.
Status remove_unneeded(const std::filesystem::path& folder);

/// Takes private words out of all text files in the folder (JSON, HTML, CSV, lenses, logs), and metadata out
/// of its JPEG files, which are a camera's own (PNG files are Limn's, without metadata). Programs read the
/// files as before. Error: a file cannot be read or written.
Status clean_folder(const std::filesystem::path& folder, const PrivateWords& words);

}  // namespace limn::validate
