#include "sim/texture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace limn::sim {
namespace {

const std::array<float, 256>& linear_from_srgb() {
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

// Linear BGR of a texture's pixel; coordinates are clamped to the image.
Eigen::Vector3f texel(const cv::Mat& texture, int x, int y) {
  const auto& linear = linear_from_srgb();
  x = std::clamp(x, 0, texture.cols - 1);
  y = std::clamp(y, 0, texture.rows - 1);
  const std::uint8_t* p = texture.ptr(y) + x * texture.channels();
  if (texture.channels() == 1) return Eigen::Vector3f::Constant(linear[p[0]]);
  return {linear[p[0]], linear[p[1]], linear[p[2]]};
}

int repeated(int at, int count) { return (at % count + count) % count; }

// The same, but the texture repeats beyond its border.
Eigen::Vector3f repeated_texel(const cv::Mat& texture, int x, int y) {
  return texel(texture, repeated(x, texture.cols), repeated(y, texture.rows));
}

// The stored values of a pixel, 0 to 1, BGR, not linearised.
Eigen::Vector3f repeated_numbers(const cv::Mat& texture, int x, int y) {
  const auto& p = texture.at<cv::Vec3b>(repeated(y, texture.rows), repeated(x, texture.cols));
  return Eigen::Vector3f(p[0], p[1], p[2]) / 255;
}

float alpha_of_texel(const cv::Mat& texture, int x, int y) {
  const auto& p = texture.at<cv::Vec4b>(repeated(y, texture.rows), repeated(x, texture.cols));
  return static_cast<float>(p[3]) / 255;
}

// Interpolates between the centres of texels; v points up.
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

Eigen::Vector4f repeated_texture(const cv::Mat& texture, const Eigen::Vector2f& uv) {
  const float alpha = texture.channels() == 4 ? between_texels(texture, uv, alpha_of_texel) : 1;
  Eigen::Vector4f out;
  out.head<3>() = between_texels(texture, uv, repeated_texel);
  out.w() = alpha;
  return out;
}

bool is_cut_out(const scene::Mesh& mesh, int triangle, const Eigen::Vector2f& uv) {
  const scene::Material& material = material_of(mesh, triangle);
  if (material.cut_below <= 0 || material.texture.channels() != 4) return false;
  return between_texels(material.texture, uv, alpha_of_texel) < material.cut_below;
}

Eigen::Vector3f material_albedo(const scene::Mesh& mesh,
                                int triangle,
                                const Eigen::Vector2f& uv,
                                const Eigen::Vector3f& colour_rgb) {
  const scene::Material& material = material_of(mesh, triangle);
  const Eigen::Vector3f bgr = material.base_colour.cwiseProduct(colour_rgb).reverse();
  if (material.texture.empty()) return bgr;
  return bgr.cwiseProduct(between_texels(material.texture, uv, repeated_texel));
}

SurfaceMaterial surface_material(const scene::Mesh& mesh,
                                 int triangle,
                                 const Eigen::Vector2f& uv,
                                 const Eigen::Vector3f& colour_rgb,
                                 const Eigen::Vector2f& second_uv) {
  const scene::Material& material = material_of(mesh, triangle);
  const scene::SurfaceMaps& maps = material.maps;
  const auto numbers_at = [&](const scene::Texture& map) {
    return between_texels(map.image, map.in_second_uvs ? second_uv : uv, repeated_numbers);
  };
  // The normal of a map of normals, relative to the mesh's.
  const auto relief_at = [&](const scene::Texture& map, float map_scale) {
    const auto scale = static_cast<double>(map_scale);
    const Eigen::Vector3d around = 2 * numbers_at(map).reverse().cast<double>() - Eigen::Vector3d::Ones();
    return Eigen::Vector3d(around.cwiseProduct(Eigen::Vector3d(scale, scale, 1)));
  };
  SurfaceMaterial found;
  found.base = material_albedo(mesh, triangle, uv, colour_rgb).cast<double>();
  found.is_unlit = material.unlit;
  found.metallic = static_cast<double>(material.metallic);
  found.roughness = static_cast<double>(material.roughness);
  found.is_diffuse =
      material.metallic == 0 && material.roughness == 1 && maps.metallic_roughness.image.empty();
  found.emitted = material.emitted.reverse().cast<double>();
  found.along = Eigen::Vector3d::UnitZ();
  if (!maps.metallic_roughness.image.empty()) {
    const Eigen::Vector3f numbers = numbers_at(maps.metallic_roughness);
    found.metallic *= static_cast<double>(numbers[0]);
    found.roughness *= static_cast<double>(numbers[1]);
  }
  if (!maps.occlusion.image.empty()) {
    const auto red = static_cast<double>(numbers_at(maps.occlusion)[2]);
    found.occlusion = 1 - static_cast<double>(maps.occlusion_strength) * (1 - red);
  }
  if (!maps.emission.image.empty())
    found.emitted.array() *=
        between_texels(maps.emission.image, maps.emission.in_second_uvs ? second_uv : uv, repeated_texel)
            .cast<double>()
            .array();
  const bool has_tangents = !mesh.tangents.empty();
  if (!maps.normals.image.empty() && has_tangents) found.along = relief_at(maps.normals, maps.normal_scale);
  const scene::Clearcoat& coat = material.coat;
  found.coat = static_cast<double>(coat.factor);
  found.coat_roughness = static_cast<double>(coat.roughness);
  if (!coat.factor_map.image.empty()) found.coat *= static_cast<double>(numbers_at(coat.factor_map)[2]);
  if (!coat.roughness_map.image.empty())
    found.coat_roughness *= static_cast<double>(numbers_at(coat.roughness_map)[1]);
  if (!coat.normals.image.empty() && has_tangents)
    found.coat_along = relief_at(coat.normals, coat.normal_scale);
  return found;
}

}  // namespace limn::sim
