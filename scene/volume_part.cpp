#include "scene/volume_part.h"

#include <fmt/format.h>

#include <Eigen/LU>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>
#include <vector>

namespace limn::scene {
namespace {

constexpr float k_box_colour = 0.03F;  // linear

std::optional<double> number_of(const std::string& word) {
  double value = 0;
  const char* const end = word.data() + word.size();
  const auto [at, failed] = std::from_chars(word.data(), end, value);
  if (failed != std::errc() || at != end || !std::isfinite(value)) return std::nullopt;
  return value;
}

}  // namespace

Mesh volume_box(const Volume& volume) {
  Mesh mesh;
  mesh.materials.front().base_colour.setConstant(k_box_colour);
  const bool is_mirrored = volume.part_from_voxel.linear().determinant() < 0;
  const Eigen::Vector3d size(volume.size[0], volume.size[1], volume.size[2]);
  // Each side by its axis and which end it is at; its corners are counter-clockwise from outside.
  for (int axis = 0; axis < 3; ++axis)
    for (const int end : {0, 1}) {
      const int u = (axis + 1) % 3, v = (axis + 2) % 3;
      const auto first = static_cast<std::uint32_t>(mesh.positions.size());
      for (const auto& [at_u, at_v] : {std::pair(0, 0), std::pair(1, 0), std::pair(1, 1), std::pair(0, 1)}) {
        Eigen::Vector3d share;
        share[axis] = end;
        share[u] = at_u;
        share[v] = at_v;
        const Eigen::Vector3d p_voxel = share.cwiseProduct(size) - Eigen::Vector3d::Constant(0.5);
        mesh.positions.push_back((volume.part_from_voxel * p_voxel).cast<float>());
      }
      const bool is_turned = (end == 0) != is_mirrored;
      const std::array<std::uint32_t, 4> corner = {first, first + (is_turned ? 3U : 1U), first + 2U,
                                                   first + (is_turned ? 1U : 3U)};
      mesh.triangles.push_back({corner[0], corner[1], corner[2]});
      mesh.triangles.push_back({corner[0], corner[2], corner[3]});
      const Eigen::Vector3f along_u = mesh.positions[corner[1]] - mesh.positions[corner[0]],
                            along_v = mesh.positions[corner[3]] - mesh.positions[corner[0]];
      mesh.normals.insert(mesh.normals.end(), 4, along_u.cross(along_v).normalized());
    }
  mesh.triangle_materials.assign(mesh.triangles.size(), 0);
  return mesh;
}

GreyWindow shown_window(const Variant& variant, const std::optional<GreyWindow>& chosen) {
  if (chosen) return *chosen;
  if (variant.window) return *variant.window;
  return variant.volume ? variant.volume->window : GreyWindow{};
}

Result<std::optional<GreyWindow>> parse_grey_window(const std::string& words) {
  std::istringstream text(words);
  std::vector<std::string> all;
  for (std::string word; text >> word;) all.push_back(word);
  if (all.empty()) return std::optional<GreyWindow>();
  const auto width = number_of(all[0]), level = all.size() == 2 ? number_of(all[1]) : std::nullopt;
  if (width && level && is_window({*level, *width})) return std::optional(GreyWindow{*level, *width});
  return error(
      "window: expected a width above 0 and a level, such as '400 40' (black at -160, white at 240), or "
      "nothing "
      "for the file's, found '{}'.",
      words);
}

std::string format_grey_window(const std::optional<GreyWindow>& window) {
  return window ? fmt::format("{:.6g} {:.6g}", window->width, window->level) : "";
}

GreyWindow read_grey_window(const ConfigNode& node) {
  node.only({"width", "level"});
  const GreyWindow window{node.at("level").number(), node.at("width").number()};
  if (is_window(window)) return window;
  node.problem(
      fmt::format("expected a width above 0 and a level, found {:g} and {:g}.", window.width, window.level));
  return {};
}

nlohmann::ordered_json to_json(const GreyWindow& window) {
  return {{"width", window.width}, {"level", window.level}};
}

bool is_window(const GreyWindow& window) {
  // Values are single precision; a window that no value can be in would be a mistake.
  constexpr double k_most = 3.4e38, k_least_width = 1e-30;
  return std::abs(window.level) <= k_most && window.width >= k_least_width && window.width <= k_most;
}

}  // namespace limn::scene
