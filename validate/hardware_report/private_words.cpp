#include "validate/hardware_report/private_words.h"

#include <pwd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdlib>
#include <iterator>
#include <nlohmann/json.hpp>
#include <regex>

namespace limn::validate {
namespace {

bool is_word(char c) { return std::isalnum(static_cast<unsigned char>(c)) || c == '_'; }

// Replaces `word` where it stands alone, so that the user "sam" leaves "same" as it is.
void replace_word(std::string* text, const std::string& word, const std::string& by) {
  for (std::size_t at = 0; (at = text->find(word, at)) != std::string::npos;) {
    const std::size_t end = at + word.size();
    const bool alone =
        (at == 0 || !is_word((*text)[at - 1])) && (end >= text->size() || !is_word((*text)[end]));
    if (alone) text->replace(at, word.size(), by);
    at += alone ? by.size() : word.size();
  }
}

bool is_serial(const std::string& word) {
  const auto digits = std::ranges::count_if(word, [](unsigned char c) { return std::isdigit(c); });
  return (digits >= 7 && digits == std::ssize(word)) || (word.size() >= 10 && digits >= 6);
}

// Serial numbers are whole words of letters and digits.
std::string without_serials(const std::string& text) {
  std::string out, word;
  const auto end_word = [&] {
    out += is_serial(word) ? "(serial)" : word;
    word.clear();
  };
  for (const char c : text) {
    if (std::isalnum(static_cast<unsigned char>(c))) {
      word += c;
      continue;
    }
    end_word();
    out += c;
  }
  end_word();
  return out;
}

}  // namespace

PrivateWords PrivateWords::of_this_machine() {
  std::vector<std::pair<std::string, std::string>> words;
  if (const char* const home = std::getenv("HOME"); home && std::string(home).size() > 1)
    words.emplace_back(home, "(home)");
  std::array<char, 256> host{};
  if (gethostname(host.data(), host.size() - 1) == 0) words.emplace_back(host.data(), "(machine)");
  if (const passwd* const user = getpwuid(getuid()); user && std::string(user->pw_name) != "root")
    words.emplace_back(user->pw_name, "(user)");
  std::erase_if(words, [](const auto& word) { return word.first.size() < 3 || word.first == "localhost"; });
  return PrivateWords(std::move(words));
}

std::string PrivateWords::without(std::string text) const {
  static const std::regex mac("([0-9A-Fa-f]{2}[:-]){5}[0-9A-Fa-f]{2}");
  static const std::regex v4("\\b(?!127\\.)[0-9]{1,3}(\\.[0-9]{1,3}){3}\\b");
  static const std::regex v6("\\b([0-9A-Fa-f]{1,4}:){3,7}(:?[0-9A-Fa-f]{1,4})+\\b");
  // With a login and a port; what follows "?" may be a password.
  static const std::regex host("://[^/\\s?\"']+"), query("(://\\(address\\)[^\\s?]*)\\?[^\\s\"']*");
  text = std::regex_replace(text, host, "://(address)");
  text = std::regex_replace(text, query, "$1");
  for (const auto& [word, by] : replaced_) replace_word(&text, word, by);
  for (const std::regex* address : {&mac, &v4, &v6}) text = std::regex_replace(text, *address, "(address)");
  return without_serials(text);
}

nlohmann::ordered_json PrivateWords::json_without(const nlohmann::ordered_json& json) const {
  if (json.is_string()) return without(json.get<std::string>());
  if (!json.is_structured()) return json;
  nlohmann::ordered_json out = json;
  for (auto& part : out) part = json_without(part);
  return out;
}

}  // namespace limn::validate
