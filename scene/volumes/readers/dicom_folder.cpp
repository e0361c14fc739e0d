#include "scene/volumes/readers/dicom_folder.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>

#include "core/utf8.h"
#include "scene/volumes/readers/dicom_slice.h"
#include "scene/volumes/readers/volume_check.h"
#include "scene/volumes/volume_name.h"

namespace limn::scene {
namespace {

namespace fs = std::filesystem;
using Slices = std::vector<DicomSlice>;

constexpr std::size_t k_most_files = 20000;  // and slices in one folder; a series has at most some thousand

// Error: slices of several series.
Status check_one_series(const fs::path& folder, const Slices& slices) {
  struct Series {
    std::string name;
    std::size_t count = 0;
  };
  std::map<std::string, Series> all;
  for (const DicomSlice& slice : slices) {
    Series& series = all[slice.series];
    ++series.count;
    if (series.name.empty()) series.name = slice.series_name.empty() ? slice.series : slice.series_name;
  }
  if (all.size() <= 1) return {};
  constexpr std::size_t k_most_listed = 8;
  std::vector<Series> listed;
  for (const auto& [id, series] : all) listed.push_back(series);
  std::sort(listed.begin(), listed.end(), [](const Series& a, const Series& b) { return a.count > b.count; });
  std::string text;
  for (std::size_t i = 0; i < std::min(listed.size(), k_most_listed); ++i)
    text += fmt::format("{}{} ({} slice{})", i == 0 ? "" : ", ", listed[i].name, listed[i].count,
                        listed[i].count == 1 ? "" : "s");
  return error(
      "{}: expected the slices of one series, found {} series: {}{}. Put the files of each series into a "
      "folder of its own.",
      as_utf8(folder.string()), listed.size(), text, listed.size() > k_most_listed ? " and others" : "");
}

// Error: a slice that differs from the first in its size, direction or spacing.
Status check_alike(const Slices& slices) {
  constexpr double k_most_turn = 1e-3;     // 0.06 degrees
  constexpr double k_most_stretch = 1e-3;  // share of the spacing
  const DicomSlice& first = slices.front();
  for (const DicomSlice& slice : slices) {
    const char* differs = nullptr;
    if (slice.size != first.size)
      differs = "size";
    else if ((slice.d_column - first.d_column).norm() > k_most_turn ||
             (slice.d_row - first.d_row).norm() > k_most_turn)
      differs = "orientation";
    else if (((slice.spacing_mm - first.spacing_mm).array().abs() > k_most_stretch * first.spacing_mm.array())
                 .any())
      differs = "spacing of pixels";
    if (differs)
      return error(
          "{}: expected a slice like {}, found another {}. Remove slices that do not belong to the stack.",
          as_utf8((slice.path.parent_path() / slice.name()).string()), first.name(), differs);
  }
  return {};
}

std::string between(const DicomSlice& a, const DicomSlice& b) {
  return fmt::format("{} and {}", a.name(), b.name());
}

// The step from a slice to the next one, LPS mm, of slices in their order. Error: the slices are not at equal
// distances along one line.
Result<Eigen::Vector3d> step_of(const std::string& where, const Slices& slices) {
  constexpr double k_same_place_mm = 1e-4;
  constexpr double k_most_error = 0.05;  // share of a step; files round places to 0.01 mm
  std::vector<double> steps;
  for (std::size_t i = 1; i < slices.size(); ++i)
    steps.push_back(slices.front().d_normal().dot(slices[i].p_first_lps_mm - slices[i - 1].p_first_lps_mm));
  std::vector<double> sorted = steps;
  std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2),
                   sorted.end());
  const double usual = sorted[sorted.size() / 2];
  for (std::size_t i = 0; i < steps.size(); ++i)
    if (steps[i] < k_same_place_mm)
      return error(
          "{}: expected each slice at a place of its own, found {} at the same. Several moments or echoes "
          "must be in folders of their own.",
          where, between(slices[i], slices[i + 1]));
  for (std::size_t i = 0; i < steps.size(); ++i)
    if (const double missing = std::round(steps[i] / usual) - 1;
        missing >= 1 && std::abs(steps[i] - (missing + 1) * usual) < k_most_error * usual)
      return error(
          "{}: expected slices at equal distances ({:.3g} mm), found {:.3g} mm between {}: {:.0f} missing. "
          "Copy the whole series.",
          where, usual, steps[i], between(slices[i], slices[i + 1]), missing);
  const Eigen::Vector3d step =
      (slices.back().p_first_lps_mm - slices.front().p_first_lps_mm) / static_cast<double>(slices.size() - 1);
  for (std::size_t i = 0; i < slices.size(); ++i) {
    const Eigen::Vector3d p = slices.front().p_first_lps_mm + static_cast<double>(i) * step;
    if (const double off_mm = (p - slices[i].p_first_lps_mm).norm(); off_mm > k_most_error * step.norm())
      return error(
          "{}: expected slices at equal distances along a line, found {} {:.3g} mm beside its place. "
          "Resample "
          "the series to equal distances.",
          where, slices[i].name(), off_mm);
  }
  return step;
}

// All slices of a folder in the order of their places.
Result<Slices> sorted_slices(const fs::path& folder, std::vector<std::string>* warnings) {
  const std::string where = as_utf8(folder.string());
  Slices slices;
  std::size_t others = 0;
  const std::vector<fs::path> files = visible_files(folder, k_most_files + 1);
  if (files.size() > k_most_files)
    return error("{}: expected at most {} files, found more. Give the folder of one series.", where,
                 k_most_files);
  for (const fs::path& file : files) {
    if (!is_dicom_file(file)) {
      ++others;
      continue;
    }
    LIMN_TRY(Slices of_file, read_dicom_slices(file));
    slices.insert(slices.end(), of_file.begin(), of_file.end());
    if (slices.size() > k_most_files)
      return error("{}: expected at most {} slices, found more. Give the folder of one series.", where,
                   k_most_files);
  }
  if (slices.empty())
    return error(
        "{}: expected a folder with the DICOM slices of one series, found none in it. Give the folder "
        "that has the files themselves.",
        where);
  if (others > 0)
    warnings->push_back(fmt::format("{}: {} files that are not DICOM are left out.", where, others));
  LIMN_TRY_STATUS(check_one_series(folder, slices));
  LIMN_TRY_STATUS(check_alike(slices));
  const Eigen::Vector3d d_normal = slices.front().d_normal();
  std::stable_sort(slices.begin(), slices.end(), [&](const DicomSlice& a, const DicomSlice& b) {
    return d_normal.dot(a.p_first_lps_mm) < d_normal.dot(b.p_first_lps_mm);
  });
  return slices;
}

// Reads the values of all slices, `in_slice` of each, in the slices' order. Each file is opened once.
Status read_values(const Slices& slices, float* values, std::size_t in_slice) {
  std::map<fs::path, std::vector<std::size_t>> by_file;
  for (std::size_t i = 0; i < slices.size(); ++i) by_file[slices[i].path].push_back(i);
  for (auto& [path, places] : by_file) {
    std::ranges::sort(places, {}, [&](std::size_t i) { return slices[i].frame; });
    LIMN_TRY(DicomValues file, DicomValues::open(path));
    for (const std::size_t i : places) {
      LIMN_TRY_STATUS(file.read(slices[i], values + i * in_slice));
    }
  }
  return {};
}

}  // namespace

Result<Volume> read_dicom_folder(const fs::path& folder) {
  const std::string where = as_utf8(folder.string());
  Volume volume;
  LIMN_TRY(const Slices slices, sorted_slices(folder, &volume.warnings));
  const DicomSlice& first = slices.front();
  LIMN_TRY_STATUS(check_volume_size(where, {first.size[0], first.size[1], static_cast<long>(slices.size())}));
  LIMN_TRY(const Eigen::Vector3d step, step_of(where, slices));
  Eigen::Affine3d lps_from_voxel = Eigen::Affine3d::Identity();
  lps_from_voxel.linear() << first.spacing_mm.x() * first.d_column, first.spacing_mm.y() * first.d_row, step;
  lps_from_voxel.translation() = first.p_first_lps_mm;
  volume.part_from_voxel = part_from_lps_mm() * lps_from_voxel;
  LIMN_TRY_STATUS(check_grid(where, volume.part_from_voxel));
  volume.size = {static_cast<int>(first.size[0]), static_cast<int>(first.size[1]),
                 static_cast<int>(slices.size())};
  const std::size_t in_slice = static_cast<std::size_t>(first.size[0] * first.size[1]);
  volume.values.resize(in_slice * slices.size());
  LIMN_TRY_STATUS(read_values(slices, volume.values.data(), in_slice));
  if (first.is_dark_high)
    volume.warnings.push_back(
        fmt::format("{}: high values are to be dark (MONOCHROME1); they are shown bright.", where));
  LIMN_TRY_STATUS(complete_values(where, slices[slices.size() / 2].window, &volume));
  return volume;
}

}  // namespace limn::scene
