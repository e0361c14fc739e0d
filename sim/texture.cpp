#include "sim/texture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace limn::sim {
namespace {

const std::array<float, 256>& linear_of_srgb() {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> t{};
    for (std::size_t i = 0; i < t.size(); ++i) {
      const double v = static_cast<double>(i) / 255;
      t[i] = static_cast<float>(v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4));
    }
    return t;
  }();
  return table;
}

// Linear BGR of a texture's pixel; coordinates beyond the border take the border's.
Eigen::Vector3f texel(const cv::Mat& texture, int x, int y) {
  const auto& linear = linear_of_srgb();
  x = std::clamp(x, 0, texture.cols - 1);
  y = std::clamp(y, 0, texture.rows - 1);
  const std::uint8_t* p = texture.ptr(y) + x * texture.channels();
  if (texture.channels() == 1) return Eigen::Vector3f::Constant(linear[p[0]]);
  return {linear[p[0]], linear[p[1]], linear[p[2]]};
}

}  // namespace

Eigen::Vector3f textured(const cv::Mat& texture, const Eigen::Vector2f& uv, bool sharp) {
  const float x = uv.x() * static_cast<float>(texture.cols),
              y = (1 - uv.y()) * static_cast<float>(texture.rows);
  if (sharp) return texel(texture, static_cast<int>(std::floor(x)), static_cast<int>(std::floor(y)));
  const int c = static_cast<int>(std::floor(x - 0.5F)), r = static_cast<int>(std::floor(y - 0.5F));
  const float fx = x - 0.5F - static_cast<float>(c), fy = y - 0.5F - static_cast<float>(r);
  return (1 - fy) * ((1 - fx) * texel(texture, c, r) + fx * texel(texture, c + 1, r)) +
         fy * ((1 - fx) * texel(texture, c, r + 1) + fx * texel(texture, c + 1, r + 1));
}

Eigen::Vector3f material_albedo(const scene::Mesh& mesh, int triangle, const Eigen::Vector2f& uv) {
  const auto t = static_cast<std::size_t>(triangle);
  const std::size_t m = mesh.triangle_materials.empty() ? 0 : mesh.triangle_materials[t];
  const scene::Material& material = mesh.materials[m];
  const Eigen::Vector3f bgr = material.base_colour.reverse();
  if (material.texture.empty()) return bgr;
  return bgr.cwiseProduct(textured(material.texture, uv, false));
}

}  // namespace limn::sim
