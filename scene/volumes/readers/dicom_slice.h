#pragma once

#include <Eigen/Core>
#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include "core/result.h"
#include "scene/volumes/volume.h"

namespace limn::scene {

/// What one DICOM file states of a slice, without its values.
struct DicomSlice {
  std::filesystem::path path;
  std::string series;                 ///< Its series' unique id.
  std::string series_name;            ///< Number and description for people; empty: the file states none.
  std::array<long, 2> size = {0, 0};  ///< Columns, rows.
  Eigen::Vector3d p_first_lps_mm;     ///< Centre of the first voxel.
  Eigen::Vector3d d_column, d_row;  ///< Unit directions in which the column's and the row's number grow, LPS.
  Eigen::Vector2d spacing_mm = {0, 0};  ///< Between columns, between rows.
  GreyWindow window = {0, 0};           ///< width 0: not stated.
  bool is_dark_high = false;            ///< The file wants high values dark (MONOCHROME1).

  Eigen::Vector3d d_normal() const { return d_column.cross(d_row); }
};

/// Reads what a file states. Error: damaged, several frames, colours, or no place in the patient.
Result<DicomSlice> read_dicom_slice(const std::filesystem::path& path);

/// Reads the values of a slice into `values` (columns * rows of them; x runs fastest), rescaled by its slope
/// and intercept. Uncompressed, RLE, JPEG and JPEG-LS are decoded. Error: another encoding, too few values.
Status read_dicom_values(const DicomSlice& slice, float* values);

}  // namespace limn::scene
