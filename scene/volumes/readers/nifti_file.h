#pragma once

#include <filesystem>

#include "core/result.h"
#include "scene/volumes/volume.h"

namespace limn::scene {

/// Reads a NIfTI-1 or NIfTI-2 file (.nii, .nii.gz) with the NIfTI library. Where several moments are in it,
/// the first. The places of voxels are those of its sform, else its qform, else its spacing alone, with a
/// warning. Errors as load_volume().
Result<Volume> read_nifti(const std::filesystem::path& path);

}  // namespace limn::scene
