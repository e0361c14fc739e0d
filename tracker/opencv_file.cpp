#include "tracker/opencv_file.h"

#include <charconv>

#include "core/data_tree.h"

namespace limn::tracker {
namespace {

std::optional<int> integer_in(const std::string& text) {
  int value = 0;
  const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (problem != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

Result<OpencvFile::Value> value_of(const std::string& name, const DataNode& node) {
  OpencvFile::Value value;
  value.text = node.text;
  const DataNode* data = node.find("data");
  if (!data) return value;
  const auto numbers = numbers_in(*data);
  if (!numbers)
    return error("{}: expected a list of numbers as the matrix's data, found something else.", name);
  value.numbers = *numbers;
  for (const auto& [key, side] : {std::pair{"rows", &value.rows}, {"cols", &value.cols}})
    if (const DataNode* count = node.find(key)) *side = integer_in(count->text).value_or(0);
  return value;
}

}  // namespace

Result<OpencvFile> OpencvFile::parse(const std::string& text) {
  LIMN_TRY(const DataNode root, parse_data(text));
  const DataNode* storage = root.find("opencv_storage");
  const DataNode& top = storage ? *storage : root;
  const bool is_other_xml = !storage && text.find_first_not_of(" \t\r\n") == text.find('<');
  if (!top.is_map() || is_other_xml)
    return error(
        "expected the entries of an OpenCV file (in XML: one element <opencv_storage>), found none.");
  OpencvFile file;
  for (std::size_t i = 0; i < top.items.size(); ++i) {
    LIMN_TRY(file.values_[top.keys[i]], value_of(top.keys[i], top.items[i]));
  }
  return file;
}

const OpencvFile::Value* OpencvFile::find(const std::string& name) const {
  const auto found = values_.find(name);
  return found == values_.end() ? nullptr : &found->second;
}

std::optional<int> OpencvFile::integer(const std::string& name) const {
  const Value* value = find(name);
  return value ? integer_in(value->text) : std::nullopt;
}

}  // namespace limn::tracker
