#pragma once

#include <filesystem>
#include <span>

#include "core/result.h"
#include "scene/show_state.h"

namespace limn::session {

/// Writes a self-contained HTML page for a review of a project's looks: each look's image (NAME.png in
/// `folder`) and its variants. A look without an image file is listed without an image.
Status write_contact_sheet(std::span<const scene::Look> looks,
                           const std::filesystem::path& folder,
                           const std::filesystem::path& page);

}  // namespace limn::session
