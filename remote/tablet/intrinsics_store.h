#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "calib/online_intrinsics.h"
#include "core/result.h"

namespace limn::remote {

/// Whether a name can be a device's: 8 to 64 letters, digits, `-`.
bool is_device_name(const std::string& device);

/// What earlier uses found of a device's lens, one estimate for each aspect ratio of its images:
/// FOLDER/DEVICE.json (limn.guest_lens/1). Nothing where nothing is kept; a damaged file is a warning and
/// nothing.
std::vector<calib::IntrinsicsEstimate> load_lenses(const std::filesystem::path& folder,
                                                   const std::string& device);

/// Replaces it. Of more than 200 devices those go whose files are oldest.
Status save_lenses(const std::filesystem::path& folder,
                   const std::string& device,
                   const std::vector<calib::IntrinsicsEstimate>& lenses);

}  // namespace limn::remote
