#pragma once

#include <filesystem>
#include <stop_token>
#include <vector>

#include "core/result.h"
#include "scene/scene.h"

namespace limn::scene {

/// As load_scene() of scene/scene.h; the reading of a CAD file, which may take minutes, ends with an error
/// when `stop` is requested.
Result<Scene> load_scene(const std::filesystem::path& path,
                         std::vector<SkippedVariant>* skipped_variants,
                         EmptySlots empty_slots,
                         const std::stop_token& stop);

}  // namespace limn::scene
