#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "core/data_tree.h"
#include "core/pose.h"
#include "core/result.h"

namespace limn::exchange {

/// An entry of a rig file of another program.
struct RigEntry {
  std::string path;                ///< As messages name it: "cam_int", "cameras.0.pose".
  const DataNode* node = nullptr;  ///< Never null.
};

/// "PATH: TEXT (line N)".
Error rig_entry_error(const RigEntry& entry, const std::string& text);

/// Finite numbers and their form.
struct NumberTable {
  std::vector<double> numbers;  ///< Row by row.
  std::size_t rows = 0, columns = 0;
};

/// A matrix as cv::FileStorage writes it (rows, cols, data), nested lists, or a list or text of numbers (one
/// row). Error: something else than finite numbers, or not rows x cols of them.
Result<NumberTable> number_table(const RigEntry& entry);
/// 3 x 3 numbers, row by row.
Result<Eigen::Matrix3d> matrix_in(const RigEntry& entry);
/// A row or column of any length.
Result<std::vector<double>> vector_in(const RigEntry& entry);
/// A whole number of pixels from 1 to k_max_side.
Result<int> side_in_pixels(const RigEntry& entry, double side);

/// A rotation: orthonormal within 1e-3, determinant +1. Else an error.
Result<Eigen::Quaterniond> rotation_in(const RigEntry& entry, const Eigen::Matrix3d& matrix);
/// A translation of at most k_largest_coordinate. Else an error.
Result<Eigen::Vector3d> translation_in(const RigEntry& entry, const Eigen::Vector3d& metres);

}  // namespace limn::exchange
