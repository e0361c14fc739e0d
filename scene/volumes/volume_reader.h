#pragma once

#include <filesystem>

#include "core/result.h"
#include "scene/volumes/volume.h"

namespace limn::scene {

/// The type of limn_read_volume(), the function of the shared library in scene/volumes/readers/: reads a
/// volume as load_volume(), without messages.
using ReadVolume = void(const std::filesystem::path& path, Result<Volume>* volume);

}  // namespace limn::scene
