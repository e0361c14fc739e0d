// Volumes: NIfTI, or one DICOM slice that lies in a folder beside another one. What is read has finite
// numbers.
#include <cmath>
#include <filesystem>
#include <string_view>

#include "core/log.h"
#include "scene/volumes/volume.h"
#include "tests/fuzz/fuzz_file.h"
#include "tests/support/volume_files.h"

namespace {

using namespace limn;
namespace fs = std::filesystem;

// The slice in a folder with one that is whole, like the seeds' at another place.
fs::path written_series(const std::uint8_t* bytes, std::size_t size) {
  test::DicomFile other;
  other.position = "0\\0\\4";
  for (int i = 0; i < 4; ++i) other.add_value(i);
  const std::string whole = other.bytes();
  const fs::path beside =
      test::fuzzed_file(reinterpret_cast<const std::uint8_t*>(whole.data()), whole.size(), "b.dcm");
  const fs::path folder = beside.parent_path() / "series";
  fs::create_directories(folder);
  fs::rename(beside, folder / "b.dcm");
  fs::rename(test::fuzzed_file(bytes, size, "a.dcm"), folder / "a.dcm");
  return folder;
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  set_log_level(LogLevel::quiet);
  const std::string_view text(reinterpret_cast<const char*>(bytes), size);
  const fs::path path = size > 132 && text.substr(128, 4) == "DICM" ? written_series(bytes, size)
                                                                    : test::fuzzed_file(bytes, size, "a.nii");
  const auto volume = scene::load_volume(path);
  test::check_read(volume, path);
  if (!volume) return 0;
  LIMN_CHECK(volume->values.size() == static_cast<std::size_t>(volume->size[0]) *
                                          static_cast<std::size_t>(volume->size[1]) *
                                          static_cast<std::size_t>(volume->size[2]));
  LIMN_CHECK(std::isfinite(volume->least) && std::isfinite(volume->most) && volume->window.width > 0);
  LIMN_CHECK(volume->part_from_voxel.matrix().allFinite());
  return 0;
}
