#include "remote/api/messages.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "core/json_text.h"
#include "remote/api/guest_name.h"

namespace limn::remote {
namespace {

using nlohmann::json;

constexpr std::size_t k_shortest_device = 8, k_longest_device = 64, k_pin_digits = 6;
constexpr std::uint64_t k_max_id =
    (std::uint64_t{1} << 53) - 1;         // the largest that JavaScript's numbers hold
constexpr std::size_t k_max_quoted = 40;  // bytes of quoted text, in errors

// Text for errors: short, and in ASCII, so that no letter is cut in half.
std::string in_quotes(const std::string& text) {
  std::string out;
  for (const char c : text.substr(0, k_max_quoted)) {
    const auto byte = static_cast<unsigned char>(c);
    out += byte < 0x20 || byte >= 0x7f ? '?' : c;
  }
  return "'" + out + (text.size() > k_max_quoted ? "…'" : "'");
}

std::string found_in(const json& value) {
  return value.is_string()       ? in_quotes(value.get_ref<const std::string&>())
         : value.is_structured() ? std::string(value.type_name())
                                 : in_quotes(json_text(value));
}

bool has_controls(const std::string& text, bool may_have_lines) {
  return std::any_of(text.begin(), text.end(), [&](char c) {
    const auto byte = static_cast<unsigned char>(c);
    return (byte < 0x20 && !(may_have_lines && c == '\n')) || byte == 0x7f;
  });
}

// Reads the members of a JSON object one by one and keeps the first problem.
class Reader {
 public:
  static Result<Reader> of(std::string_view text) {
    if (text.size() > k_longest_message)
      return error("expected a message of at most {} bytes, found {}.", k_longest_message, text.size());
    json all = json::parse(text, nullptr, false);
    if (all.is_discarded()) return error("expected a JSON object, found other text.");
    if (!all.is_object()) return error("expected a JSON object, found {}.", found_in(all));
    return Reader(std::move(all));
  }

  // An absent text is empty, if it may be absent.
  std::string text(const char* key, std::size_t longest, bool may_be_absent, bool may_have_lines = false) {
    const json* value = member(key, may_be_absent);
    if (!value) return "";
    if (!value->is_string()) return problem(key, "text", found_in(*value)), "";
    const auto& found = value->get_ref<const std::string&>();
    if (found.size() > longest)
      return problem(key, fmt::format("at most {} bytes", longest), fmt::format("{}", found.size())), "";
    if (has_controls(found, may_have_lines))
      return problem(key, "text without control characters", in_quotes(found)), "";
    return found;
  }

  std::uint64_t number(const char* key, std::uint64_t most) {
    const json* value = member(key, false);
    if (!value) return 0;
    if (!value->is_number_unsigned() || value->get<std::uint64_t>() > most)
      return problem(key, fmt::format("a whole number from 0 to {}", most), found_in(*value)), 0;
    return value->get<std::uint64_t>();
  }

  bool boolean(const char* key, bool may_be_absent = false) {
    const json* value = member(key, may_be_absent);
    if (!value) return false;
    if (!value->is_boolean()) return problem(key, "true or false", found_in(*value)), false;
    return value->get<bool>();
  }

  double real(const char* key) {
    const json* value = member(key, false);
    if (!value) return 0;
    if (!value->is_number()) return problem(key, "a number", found_in(*value)), 0;
    return value->get<double>();
  }

  // A list of numbers.
  template <int count>
  Eigen::Matrix<double, count, 1> reals(const char* key) {
    Eigen::Matrix<double, count, 1> out = Eigen::Matrix<double, count, 1>::Zero();
    const json* value = member(key, false);
    if (!value) return out;
    const bool is_list =
        value->is_array() && value->size() == count &&
        std::all_of(value->begin(), value->end(), [](const json& each) { return each.is_number(); });
    if (!is_list) return problem(key, fmt::format("a list of {} numbers", count), found_in(*value)), out;
    for (int i = 0; i < count; ++i) out[i] = (*value)[static_cast<std::size_t>(i)].template get<double>();
    return out;
  }

  // A list of 1 to `most` pairs of numbers of at most `largest` in magnitude.
  std::vector<Eigen::Vector2d> pairs(const char* key, std::size_t most, double largest) {
    std::vector<Eigen::Vector2d> out;
    const json* value = member(key, false);
    if (!value) return out;
    const auto is_pair = [&](const json& each) {
      return each.is_array() && each.size() == 2 && each[0].is_number() && each[1].is_number() &&
             std::abs(each[0].get<double>()) <= largest && std::abs(each[1].get<double>()) <= largest;
    };
    if (!value->is_array() || value->empty() || value->size() > most ||
        !std::all_of(value->begin(), value->end(), is_pair))
      return problem(key, fmt::format("a list of 1 to {} pairs of numbers", most), found_in(*value)), out;
    for (const json& each : *value) out.emplace_back(each[0].get<double>(), each[1].get<double>());
    return out;
  }

  void problem(const std::string& key, const std::string& expected, const std::string& found) {
    if (!problem_) problem_ = error("{}: expected {}, found {}.", key, expected, found);
  }

  // Call it after all reads: there must be no other keys.
  Status status() const {
    if (problem_) return *problem_;
    for (const auto& [key, value] : all_.items())
      if (std::find(read_keys_.begin(), read_keys_.end(), key) == read_keys_.end())
        return error("expected no other keys, found {}.", in_quotes(key));
    return {};
  }

 private:
  explicit Reader(json all) : all_(std::move(all)) {}
  const json* member(const char* key, bool may_be_absent) {
    read_keys_.push_back(key);
    const auto found = all_.find(key);
    if (found != all_.end()) return &*found;
    if (!may_be_absent) problem(key, "it", "no such key");
    return nullptr;
  }

  json all_;
  std::vector<std::string> read_keys_;
  std::optional<Error> problem_;
};

scene::Edit read_edit(Reader* reader) {
  scene::Edit edit;
  edit.action = reader->text("action", k_longest_word, false);
  edit.slot = reader->text("slot", k_longest_word, true);
  edit.value = reader->text("value", k_longest_word, true);
  if (!scene::find_action(edit.action))
    reader->problem("action",
                    fmt::format("one of GET /api/actions ({} and so on)", scene::actions().front().name),
                    in_quotes(edit.action));
  return edit;
}

CommentRequest read_comment(Reader* reader) {
  CommentRequest comment;
  comment.look = reader->text("look", k_longest_word, true);
  comment.slot = reader->text("slot", k_longest_word, true);
  comment.text = reader->text("text", scene::k_longest_comment, false, true);
  if (comment.text.find_first_not_of(" \n") == std::string::npos)
    reader->problem("text", "a remark", "nothing");
  return comment;
}

bool is_device_name(const std::string& name) {
  return name.size() >= k_shortest_device && name.size() <= k_longest_device &&
         std::all_of(name.begin(), name.end(), [](char c) {
           return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-';
         });
}

Message read_message(const std::string& type, Reader* reader) {
  if (type == "edit") {
    const std::uint64_t id = reader->number("id", k_max_id);
    return EditMessage{id, read_edit(reader)};
  }
  if (type == "comment") {
    const std::uint64_t id = reader->number("id", k_max_id);
    return CommentMessage{id, read_comment(reader)};
  }
  if (type == "stroke") {
    constexpr double k_farthest_px = 20000;
    StrokeMessage stroke;
    stroke.id = reader->number("id", k_max_id);
    const std::string what = reader->text("what", k_longest_word, false);
    const std::string from = reader->text("from", k_longest_word, false);
    if (what != "draw" && what != "move") reader->problem("what", "draw or move", in_quotes(what));
    if (from != "room" && from != "window") reader->problem("from", "room or window", in_quotes(from));
    stroke.moves = what == "move";
    stroke.in_window = from == "window";
    stroke.line = reader->text("line", scene::k_longest_line_name, false);
    stroke.image = static_cast<std::uint32_t>(reader->number("picture", 0xffffffffu));
    stroke.px = reader->pairs("px", k_most_stroke_px, k_farthest_px);
    return stroke;
  }
  if (type == "pictures") return ImagesMessage{reader->boolean("room")};
  if (type == "seen")
    return ImageShownMessage{static_cast<std::uint32_t>(reader->number("picture", 0xffffffffu))};
  if (type == "window") {
    WindowMessage window{reader->text("device", k_longest_word, false), reader->boolean("on")};
    const std::string parts = reader->text("parts", k_longest_word, true);
    if (parts == "rest")
      window.parts = TabletViewMode::rest;
    else if (parts == "full")
      window.parts = TabletViewMode::full;
    else if (!parts.empty() && parts != "screen")
      reader->problem("parts", "screen, rest or full", in_quotes(parts));
    if (!is_device_name(window.device))
      reader->problem("device",
                      fmt::format("{} to {} letters, digits and '-'", k_shortest_device, k_longest_device),
                      in_quotes(window.device));
    return window;
  }
  if (type == "glasses")
    return GlassesMessage{reader->boolean("on"), reader->text("marker", k_longest_word, true),
                          reader->boolean("camera", true)};
  if (type == "glasses_pose")
    return GlassesPoseMessage{reader->real("at_s"), reader->reals<4>("rotation_wxyz"),
                              reader->reals<3>("translation_m")};
  if (type == "glasses_view") {
    GlassesViewMessage view{static_cast<std::uint32_t>(reader->number("picture", 0xffffffffu)),
                            reader->real("at_s"), reader->reals<4>("rotation_wxyz"),
                            reader->reals<3>("translation_m")};
    view.width = static_cast<int>(reader->number("width", 0xffff));
    view.height = static_cast<int>(reader->number("height", 0xffff));
    view.lens_px = reader->reals<4>("lens_px");
    return view;
  }
  if (type == "glasses_state") {
    const std::string is = reader->text("is", k_longest_word, false);
    if (is != "asleep" && is != "lost") reader->problem("is", "asleep or lost", in_quotes(is));
    return GlassesStateMessage{is == "asleep"};
  }
  reader->problem(
      "type",
      "edit, comment, stroke, pictures, seen, window, glasses, glasses_pose, glasses_view or glasses_state",
      in_quotes(type));
  return {};
}

std::string list_of(const std::vector<std::string>& names) {
  std::string list;
  for (const std::string& name : names) list += (list.empty() ? "" : ", ") + name;
  return list;
}

bool is_reserved(std::string name) {
  for (char& c : name)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  const auto& all = reserved_names();
  return name.find(':') != std::string::npos ||
         std::any_of(all.begin(), all.end(), [&](const std::string& own) { return look_alike(name, own); });
}

void put_number(std::uint32_t number, std::string* out) {
  for (int shift = 0; shift < 32; shift += 8) out->push_back(static_cast<char>(number >> shift & 0xffu));
}

}  // namespace

Result<Message> parse_message(std::string_view text) {
  LIMN_TRY(Reader reader, Reader::of(text));
  const std::string type = reader.text("type", k_longest_word, false);
  Message message = read_message(type, &reader);
  LIMN_TRY_STATUS(reader.status());
  return message;
}

std::optional<std::uint64_t> parse_message_id(std::string_view text) {
  if (text.size() > k_longest_message) return std::nullopt;
  const json all = json::parse(text, nullptr, false);
  if (!all.is_object()) return std::nullopt;
  const auto id = all.find("id");
  if (id == all.end() || !id->is_number_unsigned() || id->get<std::uint64_t>() > k_max_id)
    return std::nullopt;
  return id->get<std::uint64_t>();
}

const std::vector<std::string>& reserved_names() {
  static const std::vector<std::string> all = {"operator", "key", "script", "osc", "limn"};
  return all;
}

Result<PairRequest> parse_pairing(std::string_view text) {
  LIMN_TRY(Reader reader, Reader::of(text));
  PairRequest request{reader.text("pin", k_longest_word, false),
                      reader.text("name", k_longest_guest_name, true)};
  if (request.pin.size() != k_pin_digits ||
      !std::all_of(request.pin.begin(), request.pin.end(), [](char c) { return c >= '0' && c <= '9'; }))
    reader.problem("pin", fmt::format("{} digits", k_pin_digits), "other text");
  const auto first = request.name.find_first_not_of(' ');
  request.name = first == std::string::npos
                     ? "guest"
                     : request.name.substr(first, request.name.find_last_not_of(' ') + 1 - first);
  if (!is_visible_name(request.name))
    reader.problem("name", "a name of visible characters and single blanks", "others");
  else if (is_reserved(request.name))
    reader.problem(
        "name", fmt::format("a name without ':' that is none of Limn's own ({})", list_of(reserved_names())),
        in_quotes(request.name));
  LIMN_TRY_STATUS(reader.status());
  return request;
}

Result<scene::Edit> parse_edit(std::string_view text) {
  LIMN_TRY(Reader reader, Reader::of(text));
  scene::Edit edit = read_edit(&reader);
  LIMN_TRY_STATUS(reader.status());
  return edit;
}

Result<CommentRequest> parse_comment(std::string_view text) {
  LIMN_TRY(Reader reader, Reader::of(text));
  CommentRequest comment = read_comment(&reader);
  LIMN_TRY_STATUS(reader.status());
  return comment;
}

Status parse_empty_body(std::string_view text) {
  LIMN_TRY(const Reader reader, Reader::of(text));
  return reader.status();
}

Result<FrameMessage> parse_frame(std::span<const std::uint8_t> bytes) {
  if (bytes.size() > k_longest_frame)
    return error("expected a picture of at most {} bytes, found {}.", k_longest_jpeg, bytes.size() - 4);
  if (bytes.size() < 8 || bytes[4] != 0xff || bytes[5] != 0xd8)
    return error("expected a frame's number and a JPEG, found {} other bytes.", bytes.size());
  FrameMessage frame;
  for (std::size_t i = 0; i < 4; ++i)
    frame.number |= static_cast<std::uint32_t>(bytes[i]) << static_cast<unsigned>(8 * i);
  frame.jpeg = bytes.subspan(4);
  return frame;
}

std::string image_message(ImageKind kind,
                          std::uint32_t number,
                          const std::string& json,
                          std::span<const std::uint8_t> jpeg) {
  std::string out;
  out.reserve(12 + json.size() + jpeg.size());
  put_number(static_cast<std::uint32_t>(kind), &out);
  put_number(number, &out);
  put_number(static_cast<std::uint32_t>(json.size()), &out);
  out += json;
  out.append(jpeg.begin(), jpeg.end());
  return out;
}

}  // namespace limn::remote
