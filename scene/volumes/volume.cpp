#include "scene/volumes/volume.h"

#include "core/log.h"
#include "core/program_library.h"
#include "scene/volumes/volume_reader.h"

namespace limn::scene {

Result<Volume> load_volume(const std::filesystem::path& path) {
  LIMN_TRY(void* function, library_function({.file = "liblimn_volumes.so",
                                             .variable = "LIMN_VOLUMES",
                                             .purpose = "the readers of NIfTI and DICOM",
                                             .build_package = "libdcmtk-dev"},
                                            "limn_read_volume"));
  Result<Volume> volume = Volume{};
  reinterpret_cast<ReadVolume*>(function)(path, &volume);
  if (volume)
    for (const std::string& warning : volume->warnings) log_warning("{}", warning);
  return volume;
}

Volume scaled(Volume volume, double scale) {
  volume.part_from_voxel = Eigen::Scaling(scale) * volume.part_from_voxel;
  return volume;
}

}  // namespace limn::scene
