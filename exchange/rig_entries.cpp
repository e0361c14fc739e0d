#include "exchange/rig_entries.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "core/config.h"
#include "core/imager.h"

namespace limn::exchange {
namespace {

// The rows of nested lists; another list is one row.
Status set_form_of_lists(const RigEntry& entry, NumberTable* table) {
  const std::vector<DataNode>& items = entry.node->items;
  table->rows = 1;
  table->columns = table->numbers.size();
  if (!entry.node->is_list() || items.empty() || !items[0].is_list()) return {};
  table->rows = items.size();
  table->columns = items[0].items.size();
  for (const DataNode& row : items)
    if (!row.is_list() || row.items.size() != table->columns)
      return rig_entry_error(entry, "expected rows of the same length.");
  if (table->rows * table->columns != table->numbers.size())
    return rig_entry_error(entry, "expected rows of numbers, found lists in them.");
  return {};
}

// The rows and columns that OpenCV writes beside `data`.
Status set_stated_form(const RigEntry& entry, NumberTable* table) {
  const auto side = [&](const char* key) -> std::optional<double> {
    const DataNode* node = entry.node->find(key);
    return node && node->is_text() ? limn::number_in(node->text) : std::nullopt;
  };
  const auto rows = side("rows"), columns = side("cols");
  if (!rows && !columns) return {};
  const auto count = static_cast<double>(table->numbers.size());
  if (!rows || !columns || !(*rows >= 1) || !(*columns >= 1) || *rows * *columns != count)
    return rig_entry_error(entry, fmt::format("expected rows x cols = {} x {} numbers, found {}.",
                                              rows.value_or(0), columns.value_or(0), count));
  table->rows = static_cast<std::size_t>(*rows);
  table->columns = static_cast<std::size_t>(*columns);
  return {};
}

}  // namespace

Error rig_entry_error(const RigEntry& entry, const std::string& text) {
  const std::string line = entry.node->line > 0 ? fmt::format(" (line {})", entry.node->line) : "";
  return error("{}: {}{}", entry.path, text, line);
}

Result<NumberTable> number_table(const RigEntry& entry) {
  const DataNode* data = entry.node->find("data");
  const RigEntry values{data ? entry.path + ".data" : entry.path, data ? data : entry.node};
  const auto numbers = limn::numbers_in(*values.node);
  if (!numbers || numbers->empty()) return rig_entry_error(values, "expected numbers, found something else.");
  if (!std::ranges::all_of(*numbers, [](double number) { return std::isfinite(number); }))
    return rig_entry_error(values, "expected finite numbers, found one that is not.");
  NumberTable table{*numbers, 1, numbers->size()};
  LIMN_TRY_STATUS(set_form_of_lists(values, &table));
  if (data) LIMN_TRY_STATUS(set_stated_form(entry, &table));
  return table;
}

Result<Eigen::Matrix3d> matrix_in(const RigEntry& entry) {
  LIMN_TRY(const NumberTable table, number_table(entry));
  if (table.numbers.size() != 9 || (table.rows != 3 && table.rows != 1))
    return rig_entry_error(entry,
                           fmt::format("expected 3 x 3 numbers, found {} x {}.", table.rows, table.columns));
  return Eigen::Matrix3d(
      Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(table.numbers.data()));
}

Result<std::vector<double>> vector_in(const RigEntry& entry) {
  LIMN_TRY(const NumberTable table, number_table(entry));
  if (table.rows != 1 && table.columns != 1)
    return rig_entry_error(entry, fmt::format("expected a row or a column of numbers, found {} x {}.",
                                              table.rows, table.columns));
  return table.numbers;
}

Result<int> side_in_pixels(const RigEntry& entry, double side) {
  if (side >= 1 && side <= k_max_side && side == std::floor(side)) return static_cast<int>(side);
  return rig_entry_error(
      entry, fmt::format("expected a whole number of pixels from 1 to {}, found {:g}.", k_max_side, side));
}

Result<Eigen::Quaterniond> rotation_in(const RigEntry& entry, const Eigen::Matrix3d& matrix) {
  constexpr double k_rounded = 1e-3;
  const double worst = (matrix * matrix.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (worst <= k_rounded && matrix.determinant() > 0) return Eigen::Quaterniond(matrix).normalized();
  return rig_entry_error(
      entry, fmt::format(
                 "expected a rotation (rows of length 1 at right angles, determinant 1), found rows that are "
                 "off by {:g} and the determinant {:g}.",
                 worst, matrix.determinant()));
}

Result<Eigen::Vector3d> translation_in(const RigEntry& entry, const Eigen::Vector3d& metres) {
  if (metres.norm() <= k_largest_coordinate) return metres;
  return rig_entry_error(entry, fmt::format("expected a translation of at most {:g} m, found {:g} m. Is the "
                                            "unit right?",
                                            k_largest_coordinate, metres.norm()));
}

}  // namespace limn::exchange
