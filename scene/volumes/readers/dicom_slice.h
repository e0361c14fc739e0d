#pragma once

#include <Eigen/Core>
#include <array>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "core/result.h"
#include "scene/volumes/volume.h"

namespace limn::scene {

/// What a DICOM file states of a slice, without its values: the file's only image, or a frame of it.
struct DicomSlice {
  std::filesystem::path path;
  int frame = 0, frames = 1;          ///< Its number in the file, from 0, of how many.
  std::string series;                 ///< Its series' unique id.
  std::string series_name;            ///< Number and description for people; empty: the file states none.
  std::array<long, 2> size = {0, 0};  ///< Columns, rows.
  Eigen::Vector3d p_first_lps_mm;     ///< Centre of the first voxel.
  Eigen::Vector3d d_column, d_row;  ///< Unit directions in which the column's and the row's number grow, LPS.
  Eigen::Vector2d spacing_mm = {0, 0};  ///< Between columns, between rows.
  double slope = 1, offset = 0;         ///< What is made of stored values.
  GreyWindow window = {0, 0};           ///< width 0: not stated.
  bool is_dark_high = false;            ///< The file wants high values dark (MONOCHROME1).

  Eigen::Vector3d d_normal() const { return d_column.cross(d_row); }
  /// The file's name, and the frame's number from 1 if it has several.
  std::string name() const;
};

/// Most frames of one file, as many as a volume has slices.
inline constexpr int k_most_frames = k_most_voxels_along;

/// Reads what a file states of each of its slices (enhanced DICOM has several, each a frame with functional
/// groups of its own). Error: damaged, colours, or no place in the patient.
Result<std::vector<DicomSlice>> read_dicom_slices(const std::filesystem::path& path);

/// The values in a DICOM file.
class DicomValues {
 public:
  static Result<DicomValues> open(const std::filesystem::path& path);
  DicomValues(DicomValues&&) noexcept;
  ~DicomValues();

  /// Reads the values of a slice of this file into `values` (columns * rows of them; x runs fastest),
  /// rescaled by its slope and intercept. Frames must be asked for in their order. Uncompressed, RLE, JPEG
  /// and JPEG-LS are decoded; memory for two slices is used. Error: another encoding, too few values, an
  /// image of another size than the file states.
  Status read(const DicomSlice& slice, float* values);

 private:
  struct File;
  explicit DicomValues(std::unique_ptr<File> file);
  std::unique_ptr<File> file_;
};

}  // namespace limn::scene
