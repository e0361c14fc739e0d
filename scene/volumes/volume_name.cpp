#include "scene/volumes/volume_name.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <fstream>

namespace limn::scene {

namespace fs = std::filesystem;

bool is_volume_name(const fs::path& path) {
  std::string name = path.filename().string();
  std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) { return std::tolower(c); });
  return name.ends_with(".nii") || name.ends_with(".nii.gz");
}

std::string volume_stem(const fs::path& path) {
  const fs::path stem = is_volume_name(path) ? path.stem() : path.filename();
  return is_volume_name(stem) ? stem.stem().string() : stem.string();
}

bool is_dicom_file(const fs::path& path) {
  std::array<char, 132> head{};
  std::ifstream in(path, std::ios::binary);
  return in.read(head.data(), head.size()) && std::string(head.data() + 128, 4) == "DICM";
}

bool is_dicom_folder(const fs::path& folder) {
  constexpr std::size_t k_first = 16;
  std::error_code none;
  if (!fs::is_directory(folder, none)) return false;
  const std::vector<fs::path> files = visible_files(folder, k_first);
  return std::any_of(files.begin(), files.end(), is_dicom_file);
}

std::vector<fs::path> visible_files(const fs::path& folder, std::size_t most) {
  std::vector<fs::path> files;
  std::error_code failed;
  for (fs::directory_iterator entry(folder, failed), end; !failed && entry != end && files.size() < most;
       entry.increment(failed)) {
    const std::string name = entry->path().filename().string();
    std::error_code none;
    if (!name.starts_with(".") && name != "DICOMDIR" && entry->is_regular_file(none))
      files.push_back(entry->path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

}  // namespace limn::scene
