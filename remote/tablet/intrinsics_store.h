#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "calib/online_intrinsics.h"
#include "core/result.h"

namespace limn::remote {

/// Whether a device can have this name: 8 to 64 letters, digits, `-`.
bool is_device_name(const std::string& device);

/// The saved estimates of a device's lens, one for each aspect ratio of its images: FOLDER/DEVICE.json
/// (limn.guest_lens/1). Empty when there is no file; a damaged file is a warning and empty.
std::vector<calib::IntrinsicsEstimate> load_lenses(const std::filesystem::path& folder,
                                                   const std::string& device);

/// Replaces the saved estimates. Of more than 200 devices the oldest files are removed.
Status save_lenses(const std::filesystem::path& folder,
                   const std::string& device,
                   const std::vector<calib::IntrinsicsEstimate>& lenses);

}  // namespace limn::remote
