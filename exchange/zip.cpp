#include "exchange/zip.h"

#include <zip.h>

#include <algorithm>

namespace limn::exchange {
namespace {

std::string text_of(zip_error_t* problem) {
  std::string text = zip_error_strerror(problem);
  zip_error_fini(problem);
  return text;
}

std::string text_of(int code) {
  zip_error_t problem;
  zip_error_init_with_code(&problem, code);
  return text_of(&problem);
}

}  // namespace

struct ZipArchive::Impl {
  std::string bytes;
  zip_t* archive = nullptr;

  explicit Impl(std::string bytes_in) : bytes(std::move(bytes_in)) {}
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
  ~Impl() {
    if (archive) zip_discard(archive);
  }
};

Result<ZipArchive> ZipArchive::open(std::string bytes, const std::string& where) {
  auto impl = std::make_shared<Impl>(std::move(bytes));
  zip_error_t problem;
  zip_error_init(&problem);
  zip_source_t* source = zip_source_buffer_create(impl->bytes.data(), impl->bytes.size(), 0, &problem);
  if (source) impl->archive = zip_open_from_source(source, ZIP_RDONLY, &problem);
  if (!impl->archive) {
    if (source) zip_source_free(source);
    return error(
        "{}: expected a whole zip archive, found a truncated or damaged one ({} bytes: {}). Copy it again.",
        where, impl->bytes.size(), text_of(&problem));
  }
  zip_error_fini(&problem);
  return ZipArchive(std::move(impl));
}

std::vector<std::string> ZipArchive::names() const {
  std::vector<std::string> names;
  for (zip_int64_t i = 0; i < zip_get_num_entries(impl_->archive, 0); ++i) {
    const char* name = zip_get_name(impl_->archive, static_cast<zip_uint64_t>(i), 0);
    names.emplace_back(name ? name : "");
  }
  return names;
}

Result<std::string> ZipArchive::read(const std::string& name, std::size_t most_bytes) const {
  const zip_int64_t index = zip_name_locate(impl_->archive, name.c_str(), 0);
  if (index < 0) return error("expected the file '{}' inside, found none.", name);
  const auto too_large = [&] {
    return error("'{}': expected at most {} bytes when unpacked, found more.", name, most_bytes);
  };
  zip_stat_t stat;
  if (zip_stat_index(impl_->archive, static_cast<zip_uint64_t>(index), 0, &stat) == 0 &&
      (stat.valid & ZIP_STAT_SIZE) && stat.size > most_bytes) {
    return too_large();
  }
  const auto damaged = [&](const std::string& problem) {
    return error("'{}': expected a file that can be unpacked, found: {}. Copy the archive again.", name,
                 problem);
  };
  zip_file_t* file = zip_fopen_index(impl_->archive, static_cast<zip_uint64_t>(index), 0);
  if (!file) return damaged(zip_strerror(impl_->archive));
  constexpr std::size_t k_step = 1 << 20;
  std::string content;
  std::size_t length = 0;
  zip_int64_t got = 0;
  do {
    content.resize(length + k_step);
    got = zip_fread(file, content.data() + length, k_step);  // checks the content's CRC at its end
    if (got > 0) length += static_cast<std::size_t>(got);
  } while (got > 0 && length <= most_bytes);
  const std::string problem = zip_file_strerror(file);
  zip_fclose(file);
  if (got < 0) return damaged(problem);
  if (length > most_bytes) return too_large();
  content.resize(length);
  return content;
}

Result<std::string> zipped(const std::vector<ZipFile>& files) {
  zip_error_t problem;
  zip_error_init(&problem);
  zip_source_t* target = zip_source_buffer_create(nullptr, 0, 0, &problem);
  zip_t* archive = target ? zip_open_from_source(target, ZIP_TRUNCATE, &problem) : nullptr;
  if (!archive) return error("zip archive: cannot create one: {}.", text_of(&problem));
  zip_source_keep(target);  // keeps it after the archive is closed
  zip_error_fini(&problem);
  for (const ZipFile& file : files) {
    zip_source_t* source = zip_source_buffer(archive, file.content.data(), file.content.size(), 0);
    const zip_int64_t index = zip_file_add(archive, file.name.c_str(), source, ZIP_FL_ENC_UTF_8);
    LIMN_CHECK(index >= 0);
    zip_set_file_compression(archive, static_cast<zip_uint64_t>(index),
                             file.is_packed ? ZIP_CM_STORE : ZIP_CM_DEFLATE, 1);
  }
  std::string bytes;
  const int closed = zip_close(archive);
  if (closed != 0) zip_discard(archive);
  zip_stat_t stat;
  bool is_read = false;
  if (closed == 0 && zip_source_stat(target, &stat) == 0 && zip_source_open(target) == 0) {
    bytes.resize(stat.size);
    is_read = zip_source_read(target, bytes.data(), bytes.size()) == static_cast<zip_int64_t>(bytes.size());
    zip_source_close(target);
  }
  zip_source_free(target);
  if (!is_read) return error("zip archive: cannot be written: {}.", text_of(ZIP_ER_MEMORY));
  return bytes;
}

}  // namespace limn::exchange
