#include "sim/reference_brdf.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <span>

namespace limn::sim {
namespace {

using Eigen::Vector3d;

// The light if no room light is known: soft light around the viewer's up direction and a lamp above the left
// shoulder.
constexpr double k_soft_below = 0.15, k_soft_above = 0.35, k_lamp = 0.65;
const Vector3d k_d_lamp_viewer = Vector3d(-0.36, -0.64, -0.68).normalized();

constexpr double k_dielectric = 0.04;       // reflectance at normal incidence, glTF 2.0
constexpr double k_lamp_roughness = 0.2;    // smallest roughness for lamps, because real lamps have a size
constexpr double k_least_roughness = 0.03;  // smoother surfaces reflect soft light equally
// The soft light's horizon is wide: all light from this height on is `above`.
constexpr double k_horizon_height = 0.3;
// Directions of reflected soft light: accurate to 0.4 %, see reference_brdf_test.
constexpr int k_directions = 256;
constexpr int k_image_directions = 512;  // for a picture of the room, which is less smooth
constexpr int k_fresnel_directions = 1024, k_fresnel_nodes = 65;

Vector3d bgr(const Vector3d& rgb) { return rgb.reverse(); }

// Point i of a low-discrepancy sequence in the unit square (additive sequence of the plastic number).
Eigen::Vector2d even_point(int i) {
  constexpr double k_x = 0.7548776662466927, k_y = 0.5698402909980532;
  const double x = 0.5 + k_x * i, y = 0.5 + k_y * i;
  return {x - std::floor(x), y - std::floor(y)};
}

// The light that surfaces reflect: a room's soft light and lamps, and a picture of the room.
struct Light {
  const scene::RoomLight& room;
  const RoomImageSizes* image_sizes;  // null: none
  bool has_image() const { return image_sizes != nullptr && room.image_strength > 0; }
};

// Soft light from direction d, which stands for a solid angle, as the light of a white diffuse surface in
// uniform light of this strength.
Vector3d soft_from(const Light& light, const Vector3d& d, double solid_angle) {
  const scene::RoomLight& room = light.room;
  const double height = std::clamp(d.dot(room.d_up_world) / k_horizon_height, -1.0, 1.0);
  const double above = 0.5 + 0.75 * height - 0.25 * height * height * height;
  Vector3d soft = bgr(room.below_rgb + above * (room.above_rgb - room.below_rgb));
  return light.has_image() ? Vector3d(soft + room.image_strength * light.image_sizes->from(d, solid_angle))
                           : soft;
}

// All soft light reflected by a white diffuse surface.
Vector3d soft_on(const Light& light, const Vector3d& n) {
  const double above = (1 + n.dot(light.room.d_up_world)) / 2;
  Vector3d soft = bgr((1 - above) * light.room.below_rgb + above * light.room.above_rgb);
  if (!light.has_image()) return soft;
  const Vector3d d_u = n.unitOrthogonal(), d_v = n.cross(d_u);
  Vector3d sum = Vector3d::Zero();
  for (int i = 0; i < k_image_directions; ++i) {
    const Eigen::Vector2d at = even_point(i);
    const double ring = std::sqrt(at.x()), angle = 2 * std::numbers::pi * at.y();
    const Vector3d d = ring * (std::cos(angle) * d_u + std::sin(angle) * d_v) + std::sqrt(1 - at.x()) * n;
    sum += light.image_sizes->from(d, std::numbers::pi / (k_image_directions * std::max(0.05, d.dot(n))));
  }
  return soft + light.room.image_strength / k_image_directions * sum;
}

double schlick(double cosine) {
  const double x = 1 - std::clamp(cosine, 0.0, 1.0);
  return x * x * x * x * x;
}

Vector3d fresnel(const Vector3d& f0, double cosine) { return f0 + (Vector3d::Ones() - f0) * schlick(cosine); }

// Smith's height-correlated visibility for GGX: G / (4 NL NV).
double visibility(double nl, double nv, double alpha) {
  const auto root = [&](double c) { return std::sqrt(alpha * alpha + (1 - alpha * alpha) * c * c); };
  return 0.5 / (nl * root(nv) + nv * root(nl));
}

double ggx(double nh, double alpha) {
  const double f = (nh * nh) * (alpha * alpha - 1) + 1;
  return alpha * alpha / (std::numbers::pi * f * f);
}

// Mean of Schlick's term over all light that a diffuse surface receives, as a function of the cosine to the
// viewer.
double mean_schlick(double cosine) {
  static const std::array<double, k_fresnel_nodes> table = [] {
    std::array<double, k_fresnel_nodes> means{};
    for (int node = 0; node < k_fresnel_nodes; ++node) {
      const double z = static_cast<double>(node) / (k_fresnel_nodes - 1);
      const Vector3d d_view(std::sqrt(1 - z * z), 0, z);
      for (int i = 0; i < k_fresnel_directions; ++i) {
        const Eigen::Vector2d at = even_point(i);
        const double ring = std::sqrt(at.x()), angle = 2 * std::numbers::pi * at.y();
        const Vector3d d(ring * std::cos(angle), ring * std::sin(angle), std::sqrt(1 - at.x()));
        means[static_cast<std::size_t>(node)] +=
            schlick(d_view.dot((d_view + d).normalized())) / k_fresnel_directions;
      }
    }
    return means;
  }();
  const double at = std::clamp(cosine, 0.0, 1.0) * (k_fresnel_nodes - 1);
  const auto node = std::min<std::size_t>(static_cast<std::size_t>(at), k_fresnel_nodes - 2);
  const double share = at - static_cast<double>(node);
  return (1 - share) * table[node] + share * table[node + 1];
}

// Slopes of half vectors along u and v, distributed as GGX with alpha 1.
template <int k_count>
const std::array<Eigen::Vector2d, k_count>& slopes() {
  static const std::array<Eigen::Vector2d, k_count> all = [] {
    std::array<Eigen::Vector2d, k_count> made;
    for (int i = 0; i < k_count; ++i) {
      const Eigen::Vector2d at = even_point(i);
      const double angle = 2 * std::numbers::pi * at.y();
      made[static_cast<std::size_t>(i)] =
          std::sqrt(at.x() / (1 - at.x())) * Eigen::Vector2d(std::cos(angle), std::sin(angle));
    }
    return made;
  }();
  return all;
}

// The reflected soft light, by importance sampling of GGX half vectors.
Vector3d specular_soft_light(
    double roughness, const Vector3d& f0, const Vector3d& n, const Vector3d& d_view, const Light& light) {
  const double alpha = std::pow(std::max(roughness, k_least_roughness), 2);
  const double nv = std::max(1e-4, n.dot(d_view));
  const Vector3d d_u = n.unitOrthogonal(), d_v = n.cross(d_u);
  Vector3d sum = Vector3d::Zero();
  const std::span<const Eigen::Vector2d> all =
      light.has_image() ? std::span<const Eigen::Vector2d>(slopes<k_image_directions>())
                        : std::span<const Eigen::Vector2d>(slopes<k_directions>());
  for (const Eigen::Vector2d& slope : all) {
    const Vector3d h = (alpha * (slope.x() * d_u + slope.y() * d_v) + n).normalized();
    const double vh = d_view.dot(h), nh = n.dot(h);
    const Vector3d d = 2 * vh * h - d_view;
    const double nl = n.dot(d);
    if (nl <= 0 || vh <= 0) continue;
    // The density of half vectors is D nh; that of directions is lower by the factor 4 vh.
    const double density = ggx(nh, alpha) * nh / (4 * vh);  // number of directions in 1 sr
    const Vector3d from_there = soft_from(light, d, 1 / (static_cast<double>(all.size()) * density));
    sum += from_there.cwiseProduct(fresnel(f0, vh)) * (visibility(nl, nv, alpha) * nl * 4 * vh / nh);
  }
  return sum / static_cast<double>(all.size());
}

// What a clear layer mirrors where it mirrors everything: soft light and lamps, by GGX alone.
Vector3d mirrored_by_coat(const SurfaceMaterial& material,
                          const Vector3d& n,
                          const Vector3d& d_view,
                          const Light& light) {
  const double nv = std::max(1e-4, n.dot(d_view));
  const double alpha = std::pow(std::max(material.coat_roughness, k_lamp_roughness), 2);
  Vector3d sum =
      material.occlusion * specular_soft_light(material.coat_roughness, Vector3d::Ones(), n, d_view, light);
  for (const scene::RoomLight::Lamp& lamp : light.room.lamps) {
    const double nl = n.dot(lamp.d_world);
    if (nl <= 0) continue;
    const Vector3d h = (d_view + lamp.d_world).normalized();
    sum += nl * std::numbers::pi * ggx(n.dot(h), alpha) * visibility(nl, nv, alpha) * bgr(lamp.strength_rgb);
  }
  return sum;
}

}  // namespace

RoomImageSizes::RoomImageSizes(const scene::RoomImage& image) : sizes_{image} {
  while (sizes_.back().light.rows >= 8) {
    scene::RoomImage half = sizes_.back();
    cv::resize(sizes_.back().light, half.light, sizes_.back().light.size() / 2, 0, 0, cv::INTER_AREA);
    sizes_.push_back(half);
  }
}

Vector3d RoomImageSizes::from(const Vector3d& d_world, double solid_angle) const {
  const double pixel =
      2 * std::numbers::pi * std::numbers::pi / static_cast<double>(sizes_.front().light.total());
  const double size = std::round(0.5 * std::log2(std::max(1.0, solid_angle / pixel)));
  return sizes_[std::min(static_cast<std::size_t>(size), sizes_.size() - 1)].from(d_world).cast<double>();
}

PartsLight PartsLight::beside(const Imager& viewer) {
  const Eigen::Quaterniond world_from_viewer = viewer.imager_from_world.inverse().rotation;
  PartsLight light;
  light.room.d_up_world = world_from_viewer * -Vector3d::UnitY();
  light.room.below_rgb.setConstant(k_soft_below);
  light.room.above_rgb.setConstant(k_soft_above);
  light.room.lamps = {{world_from_viewer * k_d_lamp_viewer, Vector3d::Constant(k_lamp)}};
  return light;
}

Vector3d shaded(const SurfaceMaterial& material,
                const Vector3d& n,
                const Vector3d& d_view,
                const scene::RoomLight& room,
                const std::optional<Vector3d>& n_coat,
                const RoomImageSizes* image_sizes) {
  const Light light{room, image_sizes};
  const Vector3d diffuse = (1 - material.metallic) * material.base;
  const Vector3d f0 =
      (1 - material.metallic) * Vector3d::Constant(k_dielectric) + material.metallic * material.base;
  const double nv = std::max(1e-4, n.dot(d_view));
  const double alpha = std::pow(std::max(material.roughness, k_lamp_roughness), 2);
  Vector3d soft = diffuse.isZero() ? Vector3d(diffuse) : Vector3d(diffuse.cwiseProduct(soft_on(light, n)));
  Vector3d by_lamps = Vector3d::Zero();
  if (!material.is_diffuse) {
    const Vector3d mean = f0 + (Vector3d::Ones() - f0) * mean_schlick(nv);
    soft = soft.cwiseProduct(Vector3d::Ones() - mean) +
           specular_soft_light(material.roughness, f0, n, d_view, light);
  }
  for (const scene::RoomLight::Lamp& lamp : room.lamps) {
    const double nl = n.dot(lamp.d_world);
    if (nl <= 0) continue;
    Vector3d reflected = diffuse;  // without 1 / pi, because a lamp's strength contains the factor pi
    if (!material.is_diffuse) {
      const Vector3d h = (d_view + lamp.d_world).normalized();
      const Vector3d specular = fresnel(f0, d_view.dot(h));
      reflected = (Vector3d::Ones() - specular).cwiseProduct(diffuse) +
                  specular * (std::numbers::pi * ggx(n.dot(h), alpha) * visibility(nl, nv, alpha));
    }
    by_lamps += nl * reflected.cwiseProduct(bgr(lamp.strength_rgb));
  }
  Vector3d below = material.occlusion * soft + by_lamps + material.emitted;
  if (material.coat <= 0) return below;
  // The layer's share of mirrored light is that of glass at the angle of the view; it darkens what is below.
  const Vector3d& n_layer = n_coat.value_or(n);
  const double share =
      material.coat * (k_dielectric + (1 - k_dielectric) * schlick(std::abs(n_layer.dot(d_view))));
  return (1 - share) * below + share * mirrored_by_coat(material, n_layer, d_view, light);
}

}  // namespace limn::sim
