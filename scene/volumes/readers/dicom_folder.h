#pragma once

#include <filesystem>

#include "core/result.h"
#include "scene/volumes/volume.h"

namespace limn::scene {

/// Reads the slices of one series from a folder (not from folders in it), with dcmtk, in the order of their
/// places. Slices that lean (a tilted gantry) are placed as they are. Errors as load_volume().
Result<Volume> read_dicom_folder(const std::filesystem::path& folder);

}  // namespace limn::scene
