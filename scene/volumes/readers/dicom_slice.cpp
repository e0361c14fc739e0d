#include "scene/volumes/readers/dicom_slice.h"

#include <dcmtk/config/osconfig.h>  // first: it describes the platform to the others
#include <dcmtk/dcmdata/dcdeftag.h>
#include <dcmtk/dcmdata/dcfilefo.h>
#include <dcmtk/dcmdata/dcrledrg.h>
#include <dcmtk/dcmdata/dcxfer.h>
#include <dcmtk/dcmjpeg/djdecode.h>
#include <dcmtk/dcmjpls/djdecode.h>
#include <dcmtk/oflog/oflog.h>
#include <fmt/format.h>

#include <cmath>
#include <cstdint>
#include <memory>
#include <mutex>

#include "core/utf8.h"

namespace limn::scene {
namespace {

namespace fs = std::filesystem;

// Prepares the library once: it is silent, and decodes compressed slices.
void prepare_library() {
  static std::once_flag once;
  std::call_once(once, [] {
    OFLog::configure(OFLogger::OFF_LOG_LEVEL);
    DcmRLEDecoderRegistration::registerCodecs();
    DJDecoderRegistration::registerCodecs();
    DJLSDecoderRegistration::registerCodecs();
  });
}

// A file's data set; long elements (the values) stay on the disk until they are asked for.
Result<std::unique_ptr<DcmFileFormat>> open(const fs::path& path) {
  prepare_library();
  constexpr Uint32 k_most_read_at_once = 4096;  // bytes
  auto file = std::make_unique<DcmFileFormat>();
  const OFCondition read =
      file->loadFile(path.c_str(), EXS_Unknown, EGL_noChange, k_most_read_at_once, ERM_fileOnly);
  if (read.bad() || !file->getDataset())
    return error("{}: expected a complete DICOM file, found one that is damaged ({}). Copy it again.",
                 path.string(), read.text());
  return file;
}

std::string text_at(DcmDataset* data, const DcmTagKey& tag) {
  OFString text;
  return data->findAndGetOFString(tag, text).good() ? as_utf8(std::string(text.c_str())) : "";
}

// Some numbers of an element; false when it has not as many.
template <int count>
bool read_numbers(DcmDataset* data, const DcmTagKey& tag, Eigen::Matrix<double, count, 1>* out) {
  for (int i = 0; i < count; ++i) {
    Float64 value = 0;
    if (data->findAndGetFloat64(tag, value, static_cast<unsigned long>(i)).bad()) return false;
    (*out)[i] = value;
  }
  return out->allFinite();
}

long integer_at(DcmDataset* data, const DcmTagKey& tag, long otherwise) {
  Uint16 value = 0;
  return data->findAndGetUint16(tag, value).good() ? value : otherwise;
}

double number_at(DcmDataset* data, const DcmTagKey& tag, double otherwise) {
  Float64 value = 0;
  return data->findAndGetFloat64(tag, value).good() && std::isfinite(value) ? value : otherwise;
}

std::string series_name(DcmDataset* data) {
  const std::string number = text_at(data, DCM_SeriesNumber), words = text_at(data, DCM_SeriesDescription);
  if (number.empty()) return words.empty() ? "" : "'" + words + "'";
  return words.empty() ? number : number + " '" + words + "'";
}

Status check_kind(DcmDataset* data, const std::string& where) {
  Sint32 frames = 1;
  if (data->findAndGetSint32(DCM_NumberOfFrames, frames).good() && frames > 1)
    return error(
        "{}: expected files of one slice each, found one with {} (enhanced DICOM). Convert it to NIfTI, for "
        "example with dcm2niix.",
        where, frames);
  const std::string colours = text_at(data, DCM_PhotometricInterpretation);
  if (integer_at(data, DCM_SamplesPerPixel, 1) != 1 || !colours.starts_with("MONOCHROME"))
    return error("{}: expected a slice of grey values, found {}.", where,
                 colours.empty() ? "no image" : "'" + colours + "'");
  return {};
}

Status read_place(DcmDataset* data, const std::string& where, DicomSlice* slice) {
  Eigen::Matrix<double, 6, 1> directions;
  Eigen::Vector2d between_rows_columns;
  if (!read_numbers(data, DCM_ImagePositionPatient, &slice->p_first_lps_mm) ||
      !read_numbers(data, DCM_ImageOrientationPatient, &directions) ||
      !read_numbers(data, DCM_PixelSpacing, &between_rows_columns))
    return error(
        "{}: expected a slice with its place (ImagePositionPatient, ImageOrientationPatient, PixelSpacing), "
        "found one without. Remove images that are no slices, such as reports.",
        where);
  slice->spacing_mm = {between_rows_columns[1], between_rows_columns[0]};
  slice->d_column = directions.head<3>();
  slice->d_row = directions.tail<3>();
  constexpr double k_most_error = 0.01;  // error of unit length and of the right angle; files have six digits
  if (std::abs(slice->d_column.norm() - 1) > k_most_error ||
      std::abs(slice->d_row.norm() - 1) > k_most_error ||
      std::abs(slice->d_column.dot(slice->d_row)) > k_most_error || !(slice->spacing_mm.minCoeff() > 0))
    return error(
        "{}: expected two perpendicular directions of length 1 (ImageOrientationPatient) and distances above "
        "0 (PixelSpacing), found others. Export the series again.",
        where);
  slice->d_column.normalize();
  slice->d_row.normalize();
  return {};
}

// How the bits of a stored value make a number.
struct Bits {
  int stored = 16, shift = 0;
  bool is_signed = false;

  double number(std::uint32_t word) const {
    const std::uint32_t used = word >> shift & ((1U << stored) - 1U);
    const bool is_negative = is_signed && (used >> (stored - 1) & 1U) != 0;
    return static_cast<double>(used) - (is_negative ? std::ldexp(1.0, stored) : 0.0);
  }
};

template <class Word>
void rescale(const Word* words, std::size_t count, Bits bits, double slope, double offset, float* values) {
  for (std::size_t i = 0; i < count; ++i)
    values[i] = static_cast<float>(slope * bits.number(words[i]) + offset);
}

Status copy_values(DcmDataset* data, const std::string& where, std::size_t count, float* values) {
  const long allocated = integer_at(data, DCM_BitsAllocated, 0);
  const long stored = integer_at(data, DCM_BitsStored, allocated),
             high = integer_at(data, DCM_HighBit, stored - 1);
  if ((allocated != 8 && allocated != 16) || stored < 1 || stored > allocated || high >= allocated ||
      high + 1 < stored)
    return error("{}: expected values of 8 or 16 bits, found {} bits ({} stored, the highest {}).", where,
                 allocated, stored, high);
  const Bits bits{static_cast<int>(stored), static_cast<int>(high + 1 - stored),
                  integer_at(data, DCM_PixelRepresentation, 0) == 1};
  const double slope = number_at(data, DCM_RescaleSlope, 1),
               offset = number_at(data, DCM_RescaleIntercept, 0);
  unsigned long found = 0;
  const Uint8* bytes = nullptr;
  const Uint16* words = nullptr;
  const bool is_there = allocated == 8 ? data->findAndGetUint8Array(DCM_PixelData, bytes, &found).good()
                                       : data->findAndGetUint16Array(DCM_PixelData, words, &found).good();
  if (!is_there || found < count || (!bytes && !words))
    return error("{}: expected {} values, found {}. Copy the file again.", where, count,
                 is_there ? found : 0);
  if (bytes)
    rescale(bytes, count, bits, slope, offset, values);
  else
    rescale(words, count, bits, slope, offset, values);
  return {};
}

}  // namespace

Result<DicomSlice> read_dicom_slice(const fs::path& path) {
  const std::string where = path.string();
  LIMN_TRY(const std::unique_ptr<DcmFileFormat> file, open(path));
  DcmDataset* data = file->getDataset();
  LIMN_TRY_STATUS(check_kind(data, where));
  DicomSlice slice;
  slice.path = path;
  slice.series = text_at(data, DCM_SeriesInstanceUID);
  slice.series_name = series_name(data);
  slice.size = {integer_at(data, DCM_Columns, 0), integer_at(data, DCM_Rows, 0)};
  LIMN_TRY_STATUS(read_place(data, where, &slice));
  slice.window = {number_at(data, DCM_WindowCenter, 0), number_at(data, DCM_WindowWidth, 0)};
  slice.is_dark_high = text_at(data, DCM_PhotometricInterpretation) == "MONOCHROME1";
  return slice;
}

Status read_dicom_values(const DicomSlice& slice, float* values) {
  const std::string where = slice.path.string();
  LIMN_TRY(const std::unique_ptr<DcmFileFormat> file, open(slice.path));
  DcmDataset* data = file->getDataset();
  if (data->chooseRepresentation(EXS_LittleEndianExplicit, nullptr).bad() ||
      !data->canWriteXfer(EXS_LittleEndianExplicit))
    return error(
        "{}: expected values without compression, or as RLE, JPEG or JPEG-LS, found '{}', or damaged ones. "
        "Decompress the series, for example with gdcmconv --raw.",
        where, DcmXfer(data->getOriginalXfer()).getXferName());
  return copy_values(data, where, static_cast<std::size_t>(slice.size[0] * slice.size[1]), values);
}

}  // namespace limn::scene
