#pragma once

#include <filesystem>
#include <span>

#include "core/result.h"
#include "scene/show_state.h"

namespace limn::apps {

/// A self-contained page of a project's looks for a review: each one's image (NAME.png in `folder`) and
/// variants. Looks without an image are listed without.
Status write_contact_sheet(std::span<const scene::Look> looks,
                           const std::filesystem::path& folder,
                           const std::filesystem::path& page);

}  // namespace limn::apps
