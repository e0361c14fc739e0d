#include "exchange/scene_text.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string_view>

namespace limn::exchange {
namespace {

using nlohmann::ordered_json;

constexpr const char *k_lines = "lines", *k_curve = "curve";

// The positions below are of a text that is valid JSON with comments; in another one they end with the text.

std::size_t after_blanks(const std::string& text, std::size_t at) {
  while (at < text.size()) {
    const std::string_view rest = std::string_view(text).substr(at);
    if (rest.starts_with("//"))
      at = text.find('\n', at);
    else if (rest.starts_with("/*"))
      at = text.find("*/", at + 2) == std::string::npos ? text.size() : text.find("*/", at + 2) + 2;
    else if (std::string_view(" \t\r\n").find(rest.front()) != std::string_view::npos)
      ++at;
    else
      return at;
  }
  return text.size();
}

std::size_t after_string(const std::string& text, std::size_t at) {
  for (++at; at < text.size() && text[at] != '"'; ++at)
    if (text[at] == '\\') ++at;
  return std::min(at + 1, text.size());
}

std::size_t after_value(const std::string& text, std::size_t at) {
  if (at < text.size() && text[at] == '"') return after_string(text, at);
  int depth = 0;
  const std::size_t begin = at;
  while (at < text.size()) {
    const char c = text[at];
    if (const std::size_t next = after_blanks(text, at); next != at) {
      if (depth == 0) return at;
      at = next;
    } else if (c == '"') {
      at = after_string(text, at);
    } else if (c == '{' || c == '[') {
      ++depth;
      ++at;
    } else if (c == '}' || c == ']') {
      if (depth == 0) return at;
      ++at;
      if (--depth == 0) return at;
    } else if (c == ',' && depth == 0 && at > begin) {
      return at;
    } else {
      ++at;
    }
  }
  return text.size();
}

// An object or array of the text, which begins at `open` and ends with the bracket at `close`.
struct Container {
  struct Item {
    std::string key;  // only an object has keys
    std::size_t begin = 0, end = 0;
  };
  std::size_t open = 0, close = 0;
  std::vector<Item> items = {};

  const Item* find(const std::string& key) const {
    for (const Item& item : items)
      if (item.key == key) return &item;
    return nullptr;
  }
};

Container container_at(const std::string& text, std::size_t open) {
  Container found{.open = open, .close = text.size()};
  const bool is_object = open < text.size() && text[open] == '{';
  for (std::size_t at = after_blanks(text, open + 1); at < text.size(); at = after_blanks(text, at)) {
    if (text[at] == '}' || text[at] == ']') {
      found.close = at;
      break;
    }
    if (text[at] == ',') {
      ++at;
      continue;
    }
    Container::Item item;
    if (is_object) {
      const std::size_t end = after_value(text, at);
      const ordered_json key = ordered_json::parse(text.substr(at, end - at), nullptr, false);
      if (key.is_string()) item.key = key.get<std::string>();
      at = after_blanks(text, after_blanks(text, end) + 1);  // behind the colon
    }
    item.begin = at;
    item.end = at = std::max(at + 1, after_value(text, at));
    found.items.push_back(std::move(item));
  }
  return found;
}

Container scene_in(const std::string& text) {
  const std::size_t begin = text.starts_with("\xef\xbb\xbf") ? 3 : 0;
  return container_at(text, after_blanks(text, begin));
}

// The text with further items in front of the container's closing bracket, each in a line of its own.
std::string with_items(const std::string& text,
                       const Container& container,
                       const std::vector<std::string>& items,
                       int indent) {
  const auto blanks = [](int count) { return std::string(static_cast<std::size_t>(count), ' '); };
  std::string out = text.substr(0, container.close);
  if (!container.items.empty()) out.insert(container.items.back().end, ",");
  while (out.ends_with(' ') || out.ends_with('\t')) out.pop_back();
  if (!out.ends_with('\n')) out += '\n';
  for (std::size_t i = 0; i < items.size(); ++i)
    out += blanks(indent) + items[i] + (i + 1 < items.size() ? ",\n" : "\n");
  return out + blanks(indent - 2) + text.substr(container.close);
}

std::string with_added(const std::string& text, const std::vector<std::string>& added) {
  if (added.empty()) return text;
  const Container scene = scene_in(text);
  if (const Container::Item* lines = scene.find(k_lines))
    return with_items(text, container_at(text, lines->begin), added, 4);
  std::string list = fmt::format("\"{}\": [\n", k_lines);
  for (std::size_t i = 0; i < added.size(); ++i)
    list += "    " + added[i] + (i + 1 < added.size() ? ",\n" : "\n");
  return with_items(text, scene, {list + "  ]"}, 2);
}

ordered_json parsed(const std::string& text) { return ordered_json::parse(text, nullptr, false, true); }

// What the changed text must say. Throws json::exception.
ordered_json changed(ordered_json scene,
                     const std::vector<ReplacedCurve>& replaced,
                     const std::vector<std::string>& added) {
  for (const ReplacedCurve& each : replaced) scene.at(k_lines).at(each.line).at(k_curve) = parsed(each.value);
  for (const std::string& entry : added) scene[k_lines].push_back(parsed(entry));
  return scene;
}

}  // namespace

Result<std::string> with_lines(const std::string& text,
                               const std::vector<ReplacedCurve>& replaced,
                               const std::vector<std::string>& added,
                               const std::string& where) {
  const ordered_json before = parsed(text);
  if (!before.is_object()) return error("{}: expected a JSON object, found another text.", where);
  std::string out = text;
  for (const ReplacedCurve& each : replaced) {
    const Container scene = scene_in(out);
    const Container::Item* lines = scene.find(k_lines);
    const Container list = lines ? container_at(out, lines->begin) : Container{};
    const Container line =
        each.line < list.items.size() ? container_at(out, list.items[each.line].begin) : Container{};
    const Container::Item* curve = line.find(k_curve);
    if (!curve)
      return error("{}: {}[{}]: expected a curve, found another kind of line. Give the new one another name.",
                   where, k_lines, each.line);
    out.replace(curve->begin, curve->end - curve->begin, each.value);
  }
  out = with_added(out, added);
  // An unusual text, such as one that has a key twice, must not be changed in another place.
  bool is_right = false;
  try {
    is_right = parsed(out) == changed(before, replaced, added);
  } catch (const ordered_json::exception&) {
  }
  if (!is_right)
    return error(
        "{}: expected a file whose list \"{}\" can be changed, found an unusual one. Add this by hand: {}",
        where, k_lines, fmt::join(added, ", "));
  return out;
}

}  // namespace limn::exchange
