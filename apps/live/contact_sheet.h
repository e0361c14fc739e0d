#pragma once

#include <filesystem>
#include <span>

#include "core/result.h"
#include "scene/staging.h"

namespace limn::apps {

/// A self-contained page of a project's looks for a review: each one's picture (NAME.png in `folder`) and
/// variants. Looks without a picture are listed without.
Status write_contact_sheet(std::span<const scene::Look> looks,
                           const std::filesystem::path& folder,
                           const std::filesystem::path& page);

}  // namespace limn::apps
