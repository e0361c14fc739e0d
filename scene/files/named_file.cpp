#include "scene/files/named_file.h"

#include <algorithm>
#include <cctype>
#include <cstdint>
#include <string_view>
#include <vector>

namespace limn::scene {
namespace {

namespace fs = std::filesystem;

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

bool is_file(const fs::path& path) {
  std::error_code none;
  return fs::is_regular_file(path, none);
}

// The entry of a folder with this name in any case; the first in the order of names.
std::optional<fs::path> in_any_case(const fs::path& folder, const std::string& name) {
  std::optional<fs::path> found;
  std::error_code none;
  for (const auto& entry : fs::directory_iterator(folder.empty() ? fs::path(".") : folder, none))
    if (lower(entry.path().filename().string()) == lower(name) && (!found || entry.path() < *found))
      found = entry.path();
  return found;
}

std::optional<fs::path> walked_in_any_case(const fs::path& folder, const fs::path& relative) {
  fs::path at = folder;
  for (const fs::path& step : relative) {
    std::error_code none;
    if (step == "." || step == ".." || fs::exists(at / step, none)) {
      at /= step;
      continue;
    }
    const auto next = in_any_case(at, step.string());
    if (!next) return std::nullopt;
    at = *next;
  }
  return is_file(at) ? std::optional(at) : std::nullopt;
}

int digit_of(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
}

int base64_value(char c) {
  static const std::string k_digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  if (c == '-') c = '+';  // the alphabet for addresses
  if (c == '_') c = '/';
  const auto at = k_digits.find(c);
  return at == std::string::npos ? -1 : static_cast<int>(at);
}

std::optional<std::string> base64_bytes(std::string_view text) {
  std::string bytes;
  bytes.reserve(text.size() / 4 * 3);
  std::uint32_t group = 0;
  int bits = 0;
  for (const char c : text) {
    if (c == '=' || std::isspace(static_cast<unsigned char>(c))) continue;
    const int value = base64_value(c);
    if (value < 0) return std::nullopt;
    group = group << 6 | static_cast<std::uint32_t>(value);
    bits += 6;
    if (bits < 8) continue;
    bits -= 8;
    bytes += static_cast<char>(group >> bits & 0xff);
  }
  return bytes;
}

}  // namespace

std::string trimmed(const std::string& text) {
  const char* k_blanks = " \t\r\n\v\f";
  const auto first = text.find_first_not_of(k_blanks);
  if (first == std::string::npos) return {};
  return text.substr(first, text.find_last_not_of(k_blanks) - first + 1);
}

std::string percent_decoded(const std::string& text) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool is_code =
        text[i] == '%' && i + 2 < text.size() && digit_of(text[i + 1]) >= 0 && digit_of(text[i + 2]) >= 0;
    out += is_code ? static_cast<char>(16 * digit_of(text[i + 1]) + digit_of(text[i + 2])) : text[i];
    if (is_code) i += 2;
  }
  return out;
}

std::optional<std::string> data_uri_bytes(const std::string& uri) {
  const auto comma = uri.find(',');
  if (lower(uri.substr(0, 5)) != "data:" || comma == std::string::npos) return std::nullopt;
  const bool is_base64 = lower(uri.substr(0, comma)).ends_with(";base64");
  if (!is_base64) return percent_decoded(uri.substr(comma + 1));
  std::string text = uri.substr(comma + 1);
  if (text.find('%') != std::string::npos) text = percent_decoded(text);
  return base64_bytes(text);
}

std::optional<NamedFile> find_named_file(const fs::path& folder, const std::string& name) {
  std::string written = trimmed(name);
  if (written.size() >= 2 && written.front() == '"' && written.back() == '"')
    written = written.substr(1, written.size() - 2);
  if (lower(written.substr(0, 7)) == "file://") written = written.substr(7);
  std::replace(written.begin(), written.end(), '\\', '/');
  if (written.empty() || written.find('\0') != std::string::npos) return std::nullopt;
  std::vector<fs::path> candidates;
  for (const std::string& text : {written, percent_decoded(written)}) {
    const fs::path path(text);
    const bool has_drive = text.size() > 1 && text[1] == ':';
    if (path.is_relative() && !has_drive) candidates.push_back(path);
    if (!path.filename().empty()) candidates.push_back(path.filename());
  }
  for (const fs::path& candidate : candidates)
    if (is_file(folder / candidate)) return NamedFile{folder / candidate};
  for (const fs::path& candidate : candidates)
    if (const auto found = walked_in_any_case(folder, candidate)) return NamedFile{*found, true};
  return std::nullopt;
}

}  // namespace limn::scene
