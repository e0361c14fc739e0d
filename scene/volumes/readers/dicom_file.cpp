#include "scene/volumes/readers/dicom_file.h"

#include <dcmtk/dcmdata/dcistrmf.h>
#include <dcmtk/dcmdata/dcrledrg.h>
#include <dcmtk/dcmjpeg/djdecode.h>
#include <dcmtk/dcmjpls/djdecode.h>
#include <dcmtk/oflog/oflog.h>

#include <cstdint>
#include <mutex>

#include "core/utf8.h"

namespace limn::scene {
namespace {

namespace fs = std::filesystem;

constexpr Uint32 k_most_read_at_once = 4096;  // bytes; longer elements stay on the disk

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

// The calls' depth: the library reads sequences within sequences by functions that call themselves.
std::uintptr_t stack_place() { return reinterpret_cast<std::uintptr_t>(__builtin_frame_address(0)); }

// A file that fails as soon as more is read than the limits allow.
class LimitedProducer : public DcmProducer {
 public:
  explicit LimitedProducer(const OFFilename& name) : file_(name), top_(stack_place()) {}

  OFBool good() const override { return status().good(); }
  OFCondition status() const override { return is_over_ ? OFCondition(EC_InvalidStream) : file_.status(); }
  OFBool eos() override { return is_over_ || file_.eos(); }
  offile_off_t avail() override { return is_over_ ? 0 : file_.avail(); }
  offile_off_t read(void* buffer, offile_off_t length) override {
    const std::uintptr_t place = stack_place();
    if ((place > top_ ? place - top_ : top_ - place) > k_most_stack ||
        length > static_cast<offile_off_t>(k_most_read) - read_)
      is_over_ = true;
    if (is_over_) return 0;
    const offile_off_t count = file_.read(buffer, length);
    read_ += count;
    return count;
  }
  offile_off_t skip(offile_off_t length) override { return is_over_ ? 0 : file_.skip(length); }
  void putback(offile_off_t count) override {
    read_ -= count;
    file_.putback(count);
  }

 private:
  DcmFileProducer file_;
  std::uintptr_t top_;
  offile_off_t read_ = 0;
  bool is_over_ = false;
};

class LimitedStream : public DcmInputStream {
 public:
  explicit LimitedStream(const OFFilename& name) : DcmInputStream(&producer_), name_(name), producer_(name) {}

  DcmInputStreamFactory* newFactory() const override { return new DcmInputFileStreamFactory(name_, tell()); }
  OFCondition installCompressionFilter(E_StreamCompression) override { return EC_UnsupportedEncoding; }

 private:
  OFFilename name_;
  LimitedProducer producer_;
};

// null: absent, or too long.
DcmElement* short_element(DcmItem* item, const DcmTagKey& tag) {
  DcmElement* element = nullptr;
  if (!item || item->findAndGetElement(tag, element).bad() || !element) return nullptr;
  return element->getLength() <= k_most_read_at_once ? element : nullptr;
}

}  // namespace

Result<std::unique_ptr<DcmFileFormat>> open_dicom(const fs::path& path) {
  prepare_library();
  auto file = std::make_unique<DcmFileFormat>();
  LimitedStream stream{OFFilename(path.c_str())};
  file->transferInit();
  const OFCondition read =
      stream.good() ? file->read(stream, EXS_Unknown, EGL_noChange, k_most_read_at_once) : stream.status();
  file->transferEnd();
  if (read == EC_UnsupportedEncoding)
    return error(
        "{}: expected a DICOM file that is not compressed as a whole, found a deflated one. Decompress it, "
        "for "
        "example with dcmconv.",
        path.string());
  if (read.bad() || !file->getDataset())
    return error("{}: expected a complete DICOM file, found one that is damaged ({}). Copy it again.",
                 path.string(), read.text());
  return file;
}

std::string text_at(DcmItem* item, const DcmTagKey& tag) {
  OFString text;
  DcmElement* element = short_element(item, tag);
  return element && element->getOFString(text, 0).good() ? as_utf8(std::string(text.c_str())) : "";
}

long integer_at(DcmItem* item, const DcmTagKey& tag, long otherwise) {
  DcmElement* element = short_element(item, tag);
  if (!element) return otherwise;
  Uint16 value = 0;
  Sint32 from_text = 0;
  if (element->getUint16(value, 0).good()) return value;
  return element->getSint32(from_text, 0).good() ? from_text : otherwise;
}

bool read_number(DcmItem* item, const DcmTagKey& tag, int index, double* number) {
  Float64 value = 0;
  DcmElement* element = short_element(item, tag);
  if (!element || element->getFloat64(value, static_cast<unsigned long>(index)).bad()) return false;
  *number = value;
  return std::isfinite(value);
}

double number_at(DcmItem* item, const DcmTagKey& tag, double otherwise) {
  double number = 0;
  return read_number(item, tag, 0, &number) ? number : otherwise;
}

}  // namespace limn::scene
