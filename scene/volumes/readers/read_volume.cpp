// The shared library with the readers of volumes.
#include <exception>
#include <new>

#include "core/program_library.h"
#include "scene/volumes/readers/dicom_folder.h"
#include "scene/volumes/readers/nifti_file.h"
#include "scene/volumes/volume_name.h"
#include "scene/volumes/volume_reader.h"

namespace limn::scene {
namespace {

namespace fs = std::filesystem;

Result<Volume> read_volume(const fs::path& path) {
  std::error_code failed;
  if (fs::is_directory(path, failed)) return read_dicom_folder(path);
  if (!fs::exists(path, failed))
    return error("{}: expected a NIfTI file or a folder of DICOM slices, found nothing. Check the path.",
                 path.string());
  if (is_volume_name(path)) return read_nifti(path);
  return error(
      "{}: expected a NIfTI file (.nii, .nii.gz) or a folder of DICOM slices, found another file. Convert "
      "it, "
      "for example with dcm2niix.",
      path.string());
}

}  // namespace
}  // namespace limn::scene

LIMN_LIBRARY_VERSION(LIMN_VERSION)

extern "C" __attribute__((visibility("default"))) void limn_read_volume(
    const std::filesystem::path& path, limn::Result<limn::scene::Volume>* volume) {
  try {
    *volume = limn::scene::read_volume(path);
  } catch (const std::bad_alloc&) {
    *volume = limn::error(
        "{}: expected a volume that fits into memory, found too little of it. Resample the volume.",
        path.string());
  } catch (const std::exception& failed) {
    *volume = limn::error("{}: expected a volume, but it cannot be read: {}.", path.string(), failed.what());
  }
}
