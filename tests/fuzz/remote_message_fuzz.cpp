// Everything that guests of the remote send: messages, bodies, paths, cookies, frames.
#include <algorithm>
#include <nlohmann/json.hpp>

#include "remote/api/messages.h"
#include "remote/http/http.h"
#include "tests/fuzz/fuzz_file.h"

namespace limn::remote {
namespace {

// A refusal is sent to the guest as JSON: it must be UTF-8, short, and say what was expected.
void check_refusal(const std::string& message) {
  LIMN_CHECK(message.find("expected") != std::string::npos && message.size() < 500);
  static_cast<void>(nlohmann::json(message).dump());
}

void check_word(const std::string& word, std::size_t longest) {
  LIMN_CHECK(word.size() <= longest);
  LIMN_CHECK(std::none_of(word.begin(), word.end(), [](char c) { return c >= 0 && c < 0x20 && c != '\n'; }));
  static_cast<void>(nlohmann::json(word).dump());
}

void check_edit(const scene::Edit& edit) {
  const auto& actions = scene::actions();
  LIMN_CHECK(std::any_of(actions.begin(), actions.end(),
                         [&](const scene::Action& action) { return action.name == edit.action; }));
  check_word(edit.slot, k_longest_word);
  check_word(edit.value, k_longest_word);
}

void check_comment(const CommentRequest& comment) {
  check_word(comment.look, k_longest_word);
  check_word(comment.slot, k_longest_word);
  check_word(comment.text, scene::k_longest_comment);
}

void check_message(const Message& message) {
  if (const auto* edit = std::get_if<EditMessage>(&message)) check_edit(edit->edit);
  if (const auto* comment = std::get_if<CommentMessage>(&message)) check_comment(comment->comment);
  if (const auto* window = std::get_if<WindowMessage>(&message))
    LIMN_CHECK(window->device.find_first_of("./\\ ") == std::string::npos && window->device.size() >= 8);
}

void check_bodies(const std::string& text) {
  if (const auto pairing = parse_pairing(text); pairing)
    LIMN_CHECK(pairing->pin.size() == 6 && pairing->name.size() <= k_longest_guest_name &&
               !pairing->name.empty());
  else
    check_refusal(pairing.message());
  if (const auto edit = parse_edit(text); edit)
    check_edit(*edit);
  else
    check_refusal(edit.message());
  if (const auto comment = parse_comment(text); comment)
    check_comment(*comment);
  else
    check_refusal(comment.message());
}

void check_http(const std::string& text) {
  static_cast<void>(cookie_in(text, "limn"));
  static_cast<void>(host_in(text));
  const auto path = path_of(text);
  LIMN_CHECK(!path || (path->front() == '/' && path->find('?') == std::string::npos));
  if (const auto name = decoded(text))
    LIMN_CHECK(name->find('/') == std::string::npos && name->find('\0') == std::string::npos);
}

}  // namespace
}  // namespace limn::remote

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace limn::remote;
  const std::string text(reinterpret_cast<const char*>(bytes), size);
  if (const auto message = parse_message(text); message) {
    check_message(*message);
  } else {
    check_refusal(message.message());
    static_cast<void>(parse_message_id(text));
  }
  check_bodies(text);
  check_http(text);
  if (const auto frame = parse_frame({bytes, size}); frame)
    LIMN_CHECK(frame->jpeg.size() + 4 == size && frame->jpeg.data() == bytes + 4);
  else
    check_refusal(frame.message());
  return 0;
}
