#include "core/camera_files/cahvor_file.h"

#include <Eigen/Geometry>
#include <cmath>
#include <map>
#include <sstream>
#include <string_view>
#include <vector>

#include "core/data_tree.h"

namespace limn {
namespace {

using Eigen::Vector3d;

// The lines KEY = VALUE by key; other lines (covariances, comments) are left out.
std::map<std::string, std::string> cahvor_lines(const std::string& text) {
  std::map<std::string, std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) {
    const auto equals = line.find('=');
    if (equals == std::string::npos || line.find_first_not_of(" \t") == line.find('#')) continue;
    std::string key;
    std::istringstream(line.substr(0, equals)) >> key;
    const auto end = line.find_last_not_of(" \t\r");
    lines[key] = line.substr(equals + 1, end - equals);
  }
  return lines;
}

Result<std::vector<double>> vector_of(const std::map<std::string, std::string>& lines,
                                      const std::string& key,
                                      std::size_t count) {
  const auto line = lines.find(key);
  if (line == lines.end()) return error("{}: expected {} numbers, found no such line.", key, count);
  DataNode node;
  node.kind = DataNode::Kind::text;
  node.text = line->second;
  const auto numbers = numbers_in(node);
  bool is_sound = numbers && numbers->size() == count;
  for (std::size_t i = 0; is_sound && i < count; ++i) is_sound = std::isfinite((*numbers)[i]);
  if (!is_sound)
    return error("{}: expected {} finite numbers, found '{}'.", key, count, line->second.substr(0, 60));
  return *numbers;
}

}  // namespace

bool is_cahvor(const std::string& text) {
  const auto lines = cahvor_lines(text);
  return lines.contains("C") && lines.contains("A") && lines.contains("H") && lines.contains("V");
}

Result<Imager> read_cahvor(const std::string& text) {
  const auto lines = cahvor_lines(text);
  for (const auto& [key, value] : lines)
    if (key == "E" || key.starts_with("DISTORTION"))
      return error(
          "{}: expected a CAHV or CAHVOR model, found another one. Convert it with mrcal-from-cahvor to a "
          ".cameramodel.",
          key);
  LIMN_TRY(const auto size, vector_of(lines, "Dimensions", 2));
  for (const double side : size)
    if (!(side >= 1 && side <= k_max_side && side == std::floor(side)))
      return error("Dimensions: expected whole numbers of pixels from 1 to {}, found {:g}.", k_max_side,
                   side);
  std::map<std::string, Vector3d> vectors;
  for (const char* key : {"C", "A", "H", "V"}) {
    LIMN_TRY(const auto numbers, vector_of(lines, key, 3));
    vectors[key] = Vector3d(numbers[0], numbers[1], numbers[2]);
  }
  const Vector3d a = vectors["A"];
  const double cx = vectors["H"].dot(a), cy = vectors["V"].dot(a);
  const Vector3d right = vectors["H"] - cx * a, down = vectors["V"] - cy * a;
  const double fx = right.norm(), fy = down.norm();
  Eigen::Matrix3d world_from_imager;
  world_from_imager << right / fx, down / fy, a;
  constexpr double k_rounded = 1e-3;
  if (!((world_from_imager.transpose() * world_from_imager).isIdentity(k_rounded) &&
        world_from_imager.determinant() > 0))
    return error(
        "A, H, V: expected a unit axis and pixels without skew, found vectors that are no camera's.");
  std::vector<double> values = {fx, fy, cx, cy};
  bool is_bent = false;
  if (lines.contains("R")) {
    LIMN_TRY(const auto radial, vector_of(lines, "R", 3));
    LIMN_TRY(const auto axis, lines.contains("O")
                                  ? vector_of(lines, "O", 3)
                                  : Result<std::vector<double>>(std::vector{a.x(), a.y(), a.z()}));
    const Vector3d o = world_from_imager.transpose() * Vector3d(axis[0], axis[1], axis[2]).normalized();
    if (!(o.z() > 0))
      return error("O: expected an optical axis in front of the camera, found another direction.");
    values.insert(values.end(),
                  {std::atan2(o.x(), o.z()), std::asin(o.y()), radial[0], radial[1], radial[2]});
    is_bent = true;
  }
  LIMN_TRY(Lens lens, Lens::create(is_bent ? "LENSMODEL_CAHVOR" : "LENSMODEL_PINHOLE", std::move(values)));
  const Pose pose(world_from_imager, vectors["C"]);
  return Imager{"", static_cast<int>(size[0]), static_cast<int>(size[1]), std::move(lens), pose.inverse()};
}

}  // namespace limn
