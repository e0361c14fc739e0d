#pragma once

#include <Eigen/Core>
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

/// The longest texts that are accepted, bytes. (A comment may have scene::k_longest_comment.)
constexpr std::size_t k_longest_message = 16 * 1024, k_longest_word = 200, k_longest_guest_name = 64;
/// Points of one stroke message.
constexpr std::size_t k_most_stroke_px = 300;
/// The longest frame of a window: its number and a JPEG.
constexpr std::size_t k_longest_jpeg = 4 * 1024 * 1024, k_longest_frame = 4 + k_longest_jpeg;

/// A comment that a guest writes about a look or a slot's part; both names may be empty.
struct CommentRequest {
  std::string look, slot, text;
};

/// The messages that the page sends over its WebSocket (docs/remote.md).
struct EditMessage {
  std::uint64_t id = 0;  ///< The page's number for the message; the answer has it, too.
  scene::Edit edit;
};
struct CommentMessage {
  std::uint64_t id = 0;  ///< As above.
  CommentRequest comment;
};
/// `pictures`: begins or ends images of the room.
struct ImagesMessage {
  bool room = false;
};
/// `stroke`: points in an image that was shown, through which a line is drawn on the prototype or moved on
/// it.
struct StrokeMessage {
  std::uint64_t id = 0;     ///< As above.
  bool moves = false;       ///< Moves the place of a line at the first point to the last one; else draws on.
  std::string line;         ///< A drawn line; for one that does not exist yet, its name.
  bool in_window = false;   ///< The image is one of the client's window; else of the room.
  std::uint32_t image = 0;  ///< Its number.
  std::vector<Eigen::Vector2d> px;  ///< Pixel (0, 0) is the first one's centre.
};
/// `seen`: the page has shown this image of the room.
struct ImageShownMessage {
  std::uint32_t image = 0;
};
/// `window`: opens, changes or closes the window through the tablet's camera.
struct WindowMessage {
  std::string device;
  bool on = false;
  TabletViewMode parts = TabletViewMode::as_screen;
};
/// `glasses`: puts glasses on or takes them off.
struct GlassesMessage {
  bool on = false;
  std::string marker;   ///< The marker on them; empty: the first of the scene's that no others use, or
                        ///< else their camera; k_by_camera: their camera.
  bool camera = false;  ///< The browser gives pictures of their camera.
};
/// Instead of a marker's name: the glasses are registered by their camera.
inline constexpr const char* k_by_camera = "camera";
/// `glasses_view`: announces a picture of the glasses' camera, which follows as a binary message with this
/// number: the camera's pose in the frame of the odometry (WebXR's view) at the page's moment, and its lens.
struct GlassesViewMessage {
  std::uint32_t image = 0;
  double at_s = 0;
  Eigen::Vector4d rotation_wxyz = {1, 0, 0, 0};  ///< As sent; it may be of any length.
  Eigen::Vector3d translation_m = {0, 0, 0};
  int width = 0, height = 0;
  Eigen::Vector4d lens_px = {0, 0, 0, 0};  ///< fx, fy, cx, cy; pixel (0, 0) is the first one's centre
};
/// `glasses_pose`: the eye's pose by the glasses' odometry, feed_from_eye, at a moment of the page's clock.
struct GlassesPoseMessage {
  double at_s = 0;
  Eigen::Vector4d rotation_wxyz = {1, 0, 0, 0};  ///< As sent; it may be of any length.
  Eigen::Vector3d translation_m = {0, 0, 0};
};
/// `glasses_state`: the glasses do not track, or sleep.
struct GlassesStateMessage {
  bool is_asleep = false;
};
using Message = std::variant<EditMessage,
                             CommentMessage,
                             StrokeMessage,
                             ImagesMessage,
                             ImageShownMessage,
                             WindowMessage,
                             GlassesMessage,
                             GlassesPoseMessage,
                             GlassesViewMessage,
                             GlassesStateMessage>;

/// Parses a text message. Errors say what was expected: no JSON object, an unknown type or action, keys that
/// are missing, unknown or of another type, text that is too long or has control characters. Whether slots,
/// variants and looks exist is checked elsewhere.
Result<Message> parse_message(std::string_view text);
/// The id of a message that parse_message() refuses; nullopt: it has none.
std::optional<std::uint64_t> parse_message_id(std::string_view text);

/// The body of a request for pairing.
struct PairRequest {
  std::string pin;   ///< Six digits.
  std::string name;  ///< Without blanks around it; "guest" when it was left out or empty.
};
/// Names that the log uses for Limn's own actions. No guest can have one, in upper or lower case, nor a name
/// with
/// ':', as markers have.
const std::vector<std::string>& reserved_names();
/// Parse the bodies of HTTP requests; errors as above.
Result<PairRequest> parse_pairing(std::string_view text);
Result<scene::Edit> parse_edit(std::string_view text);
Result<CommentRequest> parse_comment(std::string_view text);
/// Checks that a body is {}.
Status parse_empty_body(std::string_view text);

/// A frame of a window, as a binary message. Errors: too short, too long, no JPEG.
struct FrameMessage {
  std::uint32_t number = 0;
  std::span<const std::uint8_t> jpeg;  ///< Refers to the message's bytes.
};
Result<FrameMessage> parse_frame(std::span<const std::uint8_t> bytes);

/// Makes a binary message to the page: kind, number, JSON and image.
enum class ImageKind : std::uint32_t { room = 1, window = 2 };
std::string image_message(ImageKind kind,
                          std::uint32_t number,
                          const std::string& json,
                          std::span<const std::uint8_t> jpeg);

}  // namespace limn::remote
