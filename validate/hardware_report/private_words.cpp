#include "validate/hardware_report/private_words.h"

#include <arpa/inet.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <set>
#include <string_view>

#include "core/html.h"
#include "core/json_text.h"

namespace limn::validate {
namespace {

bool is_digit(char c) { return std::isdigit(static_cast<unsigned char>(c)); }
bool is_hex(char c) { return std::isxdigit(static_cast<unsigned char>(c)); }
bool is_letter_or_digit(char c) { return std::isalnum(static_cast<unsigned char>(c)); }
// Characters of one word. "_" separates words, so that the user "sam" is found in "sam_left".
bool is_word(char c) { return is_letter_or_digit(c) || static_cast<unsigned char>(c) >= 0x80; }

std::string lower(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

// Words of Limn's own files and words of many machines: they identify nobody.
bool is_common(const std::string& word) {
  static const std::set<std::string> k_common = {
      "admin", "board",    "camera", "capture",   "captures",  "debian",    "demo",
      "door",  "frame",    "frames", "guest",     "home",      "image",     "images",
      "light", "limn",     "linux",  "live",      "localhost", "local",     "mirror",
      "name",  "password", "pose",   "projector", "machine",   "report",    "poses",
      "rig",   "root",     "scene",  "screen",    "session",   "stream",    "studio",
      "test",  "user",     "video",  "world",     "recording", "prototype", "localdomain"};
  return k_common.contains(word);
}

// Whether what stands between `begin` and `end` stands alone, so that the user "sam" leaves "same" as it is.
// A number must not be a part of a longer one.
bool stands_alone(const std::string& text, std::size_t begin, std::size_t end) {
  const bool is_number = std::all_of(text.begin() + static_cast<std::ptrdiff_t>(begin),
                                     text.begin() + static_cast<std::ptrdiff_t>(end), is_digit);
  if (begin > 0 && is_word(text[begin]) && is_word(text[begin - 1])) return false;
  if (end < text.size() && is_word(text[end - 1]) && is_word(text[end])) return false;
  if (!is_number) return true;
  const bool continues = end + 1 < text.size() && text[end] == '.' && is_digit(text[end + 1]);
  const bool is_fraction = begin > 0 && text[begin - 1] == '.';
  return !continues && !is_fraction;
}

// "%41" is "A".
std::string percent_decoded(const std::string& text) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool is_code = text[i] == '%' && i + 2 < text.size() && is_hex(text[i + 1]) && is_hex(text[i + 2]);
    out += is_code ? static_cast<char>(std::strtol(text.substr(i + 1, 2).c_str(), nullptr, 16)) : text[i];
    if (is_code) i += 2;
  }
  return out;
}

std::string percent_encoded(const std::string& text) {
  std::string out;
  for (const char c : text) {
    const bool stays = is_letter_or_digit(c) || std::string_view("-._~").find(c) != std::string_view::npos;
    out += stays ? std::string(1, c) : fmt::format("%{:02X}", static_cast<unsigned char>(c));
  }
  return out;
}

// The text from `at` on as long as its characters satisfy `may`.
template <class Condition>
std::string_view run_at(std::string_view text, std::size_t at, const Condition& may) {
  std::size_t end = at;
  while (end < text.size() && may(text[end])) ++end;
  return text.substr(at, end - at);
}

// 00:11:22:aa:bb:cc, also with "-".
bool is_mac(std::string_view word) {
  if (word.size() != 17) return false;
  for (std::size_t i = 0; i < word.size(); ++i)
    if (i % 3 == 2 ? word[i] != word[2] || !(word[i] == ':' || word[i] == '-') : !is_hex(word[i]))
      return false;
  return true;
}

// An IPv6 address but the loopback's; the shortest are such as fe80::1.
bool is_v6(const std::string& word) {
  in6_addr address{};
  if (std::ranges::count(word, ':') < 2 || inet_pton(AF_INET6, word.c_str(), &address) != 1) return false;
  return word != "::" && word != "::1";
}

// An IPv4 address of a local network. Others have the form of a version with four numbers.
bool is_local_v4(const std::string& word) {
  in_addr address{};
  if (inet_pton(AF_INET, word.c_str(), &address) != 1) return false;
  const std::uint32_t value = ntohl(address.s_addr);
  const std::uint32_t first = value >> 24, second = value >> 16 & 255;
  return first == 10 || (first == 192 && second == 168) || (first == 172 && second >= 16 && second < 32) ||
         (first == 169 && second == 254) || (first == 100 && second >= 64 && second < 128);
}

// Whether the text before `at` says that a version follows.
bool follows_version(const std::string& text, std::size_t at) {
  const std::size_t begin = at > 24 ? at - 24 : 0;
  std::string before = lower(text.substr(begin, at - begin));
  while (!before.empty() && (before.back() == ' ' || before.back() == 'v')) before.pop_back();
  for (const char* word : {"version", "driver", "firmware", "mesa", "nvidia", "llvm", "release"})
    if (before.ends_with(word)) return true;
  return false;
}

// The form of a name in a local network.
bool is_local_name(const std::string& word) {
  const std::string small = lower(word);
  for (const char* end : {".local", ".lan", ".home", ".internal", ".localdomain", ".fritz.box", ".home.arpa"})
    if (small.ends_with(end) && small.size() > std::string_view(end).size()) return true;
  return false;
}

// What stands in `text` at `at` for an address; its length is `length`, 0: there is none.
struct Found {
  std::size_t length = 0;
  const char* by = "(address)";
};

Found address_at(const std::string& text, std::size_t at) {
  const auto word = run_at(text, at, [](char c) { return is_hex(c) || c == ':' || c == '-'; });
  if (word.size() >= 17 && is_mac(word.substr(0, 17)) && (word.size() == 17 || !is_letter_or_digit(word[17])))
    return {17};
  std::string v6(run_at(text, at, [](char c) { return is_hex(c) || c == ':' || c == '.'; }));
  while (v6.ends_with('.') || (v6.ends_with(':') && !v6.ends_with("::"))) v6.pop_back();
  const bool ends = at + v6.size() >= text.size() || !is_word(text[at + v6.size()]);
  if (ends && is_v6(v6)) {
    const std::string_view rest = std::string_view(text).substr(at + v6.size());
    const std::size_t zone = rest.starts_with('%') ? 1 + run_at(rest, 1, is_word).size() : 0;
    return {v6.size() + zone};
  }
  std::string v4(run_at(text, at, [](char c) { return is_digit(c) || c == '.'; }));
  while (v4.ends_with('.')) v4.pop_back();
  if (is_local_v4(v4) && !follows_version(text, at)) return {v4.size()};
  std::string name(run_at(text, at, [](char c) { return is_word(c) || c == '.' || c == '-'; }));
  while (name.ends_with('.')) name.pop_back();
  if (is_local_name(name)) return {name.size(), "(machine)"};
  return {};
}

// Where the machine of an address ends that begins at `at`, behind "://": with a login, whose password may
// have slashes.
std::size_t authority_end(const std::string& text, std::size_t at) {
  const auto all = run_at(
      text, at, [](char c) { return c > ' ' && c != '"' && c != '<' && c != '>' && c != '\\' && c != ','; });
  const std::string_view before_query = all.substr(0, all.find('?'));
  std::size_t login = before_query.rfind('@');
  if (login == std::string_view::npos) login = 0;
  return at + std::min(all.size(), all.find_first_of("/?#", login));
}

// Addresses with "://": the machine, and what follows "?".
std::string without_urls(const std::string& text) {
  std::string out;
  std::size_t at = 0;
  for (std::size_t mark = 0; (mark = text.find("://", at)) != std::string::npos;) {
    const std::size_t begin = mark + 3;
    out.append(text, at, begin - at);
    at = begin;
    if (text.compare(begin, 11, "www.w3.org/") == 0) continue;  // a format's name in pages
    std::size_t end = authority_end(text, begin);
    if (end > begin) out += "(address)";
    const auto path = run_at(text, end, [](char c) {
      return c > ' ' && c != '?' && c != '"' && c != '<' && c != '>' && c != '\\' && c != ',';
    });
    out += path;
    end += path.size();
    if (end < text.size() && text[end] == '?')
      end += run_at(text, end, [](char c) { return c > ' ' && c != '"' && c != '<' && c != '>'; }).size();
    at = end;
  }
  return out.append(text, at, std::string::npos);
}

// The serial number in udev's and Aravis' names of cameras: usb-MAKER_MODEL_SERIAL-video-index0,
// gige:MAKER-MODEL-SERIAL.
std::string without_device_serials(std::string text) {
  const auto may = [](char c) { return is_word(c) || c == '_' || c == '-' || c == '.' || c == ':'; };
  for (const auto& [mark, separator] : {std::pair{std::string("by-id/"), '_'}, {std::string("gige:"), '-'}}) {
    for (std::size_t at = 0; (at = text.find(mark, at)) != std::string::npos;) {
      at += mark.size();
      std::string_view id = run_at(text, at, may);
      if (const std::size_t index = id.rfind("-video-index"); index != std::string_view::npos)
        id = id.substr(0, index);
      const std::size_t last = id.rfind(separator);
      if (last == std::string_view::npos || last + 1 == id.size()) continue;
      text.replace(at + last + 1, id.size() - last - 1, "(serial)");
    }
  }
  return text;
}

// The words after "serial" and "serial number".
std::string without_named_serials(std::string text) {
  for (std::size_t at = 0; (at = lower(text).find("serial", at)) != std::string::npos;) {
    at += 6;
    std::size_t begin = at;
    for (const char* word : {" number", "number", "_number", " no."})
      if (lower(text.substr(begin, std::string_view(word).size())) == word)
        begin += std::string_view(word).size();
    const std::size_t gap =
        run_at(text, begin, [](char c) { return c == ' ' || c == ':' || c == '='; }).size();
    begin += gap;
    const auto word = run_at(text, begin, [](char c) { return is_word(c) || c == '-'; });
    if (gap == 0 || word.size() < 4 || std::ranges::none_of(word, is_digit)) continue;
    text.replace(begin, word.size(), "(serial)");
    at = begin;
  }
  return text;
}

// Whether an address may begin at `at`: it is the begin of a word, or stands behind a word with a colon that
// is no part of an address, such as "gige:".
bool may_begin(const std::string& text, std::size_t at) {
  if (!is_letter_or_digit(text[at]) && text[at] != ':') return false;
  if (at == 0) return true;
  if (text[at - 1] != ':') return !is_word(text[at - 1]) && text[at - 1] != '.' && text[at - 1] != '-';
  std::size_t begin = at - 1;
  while (begin > 0 && is_word(text[begin - 1])) --begin;
  const std::string_view word = std::string_view(text).substr(begin, at - 1 - begin);
  return word.size() > 4 || std::ranges::any_of(word, [](char c) { return !is_hex(c); });
}

std::string without_addresses(const std::string& text) {
  std::string out;
  out.reserve(text.size());
  for (std::size_t at = 0; at < text.size();) {
    const Found found = may_begin(text, at) ? address_at(text, at) : Found{};
    if (found.length > 0) {
      out += found.by;
      at += found.length;
      continue;
    }
    out += text[at++];
  }
  return out;
}

}  // namespace

void PrivateWords::add(const std::string& word, const std::string& by) {
  const std::string in_json = json_text(nlohmann::ordered_json(word));
  for (const std::string& form : {word, in_json.substr(1, in_json.size() - 2), escaped(word),
                                  percent_decoded(word), percent_encoded(word)}) {
    const std::pair one{lower(form), by};
    const bool is_number = std::ranges::all_of(one.first, is_digit);
    if (one.first.size() < (is_number ? 6 : 3) || is_common(one.first)) continue;
    if (std::ranges::find(replaced_, one) == replaced_.end()) replaced_.push_back(one);
  }
  // The longest first: a path before the user's name in it.
  std::ranges::stable_sort(replaced_,
                           [](const auto& a, const auto& b) { return a.first.size() > b.first.size(); });
}

std::string PrivateWords::without_known(const std::string& text) const {
  std::string out = text, small = lower(text);
  for (const auto& [word, by] : replaced_) {
    for (std::size_t at = 0; (at = small.find(word, at)) != std::string::npos;) {
      if (!stands_alone(small, at, at + word.size())) {
        ++at;
        continue;
      }
      out.replace(at, word.size(), by);
      small.replace(at, word.size(), by);
      at += by.size();
    }
  }
  return out;
}

bool PrivateWords::is_in(const std::string& text) const { return without_known(text) != text; }

std::string PrivateWords::without(const std::string& text) const {
  const auto cleaned = [this](const std::string& part) {
    return without_addresses(
        without_named_serials(without_device_serials(without_urls(without_known(part)))));
  };
  // Images inside pages stay.
  static const std::string k_image = ";base64,";
  std::string out;
  std::size_t at = 0;
  for (std::size_t mark = 0; (mark = text.find(k_image, at)) != std::string::npos;) {
    const std::size_t begin = mark + k_image.size();
    out += cleaned(text.substr(at, begin - at));
    const auto image =
        run_at(text, begin, [](char c) { return is_letter_or_digit(c) || c == '+' || c == '/' || c == '='; });
    out += image;
    at = begin + image.size();
  }
  return out + cleaned(text.substr(at));
}

nlohmann::ordered_json PrivateWords::json_without(const nlohmann::ordered_json& json) const {
  if (json.is_string()) return without(json.get<std::string>());
  if (!json.is_structured()) return json;
  if (json.is_array()) {
    nlohmann::ordered_json out = nlohmann::ordered_json::array();
    for (const auto& part : json) out.push_back(json_without(part));
    return out;
  }
  nlohmann::ordered_json out = nlohmann::ordered_json::object();
  for (const auto& [key, part] : json.items()) out[key] = json_without(part);
  return out;
}

}  // namespace limn::validate
