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
  Stamp arrived_at;  ///< Arrival of its first byte.
};

/// Reads the answer of an HTTP server that sends JPEGs as multipart/x-mixed-replace. The bytes may come in
/// pieces of any length. Only the newest complete image is kept. Images end by their Content-Length or,
/// without one, at the next boundary; chunked answers are decoded. This class uses no sockets.
class MjpegStream {
 public:
  explicit MjpegStream(std::size_t max_part_bytes) : max_part_bytes_(max_part_bytes) {}

  /// Reads more bytes. Error when they are not such an answer (HTTP error, other content, bad boundary, part
  /// too large, end of the stream); then no more can be fed. The message does not name the camera.
  Status feed(std::string_view bytes, Stamp arrived_at);
  bool has_part() const { return newest_.has_value(); }
  /// Returns the newest complete image and forgets it.
  std::optional<MjpegPart> take_newest();
  /// Number of complete images that a newer one replaced before they were taken.
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
  std::string buffer_;    // bytes that are not parsed yet
  std::string boundary_;  // with its leading dashes
  Chunk chunk_ = Chunk::none;
  std::string chunk_line_;
  std::size_t chunk_left_ = 0;
  std::optional<std::size_t> part_length_;
  std::size_t searched_ = 0;  // offset in buffer_ before which no boundary begins
  std::optional<Stamp> part_arrived_at_;
  std::optional<MjpegPart> newest_;
  long dropped_ = 0;
};

}  // namespace limn::device
