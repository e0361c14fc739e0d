#include "session/requests/osc.h"

#include <cmath>
#include <optional>

namespace limn::session {
namespace {

const std::string k_root = "/limn/";
constexpr std::size_t k_longest_text = 200;  // bytes

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

// Reads a message's arguments one after the other.
struct Reader {
  std::string path;
  std::vector<exchange::OscArgument> arguments;
  std::size_t next = 0;

  bool is_at_end() const { return next == arguments.size(); }

  Result<std::string> text(std::string_view what) {
    const std::string* found = is_at_end() ? nullptr : arguments[next].text();
    if (!found) return error("{}: expected {} as text, found {}.", path, what, found_here());
    if (found->size() > k_longest_text || !exchange::is_printable(*found))
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
  const exchange::OscArgument& argument = reader->arguments[reader->next];
  if (argument.text()) return reader->text("on, off or toggle");
  const double* number = std::get_if<double>(&argument.value);
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
  LIMN_TRY(exchange::OscMessage message, exchange::parsed_osc(datagram));
  Reader reader{std::move(message.path), std::move(message.arguments)};
  const scene::Action* action =
      reader.path.starts_with(k_root) ? scene::find_action(reader.path.substr(k_root.size())) : nullptr;
  if (!action)
    return error("expected an address of docs/osc.md ({}{} and so on), found '{}'.", k_root,
                 scene::actions().front().name, exchange::printable(reader.path));
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

}  // namespace limn::session
