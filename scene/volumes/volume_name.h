#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

namespace limn::scene {

/// Whether a path is named as a file of a volume: .nii or .nii.gz.
bool is_volume_name(const std::filesystem::path& path);

/// The file's name without .nii or .nii.gz; a folder's name as it is.
std::string volume_stem(const std::filesystem::path& path);

/// Whether the file has DICOM's signature.
bool is_dicom_file(const std::filesystem::path& path);

/// Whether there is a DICOM file in the folder itself; only its first files are read.
bool is_dicom_folder(const std::filesystem::path& folder);

/// The first `most` files of a folder by name, without hidden ones and the list of a medium (DICOMDIR).
std::vector<std::filesystem::path> visible_files(const std::filesystem::path& folder, std::size_t most);

}  // namespace limn::scene
