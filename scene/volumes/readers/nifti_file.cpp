#include "scene/volumes/readers/nifti_file.h"

#include <fmt/format.h>
#include <nifti/nifti2_io.h>
#include <zlib.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <limits>
#include <memory>
#include <mutex>
#include <vector>

#include "scene/volumes/readers/volume_check.h"

namespace limn::scene {
namespace {

namespace fs = std::filesystem;

using NiftiImage = std::unique_ptr<nifti_image, decltype(&nifti_image_free)>;
using GzFile =
    std::unique_ptr<gzFile_s, decltype(&gzclose)>;  // zlib also reads files that are not compressed

template <class Number>
double number_at(const char* bytes) {
  Number number{};
  std::memcpy(&number, bytes, sizeof number);
  return static_cast<double>(number);
}

using NumberReader = double (*)(const char* bytes);

// The reader of a type of values; null: not grey values.
NumberReader number_reader(int datatype) {
  switch (datatype) {
    case NIFTI_TYPE_UINT8:
      return number_at<std::uint8_t>;
    case NIFTI_TYPE_INT8:
      return number_at<std::int8_t>;
    case NIFTI_TYPE_UINT16:
      return number_at<std::uint16_t>;
    case NIFTI_TYPE_INT16:
      return number_at<std::int16_t>;
    case NIFTI_TYPE_UINT32:
      return number_at<std::uint32_t>;
    case NIFTI_TYPE_INT32:
      return number_at<std::int32_t>;
    case NIFTI_TYPE_UINT64:
      return number_at<std::uint64_t>;
    case NIFTI_TYPE_INT64:
      return number_at<std::int64_t>;
    case NIFTI_TYPE_FLOAT32:
      return number_at<float>;
    case NIFTI_TYPE_FLOAT64:
      return number_at<double>;
    default:
      return nullptr;
  }
}

// The size of the file's unit of length in mm.
double mm_per_unit(const nifti_image& image, const std::string& where, Volume* volume) {
  if (image.xyz_units == NIFTI_UNITS_METER) return 1e3;
  if (image.xyz_units == NIFTI_UNITS_MICRON) return 1e-3;
  if (image.xyz_units != NIFTI_UNITS_MM)
    volume->warnings.push_back(fmt::format("{}: its unit of length is not stated; mm are assumed.", where));
  return 1;
}

Eigen::Affine3d affine_of(const nifti_dmat44& matrix) {
  Eigen::Affine3d out = Eigen::Affine3d::Identity();
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 4; ++column) out.matrix()(row, column) = matrix.m[row][column];
  return out;
}

// Where the voxels are, in the file's unit.
Eigen::Affine3d ras_from_voxel(const nifti_image& image, const std::string& where, Volume* volume) {
  if (image.sform_code > 0) return affine_of(image.sto_xyz);
  if (image.qform_code > 0) return affine_of(image.qto_xyz);
  volume->warnings.push_back(fmt::format(
      "{}: it states no orientation (sform, qform); its axes are taken as right, front, head.", where));
  return Eigen::Affine3d(Eigen::Scaling(image.dx, image.dy, image.dz));
}

// What the library must not be given, because it would print words of its own.
template <class Header>
Status check_header(const Header& header, const std::string& where) {
  constexpr int k_most_dimensions = 7;
  const bool has_dimensions = header.dim[0] >= 1 && header.dim[0] <= k_most_dimensions;
  for (int i = 1; i <= (has_dimensions ? static_cast<int>(header.dim[0]) : 0); ++i)
    if (header.dim[i] < 1 || header.dim[i] > std::numeric_limits<std::int32_t>::max())
      return error("{}: expected 1 or more voxels along each axis, found {} along axis {}. Copy it again.",
                   where, header.dim[i], i);
  if (!has_dimensions)
    return error("{}: expected 1 to 7 axes, found {}. Copy it again.", where, header.dim[0]);
  if (!number_reader(header.datatype))
    return error("{}: expected grey values, found the type {}. Convert it to a volume of single values.",
                 where, nifti_datatype_string(header.datatype));
  return {};
}

template <class Header>
Result<NiftiImage> converted(const std::string& bytes,
                             const std::string& where,
                             int version,
                             nifti_image* (*convert)(Header, const char*)) {
  Header as_stored{};
  std::memcpy(&as_stored, bytes.data(), sizeof as_stored);
  Header header = as_stored;
  if (header.sizeof_hdr != static_cast<int>(sizeof header)) swap_nifti_header(&header, version);
  LIMN_TRY_STATUS(check_header(header, where));
  NiftiImage image(convert(as_stored, where.c_str()), &nifti_image_free);
  if (!image) return error("{}: expected a NIfTI file, found a damaged header. Copy it again.", where);
  return image;
}

// Reads the header, in either order of bytes.
Result<NiftiImage> read_header(gzFile_s* file, const std::string& where) {
  std::string bytes(sizeof(nifti_2_header), '\0');
  const int count = gzread(file, bytes.data(), static_cast<unsigned>(bytes.size()));
  if (count < static_cast<int>(sizeof(nifti_1_header)))
    return error("{}: expected a NIfTI file, found one that ends within its header. Copy it again.", where);
  const std::string magic_1 = bytes.substr(344, 3), magic_2 = bytes.substr(4, 3);
  if (magic_1 == "ni1" || magic_2 == "ni2")
    return error("{}: expected header and values in one .nii file, found a header of a pair (.hdr, .img).",
                 where);
  if (magic_2 == "n+2" && count == static_cast<int>(bytes.size()))
    return converted(bytes, where, 2, &nifti_convert_n2hdr2nim);
  if (magic_1 == "n+1") return converted(bytes, where, 1, &nifti_convert_n1hdr2nim);
  return error("{}: expected a NIfTI file, found another format.", where);
}

// Reads the values of the first moment, slice by slice.
Status read_values(gzFile_s* file, const nifti_image& image, const std::string& where, Volume* volume) {
  if (image.nt > 1 || image.nu > 1 || image.nv > 1 || image.nw > 1)
    volume->warnings.push_back(fmt::format("{}: it has {} volumes or more; the first is shown.", where,
                                           std::max({image.nt, image.nu, image.nv, image.nw})));
  const NumberReader number_at = number_reader(image.datatype);
  const std::size_t in_slice = static_cast<std::size_t>(image.nx * image.ny),
                    of_value = static_cast<std::size_t>(image.nbyper);
  // A slope of 0 means that values are not rescaled.
  const double slope = image.scl_slope == 0 ? 1 : image.scl_slope,
               offset = image.scl_slope == 0 ? 0 : image.scl_inter;
  constexpr std::int64_t k_most_before = std::int64_t{64} << 20;  // bytes of header extensions
  if (image.iname_offset < 0 || image.iname_offset > k_most_before)
    return error("{}: expected values within the first 64 MiB, found them stated at byte {}. Copy it again.",
                 where, image.iname_offset);
  std::vector<char> slice(in_slice * of_value);
  bool is_complete = gzseek(file, image.iname_offset, SEEK_SET) >= 0;
  for (std::int64_t k = 0; k < image.nz && is_complete; ++k) {
    is_complete =
        gzread(file, slice.data(), static_cast<unsigned>(slice.size())) == static_cast<int>(slice.size());
    if (image.byteorder != nifti_short_order())
      nifti_swap_Nbytes(static_cast<std::int64_t>(in_slice), image.nbyper, slice.data());
    for (std::size_t i = 0; i < in_slice && is_complete; ++i)
      volume->values.push_back(static_cast<float>(slope * number_at(slice.data() + i * of_value) + offset));
  }
  if (!is_complete)
    return error(
        "{}: expected {} x {} x {} values, found a file that ends before or is damaged. Copy it again.",
        where, image.nx, image.ny, image.nz);
  return {};
}

}  // namespace

Result<Volume> read_nifti(const fs::path& path) {
  static std::mutex one_at_a_time;  // the library keeps options in globals
  const std::lock_guard lock(one_at_a_time);
  nifti_set_debug_level(0);  // it would print its own words about damaged files
  const std::string where = path.string();
  const GzFile file(gzopen(path.c_str(), "rb"), &gzclose);
  if (!file) return error("{}: expected a file that can be read, but it cannot be opened.", where);
  LIMN_TRY(const NiftiImage image, read_header(file.get(), where));
  LIMN_TRY_STATUS(check_volume_size(where, {image->nx, image->ny, image->nz}));
  Volume volume;
  volume.size = {static_cast<int>(image->nx), static_cast<int>(image->ny), static_cast<int>(image->nz)};
  const double mm = mm_per_unit(*image, where, &volume);
  volume.part_from_voxel = part_from_ras_mm() * Eigen::Scaling(mm) * ras_from_voxel(*image, where, &volume);
  LIMN_TRY_STATUS(check_grid(where, volume.part_from_voxel));
  LIMN_TRY_STATUS(read_values(file.get(), *image, where, &volume));
  const double low = image->cal_min, high = image->cal_max;
  LIMN_TRY_STATUS(complete_values(where, {(low + high) / 2, high - low}, &volume));
  return volume;
}

}  // namespace limn::scene
