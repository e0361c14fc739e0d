#include "scene/volumes/readers/dicom_slice.h"

#include <dcmtk/config/osconfig.h>  // first: it describes the platform to the others
#include <dcmtk/dcmdata/dcdeftag.h>
#include <dcmtk/dcmdata/dcfcache.h>
#include <dcmtk/dcmdata/dcpixel.h>
#include <dcmtk/dcmdata/dcpixseq.h>
#include <dcmtk/dcmdata/dcpxitem.h>
#include <dcmtk/dcmdata/dcxfer.h>
#include <fmt/format.h>

#include <cmath>
#include <cstdint>
#include <cstring>

#include "core/utf8.h"
#include "scene/volumes/readers/dcmtk_versions.h"
#include "scene/volumes/readers/dicom_file.h"
#include "scene/volumes/readers/jpeg_size.h"

namespace limn::scene {
namespace {

namespace fs = std::filesystem;

std::string series_name(DcmItem* data) {
  const std::string number = text_at(data, DCM_SeriesNumber), words = text_at(data, DCM_SeriesDescription);
  if (number.empty()) return words.empty() ? "" : "'" + words + "'";
  return words.empty() ? number : number + " '" + words + "'";
}

DcmItem* item_at(DcmItem* item, const DcmTagKey& sequence, long index) {
  DcmItem* found = nullptr;
  return item && item->findAndGetSequenceItem(sequence, found, index).good() ? found : nullptr;
}

// Where the attributes of one frame are: in its own functional groups, in those that all frames share, or
// beside the image (files of one slice).
struct FrameAttributes {
  DcmItem* data = nullptr;
  DcmItem* own = nullptr;
  DcmItem* shared = nullptr;

  DcmItem* in(const DcmTagKey& group) const {
    if (!own && !shared) return data;
    DcmItem* of_frame = item_at(own, group, 0);
    return of_frame ? of_frame : item_at(shared, group, 0);
  }
};

// The number of frames. Error: colours, or too many.
Result<int> read_kind(DcmItem* data, const std::string& where) {
  const long frames = integer_at(data, DCM_NumberOfFrames, 1);
  if (frames > k_most_frames)
    return error("{}: expected at most {} slices in a file, found {}. Crop the volume.", where, k_most_frames,
                 frames);
  const std::string colours = text_at(data, DCM_PhotometricInterpretation);
  if (integer_at(data, DCM_SamplesPerPixel, 1) != 1 || !colours.starts_with("MONOCHROME"))
    return error("{}: expected a slice of grey values, found {}.", where,
                 colours.empty() ? "no image" : "'" + colours + "'");
  return static_cast<int>(std::max(1L, frames));
}

Status read_place(const FrameAttributes& attributes, const std::string& where, DicomSlice* slice) {
  Eigen::Matrix<double, 6, 1> directions;
  Eigen::Vector2d between_rows_columns;
  if (!read_numbers(attributes.in(DCM_PlanePositionSequence), DCM_ImagePositionPatient,
                    &slice->p_first_lps_mm) ||
      !read_numbers(attributes.in(DCM_PlaneOrientationSequence), DCM_ImageOrientationPatient, &directions) ||
      !read_numbers(attributes.in(DCM_PixelMeasuresSequence), DCM_PixelSpacing, &between_rows_columns))
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

// What its functional groups state of a frame.
Status read_frame(const FrameAttributes& attributes, const std::string& where, DicomSlice* slice) {
  LIMN_TRY_STATUS(read_place(attributes, where, slice));
  DcmItem* const window = attributes.in(DCM_FrameVOILUTSequence);
  slice->window = {number_at(window, DCM_WindowCenter, 0), number_at(window, DCM_WindowWidth, 0)};
  DcmItem* const rescale = attributes.in(DCM_PixelValueTransformationSequence);
  slice->slope = number_at(rescale, DCM_RescaleSlope, 1);
  slice->offset = number_at(rescale, DCM_RescaleIntercept, 0);
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

// The bits of a file's values, and how many bytes each has.
struct Layout {
  Bits bits;
  int bytes = 2;
};

Result<Layout> read_layout(DcmItem* data, const std::string& where) {
  const long allocated = integer_at(data, DCM_BitsAllocated, 0);
  const long stored = integer_at(data, DCM_BitsStored, allocated),
             high = integer_at(data, DCM_HighBit, stored - 1);
  if ((allocated != 8 && allocated != 16) || stored < 1 || stored > allocated || high >= allocated ||
      high + 1 < stored)
    return error("{}: expected values of 8 or 16 bits, found {} bits ({} stored, the highest {}).", where,
                 allocated, stored, high);
  return Layout{{static_cast<int>(stored), static_cast<int>(high + 1 - stored),
                 integer_at(data, DCM_PixelRepresentation, 0) == 1},
                static_cast<int>(allocated / 8)};
}

bool is_jpeg(E_TransferSyntax syntax) {
  const DcmXfer xfer(syntax);
  return std::string(xfer.getXferName()).starts_with("JPEG") && syntax != EXS_JPEG2000 &&
         syntax != EXS_JPEG2000LosslessOnly;
}

}  // namespace

std::string DicomSlice::name() const {
  const std::string file = as_utf8(path.filename().string());
  return frames == 1 ? file : fmt::format("{} (frame {})", file, frame + 1);
}

Result<std::vector<DicomSlice>> read_dicom_slices(const fs::path& path) {
  const std::string where = path.string();
  LIMN_TRY(const std::unique_ptr<DcmFileFormat> file, open_dicom(path));
  DcmDataset* data = file->getDataset();
  LIMN_TRY(const int frames, read_kind(data, where));
  FrameAttributes attributes;
  attributes.data = data;
  attributes.shared = item_at(data, DCM_SharedFunctionalGroupsSequence, 0);
  DicomSlice slice;
  slice.path = path;
  slice.frames = frames;
  slice.series = text_at(data, DCM_SeriesInstanceUID);
  slice.series_name = series_name(data);
  slice.size = {integer_at(data, DCM_Columns, 0), integer_at(data, DCM_Rows, 0)};
  slice.is_dark_high = text_at(data, DCM_PhotometricInterpretation) == "MONOCHROME1";
  std::vector<DicomSlice> slices;
  for (slice.frame = 0; slice.frame < frames; ++slice.frame) {
    attributes.own = item_at(data, DCM_PerFrameFunctionalGroupsSequence, slice.frame);
    if (frames > 1 && !attributes.own)
      return error(
          "{}: expected the place of each of its {} frames (enhanced DICOM), found none of frame {}. Convert "
          "it to NIfTI, for example with dcm2niix.",
          where, frames, slice.frame + 1);
    LIMN_TRY_STATUS(read_frame(
        attributes, frames == 1 ? where : fmt::format("{}, frame {}", where, slice.frame + 1), &slice));
    slices.push_back(slice);
  }
  return slices;
}

struct DicomValues::File {
  std::string where;
  std::unique_ptr<DcmFileFormat> file;
  DcmPixelData* pixels = nullptr;
  DcmFileCache cache;
  Layout layout;
  E_TransferSyntax syntax = EXS_Unknown;
  Uint32 fragment = 1;  // that of the next frame; the first fragment is a table
  std::vector<std::uint8_t> frame;

  // Error: a JPEG image of another size than the slice's, for which its decoder would take memory.
  Status check_jpeg(const DicomSlice& slice) const {
    DcmPixelSequence* fragments = nullptr;
    DcmPixelItem* first = nullptr;
    if (pixels->getEncapsulatedRepresentation(syntax, nullptr, fragments).bad() || !fragments ||
        fragments->getItem(first, fragment).bad() || !first)
      return error("{}: expected {} compressed images, found fewer. Copy the file again.", where,
                   slice.frames);
    std::vector<std::uint8_t> head(std::min<std::size_t>(first->getLength(), k_longest_jpeg_head));
    if (!head.empty() && first->getPartialValue(head.data(), 0, static_cast<Uint32>(head.size())).bad())
      head.clear();
    const auto size = jpeg_size(head);
    if (!size || (*size)[0] != slice.size[0] || (*size)[1] != slice.size[1])
      return error("{}: expected a JPEG image of {} x {} grey values, found {}. Copy the file again.", where,
                   slice.size[0], slice.size[1],
                   size ? fmt::format("{} x {}", (*size)[0], (*size)[1]) : "another or a damaged one");
    return {};
  }
};

DicomValues::DicomValues(std::unique_ptr<File> file) : file_(std::move(file)) {}
DicomValues::DicomValues(DicomValues&&) noexcept = default;
DicomValues::~DicomValues() = default;

Result<DicomValues> DicomValues::open(const fs::path& path) {
  auto out = std::make_unique<File>();
  out->where = path.string();
  LIMN_TRY(out->file, open_dicom(path));
  DcmDataset* data = out->file->getDataset();
  LIMN_TRY(out->layout, read_layout(data, out->where));
  out->syntax = data->getOriginalXfer();
  DcmElement* element = nullptr;
  if (data->findAndGetElement(DCM_PixelData, element).good())
    out->pixels = dynamic_cast<DcmPixelData*>(element);
  if (!out->pixels) return error("{}: expected an image, found none. Copy the file again.", out->where);
  return DicomValues(std::move(out));
}

Status DicomValues::read(const DicomSlice& slice, float* values) {
  File& file = *file_;
  DcmDataset* data = file.file->getDataset();
  if (is_jpeg(file.syntax)) {
    LIMN_TRY_STATUS(file.check_jpeg(slice));
  }
  const std::size_t count = static_cast<std::size_t>(slice.size[0] * slice.size[1]),
                    bytes = count * static_cast<std::size_t>(file.layout.bytes);
  file.frame.resize(bytes + bytes % 2);
  Uint32 stated = 0;
  OFString colours;
  const bool is_encoded = uses_encapsulated_format(DcmXfer(file.syntax));
  if (uncompressed_frame_size(*file.pixels, data, !is_encoded, &stated).bad() || stated != bytes ||
      file.pixels
          ->getUncompressedFrame(data, static_cast<Uint32>(slice.frame), file.fragment, file.frame.data(),
                                 static_cast<Uint32>(file.frame.size()), colours, &file.cache)
          .bad()) {
    if (!is_encoded)
      return error("{}: expected {} values for each slice, found fewer. Copy the file again.", file.where,
                   count);
    return error(
        "{}: expected values without compression, or as RLE, JPEG or JPEG-LS, found '{}', or damaged ones. "
        "Decompress the series, for example with gdcmconv --raw.",
        file.where, DcmXfer(file.syntax).getXferName());
  }
  for (std::size_t i = 0; i < count; ++i) {
    std::uint32_t word = file.frame[i];
    if (file.layout.bytes == 2) {
      std::uint16_t two = 0;  // in this machine's order of bytes
      std::memcpy(&two, file.frame.data() + 2 * i, sizeof two);
      word = two;
    }
    values[i] = static_cast<float>(slice.slope * file.layout.bits.number(word) + slice.offset);
  }
  return {};
}

}  // namespace limn::scene
