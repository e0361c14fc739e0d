#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn::scene {

/// How values become grey: `level` is middle grey; `width` is the distance from black to white. Grey is
/// perceived brightness (sRGB), not linear light.
struct GreyWindow {
  double level = 0;
  double width = 1;  ///< > 0
  bool operator==(const GreyWindow&) const = default;
};

/// Values on a grid in space, such as a computed tomography. Its part frame is the patient's in metres: x to
/// the right (the patient's), y to the front, z to the head (RAS), with the origin of the file.
struct Volume {
  std::array<int, 3> size = {0, 0, 0};  ///< Voxels along the grid's x, y and z; each at least 2.
  std::vector<float> values;            ///< Finite; x runs fastest. Rescaled as the file says.
  /// Takes the index of a voxel (its centre) to the part's frame. It may mirror and shear.
  Eigen::Affine3d part_from_voxel = Eigen::Affine3d::Identity();
  float least = 0, most = 0;          ///< The smallest and the largest value.
  GreyWindow window;                  ///< As the file states it, else around 98 % of the values.
  std::vector<std::string> warnings;  ///< What is shown otherwise than the file says; each with its file.

  std::size_t voxel_count() const { return values.size(); }
};

/// Limits, so that no file fills the memory: OpenGL 4.5 guarantees textures of this side, and this many
/// voxels need 512 MiB.
inline constexpr int k_most_voxels_along = 2048;
inline constexpr std::size_t k_most_voxels = std::size_t{1} << 27;

/// Reads a volume: a NIfTI file (.nii, .nii.gz), or a folder of DICOM slices of one series. Its warnings are
/// logged. The readers are in a shared library of their own (scene/volumes/readers/), because dcmtk would
/// lengthen every start of the program. Errors: another or a damaged file; slices of several series, that are
/// missing or of other sizes; a grid without volume; more voxels than the limits.
Result<Volume> load_volume(const std::filesystem::path& path);

/// The volume with `scale` times its size, about its frame's origin.
Volume scaled(Volume volume, double scale);

}  // namespace limn::scene
