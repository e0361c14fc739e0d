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

float alpha_of_texel(const cv::Mat& texture, int x, int y) {
  x = std::clamp(x, 0, texture.cols - 1);
  y = std::clamp(y, 0, texture.rows - 1);
  return static_cast<float>(texture.at<cv::Vec4b>(y, x)[3]) / 255;
}

// Between the middles of texels, v up.
template <typename TexelAt>
auto between_texels(const cv::Mat& texture, const Eigen::Vector2f& uv, const TexelAt& at) {
  using Value = decltype(at(texture, 0, 0));
  const float x = uv.x() * static_cast<float>(texture.cols) - 0.5F;
  const float y = (1 - uv.y()) * static_cast<float>(texture.rows) - 0.5F;
  const int c = static_cast<int>(std::floor(x)), r = static_cast<int>(std::floor(y));
  const float fx = x - static_cast<float>(c), fy = y - static_cast<float>(r);
  return Value((1 - fy) * ((1 - fx) * at(texture, c, r) + fx * at(texture, c + 1, r)) +
               fy * ((1 - fx) * at(texture, c, r + 1) + fx * at(texture, c + 1, r + 1)));
}

const scene::Material& material_of(const scene::Mesh& mesh, int triangle) {
  return mesh.materials[mesh.triangle_materials.empty()
                            ? 0
                            : mesh.triangle_materials[static_cast<std::size_t>(triangle)]];
}

}  // namespace

Eigen::Vector3f textured(const cv::Mat& texture, const Eigen::Vector2f& uv, bool sharp) {
  if (!sharp) return between_texels(texture, uv, texel);
  return texel(texture, static_cast<int>(std::floor(uv.x() * static_cast<float>(texture.cols))),
               static_cast<int>(std::floor((1 - uv.y()) * static_cast<float>(texture.rows))));
}

bool is_cut_out(const scene::Mesh& mesh, int triangle, const Eigen::Vector2f& uv) {
  const scene::Material& material = material_of(mesh, triangle);
  if (material.cut_below <= 0 || material.texture.channels() != 4) return false;
  return between_texels(material.texture, uv, alpha_of_texel) < material.cut_below;
}

Eigen::Vector3f material_albedo(const scene::Mesh& mesh, int triangle, const Eigen::Vector2f& uv) {
  const scene::Material& material = material_of(mesh, triangle);
  const Eigen::Vector3f bgr = material.base_colour.reverse();
  if (material.texture.empty()) return bgr;
  return bgr.cwiseProduct(textured(material.texture, uv, false));
}

}  // namespace limn::sim
