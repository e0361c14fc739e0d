#include "sim/reference_renderer.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/core.hpp>

#include "core/names.h"
#include "core/result.h"
#include "scene/meshes/closed_pieces.h"
#include "scene/volume_part.h"
#include "sim/directions.h"
#include "sim/slice_light.h"
#include "sim/texture.h"

namespace limn::sim {
namespace {

// m; a surface part within this distance is on the prototype (docs/formats.md).
constexpr double k_on_surface = 2e-3;
// Samples along each side of a pixel on an edge: its cover is then accurate to 1/128.
constexpr int k_sub_samples = 8;
// Share of full light, 1/255: samples that differ by less count as one colour.
constexpr float k_same_light = 0.004F;

std::vector<MeshInstance> prototype_of(const World& world) {
  const Object* prototype = world.find("prototype");
  if (prototype == nullptr) return {};
  return {{prototype->mesh.get(), prototype->world_from_object}};
}

RayScene rays_of(const MeshInstance& mesh) { return RayScene(std::span(&mesh, 1)); }

Eigen::Vector3d turned_against(const Eigen::Vector3d& n, const Eigen::Vector3d& d) {
  return n.dot(d) > 0 ? Eigen::Vector3d(-n) : n;
}

// The normal n, turned perpendicular to d if it would face away from the viewer (at a silhouette).
Eigen::Vector3d turned_to_viewer(const Eigen::Vector3d& n, const Eigen::Vector3d& d) {
  return n.dot(d) > 0 ? Eigen::Vector3d((n - n.dot(d) * d).normalized()) : n;
}

std::shared_ptr<const RoomImageSizes> image_sizes_of(const scene::Scene& scene) {
  return scene.room_image ? std::make_shared<RoomImageSizes>(*scene.room_image) : nullptr;
}

}  // namespace

ReferenceRenderer::ReferenceRenderer(const World& world, const scene::PosedScene& parts, const Imager& viewer)
    : world_(world),
      prototype_(prototype_of(world)),
      p_viewer_(viewer.imager_from_world.inverse().translation),
      light_(PartsLight::beside(viewer)) {
  LIMN_CHECK(world.scene.has_value());
  if (const auto& room = parts.light ? parts.light : world.scene->light)
    light_ = {*room, image_sizes_of(*world.scene), true};
  finish_ = find_named(world.scene->finishes, parts.finish);
  cut_ = parts.cut;
  lines_ = ReferenceLines(*world.scene, parts);
  if (const Object* prototype = world.find("prototype"))
    prototype_from_world_ = prototype->world_from_object.inverse();
  for (const scene::PosedPart& posed : parts.parts) {
    const scene::Slot* slot = world.scene->find_slot(posed.slot);
    LIMN_CHECK(slot != nullptr);
    const scene::Variant* variant = find_named(slot->variants, posed.variant);
    LIMN_CHECK(variant != nullptr);
    const auto& section = world.scene->section;
    const bool is_cut = parts.cut && section && section->cuts(slot->name);
    parts_.push_back({rays_of({&variant->mesh, posed.world_from_part}), &variant->mesh,
                      slot->mode == scene::Mode::surface,
                      1 + static_cast<int>(slot - world.scene->slots.data()), posed.world_from_part.inverse(),
                      is_cut, is_cut ? scene::are_of_closed_pieces(variant->mesh) : std::vector<bool>(),
                      variant->volume.get(), scene::shown_window(*variant, posed.window)});
  }
}

// A pixel whose corners agree with its centre gets one sample; other pixels are averaged over a grid of
// samples.
template <class SampleAt>
PartImage ReferenceRenderer::averaged(const Imager& imager, const SampleAt& sample_at) {
  const Directions directions(imager);
  const Eigen::Vector3d p_imager = imager.imager_from_world.inverse().translation;
  const auto along = [&](const Eigen::Vector3f& d) {
    return d.allFinite() ? sample_at(Ray{p_imager, d.cast<double>().normalized()}) : Sample{};
  };
  const auto width = static_cast<std::size_t>(imager.width);
  const auto corner_row = [&](int row) {
    std::vector<Eigen::Vector3f> d(width + 1);
    directions.row(-0.5, row - 0.5, d);
    std::vector<Sample> samples(d.size());
    std::transform(d.begin(), d.end(), samples.begin(), along);
    return samples;
  };
  const auto agree = [](const Sample& a, const Sample& b) {
    return a.part == b.part && (a.light - b.light).cwiseAbs().maxCoeff() < k_same_light;
  };
  PartImage out{cv::Mat(imager.height, imager.width, CV_32FC3, cv::Scalar::all(0)),
                cv::Mat(imager.height, imager.width, CV_32F, cv::Scalar(0))};
  const auto average = [&](int column, int row) {
    Eigen::Vector3f light = Eigen::Vector3f::Zero();
    float cover = 0;
    for (int k = 0; k < k_sub_samples * k_sub_samples; ++k) {
      const double x = column + (k % k_sub_samples + 0.5) / k_sub_samples - 0.5;
      const double y = row + (k / k_sub_samples + 0.5) / k_sub_samples - 0.5;
      const Sample sample = along(directions.at(x, y));
      light += sample.light;
      cover += sample.part >= 0 ? 1.0F : 0.0F;
    }
    constexpr float k_share = 1.0F / (k_sub_samples * k_sub_samples);
    return std::pair<Eigen::Vector3f, float>(light * k_share, cover * k_share);
  };
  constexpr int k_strip = 16;  // rows of a strip; the corner row between strips is traced twice
  cv::parallel_for_({0, (imager.height + k_strip - 1) / k_strip}, [&](const cv::Range& strips) {
    for (int row = strips.start * k_strip; row < std::min(imager.height, strips.end * k_strip); ++row) {
      const std::vector<Sample> above = corner_row(row), below = corner_row(row + 1);
      std::vector<Eigen::Vector3f> d(width);
      directions.row(0, row, d);
      for (std::size_t i = 0; i < width; ++i) {
        const Sample centre = along(d[i]);
        const bool plain = agree(centre, above[i]) && agree(centre, above[i + 1]) &&
                           agree(centre, below[i]) && agree(centre, below[i + 1]);
        const auto column = static_cast<int>(i);
        const auto [light, cover] =
            plain ? std::pair<Eigen::Vector3f, float>(centre.light, centre.part >= 0 ? 1.0F : 0.0F)
                  : average(column, row);
        out.light.at<cv::Vec3f>(row, column) = {light.x(), light.y(), light.z()};
        out.cover.at<float>(row, column) = cover;
      }
    }
  });
  return out;
}

// The first surface of a part that is kept, and how often the ray leaves closed pieces on the kept side more
// than it enters them: that is how often they wind around the point where the ray meets the plane.
Hit ReferenceRenderer::first_kept(const Part& part, const Ray& ray, int* windings) const {
  constexpr double k_step = 1e-6;  // m; the ray goes on behind a surface after this distance
  constexpr int k_most_surfaces = 4096;
  Hit first;
  *windings = 0;
  double from = 0;
  for (int count = 0; count < k_most_surfaces; ++count) {
    Hit hit = part.rays.next_surface({ray.p_origin + from * ray.d, ray.d});
    if (hit.object < 0) break;
    hit.distance += from;
    from = hit.distance + k_step;
    if (height_over(*cut_, ray.p_origin + hit.distance * ray.d) > -scene::k_cut_margin_m) continue;
    if (part.closed[static_cast<std::size_t>(hit.triangle)])
      *windings += part.rays.face_normal(hit).dot(ray.d) > 0 ? 1 : -1;
    if (first.object < 0 && !is_cut_out(*part.mesh, hit.triangle, part.rays.uv(hit))) first = hit;
  }
  return first;
}

// What a ray first meets of a part: its surface, or the cap where the plane cuts it open.
ReferenceRenderer::Nearest ReferenceRenderer::first_of(std::size_t index, const Ray& ray) const {
  const Part& part = parts_[index];
  if (!part.is_cut) {
    const Hit hit = part.rays.first_hit(ray);
    return {hit.object < 0 ? -1 : static_cast<int>(index), hit};
  }
  int windings = 0;
  const Hit hit = first_kept(part, ray, &windings);
  const double to_plane = -height_over(*cut_, ray.p_origin) / cut_->normal.dot(ray.d);
  const bool is_capped = windings != 0 && to_plane > 0 && std::isfinite(to_plane);
  if (is_capped && (hit.object < 0 || to_plane < hit.distance)) {
    Hit cap;
    cap.object = 0;
    cap.distance = to_plane;
    return {static_cast<int>(index), cap, ray.p_origin + to_plane * ray.d};
  }
  return {hit.object < 0 ? -1 : static_cast<int>(index), hit};
}

// A cap with its lines. This function alone says what a cap looks like.
Eigen::Vector3f ReferenceRenderer::cap_colour(const Part& part, const Eigen::Vector3d& p) const {
  if (part.volume)
    return Eigen::Vector3f::Constant(
        static_cast<float>(slice_light(*part.volume, part.window, part.part_from_world * p)));
  const scene::Section& section = *world_.scene->section;
  const Eigen::Vector3d across =
      scene::across_hatch(part.part_from_world.rotation * cut_->normal, part.owner);
  const double phase = across.dot(part.part_from_world * p) / section.hatch_m;
  const bool is_line = phase - std::floor(phase) < scene::k_hatch_line;
  const Eigen::Vector3d bgr = section.cap_colour.reverse();
  return ((is_line ? scene::k_hatch_colour : 1.0) * bgr).cast<float>();
}

ReferenceRenderer::Nearest ReferenceRenderer::nearest_part(const Ray& ray) const {
  Nearest nearest;
  nearest.hit.distance = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < parts_.size(); ++i)
    if (const Nearest found = first_of(i, ray); found.part >= 0 && found.hit.distance < nearest.hit.distance)
      nearest = found;
  return nearest;
}

// Whether the prototype hides the part that a ray hits first. A surface part may lie up to 2 mm inside it.
bool ReferenceRenderer::is_hidden(const Nearest& nearest, const Ray& ray, const Hit& behind) const {
  if (behind.object < 0) return false;
  const double cosine = std::abs(prototype_.face_normal(behind).dot(ray.d));
  const bool on_surface = parts_[static_cast<std::size_t>(nearest.part)].on_surface;
  return (nearest.hit.distance - behind.distance) * cosine > (on_surface ? k_on_surface : 0);
}

SurfaceMaterial ReferenceRenderer::material_at(const Part& part, const Hit& hit) {
  return surface_material(*part.mesh, hit.triangle, part.rays.uv(hit), part.rays.colour(hit),
                          part.rays.second_uv(hit));
}

Eigen::Vector3f ReferenceRenderer::radiance_along(const Eigen::Vector3d& d,
                                                  const Nearest& nearest,
                                                  const PartsLight& light) const {
  const Part& part = parts_[static_cast<std::size_t>(nearest.part)];
  if (nearest.p_cap) return cap_colour(part, *nearest.p_cap);
  const SurfaceMaterial material = material_at(part, nearest.hit);
  if (material.is_unlit) return material.base.cast<float>();
  const Eigen::Vector3d face = turned_against(part.rays.face_normal(nearest.hit), d);
  const double side = part.rays.shading_normal(nearest.hit).dot(face) < 0 ? -1 : 1;
  const auto turned = [&](const Eigen::Vector3d& along) {
    return turned_to_viewer(side * part.rays.mapped_normal(nearest.hit, along), d);
  };
  return shaded(material, turned(material.along), -d, light.room, turned(material.coat_along),
                light.image_sizes.get())
      .cast<float>();
}

// If no room light is known, the light comes along the prototype's normal and nothing is reflected
// specularly.
Eigen::Vector3f ReferenceRenderer::radiance_on_surface(const Nearest& nearest,
                                                       const Eigen::Vector3d& d_normal) const {
  const Part& part = parts_[static_cast<std::size_t>(nearest.part)];
  const SurfaceMaterial material = material_at(part, nearest.hit);
  if (material.is_unlit) return material.base.cast<float>();
  const double side = part.rays.shading_normal(nearest.hit).dot(d_normal) < 0 ? -1 : 1;
  const auto turned = [&](const Eigen::Vector3d& along) {
    return turned_to_viewer(side * part.rays.mapped_normal(nearest.hit, along), -d_normal);
  };
  const Eigen::Vector3d n = turned(material.along);
  if (light_.is_room_light)
    return shaded(material, n, d_normal, light_.room, turned(material.coat_along), light_.image_sizes.get())
        .cast<float>();
  const Eigen::Vector3d light = material.occlusion * light_.room.above_rgb.reverse() +
                                n.dot(d_normal) * light_.room.lamps[0].strength_rgb.reverse();
  return (material.base.cwiseProduct(light) + material.emitted).cast<float>();
}

// The view part that the viewer sees in front of p, a point of the prototype.
ReferenceRenderer::Sample ReferenceRenderer::view_sample(const Eigen::Vector3d& p,
                                                         const Eigen::Vector3d& n_face) const {
  const double distance = (p - p_viewer_).norm();
  const Ray ray{p_viewer_, (p - p_viewer_) / distance};
  if (n_face.dot(ray.d) >= 0) return {};  // the viewer sees the other side
  const Nearest nearest = nearest_part(ray);
  if (nearest.part < 0 || nearest.hit.distance > distance) return {};
  if (parts_[static_cast<std::size_t>(nearest.part)].on_surface) return {};
  if (!prototype_.reached(p_viewer_, p)) return {};
  return {nearest.part, radiance_along(ray.d, nearest, light_)};
}

// The surface part nearest to p along the normal, within 2 mm on either side.
ReferenceRenderer::Sample ReferenceRenderer::surface_sample(const Eigen::Vector3d& p,
                                                            const Eigen::Vector3d& n) const {
  Nearest best;
  double best_height = k_on_surface;
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    if (!parts_[i].on_surface) continue;
    for (const double side : {-1.0, 1.0}) {
      const Ray ray{p + side * k_on_surface * n, -side * n};
      int windings = 0;
      const Hit hit =
          parts_[i].is_cut ? first_kept(parts_[i], ray, &windings) : parts_[i].rays.first_hit(ray);
      const double height = std::abs(k_on_surface - hit.distance);
      if (hit.object < 0 || height > best_height) continue;
      best = {static_cast<int>(i), hit};
      best_height = height;
    }
  }
  if (best.part < 0) return {};
  return {best.part, radiance_on_surface(best, n)};
}

// The finish's material at a point of the prototype, in the world.
SurfaceMaterial ReferenceRenderer::finish_at(const Hit& hit, const Eigen::Vector3d& p) const {
  SurfaceMaterial material;
  material.base = finish_->base_colour.reverse();
  material.metallic = finish_->metallic;
  material.roughness = finish_->roughness;
  material.is_diffuse = finish_->metallic == 0 && finish_->roughness == 1;
  material.emitted.setZero();
  material.coat = finish_->clearcoat;
  material.coat_roughness = finish_->clearcoat_roughness;
  if (!finish_->image) return material;
  Eigen::Vector2f uv = prototype_.uv(hit);
  if (const auto& projection = finish_->image->projection) {
    const Eigen::Vector3d p_image = projection->prototype_from_image.inverse() * (prototype_from_world_ * p);
    uv = (p_image.head<2>().cwiseQuotient(projection->size_m).array() + 0.5).matrix().cast<float>();
  }
  const bool is_inside = uv.minCoeff() >= 0 && uv.maxCoeff() <= 1;
  if (!is_inside && !finish_->image->repeats) return material;
  const Eigen::Vector4d over = repeated_texture(finish_->image->texture.image, uv).cast<double>();
  material.base = (1 - over.w()) * material.base + over.w() * over.head<3>();
  return material;
}

// The finish where a ray meets the prototype, as seen from p_eye if it is for a viewer.
ReferenceRenderer::Sample ReferenceRenderer::finish_sample(const Hit& hit,
                                                           const Ray& ray,
                                                           const Eigen::Vector3d& p_eye,
                                                           const PartsLight& light) const {
  if (finish_ == nullptr || hit.object < 0) return {};
  const Eigen::Vector3d p = ray.p_origin + hit.distance * ray.d, d = (p - p_eye).normalized();
  const Eigen::Vector3d n_face = turned_against(prototype_.face_normal(hit), ray.d);
  const Eigen::Vector3d n = turned_against(prototype_.shading_normal(hit), -n_face);
  const SurfaceMaterial material = finish_at(hit, p);
  const int part = static_cast<int>(parts_.size());
  if (finish_->for_viewer && n_face.dot(d) < 0)
    return {
        part,
        shaded(material, turned_to_viewer(n, d), -d, light.room, {}, light.image_sizes.get()).cast<float>()};
  if (light.is_room_light)
    return {part, shaded(material, n, n, light.room, {}, light.image_sizes.get()).cast<float>()};
  const Eigen::Vector3d from_front =
      light.room.above_rgb.reverse() + light.room.lamps[0].strength_rgb.reverse();
  return {part, material.base.cwiseProduct(from_front).cast<float>()};
}

// The line of light there, else the finish.
ReferenceRenderer::Sample ReferenceRenderer::paint_sample(const Hit& hit,
                                                          const Ray& ray,
                                                          const Eigen::Vector3d& p_eye,
                                                          const PartsLight& light) const {
  if (hit.object < 0) return {};
  const Eigen::Vector3d p = ray.p_origin + hit.distance * ray.d;
  const auto line = lines_.colour_at(prototype_from_world_ * p,
                                     prototype_from_world_.rotation * prototype_.face_normal(hit));
  if (!line) return finish_sample(hit, ray, p_eye, light);
  return {static_cast<int>(parts_.size()), line->reverse().cast<float>()};
}

ReferenceRenderer::Sample ReferenceRenderer::light_along(const Ray& ray) const {
  const Hit hit = prototype_.first_hit(ray);
  if (hit.object < 0) return {};
  const Eigen::Vector3d p = ray.p_origin + hit.distance * ray.d;
  const Eigen::Vector3d n_face = turned_against(prototype_.face_normal(hit), ray.d);
  const Sample view = view_sample(p, n_face);
  if (view.part >= 0) return view;
  const Sample on_surface = surface_sample(p, turned_against(prototype_.shading_normal(hit), -n_face));
  return on_surface.part >= 0 ? on_surface : paint_sample(hit, ray, p_viewer_, light_);
}

ReferenceRenderer::Sample ReferenceRenderer::parts_along(const Ray& ray, const PartsLight& light) const {
  const Nearest nearest = nearest_part(ray);
  if (nearest.part < 0 && finish_ == nullptr && lines_.is_empty()) return {};
  const Hit prototype = prototype_.first_hit(ray);
  if (nearest.part < 0 || is_hidden(nearest, ray, prototype))
    return paint_sample(prototype, ray, ray.p_origin, light);
  const Part& part = parts_[static_cast<std::size_t>(nearest.part)];
  if (part.on_surface && !nearest.p_cap)
    return {nearest.part, radiance_on_surface(nearest, part.rays.shading_normal(nearest.hit))};
  return {nearest.part, radiance_along(ray.d, nearest, light)};
}

PartImage ReferenceRenderer::projector_image(std::size_t index) const {
  return averaged(world_.rig.projectors.at(index), [&](const Ray& ray) { return light_along(ray); });
}

PartImage ReferenceRenderer::parts_image(const Imager& imager) const {
  const PartsLight light = light_.is_room_light ? light_ : PartsLight::beside(imager);
  return averaged(imager, [&](const Ray& ray) { return parts_along(ray, light); });
}

DepthOrder ReferenceRenderer::depth_order(const Imager& imager) const {
  const Directions directions(imager);
  const Eigen::Vector3d p_imager = imager.imager_from_world.inverse().translation;
  DepthOrder out{cv::Mat(imager.height, imager.width, CV_16S, cv::Scalar(-1)),
                 cv::Mat(imager.height, imager.width, CV_8U, cv::Scalar(0))};
  cv::parallel_for_({0, imager.height}, [&](const cv::Range& rows) {
    std::vector<Eigen::Vector3f> d(static_cast<std::size_t>(imager.width));
    for (int row = rows.start; row < rows.end; ++row) {
      directions.row(0, row, d);
      for (int column = 0; column < imager.width; ++column) {
        const Eigen::Vector3f& direction = d[static_cast<std::size_t>(column)];
        if (!direction.allFinite()) continue;
        const Ray ray{p_imager, direction.cast<double>().normalized()};
        const Nearest nearest = nearest_part(ray);
        if (nearest.part < 0) continue;
        const Hit behind = prototype_.first_hit(ray);
        const bool crossed = std::any_of(parts_.begin(), parts_.end(), [&](const Part& part) {
          return &part != &parts_[static_cast<std::size_t>(nearest.part)] &&
                 part.rays.first_hit(ray).object >= 0;
        });
        if (behind.object >= 0 || crossed) out.contested.at<std::uint8_t>(row, column) = 255;
        if (!is_hidden(nearest, ray, behind))
          out.front.at<std::int16_t>(row, column) = static_cast<std::int16_t>(nearest.part);
      }
    }
  });
  return out;
}

}  // namespace limn::sim
