#pragma once

#include <dcmtk/config/osconfig.h>  // first: it describes the platform to the others
#include <dcmtk/dcmdata/dcfilefo.h>

#include <Eigen/Core>
#include <cmath>
#include <filesystem>
#include <memory>
#include <string>

#include "core/result.h"

namespace limn::scene {

/// Opens a DICOM file. Long elements (the values) stay on the disk until they are asked for. What the file
/// makes the library keep is bounded: k_most_read bytes of other elements (each costs the library at most
/// some thirty times its size), nested no deeper than k_most_stack allows. Error: damaged, deflated as a
/// whole (which could grow a thousandfold), or beyond these limits.
Result<std::unique_ptr<DcmFileFormat>> open_dicom(const std::filesystem::path& path);

constexpr std::size_t k_most_read = std::size_t{16} << 20;  ///< Bytes; 2000 frames have some 4 MiB.
constexpr std::size_t k_most_stack = std::size_t{1} << 20;  ///< Bytes.

// Elements of a data set or of an item in it. An element of over 4 kB counts as absent.

/// UTF-8; empty: absent.
std::string text_at(DcmItem* item, const DcmTagKey& tag);
/// A whole number, of 16 bits or written as text.
long integer_at(DcmItem* item, const DcmTagKey& tag, long otherwise);
double number_at(DcmItem* item, const DcmTagKey& tag, double otherwise);

/// Number `index` of an element; false: absent, or not finite.
bool read_number(DcmItem* item, const DcmTagKey& tag, int index, double* number);
/// Some numbers of an element; false when it has not as many.
template <int count>
bool read_numbers(DcmItem* item, const DcmTagKey& tag, Eigen::Matrix<double, count, 1>* out) {
  for (int i = 0; i < count; ++i)
    if (!read_number(item, tag, i, &(*out)[i])) return false;
  return true;
}

}  // namespace limn::scene
