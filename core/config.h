#pragma once

#include <array>
#include <filesystem>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/pose.h"
#include "core/result.h"

namespace limn {

/// Larger numbers in a file are mistakes; later computations would not stay finite with them.
inline constexpr double k_largest_number = 1e9;
/// Metres: no room is larger, and single precision resolves a centimetre at this distance.
inline constexpr double k_largest_coordinate = 1e5;

/// A value in a JSON file that people edit; it knows its path. A getter returns the value. If that is not
/// possible, it records the problem, unless the file already has one ("FILE: projectors[0].lens.fx: expected
/// …, found …."), and returns a default. So callers read everything and check Config::status() once at the
/// end.
class ConfigNode {
 public:
  ConfigNode() = default;  ///< an absent node: every getter returns its default and records no problem

  /// A required member. If it is absent, a problem is recorded.
  ConfigNode at(const std::string& key) const;
  /// An optional member.
  std::optional<ConfigNode> find(const std::string& key) const;
  /// The elements of an array.
  std::vector<ConfigNode> items() const;
  /// Member names of an object, in the file's order.
  std::vector<std::string> keys() const;

  /// A number of at most k_largest_number in magnitude.
  double number() const;
  double positive(double most = k_largest_number) const;  ///< > 0, at most `most`.
  int integer() const;
  bool boolean() const;
  std::string text() const;
  /// One of `choices`.
  std::string choice(const std::vector<std::string>& choices) const;
  /// Array of exactly `count` numbers as number() takes them (any number when count < 0).
  std::vector<double> numbers(int count) const;
  /// Three numbers of at most k_largest_coordinate in magnitude: a position (m), a direction, a colour.
  Eigen::Vector3d vector3() const;
  /// [width, height] in whole pixels, each from `smallest` to k_max_side (core/imager.h).
  std::array<int, 2> image_size(int smallest = 1) const;
  /// {"rotation_wxyz": [...], "translation_m": [...]}; the quaternion must have unit length within 1e-3.
  Pose pose() const;
  /// A relative path that must stay inside the file's folder; returned joined to that folder.
  std::filesystem::path path_inside() const;
  /// The same for a path that is a part of this value's text.
  std::filesystem::path path_inside(const std::filesystem::path& path) const;

  bool is_object() const;
  bool is_array() const;
  bool is_string() const;
  bool is_number() const;
  const nlohmann::json& json() const;

  /// Records a problem of this value. The caller gives the sentence, such as "expected X, found Y."
  void problem(const std::string& sentence) const;
  /// Records a problem if the object has a key outside `known`; the message suggests the nearest known key.
  void only(const std::set<std::string>& known) const;
  const std::string& where() const { return where_; }

 private:
  friend class Config;
  struct File;
  ConfigNode(std::shared_ptr<File> file, const nlohmann::json* json, std::string where)
      : file_(std::move(file)), json_(json), where_(std::move(where)) {}
  std::shared_ptr<File> file_;
  const nlohmann::json* json_ = nullptr;
  std::string where_;
};

/// A JSON file (with // comments) whose "schema" is checked.
class Config {
 public:
  /// `schema` such as "limn.scene/1"; empty accepts files without one (POSES.json, VIEWER.json).
  static Result<Config> load(const std::filesystem::path& path, const std::string& schema);
  /// The same for a file's text. `path` names it in messages.
  static Result<Config> parse(const std::string& text,
                              const std::filesystem::path& path,
                              const std::string& schema);
  ConfigNode root() const;
  /// The first recorded problem, if any.
  Status status() const;
  std::filesystem::path folder() const;

 private:
  std::shared_ptr<ConfigNode::File> file_;
};

/// {"rotation_wxyz": [w,x,y,z], "translation_m": [x,y,z]}
nlohmann::json to_json(const Pose& pose);

}  // namespace limn
