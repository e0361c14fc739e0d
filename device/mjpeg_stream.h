#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "core/frame.h"
#include "core/result.h"

namespace limn::device {

/// One image of a stream, as sent.
struct MjpegPart {
  std::string jpeg;
  Stamp arrived_at;  ///< of its first byte
};

/// The answer of an HTTP server that sends JPEGs as multipart/x-mixed-replace, read as its bytes come in, cut
/// anywhere. Keeps the newest whole image alone. Images end where their Content-Length says or, without
/// one, at the next boundary; chunked answers are unwrapped. No sockets here.
class MjpegStream {
 public:
  explicit MjpegStream(std::size_t max_part_bytes) : max_part_bytes_(max_part_bytes) {}

  /// Error when these bytes cannot be such an answer (HTTP error, other content, bad boundary, part too
  /// large, end of the stream); nothing more can be fed then. The message is a sentence without a place.
  Status feed(std::string_view bytes, Stamp arrived_at);
  bool has_part() const { return newest_.has_value(); }
  /// The newest whole image, once.
  std::optional<MjpegPart> take_newest();
  /// Whole images that a newer one replaced before they were taken.
  long dropped() const { return dropped_; }

 private:
  enum class At { answer, delimiter, part_head, part_body };
  enum class Chunk { none, size, data, end };

  Status read_answer(std::string_view head);
  Status unchunk(std::string_view bytes);
  Status read_delimiter(std::string_view line);
  Status read_part_head(std::string_view head);
  Result<bool> step(Stamp arrived_at);
  Result<bool> take_body(Stamp arrived_at);
  void keep(std::size_t jpeg_bytes);

  std::size_t max_part_bytes_;
  At at_ = At::answer;
  std::string buffer_;    // not yet understood
  std::string boundary_;  // with its leading dashes
  Chunk chunk_ = Chunk::none;
  std::string chunk_line_;
  std::size_t chunk_left_ = 0;
  std::optional<std::size_t> part_length_;
  std::size_t searched_ = 0;  // of buffer_: no boundary begins before
  std::optional<Stamp> part_arrived_at_;
  std::optional<MjpegPart> newest_;
  long dropped_ = 0;
};

}  // namespace limn::device
