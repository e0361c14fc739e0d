#include "session/osc.h"

#include <lo/lo.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <optional>

#include "core/utf8.h"

namespace limn::session {
namespace {

const std::string k_root = "/limn/";
constexpr std::size_t k_longest_text = 200;  // bytes

struct FreeMessage {
  void operator()(lo_message message) const { lo_message_free(message); }
};
using OscMessage = std::unique_ptr<std::remove_pointer_t<lo_message>, FreeMessage>;

std::string arguments_of(const scene::Action& action) {
  std::vector<std::string> words;
  if (action.of_slot) words.push_back("slot (text)");
  switch (action.argument_kind) {
    case scene::ArgumentKind::nothing:
      break;
    case scene::ArgumentKind::text:
      words.push_back(fmt::format("{} (text)", action.value));
      break;
    case scene::ArgumentKind::maybe_text:
      words.push_back(fmt::format("{} (text, may be left out)", action.value));
      break;
    case scene::ArgumentKind::number:
      words.push_back(fmt::format("{} (a number)", action.value));
      break;
    case scene::ArgumentKind::millimetres:
      words.push_back("three numbers, mm");
      break;
    case scene::ArgumentKind::pose:
      words.emplace_back(action.value);
      break;
    case scene::ArgumentKind::on_off:
      words.push_back("on, off or toggle (text; or true, false, a number: 0 is off; left out: toggle)");
      break;
  }
  if (!action.of.empty()) words.push_back(fmt::format("{} (text)", action.of));
  return words.empty() ? "none" : fmt::format("{}", fmt::join(words, "; "));
}

// Whether the text is UTF-8 without control characters.
bool is_printable(const std::string& text) {
  const auto is_control = [](unsigned char byte) { return byte < 0x20 || byte == 0x7f; };
  return is_utf8(text) && std::none_of(text.begin(), text.end(), is_control);
}

// The text as it may appear in a message to people. A character that is cut off becomes U+FFFD.
std::string printable(const std::string& text) {
  return is_printable(text) ? as_utf8(text.substr(0, k_longest_text)) : "?";
}

// Reads the padded text that begins at `at`; nullopt: it has no end.
std::optional<std::string> text_at(std::span<const std::uint8_t> bytes, std::size_t at) {
  const auto begin = bytes.begin() + static_cast<std::ptrdiff_t>(std::min(at, bytes.size()));
  const auto end = std::find(begin, bytes.end(), 0);
  if (end == bytes.end()) return std::nullopt;
  return std::string(begin, end);
}

// The type letters of a message; nullopt: it is not a message.
std::optional<std::string> types_of(std::span<const std::uint8_t> bytes) {
  const auto path = text_at(bytes, 0);
  if (!path || path->empty() || path->front() != '/') return std::nullopt;
  const auto types = text_at(bytes, (path->size() / 4 + 1) * 4);
  if (!types || types->empty() || types->front() != ',') return std::nullopt;
  return types->substr(1);
}

// The types that actions use. Other types are not passed to liblo (0.31): it reads beyond the end of a blob
// that was cut off.
const std::string k_known_types = {LO_INT32,  LO_INT64,  LO_FLOAT, LO_DOUBLE,
                                   LO_STRING, LO_SYMBOL, LO_TRUE,  LO_FALSE};

// One argument of a known type.
struct Argument {
  char type;
  const void* value;

  std::optional<double> number() const {
    switch (type) {
      case LO_INT32:
        return as<std::int32_t>();
      case LO_INT64:
        return static_cast<double>(as<std::int64_t>());
      case LO_FLOAT:
        return as<float>();
      case LO_DOUBLE:
        return as<double>();
      default:
        return std::nullopt;
    }
  }
  std::optional<std::string> text() const {
    if (type != LO_STRING && type != LO_SYMBOL) return std::nullopt;
    return std::string(reinterpret_cast<const char*>(value));
  }
  // liblo aligns all values to 4 bytes only, whatever their type.
  template <class T>
  T as() const {
    T out;
    std::memcpy(&out, value, sizeof out);
    return out;
  }
};

// Reads a message's arguments one after the other.
struct Reader {
  std::string path;
  std::vector<Argument> arguments;
  std::size_t next = 0;

  bool is_at_end() const { return next == arguments.size(); }

  Result<std::string> text(std::string_view what) {
    const auto found = is_at_end() ? std::nullopt : arguments[next].text();
    if (!found) return error("{}: expected {} as text, found {}.", path, what, found_here());
    if (found->size() > k_longest_text || !is_printable(*found))
      return error("{}: expected {} of at most {} printable bytes of UTF-8, found {} bytes.", path, what,
                   k_longest_text, found->size());
    ++next;
    return *found;
  }

  Result<double> number(const char* what = "a number of millimetres") {
    const auto found = is_at_end() ? std::nullopt : arguments[next].number();
    if (!found) return error("{}: expected {}, found {}.", path, what, found_here());
    if (!std::isfinite(*found)) return error("{}: expected finite numbers, found {}.", path, *found);
    ++next;
    return *found;
  }

  std::string found_here() const {
    return is_at_end() ? std::string("no more arguments")
                       : fmt::format("an argument of type '{}'", arguments[next].type);
  }
};

Result<std::string> switch_of(Reader* reader) {
  if (reader->is_at_end()) return std::string();
  const Argument& argument = reader->arguments[reader->next];
  if (argument.text()) return reader->text("on, off or toggle");
  const auto number = argument.type == LO_TRUE    ? std::optional<double>(1)
                      : argument.type == LO_FALSE ? std::optional<double>(0)
                                                  : argument.number();
  if (!number || !std::isfinite(*number))
    return error("{}: expected on, off, toggle, true, false or a number, found {}.", reader->path,
                 number ? fmt::format("{}", *number) : reader->found_here());
  ++reader->next;
  return std::string(*number == 0 ? "off" : "on");
}

Result<std::string> value_of(scene::ArgumentKind argument_kind, std::string_view what, Reader* reader) {
  switch (argument_kind) {
    case scene::ArgumentKind::nothing:
      return std::string();
    case scene::ArgumentKind::text:
      return reader->text(what);
    case scene::ArgumentKind::maybe_text:
      return reader->is_at_end() ? Result<std::string>(std::string()) : reader->text(what);
    case scene::ArgumentKind::number: {
      LIMN_TRY(const double number, reader->number());
      return fmt::format("{}", number);
    }
    case scene::ArgumentKind::millimetres: {
      LIMN_TRY(const double x, reader->number());
      LIMN_TRY(const double y, reader->number());
      LIMN_TRY(const double z, reader->number());
      return fmt::format("{} {} {}", x, y, z);
    }
    case scene::ArgumentKind::pose: {
      std::string all;
      for (int i = 0; i < 7; ++i) {
        LIMN_TRY(const double number, reader->number(i < 3 ? "a number of millimetres" : "a number"));
        all += fmt::format("{}{}", i > 0 ? " " : "", number);
      }
      return all;
    }
    case scene::ArgumentKind::on_off:
      return switch_of(reader);
  }
  LIMN_CHECK(false);
}

}  // namespace

std::vector<OscAddress> osc_received() {
  std::vector<OscAddress> all;
  for (const scene::Action& action : scene::actions())
    all.push_back({fmt::format("{}{}", k_root, action.name), arguments_of(action), std::string(action.what),
                   name_of(action.role)});
  return all;
}

const std::vector<OscAddress>& osc_sent() {
  static const std::vector<OscAddress> all = {
      {"/limn/state/variant", "slot (text); variant (text)", "which variant a slot shows"},
      {"/limn/state/pose", "slot (text); x, y, z in mm; quaternion w, x, y, z",
       "the part's pose in the prototype's frame (in the world frame without a prototype)"},
      {"/limn/state/lost", "slot (text)", "the part is not shown: its marker is not seen"},
      {"/limn/state/prototype", "x, y, z in mm; quaternion w, x, y, z",
       "the prototype's pose in the world frame"},
      {"/limn/state/look", "name (text; empty: none)", "the look last saved or restored"},
      {"/limn/state/looks", "number from 0; how many there are; name (text)", "one of the saved looks"},
      {"/limn/state/blackout", "0 or 1", "1: the projectors give no light"},
      {"/limn/state/freeze", "0 or 1", "1: the images are frozen"},
      {"/limn/state/marker_states", "0 or 1", "1: rings are shown around markers"},
      {"/limn/state/screen", "rest, full, camera, view, stereo or off (text)",
       "what was last chosen for all screens"},
      {"/limn/state/output", "a screen (text); rest, full, camera, view, stereo or off (text)",
       "what that screen shows"},
      {"/limn/state/viewer", "name (text; empty: the scene's own viewer)",
       "the guest whose tablet is the viewpoint"},
  };
  return all;
}

Result<scene::Edit> edit_of_osc(std::span<const std::uint8_t> datagram) {
  if (datagram.size() > k_longest_osc)
    return error("expected a message of at most {} bytes, found {}.", k_longest_osc, datagram.size());
  std::vector<std::uint8_t> bytes(datagram.begin(), datagram.end());
  if (bytes.size() >= 8 && std::equal(bytes.begin(), bytes.begin() + 8, "#bundle"))
    return error("expected a message, found a bundle. Send its messages one by one.");
  const auto types = types_of(bytes);
  const auto unknown = types ? types->find_first_not_of(k_known_types) : std::string::npos;
  if (unknown != std::string::npos)
    return error("{}: expected text, numbers, true or false, found an argument of type '{}'.",
                 printable(*text_at(bytes, 0)), printable(types->substr(unknown, 1)));
  int problem = 0;
  const OscMessage message(!types ? nullptr : lo_message_deserialise(bytes.data(), bytes.size(), &problem));
  if (!message)
    return error("expected a message of Open Sound Control 1.0, found {} other bytes.", bytes.size());
  Reader reader{reinterpret_cast<const char*>(bytes.data()), {}};
  const scene::Action* action =
      reader.path.starts_with(k_root) ? scene::find_action(reader.path.substr(k_root.size())) : nullptr;
  if (!action)
    return error("expected an address of docs/osc.md ({}{} and so on), found '{}'.", k_root,
                 scene::actions().front().name, printable(reader.path));
  lo_arg** values = lo_message_get_argv(message.get());
  for (int i = 0; i < lo_message_get_argc(message.get()); ++i)
    reader.arguments.push_back({(*types)[static_cast<std::size_t>(i)], values[i]});
  scene::Edit edit = scene::make_edit(action->id);
  if (action->of_slot) {
    LIMN_TRY(edit.slot, reader.text("a slot"));
  }
  LIMN_TRY(edit.value, value_of(action->argument_kind, action->value, &reader));
  if (!action->of.empty() && !reader.is_at_end()) {
    LIMN_TRY(edit.slot, reader.text(action->of));
  }
  if (!reader.is_at_end())
    return error("{}: expected {} arguments at most, found {}.", reader.path, reader.next,
                 reader.arguments.size());
  return edit;
}

std::vector<std::uint8_t> osc_message(const std::string& path, const std::vector<OscValue>& arguments) {
  const OscMessage message(lo_message_new());
  LIMN_CHECK(message != nullptr);
  for (const OscValue& argument : arguments) {
    if (const int* whole = std::get_if<int>(&argument))
      lo_message_add_int32(message.get(), *whole);
    else if (const float* number = std::get_if<float>(&argument))
      lo_message_add_float(message.get(), *number);
    else
      lo_message_add_string(message.get(), std::get<std::string>(argument).c_str());
  }
  std::vector<std::uint8_t> bytes(lo_message_length(message.get(), path.c_str()));
  lo_message_serialise(message.get(), path.c_str(), bytes.data(), nullptr);
  return bytes;
}

}  // namespace limn::session
