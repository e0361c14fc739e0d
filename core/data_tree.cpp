#include "core/data_tree.h"

#include <utf8cpp/utf8.h>
#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/exceptions.h>
#include <yaml-cpp/mark.h>
#include <yaml-cpp/parser.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <limits>
#include <nlohmann/json.hpp>
#include <pugixml.hpp>
#include <sstream>

#include "core/utf8.h"

namespace limn {
namespace {

using NodeKind = DataNode::Kind;

constexpr std::size_t k_most_depth = 64;
constexpr std::string_view k_blanks = " \t\r\n";

// Builds the tree from what a parser reports in the order of the file.
class TreeBuilder {
 public:
  // False when the entries are nested too deep.
  bool open(NodeKind kind, int line) {
    if (open_.size() >= k_most_depth) return false;
    open_.push_back({});
    open_.back().node.kind = kind;
    open_.back().node.line = line;
    return true;
  }
  void close() {
    DataNode node = std::move(open_.back().node);
    open_.pop_back();
    add(std::move(node));
  }
  void add_text(std::string text, int line) {
    DataNode node;
    node.kind = NodeKind::text;
    node.text = std::move(text);
    node.line = line;
    add(std::move(node));
  }
  void add_null(int line) {
    DataNode node;
    node.line = line;
    add(std::move(node));
  }
  void set_key(std::string key) {
    open_.back().key = std::move(key);
    open_.back().has_key = true;
  }
  // Whether the next text is the key of a map.
  bool expects_key() const {
    return !open_.empty() && open_.back().node.kind == NodeKind::map && !open_.back().has_key;
  }
  const DataNode& root() const { return root_; }

 private:
  struct Open {
    DataNode node;
    std::string key;
    bool has_key = false;
  };
  std::vector<Open> open_;
  DataNode root_;

  void add(DataNode node) {
    if (open_.empty()) {
      root_ = std::move(node);
      return;
    }
    Open& parent = open_.back();
    if (parent.node.kind == NodeKind::map) parent.node.keys.push_back(std::exchange(parent.key, {}));
    parent.has_key = false;
    parent.node.items.push_back(std::move(node));
  }
};

const std::string& too_deep() {
  static const std::string message = fmt::format("expected entries nested at most {} deep", k_most_depth);
  return message;
}

// ---- YAML ----

class YamlEvents : public YAML::EventHandler {
 public:
  TreeBuilder tree;

  void OnDocumentStart(const YAML::Mark&) override {}
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark& mark, YAML::anchor_t) override {
    if (tree.expects_key()) throw YAML::ParserException(mark, "expected a name before the colon");
    tree.add_null(mark.line + 1);
  }
  void OnAlias(const YAML::Mark& mark, YAML::anchor_t) override {
    throw YAML::ParserException(mark, "expected no alias (*name); write the entry itself");
  }
  void OnScalar(const YAML::Mark& mark,
                const std::string& tag,
                YAML::anchor_t,
                const std::string& text) override {
    if (tree.expects_key()) return tree.set_key(text);
    const bool is_null = tag == "?" && (text.empty() || text == "~" || text == "null");
    is_null ? tree.add_null(mark.line + 1) : tree.add_text(text, mark.line + 1);
  }
  void OnSequenceStart(const YAML::Mark& mark,
                       const std::string&,
                       YAML::anchor_t,
                       YAML::EmitterStyle::value) override {
    open(NodeKind::list, mark);
  }
  void OnSequenceEnd() override { tree.close(); }
  void OnMapStart(const YAML::Mark& mark,
                  const std::string&,
                  YAML::anchor_t,
                  YAML::EmitterStyle::value) override {
    open(NodeKind::map, mark);
  }
  void OnMapEnd() override { tree.close(); }

 private:
  void open(NodeKind kind, const YAML::Mark& mark) {
    if (tree.expects_key())
      throw YAML::ParserException(mark, "expected a text as a name, found a list or a map");
    if (!tree.open(kind, mark.line + 1)) throw YAML::ParserException(mark, too_deep());
  }
};

Result<DataNode> parse_yaml(const std::string& text) {
  std::istringstream stream(text);
  YamlEvents events;
  try {
    YAML::Parser parser(stream);
    // Empty documents come before the first one. The parser reports them without end where it is stuck.
    constexpr int k_most_documents = 4;
    for (int i = 0; i < k_most_documents && events.tree.root().kind == NodeKind::null; ++i)
      if (!parser.HandleNextDocument(events)) break;
  } catch (const YAML::Exception& problem) {
    return error("line {}: {}.", problem.mark.line + 1, problem.msg);
  }
  return events.tree.root();
}

// ---- JSON ----

// nlohmann_json calls these functions; false ends the reading.
class JsonEvents : public nlohmann::json_sax<nlohmann::json> {
 public:
  TreeBuilder tree;
  std::string problem;

  bool null() override { return tree.add_null(0), true; }
  bool boolean(bool value) override { return tree.add_text(value ? "true" : "false", 0), true; }
  bool number_integer(std::int64_t value) override { return tree.add_text(std::to_string(value), 0), true; }
  bool number_unsigned(std::uint64_t value) override { return tree.add_text(std::to_string(value), 0), true; }
  bool number_float(double, const std::string& text) override { return tree.add_text(text, 0), true; }
  bool string(std::string& text) override { return tree.add_text(text, 0), true; }
  bool binary(nlohmann::json::binary_t&) override { return false; }
  bool start_object(std::size_t) override { return open(NodeKind::map); }
  bool key(std::string& name) override { return tree.set_key(name), true; }
  bool end_object() override { return tree.close(), true; }
  bool start_array(std::size_t) override { return open(NodeKind::list); }
  bool end_array() override { return tree.close(), true; }
  bool parse_error(std::size_t, const std::string&, const nlohmann::json::exception& found) override {
    problem = fmt::format("expected JSON, found: {}", found.what());
    return false;
  }

 private:
  bool open(NodeKind kind) {
    if (tree.open(kind, 0)) return true;
    problem = too_deep();
    return false;
  }
};

Result<DataNode> parse_json(const std::string& text) {
  JsonEvents events;
  constexpr bool is_strict = true, ignores_comments = true;
  if (!nlohmann::json::sax_parse(text, &events, nlohmann::json::input_format_t::json, is_strict,
                                 ignores_comments))
    return error("{}.", as_utf8(events.problem));
  return events.tree.root();
}

// ---- XML ----

std::string_view without_blanks(std::string_view text) {
  const auto first = text.find_first_not_of(k_blanks);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(k_blanks) - first + 1);
}

// OpenCV writes texts with quotes into XML where they would read as numbers.
std::string without_quotes(std::string_view text) {
  if (text.size() >= 2 && text.front() == '"' && text.back() == '"') text = text.substr(1, text.size() - 2);
  return std::string(text);
}

// Adds the content of an element; false when it is nested too deep.
bool add_element(const pugi::xml_node& element, TreeBuilder* tree) {
  const pugi::xml_node first =
      element.find_child([](const pugi::xml_node& child) { return child.type() == pugi::node_element; });
  if (!first) {
    tree->add_text(without_quotes(without_blanks(element.child_value())), 0);
    return true;
  }
  const bool is_list = std::string_view(first.name()) == "_";
  if (!tree->open(is_list ? NodeKind::list : NodeKind::map, 0)) return false;
  for (const pugi::xml_node& child : element.children()) {
    if (child.type() != pugi::node_element) continue;
    if (!is_list) tree->set_key(child.name());
    if (!add_element(child, tree)) return false;
  }
  tree->close();
  return true;
}

Result<DataNode> parse_xml(const std::string& text) {
  pugi::xml_document document;
  const pugi::xml_parse_result result = document.load_buffer(text.data(), text.size());
  if (!result) {
    const auto end = text.begin() + std::min(result.offset, static_cast<std::ptrdiff_t>(text.size()));
    return error("line {}: expected XML with a closing tag for every opened one, found: {}.",
                 1 + std::count(text.begin(), end, '\n'), result.description());
  }
  TreeBuilder tree;
  tree.open(NodeKind::map, 0);
  const pugi::xml_node root = document.document_element();
  tree.set_key(root.name());
  if (!add_element(root, &tree)) return error("{}.", too_deep());
  tree.close();
  return tree.root();
}

// ---- encodings ----

// Text in UTF-8 without a byte order mark and with "\n" at the end of lines. Without a mark UTF-16 is told
// from the zero beside the first character.
std::string as_plain_utf8(std::string_view text) {
  const auto byte = [&](std::size_t i) { return i < text.size() ? static_cast<unsigned char>(text[i]) : -1; };
  const bool has_mark = (byte(0) == 0xff && byte(1) == 0xfe) || (byte(0) == 0xfe && byte(1) == 0xff);
  const bool is_little = has_mark ? byte(0) == 0xff : byte(0) > 0 && byte(1) == 0;
  const bool is_utf16 = has_mark || is_little || (byte(0) == 0 && byte(1) > 0);
  std::string plain;
  if (is_utf16) {
    std::u16string wide;
    for (std::size_t i = has_mark ? 2 : 0; i + 1 < text.size(); i += 2) {
      const int low = is_little ? byte(i) : byte(i + 1), high = is_little ? byte(i + 1) : byte(i);
      const auto unit = static_cast<char16_t>(high << 8 | low);
      wide.push_back(unit >= 0xd800 && unit < 0xe000 ? u'\ufffd' : unit);  // pairs are in no camera's entries
    }
    utf8::utf16to8(wide.begin(), wide.end(), std::back_inserter(plain));
  } else {
    plain = as_utf8(text);
    if (plain.starts_with("\xef\xbb\xbf")) plain.erase(0, 3);
  }
  std::erase(plain, '\r');
  return plain;
}

bool add_numbers(const DataNode& node, std::vector<double>* numbers) {
  if (node.is_list())
    return std::ranges::all_of(node.items, [&](const DataNode& item) { return add_numbers(item, numbers); });
  if (!node.is_text()) return false;
  constexpr std::string_view k_between = " \t\r\n,";
  const std::string_view list = node.text;
  for (auto at = list.find_first_not_of(k_between); at != std::string_view::npos;) {
    const auto end = std::min(list.find_first_of(k_between, at), list.size());
    const auto number = number_in(list.substr(at, end - at));
    if (!number) return false;
    numbers->push_back(*number);
    at = list.find_first_not_of(k_between, end);
  }
  return true;
}

}  // namespace

const DataNode* DataNode::find(std::string_view key) const {
  const auto found = std::ranges::find(keys, key);
  return found == keys.end() ? nullptr : &items[static_cast<std::size_t>(found - keys.begin())];
}

Result<DataNode> parse_data(std::string_view text) {
  const std::string plain = as_plain_utf8(text);
  const auto first = plain.find_first_not_of(k_blanks);
  if (first == std::string::npos) return error("expected YAML, JSON or XML, found an empty file.");
  if (plain.find('\0') != std::string::npos) return error("expected text, found binary data.");
  if (plain[first] == '<') return parse_xml(plain);
  if (plain[first] == '{' || plain[first] == '[') return parse_json(plain);
  return parse_yaml(plain);
}

std::optional<double> number_in(std::string_view text) {
  if (text.starts_with('+')) text.remove_prefix(1);
  std::string lower(text);
  std::ranges::transform(lower, lower.begin(),
                         [](char c) { return c >= 'A' && c <= 'Z' ? char(c - 'A' + 'a') : c; });
  if (lower == ".nan") return std::numeric_limits<double>::quiet_NaN();
  if (lower == ".inf" || lower == "-.inf") return lower[0] == '-' ? -INFINITY : INFINITY;
  double value = 0;
  const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (problem == std::errc::result_out_of_range) return INFINITY;
  if (problem != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

std::optional<std::vector<double>> numbers_in(const DataNode& node) {
  std::vector<double> numbers;
  if (!add_numbers(node, &numbers)) return std::nullopt;
  return numbers;
}

}  // namespace limn
