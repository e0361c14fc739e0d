#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "core/result.h"
#include "remote/tablet/tablet_view_mode.h"
#include "scene/actions.h"
#include "scene/comments.h"

namespace limn::remote {

/// The longest texts that are looked at, bytes; a comment's is scene::k_longest_comment.
constexpr std::size_t k_longest_message = 16 * 1024, k_longest_word = 200, k_longest_guest_name = 64;
/// A frame of the window: its number and at most so much JPEG.
constexpr std::size_t k_longest_jpeg = 4 * 1024 * 1024, k_longest_frame = 4 + k_longest_jpeg;

/// What a guest writes about a look or a part; both may be empty.
struct CommentRequest {
  std::string look, slot, text;
};

/// What the page says over its WebSocket (docs/remote.md).
struct EditMessage {
  std::uint64_t id = 0;  ///< of the page, for the answer
  scene::Edit edit;
};
struct CommentMessage {
  std::uint64_t id = 0;
  CommentRequest comment;
};
struct ImagesMessage {
  bool room = false;
};
struct ImageShownMessage {
  std::uint32_t image = 0;
};
struct WindowMessage {
  std::string device;
  bool on = false;
  TabletViewMode parts = TabletViewMode::as_screen;  ///< also when it is left out
};
using Message = std::variant<EditMessage, CommentMessage, ImagesMessage, ImageShownMessage, WindowMessage>;

/// A text message. Errors say what was expected: no JSON object, an unknown type or action, keys that are
/// missing, unknown or of another kind, text that is too long or has control characters. Slots, variants and
/// looks are the scene's affair.
Result<Message> parse_message(std::string_view text);
/// The id in a message that could not be understood otherwise.
std::optional<std::uint64_t> parse_message_id(std::string_view text);

/// Bodies of HTTP requests; errors as above.
struct PairRequest {
  std::string pin;   ///< six digits
  std::string name;  ///< without blanks around it; "guest" when it was left out or empty
};
/// Names that the log gives to Limn's own doings: no guest's, however they are written; nor is one with ':',
/// as markers have it.
const std::vector<std::string>& reserved_names();
Result<PairRequest> parse_pairing(std::string_view text);
Result<scene::Edit> parse_edit(std::string_view text);
Result<CommentRequest> parse_comment(std::string_view text);
Status parse_empty_body(std::string_view text);  ///< {}

/// A binary message of the window. Error: too short, too long, no JPEG's beginning.
struct FrameMessage {
  std::uint32_t number = 0;
  std::span<const std::uint8_t> jpeg;  ///< within the bytes given
};
Result<FrameMessage> parse_frame(std::span<const std::uint8_t> bytes);

/// A binary message to the page: kind, number, JSON and image.
enum class ImageKind : std::uint32_t { room = 1, window = 2 };
std::string image_message(ImageKind kind,
                          std::uint32_t number,
                          const std::string& json,
                          std::span<const std::uint8_t> jpeg);

}  // namespace limn::remote
