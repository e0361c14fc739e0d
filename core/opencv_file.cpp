#include "core/opencv_file.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <string_view>

namespace limn {
namespace {

using Value = OpencvFile::Value;
using Values = std::map<std::string, Value>;
using Json = nlohmann::json;

constexpr std::string_view k_space = " \t\r\n";

std::string_view trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(k_space);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(k_space) - first + 1);
}

template <class Number>
std::optional<Number> number_of(std::string_view text) {
  Number value{};
  const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (problem != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

// Also reads OpenCV's spelling of NaN and infinity.
std::optional<double> element_of(std::string_view word) {
  if (word == ".Nan") return std::numeric_limits<double>::quiet_NaN();
  if (word == ".Inf" || word == "-.Inf") return word[0] == '-' ? -INFINITY : INFINITY;
  return number_of<double>(word);
}

// Numbers separated by spaces or commas.
std::optional<std::vector<double>> elements_of(std::string_view list) {
  constexpr std::string_view k_between = " \t\r\n,";
  std::vector<double> numbers;
  for (auto at = list.find_first_not_of(k_between); at != std::string_view::npos;) {
    const auto end = std::min(list.find_first_of(k_between, at), list.size());
    const auto number = element_of(list.substr(at, end - at));
    if (!number) return std::nullopt;
    numbers.push_back(*number);
    at = list.find_first_not_of(k_between, end);
  }
  return numbers;
}

Error no_numbers(const std::string& name) {
  return error("{}: expected a complete list of numbers as the matrix's data, found something else.", name);
}

// The text between quotes, or all of it.
std::optional<std::string> unquoted(std::string_view text) {
  if (text.empty() || text[0] != '"') return std::string(text);
  std::string inside;
  for (std::size_t i = 1; i < text.size(); ++i) {
    if (text[i] == '"') return inside;
    if (text[i] == '\\' && i + 1 < text.size()) ++i;
    inside += text[i];
  }
  return std::nullopt;
}

// ---- YAML ----

std::string_view without_comment(std::string_view text) {
  if (text.empty() || text[0] == '"') return text;
  return trimmed(text[0] == '#' ? std::string_view() : text.substr(0, text.find(" #")));
}

struct YamlLine {
  bool is_indented = false;
  std::string_view text;
  std::size_t number = 0;
};

// The lines without empty lines, comments and document markers.
std::vector<YamlLine> yaml_lines(std::string_view text) {
  std::vector<YamlLine> lines;
  for (std::size_t number = 1; !text.empty(); ++number) {
    const auto end = std::min(text.find('\n'), text.size());
    const std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    const std::string_view inside = trimmed(line);
    if (inside.empty() || inside[0] == '#' || line[0] == '%' || inside == "---" || inside == "...") continue;
    lines.push_back({line[0] == ' ' || line[0] == '\t' || line[0] == '-', inside, number});
  }
  return lines;
}

struct YamlMember {
  std::string_view name, value;
};

std::optional<YamlMember> yaml_member(std::string_view line) {
  const auto colon = line.find(':');
  if (colon == std::string_view::npos || colon == 0) return std::nullopt;
  return YamlMember{trimmed(line.substr(0, colon)), trimmed(line.substr(colon + 1))};
}

// The matrix in the indented lines below a name (members rows, cols and data), if they are a matrix.
Result<Value> yaml_matrix(const std::string& name, std::span<const YamlLine> lines) {
  Value value;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const auto member = yaml_member(lines[i].text);
    if (!member) continue;
    if (member->name == "rows") value.rows = number_of<int>(member->value).value_or(0);
    if (member->name == "cols") value.cols = number_of<int>(member->value).value_or(0);
    if (member->name != "data" || !member->value.starts_with('[')) continue;
    std::string list;
    std::string_view more = member->value.substr(1);
    for (; more.find(']') == std::string_view::npos && i + 1 < lines.size(); more = lines[++i].text)
      list.append(more).append(1, ' ');
    const auto numbers = elements_of(list.append(more.substr(0, more.find(']'))));
    if (more.find(']') == std::string_view::npos || !numbers) return no_numbers(name);
    value.numbers = *numbers;
  }
  return value;
}

Result<Values> parse_yaml(const std::string& text) {
  const std::vector<YamlLine> lines = yaml_lines(text);
  Values values;
  for (std::size_t i = 0; i < lines.size();) {
    const auto member = yaml_member(lines[i].text);
    if (lines[i].is_indented || !member)
      return error("line {}: expected NAME: VALUE, found \"{}\".", lines[i].number,
                   std::string(lines[i].text.substr(0, 60)));
    const std::string name(member->name);
    const std::size_t number = lines[i].number;
    const std::size_t first = ++i;
    while (i < lines.size() && lines[i].is_indented) ++i;
    const std::span below = std::span(lines).subspan(first, i - first);
    Value value;
    if (member->value.empty() || member->value.starts_with("!!opencv-matrix")) {
      LIMN_TRY(value, yaml_matrix(name, below));
    } else if (const auto scalar = unquoted(without_comment(member->value))) {
      value.text = *scalar;
    } else {
      return error("line {}: expected a closing quote, found none.", number);
    }
    values.insert_or_assign(name, std::move(value));
  }
  return values;
}

// ---- JSON ----

Result<Value> json_value(const std::string& name, const Json& node) {
  Value value;
  if (node.is_string()) value.text = node.get<std::string>();
  if (node.is_number()) value.text = node.dump();
  if (!node.is_object() || !node.contains("data") || !node["data"].is_array()) return value;
  for (const auto& [key, side] : {std::pair{"rows", &value.rows}, {"cols", &value.cols}})
    if (node.contains(key)) *side = number_of<int>(node[key].dump()).value_or(0);
  for (const Json& number : node["data"]) {
    if (!number.is_number()) return no_numbers(name);
    value.numbers.push_back(number.get<double>());
  }
  return value;
}

Result<Values> parse_json(const std::string& text) {
  constexpr int k_depth = 8;  // the values that Limn needs lie above this depth
  Json json;
  try {
    json = Json::parse(
        text, [](int depth, Json::parse_event_t, Json&) { return depth <= k_depth; }, true, true);
  } catch (const Json::exception& problem) {
    return error("expected JSON, found: {}.", problem.what());
  }
  if (!json.is_object()) return error("expected an object {{...}}, found something else.");
  Values values;
  for (const auto& [name, node] : json.items()) {
    LIMN_TRY(values[name], json_value(name, node));
  }
  return values;
}

// ---- XML ----

struct XmlElement {
  std::string_view name, inside;
  std::size_t end = 0;  // offset after its closing tag
};

// The first element at or after `from`; comments and declarations are skipped. If there is none, an element
// without a name. Nullopt when the element has no end.
std::optional<XmlElement> xml_element(std::string_view text, std::size_t from) {
  std::string_view name;
  std::size_t inside = 0;
  int depth = 0;
  for (auto at = text.find('<', from); at != std::string_view::npos; at = text.find('<', at)) {
    const bool is_comment = text.substr(at).starts_with("<!--");
    const auto end = is_comment ? text.find("-->", at) : text.find('>', at);
    if (end == std::string_view::npos) return std::nullopt;
    const std::string_view tag = text.substr(at + 1, end - at - 1);  // without its brackets
    const std::size_t start = std::exchange(at, end + (is_comment ? 3 : 1));
    if (is_comment || tag.starts_with('?')) continue;
    if (tag.starts_with('/')) {
      if (depth == 0) return std::nullopt;
      if (--depth == 0) return XmlElement{name, text.substr(inside, start - inside), at};
    } else if (!tag.ends_with('/') && depth++ == 0) {
      name = tag.substr(0, tag.find_first_of(k_space));
      inside = at;
    }
  }
  if (depth > 0) return std::nullopt;
  return XmlElement{{}, {}, text.size()};
}

Result<std::vector<XmlElement>> xml_elements(std::string_view text) {
  std::vector<XmlElement> elements;
  for (std::size_t at = 0;; at = elements.back().end) {
    const auto element = xml_element(text, at);
    if (!element) return error("expected a closing tag for every opened one, found none.");
    if (element->name.empty()) return elements;
    elements.push_back(*element);
  }
}

Result<Value> xml_value(const XmlElement& element) {
  Value value;
  if (element.inside.find('<') == std::string_view::npos) {
    value.text = unquoted(trimmed(element.inside)).value_or("");
    return value;
  }
  LIMN_TRY(const auto members, xml_elements(element.inside));
  for (const XmlElement& member : members) {
    if (member.name == "rows") value.rows = number_of<int>(trimmed(member.inside)).value_or(0);
    if (member.name == "cols") value.cols = number_of<int>(trimmed(member.inside)).value_or(0);
    if (member.name != "data") continue;
    const auto numbers = elements_of(member.inside);
    if (!numbers) return no_numbers(std::string(element.name));
    value.numbers = *numbers;
  }
  return value;
}

Result<Values> parse_xml(const std::string& text) {
  LIMN_TRY(const auto roots, xml_elements(text));
  if (roots.size() != 1 || roots[0].name != "opencv_storage")
    return error("expected one element <opencv_storage>, found {} elements.", roots.size());
  LIMN_TRY(const auto elements, xml_elements(roots[0].inside));
  Values values;
  for (const XmlElement& element : elements) {
    LIMN_TRY(values[std::string(element.name)], xml_value(element));
  }
  return values;
}

}  // namespace

Result<OpencvFile> OpencvFile::parse(const std::string& text) {
  const auto first = text.find_first_not_of(" \t\r\n\xef\xbb\xbf");
  const char mark = first == std::string::npos ? '\0' : text[first];
  if (mark == '\0') return error("expected YAML, XML or JSON of OpenCV, found an empty file.");
  OpencvFile file;
  const std::string whole = text.substr(first);
  LIMN_TRY(file.values_, mark == '<'   ? parse_xml(whole)
                         : mark == '{' ? parse_json(whole)
                                       : parse_yaml(whole));
  return file;
}

const OpencvFile::Value* OpencvFile::find(const std::string& name) const {
  const auto found = values_.find(name);
  return found == values_.end() ? nullptr : &found->second;
}

std::optional<int> OpencvFile::integer(const std::string& name) const {
  const Value* value = find(name);
  return value ? number_of<int>(value->text) : std::nullopt;
}

}  // namespace limn
