#include "device/mjpeg_stream.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <utility>

namespace limn::device {
namespace {

constexpr std::size_t k_max_head = 16384;  // servers in the wild stay below 2 KB

std::string lower(std::string_view text) {
  std::string small(text);
  std::transform(small.begin(), small.end(), small.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return small;
}

std::string_view trimmed(std::string_view text) {
  const auto is_space = [](char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; };
  while (!text.empty() && is_space(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_space(text.back())) text.remove_suffix(1);
  return text;
}

// The text, short and printable, for a message.
std::string found(std::string_view text) {
  std::string shown;
  for (const char c : text.substr(0, 40)) shown += c >= ' ' && c <= '~' ? c : '.';
  return text.size() > 40 ? shown + "..." : shown;
}

// The value of a header field; empty when absent.
std::string_view field(std::string_view head, const std::string& name) {
  while (!head.empty()) {
    const std::size_t end = std::min(head.find('\n'), head.size() - 1);
    const std::string_view line = head.substr(0, end + 1);
    head.remove_prefix(end + 1);
    const std::size_t colon = line.find(':');
    if (colon != std::string_view::npos && lower(trimmed(line.substr(0, colon))) == name)
      return trimmed(line.substr(colon + 1));
  }
  return {};
}

std::optional<std::size_t> number(std::string_view text, int base) {
  std::size_t value = 0;
  const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), value, base);
  if (problem != std::errc() || end == text.data()) return std::nullopt;
  return value;
}

// The boundary parameter of a content type, without quotes and without the dashes that some servers add.
std::string boundary_of(std::string_view content_type) {
  const std::size_t at = lower(content_type).find("boundary=");
  if (at == std::string::npos) return {};
  std::string_view value = content_type.substr(at + 9);
  value = trimmed(value.substr(0, value.find(';')));
  if (value.size() >= 2 && value.front() == '"' && value.back() == '"')
    value = value.substr(1, value.size() - 2);
  if (value.starts_with("--")) value.remove_prefix(2);
  return std::string(value);
}

// Removes and returns the text before the first empty line; nullopt when there is no empty line yet.
std::optional<std::string> take_head(std::string* buffer) {
  std::size_t end = buffer->find("\r\n\r\n"), skip = 4;
  if (const std::size_t bare = buffer->find("\n\n"); bare < end) end = bare, skip = 2;
  if (end == std::string::npos) return std::nullopt;
  std::string head = buffer->substr(0, end + skip);
  buffer->erase(0, end + skip);
  return head;
}

}  // namespace

Status MjpegStream::read_answer(std::string_view head) {
  const std::string_view status = trimmed(head.substr(0, head.find('\n')));
  if (!status.starts_with("HTTP/1."))
    return error("expected an HTTP answer, found \"{}\". Check the port.", found(status));
  const std::string_view code = trimmed(status.substr(std::min<std::size_t>(9, status.size())));
  if (code.starts_with("401"))
    return error("the server requires a name and password ({}). Give them: http://NAME:PASSWORD@HOST/.",
                 found(status));
  if (code.starts_with("3"))
    return error("the server redirects to {} ({}). Use that address.", found(field(head, "location")),
                 found(status));
  if (!code.starts_with("200"))
    return error("expected the answer 200, found \"{}\". Check the address's path.", found(status));
  const std::string_view type = field(head, "content-type");
  boundary_ = boundary_of(type);
  if (!lower(type).starts_with("multipart/") || boundary_.empty())
    return error(
        "expected multipart/x-mixed-replace with a boundary, found the content \"{}\". "
        "Use the address of the camera's MJPEG stream.",
        found(type));
  boundary_ = "--" + boundary_;
  if (lower(field(head, "transfer-encoding")) == "chunked") chunk_ = Chunk::size;
  at_ = At::delimiter;
  return {};
}

// Appends the data of chunks to buffer_.
Status MjpegStream::unchunk(std::string_view bytes) {
  while (!bytes.empty()) {
    if (chunk_ == Chunk::data) {
      const std::size_t count = std::min(chunk_left_, bytes.size());
      buffer_ += bytes.substr(0, count);
      bytes.remove_prefix(count);
      chunk_left_ -= count;
      if (chunk_left_ == 0) chunk_ = Chunk::end;
      continue;
    }
    const char c = bytes.front();
    bytes.remove_prefix(1);
    if (c != '\n') {
      chunk_line_ += c;
      if (chunk_line_.size() > k_max_head)
        return error("expected the size of a chunk, found \"{}\".", found(chunk_line_));
      continue;
    }
    const std::string line = std::exchange(chunk_line_, {});
    if (chunk_ == Chunk::end) {  // the end of line after a chunk's data
      chunk_ = Chunk::size;
      continue;
    }
    const auto size = number(trimmed(line), 16);
    if (!size) return error("expected the size of a chunk, found \"{}\".", found(line));
    if (*size == 0) return error("the server ended the stream.");
    chunk_left_ = *size;
    chunk_ = Chunk::data;
  }
  return {};
}

Status MjpegStream::read_delimiter(std::string_view line) {
  if (line.empty()) return {};
  if (line == boundary_ + "--") return error("the server ended the stream.");
  if (line != boundary_)
    return error("expected the boundary \"{}\" between images, found \"{}\".", found(boundary_), found(line));
  at_ = At::part_head;
  return {};
}

Status MjpegStream::read_part_head(std::string_view head) {
  const std::string type = lower(field(head, "content-type"));
  if (!type.empty() && !type.starts_with("image/jpeg") && !type.starts_with("image/jpg"))
    return error("expected parts of image/jpeg, found \"{}\".", found(type));
  const std::string_view length = field(head, "content-length");
  part_length_ = number(length, 10);
  if (!length.empty() && !part_length_)
    return error("expected a part's Content-Length to be a number, found \"{}\".", found(length));
  if (part_length_ && *part_length_ > max_part_bytes_)
    return error("expected parts of at most {} bytes, found one announced with {}.", max_part_bytes_,
                 *part_length_);
  at_ = At::part_body;
  searched_ = 0;
  part_arrived_at_.reset();
  return {};
}

// Keeps the first bytes of the buffer, a complete image, as the newest one.
void MjpegStream::keep(std::size_t jpeg_bytes) {
  dropped_ += newest_ ? 1 : 0;
  newest_ = MjpegPart{buffer_.substr(0, jpeg_bytes), part_arrived_at_.value()};
  buffer_.erase(0, jpeg_bytes);
  at_ = At::delimiter;
}

Result<bool> MjpegStream::take_body(Stamp arrived_at) {
  if (buffer_.empty()) return false;
  if (!part_arrived_at_) part_arrived_at_ = arrived_at;
  if (part_length_) {
    if (buffer_.size() < *part_length_) return false;
    keep(*part_length_);
    return true;
  }
  const std::string end = "\r\n" + boundary_;
  const std::size_t at = buffer_.find(end, searched_);
  if (std::min(at, buffer_.size()) > max_part_bytes_)
    return error("expected parts of at most {} bytes, found {} without the boundary \"{}\".", max_part_bytes_,
                 buffer_.size(), found(boundary_));
  if (at == std::string::npos) {
    searched_ = buffer_.size() - std::min(buffer_.size(), end.size() - 1);
    return false;
  }
  keep(at);
  return true;
}

// Parses the next element in the buffer; false when more bytes are needed.
Result<bool> MjpegStream::step(Stamp arrived_at) {
  if (at_ == At::part_body) return take_body(arrived_at);
  if (at_ == At::delimiter) {
    const std::size_t end = buffer_.find('\n');
    if (end == std::string::npos && buffer_.size() <= k_max_head) return false;
    const std::string line = buffer_.substr(0, end);
    buffer_.erase(0, end == std::string::npos ? end : end + 1);
    LIMN_TRY_STATUS(read_delimiter(trimmed(line)));
    return true;
  }
  // In a part without any header the empty line follows the boundary directly.
  if (at_ == At::part_head && buffer_.starts_with("\r\n")) buffer_.insert(0, "\r\n");
  const auto head = take_head(&buffer_);
  if (!head && buffer_.size() > k_max_head)
    return error("expected a header of at most {} bytes, found more: \"{}\".", k_max_head, found(buffer_));
  if (!head) return false;
  if (at_ == At::part_head) {
    LIMN_TRY_STATUS(read_part_head(*head));
    return true;
  }
  LIMN_TRY_STATUS(read_answer(*head));
  if (chunk_ != Chunk::none) LIMN_TRY_STATUS(unchunk(std::exchange(buffer_, {})));
  return true;
}

Status MjpegStream::feed(std::string_view bytes, Stamp arrived_at) {
  if (chunk_ == Chunk::none) buffer_ += bytes;
  Status chunks;  // images before a bad chunk are still valid
  if (chunk_ != Chunk::none) chunks = unchunk(bytes);
  for (bool more = true; more;) {
    LIMN_TRY(more, step(arrived_at));
  }
  return chunks;
}

std::optional<MjpegPart> MjpegStream::take_newest() { return std::exchange(newest_, std::nullopt); }

}  // namespace limn::device
