#include "core/config.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "core/file.h"
#include "core/imager.h"
#include "core/json_text.h"
#include "core/names.h"

namespace limn {

using Json = nlohmann::json;

struct ConfigNode::File {
  std::filesystem::path path;
  Json json;
  std::optional<Error> problem;  // the first one
};

namespace {

constexpr double k_quaternion_tolerance = 1e-3;
constexpr int k_max_depth = 100;  // Limn's files need 8; printing or freeing a deeper one overflows the stack

// The value as text, short enough for a message.
std::string found(const Json& json) {
  std::string text = json_text(json);
  if (text.size() > 60) text = text.substr(0, 57) + "...";
  return std::string(json.type_name()) + " " + text;
}

int edit_distance(const std::string& a, const std::string& b) {
  std::vector<int> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = static_cast<int>(j);
  for (std::size_t i = 1; i <= a.size(); ++i) {
    int diagonal = std::exchange(row[0], static_cast<int>(i));
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const int replaced = diagonal + (a[i - 1] != b[j - 1]);
      diagonal = std::exchange(row[j], std::min({row[j] + 1, row[j - 1] + 1, replaced}));
    }
  }
  return row[b.size()];
}

// Reads JSON. `problem` reports the first key that is twice in one object, or nesting that is too deep.
Json parse(const std::string& text, std::optional<std::string>* problem) {
  std::vector<std::set<std::string>> keys;  // keys so far of each object that is open
  const auto look = [&](int depth, Json::parse_event_t event, Json& value) {
    if (depth > k_max_depth) {
      if (!*problem)
        *problem = fmt::format("expected at most {} levels of brackets, found more.", k_max_depth);
      return false;
    }
    if (event == Json::parse_event_t::object_start) keys.emplace_back();
    if (event == Json::parse_event_t::object_end) keys.pop_back();
    if (event == Json::parse_event_t::key && !keys.back().insert(value.get<std::string>()).second &&
        !*problem)
      *problem =
          fmt::format("expected each key once, found \"{}\" twice in one object.", value.get<std::string>());
    return true;
  };
  return Json::parse(text, look, true, true);
}

}  // namespace

void ConfigNode::problem(const std::string& sentence) const {
  if (!file_ || file_->problem) return;
  file_->problem = error("{}: {}{}{}", file_->path.string(), where_, where_.empty() ? "" : ": ", sentence);
}

ConfigNode ConfigNode::at(const std::string& key) const {
  if (!json_) return {};
  if (!json_->is_object()) {
    problem(fmt::format("expected an object with \"{}\", found {}.", key, found(*json_)));
    return {};
  }
  const auto member = json_->find(key);
  const std::string where = where_.empty() ? key : where_ + "." + key;
  if (member == json_->end()) {
    ConfigNode(file_, nullptr, where).problem("this key is missing; config/README.md says what it means.");
    return {};
  }
  return {file_, &*member, where};
}

std::optional<ConfigNode> ConfigNode::find(const std::string& key) const {
  if (!json_ || !json_->is_object() || !json_->contains(key)) return std::nullopt;
  return at(key);
}

std::vector<ConfigNode> ConfigNode::items() const {
  std::vector<ConfigNode> nodes;
  if (!json_) return nodes;
  if (!json_->is_array()) {
    problem(fmt::format("expected a list, found {}.", found(*json_)));
    return nodes;
  }
  for (std::size_t i = 0; i < json_->size(); ++i) {
    nodes.push_back(ConfigNode(file_, &(*json_)[i], fmt::format("{}[{}]", where_, i)));
  }
  return nodes;
}

std::vector<std::string> ConfigNode::keys() const {
  std::vector<std::string> names;
  if (!json_) return names;
  if (!json_->is_object()) {
    problem(fmt::format("expected an object, found {}.", found(*json_)));
    return names;
  }
  for (const auto& [key, value] : json_->items()) names.push_back(key);
  return names;
}

double ConfigNode::number() const {
  if (!json_) return 0;
  const double value = json_->is_number() ? json_->get<double>() : NAN;
  if (std::abs(value) <= k_largest_number) return value;
  if (std::isfinite(value))
    problem(fmt::format("expected a number from {} to {}, found {}.", -k_largest_number, k_largest_number,
                        value));
  else
    problem(fmt::format("expected a finite number, found {}.", found(*json_)));
  return 0;
}

double ConfigNode::positive(double most) const {
  const double value = number();
  if (value > most) problem(fmt::format("expected at most {}, found {}.", most, value));
  if (json_ && json_->is_number() && !(value > 0))
    problem(fmt::format("expected a number > 0, found {}.", value));
  return value > 0 ? value : 1;
}

int ConfigNode::integer() const {
  if (!json_) return 0;
  const double value = json_->is_number() ? json_->get<double>() : NAN;
  if (value == std::floor(value) && std::abs(value) < 1e9) return static_cast<int>(value);
  problem(fmt::format("expected a whole number, found {}.", found(*json_)));
  return 0;
}

bool ConfigNode::boolean() const {
  if (!json_) return false;
  if (json_->is_boolean()) return json_->get<bool>();
  problem(fmt::format("expected true or false, found {}.", found(*json_)));
  return false;
}

std::string ConfigNode::text() const {
  if (!json_) return "";
  if (json_->is_string()) return json_->get<std::string>();
  problem(fmt::format("expected text in quotes, found {}.", found(*json_)));
  return "";
}

std::string ConfigNode::choice(const std::vector<std::string>& choices) const {
  if (!json_) return choices.front();
  const std::string word = text();
  if (std::find(choices.begin(), choices.end(), word) != choices.end()) return word;
  problem(fmt::format("expected one of {}, found {}.", joined_names(choices), found(*json_)));
  return choices.front();
}

std::vector<double> ConfigNode::numbers(int count) const {
  std::vector<double> values;
  if (json_) {
    for (const ConfigNode& item : items()) values.push_back(item.number());
    if (count >= 0 && static_cast<int>(values.size()) != count) {
      problem(fmt::format("expected {} numbers, found {}.", count, found(*json_)));
    }
  }
  if (count >= 0) values.resize(static_cast<std::size_t>(count));
  return values;
}

Eigen::Vector3d ConfigNode::vector3() const {
  const auto values = numbers(3);
  for (const double value : values)
    if (std::abs(value) > k_largest_coordinate)
      problem(fmt::format("expected three numbers from {} to {}, found {}.", -k_largest_coordinate,
                          k_largest_coordinate, value));
  return {values[0], values[1], values[2]};
}

std::array<int, 2> ConfigNode::image_size(int smallest) const {
  const auto values = numbers(2);
  if (!json_) return {smallest, smallest};
  const auto is_side = [&](double value) {
    return value >= smallest && value <= k_max_side && value == std::floor(value);
  };
  if (is_side(values[0]) && is_side(values[1]))
    return {static_cast<int>(values[0]), static_cast<int>(values[1])};
  problem(fmt::format("expected [width, height] in whole pixels, each from {} to {}, found {}.", smallest,
                      k_max_side, found(*json_)));
  return {smallest, smallest};
}

Pose ConfigNode::pose() const {
  only({"rotation_wxyz", "translation_m"});
  const ConfigNode rotation = at("rotation_wxyz");
  const auto wxyz = rotation.numbers(4);
  const Eigen::Vector3d translation = at("translation_m").vector3();
  const Eigen::Quaterniond q(wxyz[0], wxyz[1], wxyz[2], wxyz[3]);
  if (rotation.json_ && !(std::abs(q.norm() - 1) <= k_quaternion_tolerance)) {
    rotation.problem(fmt::format("expected a unit quaternion [w, x, y, z], found length {:.4g}.", q.norm()));
    return {};
  }
  if (!rotation.json_) return {};
  return {q, translation};
}

std::filesystem::path ConfigNode::path_inside() const { return path_inside(text()); }

std::filesystem::path ConfigNode::path_inside(const std::filesystem::path& path) const {
  if (!json_) return {};
  const std::filesystem::path normal = path.lexically_normal();
  if (path.empty() || path.is_absolute() || *normal.begin() == "..") {
    problem(fmt::format("expected a relative path inside the file's folder, found \"{}\".", path.string()));
    return {};
  }
  return file_->path.parent_path() / normal;
}

bool ConfigNode::is_object() const { return json_ && json_->is_object(); }
bool ConfigNode::is_array() const { return json_ && json_->is_array(); }
bool ConfigNode::is_string() const { return json_ && json_->is_string(); }
bool ConfigNode::is_number() const { return json_ && json_->is_number(); }

const Json& ConfigNode::json() const {
  static const Json absent;
  return json_ ? *json_ : absent;
}

void ConfigNode::only(const std::set<std::string>& known) const {
  if (!json_) return;
  for (const std::string& key : keys()) {
    if (known.contains(key)) continue;
    const auto nearest = std::min_element(known.begin(), known.end(), [&](const auto& a, const auto& b) {
      return edit_distance(a, key) < edit_distance(b, key);
    });
    problem(fmt::format("unknown key \"{}\"; did you mean \"{}\"? Known: {}.", key, *nearest,
                        joined_names(known)));
  }
}

Result<Config> Config::load(const std::filesystem::path& path, const std::string& schema) {
  LIMN_TRY(const std::string text, read_file(path));
  return parse(text, path, schema);
}

Result<Config> Config::parse(const std::string& text,
                             const std::filesystem::path& path,
                             const std::string& schema) {
  auto file = std::make_shared<ConfigNode::File>();
  file->path = path;
  std::optional<std::string> unsound;
  try {
    file->json = limn::parse(text, &unsound);
  } catch (const Json::parse_error& problem) {
    const auto end = text.begin() + static_cast<std::ptrdiff_t>(std::min(problem.byte, text.size()));
    return error(
        "{}:{}: expected JSON (// comments allowed), found a syntax error or the end of a truncated file.",
        path.string(), 1 + std::count(text.begin(), end, '\n'));
  } catch (const Json::exception& problem) {
    return error("{}: expected JSON (// comments allowed), found: {}.", path.string(), problem.what());
  }
  if (unsound) return error("{}: {}", path.string(), *unsound);
  Config config;
  config.file_ = std::move(file);
  if (!config.root().is_object()) {
    return error("{}: expected an object {{...}}, found {}.", path.string(), found(config.root().json()));
  }
  if (schema.empty()) return config;
  const std::string stated = config.root().at("schema").text();
  if (!config.status()) return config.status().error();
  if (stated != schema) {
    return error("{}: schema: expected \"{}\", found \"{}\". Is it the right file?", path.string(), schema,
                 stated);
  }
  return config;
}

ConfigNode Config::root() const { return {file_, &file_->json, ""}; }

Status Config::status() const { return file_->problem ? Status(*file_->problem) : Status(); }

std::filesystem::path Config::folder() const { return file_->path.parent_path(); }

Json to_json(const Pose& pose) {
  const auto& q = pose.rotation;
  const auto& t = pose.translation;
  return {{"rotation_wxyz", {q.w(), q.x(), q.y(), q.z()}}, {"translation_m", {t.x(), t.y(), t.z()}}};
}

}  // namespace limn
