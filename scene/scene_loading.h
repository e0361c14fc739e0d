#pragma once

#include <filesystem>
#include <vector>

#include "core/result.h"
#include "scene/meshes/cad_file.h"
#include "scene/scene.h"

namespace limn::scene {

/// As load_scene() of scene/scene.h; `wait` says what is done about CAD files.
Result<Scene> load_scene(const std::filesystem::path& path,
                         std::vector<SkippedVariant>* skipped_variants,
                         EmptySlots empty_slots,
                         const CadWait& wait);

}  // namespace limn::scene
