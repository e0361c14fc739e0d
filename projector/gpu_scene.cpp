#include "projector/gpu_scene.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <compare>
#include <cstdint>
#include <opencv2/imgproc.hpp>
#include <span>
#include <utility>

#include "core/log.h"
#include "core/photometric_response.h"
#include "core/result.h"
#include "projector/bindings.h"
#include "projector/brdf_lut.h"
#include "projector/cap_counter.h"
#include "scene/meshes/closed_pieces.h"

namespace limn::projector {
namespace {

constexpr int k_cluster = 128;  // triangles in a cluster

// As in shaders/scene.glsl.
struct GpuMaterial {
  Eigen::Vector4f colour;      // a: 1 when unlit
  Eigen::Vector4f parameters;  // texture layer (-1 when it has none), metallic, roughness, alpha cutoff
  Eigen::Vector4f emitted = {0, 0, 0, -1};
  Eigen::Vector4f maps = {-1, -1, 1, 1};
  Eigen::Vector4i more = Eigen::Vector4i::Zero();
  Eigen::Vector4f coat = {0, 0, 1, -1};
  Eigen::Vector4f more_maps = {-1, -1, -1, 0};
  Eigen::Vector4i second = Eigen::Vector4i::Zero();
  Eigen::Vector4f image_u = Eigen::Vector4f::Zero(), image_v = Eigen::Vector4f::Zero();
};

// As in shaders/material.glsl.
constexpr int k_second_map = 1, k_second_normals = 2, k_second_occlusion = 4, k_second_emission = 8,
              k_second_coat = 16, k_second_coat_roughness = 32, k_second_coat_normals = 64;

template <class T>
GlName buffer_of(const std::vector<T>& items) {
  return make_buffer(items.data(), items.size() * sizeof(T));
}

std::size_t triangles_of(const scene::Scene& scene) {
  std::size_t count = scene.prototype ? scene.prototype->mesh.triangles.size() : 0;
  for (const scene::Slot& slot : scene.slots)
    for (const scene::Variant& variant : slot.variants) count += variant.mesh.triangles.size();
  return count;
}

// Number of triangles with tangents, plus those of triangles with second uvs and with colours: these are
// stored after the normals.
std::size_t triangles_after_normals(const scene::Scene& scene) {
  const auto of = [](const scene::Mesh& mesh) {
    return (mesh.tangents.empty() ? 0 : mesh.triangles.size()) +
           (mesh.second_uvs.empty() ? 0 : mesh.triangles.size()) +
           (mesh.colours.empty() ? 0 : mesh.triangles.size());
  };
  std::size_t count = scene.prototype ? of(scene.prototype->mesh) : 0;
  for (const scene::Slot& slot : scene.slots)
    for (const scene::Variant& variant : slot.variants) count += of(variant.mesh);
  return count;
}

// As in shaders/scene.glsl.
struct GpuTriangle {
  std::uint32_t owner = 0, material = 0;
  std::array<std::uint32_t, 3> beside = {0, 0, 0};  // ids
};

constexpr std::size_t k_triangle_texels = sizeof(GpuTriangle) / sizeof(std::uint32_t);

// Volume of the tetrahedron of the origin and a triangle. Its sum over a closed mesh is the mesh's volume.
double signed_volume(const scene::Mesh& mesh, std::size_t triangle) {
  Eigen::Matrix3d corners;
  for (std::size_t k = 0; k < 3; ++k)
    corners.col(static_cast<Eigen::Index>(k)) = mesh.positions[mesh.triangles[triangle][k]].cast<double>();
  return corners.determinant() / 6;
}

// Whether the triangle across side k of a triangle has the same side, in the opposite direction, and is
// linked back to it. The mesh is the first one, so that its ids begin with 1.
bool is_linked_back(const scene::Mesh& mesh,
                    std::span<const GpuTriangle> linked,
                    std::size_t triangle,
                    std::size_t k) {
  const std::uint32_t id = linked[triangle].beside[k];
  if (id == 0) return false;
  const std::size_t other = id - 1;
  const auto corner = [&](std::size_t t, std::size_t i) { return mesh.positions[mesh.triangles[t][i % 3]]; };
  for (std::size_t j = 0; j < 3; ++j)
    if (linked[other].beside[j] == triangle + 1 && corner(other, j + 1) == corner(triangle, k + 2) &&
        corner(other, j + 2) == corner(triangle, k + 1))
      return true;
  return false;
}

// Whether a mesh bounds a solid: each side belongs to two triangles, which run along it in opposite
// directions, and each connected piece winds as seen from outside (its volume is positive).
bool is_solid(const scene::Mesh& mesh, std::span<const GpuTriangle> linked) {
  std::vector<bool> is_seen(linked.size());
  std::vector<std::size_t> to_visit;
  for (std::size_t start = 0; start < linked.size(); ++start) {
    if (is_seen[start]) continue;
    double volume = 0;
    to_visit = {start};
    is_seen[start] = true;
    while (!to_visit.empty()) {
      const std::size_t triangle = to_visit.back();
      to_visit.pop_back();
      volume += signed_volume(mesh, triangle);
      for (std::size_t k = 0; k < 3; ++k) {
        if (!is_linked_back(mesh, linked, triangle, k)) return false;
        const std::size_t next = linked[triangle].beside[k] - 1;
        if (!is_seen[next]) to_visit.push_back(next);
        is_seen[next] = true;
      }
    }
    if (volume <= 0) return false;
  }
  return !linked.empty();
}

// Appends a mesh's triangles with the ids of their neighbours. Where more than two triangles share a side,
// each gets one neighbour. Corners at the same position count as one.
void append_linked(const scene::Mesh& mesh, std::vector<GpuTriangle>* triangles) {
  const std::vector<std::uint32_t> place = scene::first_at_place(mesh);
  struct Side {
    std::uint32_t lower, upper;  // indices of positions
    std::uint32_t corner;        // index of the opposite corner, three for each triangle
    auto operator<=>(const Side&) const = default;
  };
  std::vector<Side> sides;
  sides.reserve(3 * mesh.triangles.size());
  for (const auto& triangle : mesh.triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = place[triangle[(k + 1) % 3]], b = place[triangle[(k + 2) % 3]];
      sides.push_back({std::min(a, b), std::max(a, b), static_cast<std::uint32_t>(sides.size())});
    }
  }
  std::sort(sides.begin(), sides.end());
  const std::size_t first = triangles->size();
  triangles->resize(first + mesh.triangles.size());
  const auto link = [&](const Side& from, const Side& to) {
    (*triangles)[first + from.corner / 3].beside[from.corner % 3] =
        static_cast<std::uint32_t>(first) + to.corner / 3 + 1;
  };
  for (std::size_t i = 1; i < sides.size(); ++i) {
    if (sides[i - 1].lower != sides[i].lower || sides[i - 1].upper != sides[i].upper) continue;
    link(sides[i - 1], sides[i]);
    link(sides[i], sides[i - 1]);
  }
}

int level_count(int side) { return 1 + static_cast<int>(std::floor(std::log2(side))); }

cv::Mat resized(const cv::Mat& image, const cv::Size& size) {
  cv::Mat out;
  cv::resize(image, out, size);
  return out;
}

// The layer of a texture in an array of textures. Adds it if it is not there yet.
float layer_of(const scene::Texture& texture, std::vector<scene::Texture>* layers) {
  const auto known = std::find_if(layers->begin(), layers->end(), [&](const scene::Texture& layer) {
    return layer.image.data == texture.image.data;
  });
  const auto layer = static_cast<float>(known - layers->begin());
  if (known == layers->end()) layers->push_back(texture);
  return layer;
}

// One layer for each texture, all resized to the largest width and height, so that a single sampler is enough
// and uv stays 0 to 1.
GlName make_layers(const std::vector<scene::Texture>& textures, GLenum format) {
  const int most = largest_texture();
  int width = 1, height = 1;
  for (const scene::Texture& texture : textures) {
    width = std::min(most, std::max(width, texture.image.cols));
    height = std::min(most, std::max(height, texture.image.rows));
  }
  const int count = std::max(1, static_cast<int>(textures.size()));
  GlName layers =
      make_texture(GL_TEXTURE_2D_ARRAY, format, width, height, count, level_count(std::max(width, height)));
  glTextureParameteri(*layers, GL_TEXTURE_MIN_FILTER, GL_LINEAR_MIPMAP_LINEAR);
  glTextureParameteri(*layers, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
  glTextureParameteri(*layers, GL_TEXTURE_WRAP_S, GL_REPEAT);
  glTextureParameteri(*layers, GL_TEXTURE_WRAP_T, GL_REPEAT);
  glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
  for (std::size_t i = 0; i < textures.size(); ++i) {
    const cv::Mat layer = resized(fitting_texture(textures[i].image, textures[i].file), {width, height});
    glTextureSubImage3D(*layers, 0, 0, 0, static_cast<GLint>(i), width, height, 1,
                        layer.channels() == 4 ? GL_BGRA : GL_BGR, GL_UNSIGNED_BYTE, layer.data);
  }
  if (!textures.empty()) glGenerateTextureMipmap(*layers);
  return layers;
}

// Packs occlusion, roughness and metalness into red, green and blue; a missing one is 1. An image that has
// all three is used as it is.
scene::Texture packed(const scene::SurfaceMaps& maps) {
  const scene::Texture &metal = maps.metallic_roughness, &open = maps.occlusion;
  if (metal.image.data == open.image.data) return metal;
  cv::Mat of_metal, of_open;
  if (!metal.image.empty()) of_metal = fitting_texture(metal.image, metal.file);
  if (!open.image.empty()) of_open = fitting_texture(open.image, open.file);
  const cv::Size size(std::max(of_metal.cols, of_open.cols), std::max(of_metal.rows, of_open.rows));
  for (cv::Mat* image : {&of_metal, &of_open})
    *image = image->empty() ? cv::Mat(size, CV_8UC3, cv::Scalar::all(255)) : resized(*image, size);
  const cv::Mat from[] = {of_metal, of_open};
  cv::Mat all(size, CV_8UC3);
  const int from_to[] = {0, 0, 1, 1, 5, 2};  // blue and green come from `of_metal`, red comes from `of_open`
  cv::mixChannels(from, 2, &all, 1, from_to, 3);
  return {all, metal.file.empty() ? open.file : metal.file};
}

// Adds the layer of a map to s_maps, and its bit if it lies in the second texture coordinates.
float add_map(const scene::Texture& map, int bit, GpuMaterial* gpu, std::vector<scene::Texture>* layers) {
  if (map.image.empty()) return -1;
  if (map.in_second_uvs) gpu->second.y() |= bit;
  return layer_of(map, layers);
}

// The layers of occlusion, roughness and metalness: one, or two where they lie in different coordinates.
void add_packed(const scene::SurfaceMaps& maps, GpuMaterial* gpu, std::vector<scene::Texture>* layers) {
  const scene::Texture &metal = maps.metallic_roughness, &open = maps.occlusion;
  if (metal.image.empty() && open.image.empty()) return;
  const bool are_apart =
      !metal.image.empty() && !open.image.empty() && metal.in_second_uvs != open.in_second_uvs;
  scene::Texture together = are_apart ? metal : packed(maps);
  together.in_second_uvs = metal.image.empty() ? open.in_second_uvs : metal.in_second_uvs;
  gpu->maps.x() = add_map(together, k_second_map, gpu, layers);
  if (are_apart) gpu->more_maps.z() = add_map(open, k_second_occlusion, gpu, layers);
}

// Makes a texture in the second coordinates plain: with its colour at (0, 0), where four of its texels meet.
void make_plain(scene::Texture* map, bool is_srgb) {
  if (map->image.empty() || !map->in_second_uvs) return;
  const cv::Mat& image = map->image;
  cv::Mat plain(1, 1, CV_8UC3);
  for (int c = 0; c < 3; ++c) {
    double sum = 0;
    for (const int row : {0, image.rows - 1})
      for (const int column : {0, image.cols - 1}) {
        const double value = image.at<cv::Vec3b>(row, column)[c] / 255.0;
        sum += is_srgb ? linear_from_srgb(value) : value;
      }
    const double mean = is_srgb ? srgb_from_linear(sum / 4) : sum / 4;
    plain.at<cv::Vec3b>(0, 0)[c] = cv::saturate_cast<std::uint8_t>(255 * mean);
  }
  map->image = plain;
  map->in_second_uvs = false;
}

// A material as a mesh without second texture coordinates shows it.
scene::Material without_second_uvs(scene::Material material) {
  scene::SurfaceMaps& maps = material.maps;
  scene::Clearcoat& coat = material.coat;
  for (scene::Texture* map : {&maps.metallic_roughness, &maps.normals, &maps.occlusion, &coat.factor_map,
                              &coat.roughness_map, &coat.normals})
    make_plain(map, false);
  make_plain(&maps.emission, true);
  return material;
}

}  // namespace

struct GpuScene::Staging {
  std::vector<Eigen::Vector4f> corners, normals;
  std::vector<Eigen::Vector4f> after_normals;  // tangents, second uvs and colours at the corners
  std::vector<GpuTriangle> triangles;
  std::vector<GpuMaterial> materials;
  std::vector<scene::Texture> colour_maps, maps;
};

std::size_t GpuScene::most_triangles() {
  GLint64 texels = 0;
  glGetInteger64v(GL_MAX_TEXTURE_BUFFER_SIZE, &texels);
  return static_cast<std::size_t>(texels) / k_triangle_texels;
}

Status GpuScene::check_fits(const scene::Scene& scene, std::size_t most) {
  const std::size_t count = triangles_of(scene) + triangles_after_normals(scene);
  if (count <= most) return {};
  return error(
      "scene: expected at most {} triangles in the prototype and all variants (the largest buffer of {}; "
      "triangles count once more for each of a normal map, second texture coordinates and colours at their "
      "vertices), found {}. Simplify the largest mesh.",
      most, reinterpret_cast<const char*>(glGetString(GL_RENDERER)), count);
}

GpuScene::GpuScene(const scene::Scene& scene) : section_(scene.section), volumes_(scene), lines_(scene) {
  Staging staging;
  const std::size_t count = triangles_of(scene);
  // The neighbours come first, so that their temporary memory is freed before the corners and normals need
  // memory.
  staging.triangles.reserve(count);
  if (scene.prototype) append_linked(scene.prototype->mesh, &staging.triangles);
  const bool is_prototype_solid = scene.prototype && is_solid(scene.prototype->mesh, staging.triangles);
  for (const scene::Slot& slot : scene.slots)
    for (const scene::Variant& variant : slot.variants) append_linked(variant.mesh, &staging.triangles);
  staging.corners.reserve(3 * count);
  staging.normals.reserve(3 * count);
  if (scene.prototype) {
    prototype_ = add(scene.prototype->mesh, 0, &staging);
    prototype_->is_solid = is_prototype_solid;
  }
  for (const scene::Slot& slot : scene.slots) {
    SlotRuns runs{slot.name, slot.mode == scene::Mode::surface, {}};
    const int owner = owner_count();
    for (const scene::Variant& variant : slot.variants) {
      runs.variants.emplace(variant.name, add(variant.mesh, owner, &staging));
    }
    slots_.push_back(std::move(runs));
  }
  has_room_image_ = scene.room_image.has_value();
  for (const scene::Finish& finish : scene.finishes) add_finish(finish, &staging);
  constexpr int k_deviation = 8;  // as in shaders/deviation.glsl
  add_finish({}, &staging);
  staging.materials.back().second.z() = k_deviation;
  deviation_words_ = buffer_of(std::vector<std::uint32_t>(1));
  corners_ = buffer_of(std::exchange(staging.corners, {}));  // each array is freed after its upload
  staging.normals.insert(staging.normals.end(), staging.after_normals.begin(), staging.after_normals.end());
  normals_ = buffer_of(std::exchange(staging.normals, {}));
  triangles_ = buffer_of(std::exchange(staging.triangles, {}));
  materials_ = buffer_of(staging.materials);
  gpu_owners_.resize(static_cast<std::size_t>(owner_count()));
  placements_ = buffer_of(gpu_owners_);
  corner_texels_ = make_texels(corners_, GL_RGBA32F);
  normal_texels_ = make_texels(normals_, GL_RGBA32F);
  triangle_texels_ = make_texels(triangles_, GL_R32UI);
  placement_texels_ = make_texels(placements_, GL_RGBA32F);
  colour_maps_ = make_layers(staging.colour_maps, GL_SRGB8_ALPHA8);
  // 16 bits for 8-bit images: software GL interpolates texels with the precision of the format.
  maps_ = make_layers(staging.maps, GL_RGBA16);
  const cv::Mat& lut = brdf_lut();
  brdf_lut_ = make_texture(GL_TEXTURE_2D, GL_RGBA32F, lut.cols, lut.rows);
  for (const GLenum filter : {GL_TEXTURE_MIN_FILTER, GL_TEXTURE_MAG_FILTER})
    glTextureParameteri(*brdf_lut_, filter, GL_LINEAR);
  upload(brdf_lut_, lut);

  vertex_array_ = make_vertex_array();
  glVertexArrayVertexBuffer(*vertex_array_, 0, *corners_, 0, sizeof(Eigen::Vector4f));
  glVertexArrayAttribFormat(*vertex_array_, 0, 4, GL_FLOAT, GL_FALSE, 0);
  glVertexArrayAttribBinding(*vertex_array_, 0, 0);
  glEnableVertexArrayAttrib(*vertex_array_, 0);
}

void GpuScene::add_material(const scene::Material& material, const scene::Mesh& mesh, Staging* staging) {
  const bool has_uvs = !mesh.uvs.empty();
  GpuMaterial gpu{material.base_colour.homogeneous(), Eigen::Vector4f::Constant(-1)};
  gpu.colour.w() = material.unlit ? 1 : 0;
  gpu.parameters.tail<3>() << material.metallic, material.roughness, 0;
  gpu.emitted.head<3>() = material.emitted;
  has_surface_maps_ |= !material.emitted.isZero();
  if (has_uvs && !material.texture.empty()) {
    gpu.parameters.x() = layer_of({material.texture, material.texture_file}, &staging->colour_maps);
    if (material.texture.channels() == 4) gpu.parameters.w() = material.cut_below;
  }
  const scene::SurfaceMaps& maps = material.maps;
  if (has_uvs && !maps.is_none()) {
    has_surface_maps_ = true;
    gpu.emitted.w() = add_map(maps.emission, k_second_emission, &gpu, &staging->colour_maps);
    add_packed(maps, &gpu, &staging->maps);
    gpu.maps.y() = add_map(maps.normals, k_second_normals, &gpu, &staging->maps);
    gpu.more.y() = maps.metallic_roughness.image.empty() ? 0 : 1;
    gpu.maps.tail<2>() << maps.normal_scale, maps.occlusion_strength;
  }
  const scene::Clearcoat& coat = material.coat;
  gpu.coat.head<3>() << coat.factor, coat.roughness, coat.normal_scale;
  has_clearcoat_ |= coat.factor > 0;
  if (has_uvs && coat.factor > 0) {
    gpu.more_maps.x() = add_map(coat.factor_map, k_second_coat, &gpu, &staging->maps);
    gpu.more_maps.y() = add_map(coat.roughness_map, k_second_coat_roughness, &gpu, &staging->maps);
    gpu.coat.w() = add_map(coat.normals, k_second_coat_normals, &gpu, &staging->maps);
    has_surface_maps_ |= coat.has_maps();
  }
  staging->materials.push_back(gpu);
}

void GpuScene::add_finish(const scene::Finish& finish, Staging* staging) {
  constexpr int k_decal_image = 1, k_pattern_image = 2, k_projected_image = 4;  // as in shaders/finish.glsl
  finishes_.push_back({finish.name, static_cast<int>(staging->materials.size()), finish.for_viewer});
  GpuMaterial gpu{finish.base_colour.cast<float>().homogeneous(), Eigen::Vector4f::Constant(-1)};
  gpu.colour.w() = 0;
  gpu.parameters.tail<3>() << static_cast<float>(finish.metallic), static_cast<float>(finish.roughness), 0;
  gpu.coat.head<2>() << static_cast<float>(finish.clearcoat), static_cast<float>(finish.clearcoat_roughness);
  has_coated_finish_ |= finish.clearcoat > 0;
  if (const auto& image = finish.image) {
    gpu.parameters.x() = layer_of(image->texture, &staging->colour_maps);
    gpu.second.z() = image->repeats ? k_pattern_image : k_decal_image;
    if (const auto& projection = image->projection) {
      gpu.second.z() |= k_projected_image;
      const Eigen::Matrix4d image_from_prototype = projection->prototype_from_image.inverse().matrix();
      gpu.image_u = (image_from_prototype.row(0) / projection->size_m.x()).cast<float>();
      gpu.image_v = (image_from_prototype.row(1) / projection->size_m.y()).cast<float>();
      gpu.image_u.w() += 0.5F;
      gpu.image_v.w() += 0.5F;
    }
  }
  staging->materials.push_back(gpu);
}

// Must be called before the mesh's own corners are added.
void GpuScene::add_second_uvs(const scene::Mesh& mesh, std::size_t first_material, Staging* staging) {
  if (mesh.second_uvs.empty()) return;
  has_second_uvs_ = true;
  const std::size_t first = 3 * staging->triangles.size() + staging->after_normals.size();
  for (std::size_t i = first_material; i < staging->materials.size(); ++i)
    staging->materials[i].second.x() = static_cast<int>(first) - static_cast<int>(staging->corners.size());
  for (const auto& triangle : mesh.triangles)
    for (const std::uint32_t i : triangle)
      staging->after_normals.push_back((Eigen::Vector4f() << mesh.second_uvs[i], 0, 0).finished());
}

// Must be called before the mesh's own corners are added.
void GpuScene::add_tangents(const scene::Mesh& mesh, std::size_t first_material, Staging* staging) {
  // The tangents come after all normals, three for each of `triangles`.
  const std::size_t first = 3 * staging->triangles.size() + staging->after_normals.size();
  for (std::size_t i = first_material; i < staging->materials.size(); ++i) {
    GpuMaterial& material = staging->materials[i];
    if (mesh.tangents.empty()) material.maps.y() = material.coat.w() = -1;
    material.more.x() = static_cast<int>(first) - static_cast<int>(staging->corners.size());
  }
  if (mesh.tangents.empty()) return;
  for (const auto& triangle : mesh.triangles)
    for (const std::uint32_t i : triangle) staging->after_normals.push_back(mesh.tangents[i]);
}

// Must be called before the mesh's own corners are added.
void GpuScene::add_colours(const scene::Mesh& mesh, std::size_t first_material, Staging* staging) {
  if (mesh.colours.empty()) return;
  has_vertex_colours_ = true;
  const std::size_t first = 3 * staging->triangles.size() + staging->after_normals.size();
  for (std::size_t i = first_material; i < staging->materials.size(); ++i)
    staging->materials[i].more.tail<2>()
        << static_cast<int>(first) - static_cast<int>(staging->corners.size()),
        1;
  for (const auto& triangle : mesh.triangles)
    for (const std::uint32_t i : triangle) staging->after_normals.push_back(mesh.colours[i].homogeneous());
}

TriangleRun GpuScene::add(const scene::Mesh& mesh, int owner, Staging* staging) {
  const auto first_material = static_cast<std::uint32_t>(staging->materials.size());
  for (const scene::Material& material : mesh.materials)
    add_material(mesh.second_uvs.empty() ? without_second_uvs(material) : material, mesh, staging);
  TriangleRun run;
  run.has_cut_outs = std::any_of(staging->materials.begin() + static_cast<std::ptrdiff_t>(first_material),
                                 staging->materials.end(),
                                 [](const GpuMaterial& material) { return material.parameters.w() > 0; });
  has_cut_outs_ |= run.has_cut_outs;
  run.first = static_cast<int>(staging->corners.size() / 3);
  run.count = static_cast<int>(mesh.triangles.size());
  add_tangents(mesh, first_material, staging);
  add_second_uvs(mesh, first_material, staging);
  add_colours(mesh, first_material, staging);
  constexpr std::uint32_t k_sheet = 1U << 31;  // as in shaders/scene.glsl
  std::vector<bool> are_closed(mesh.triangles.size(), true);
  if (section_) are_closed = scene::are_of_closed_pieces(mesh);
  Eigen::AlignedBox3d bounds;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    if (t % k_cluster == 0) run.clusters.push_back({run.first + static_cast<int>(t), 0, {}});
    ++run.clusters.back().count;
    for (const std::uint32_t i : mesh.triangles[t]) {
      const Eigen::Vector2f uv = mesh.uvs.empty() ? Eigen::Vector2f(0, 0) : mesh.uvs[i];
      staging->corners.push_back((Eigen::Vector4f() << mesh.positions[i], uv.x()).finished());
      staging->normals.push_back((Eigen::Vector4f() << mesh.normals[i], uv.y()).finished());
      run.clusters.back().box.extend(mesh.positions[i].cast<double>());
    }
    GpuTriangle& triangle = staging->triangles[static_cast<std::size_t>(run.first) + t];
    triangle.owner = static_cast<std::uint32_t>(owner);
    triangle.material = first_material + mesh.triangle_materials[t];
    if (!are_closed[t]) triangle.material |= k_sheet;
  }
  for (const TriangleRun::Cluster& cluster : run.clusters) bounds.extend(cluster.box);
  if (run.count > 0) {
    run.p_lower = bounds.min();
    run.p_upper = bounds.max();
  }
  return run;
}

Pose GpuScene::scene_from_world(const scene::PosedScene& posed) {
  return posed.world_from_prototype ? posed.world_from_prototype->inverse() : Pose();
}

void GpuScene::placed(const scene::PosedScene& posed, std::vector<PlacedRun>* runs) const {
  const Pose from_world = scene_from_world(posed);
  std::optional<scene::CutPlane> cut;
  if (section_ && posed.cut) cut = scene::transformed(from_world, *posed.cut);
  runs->clear();
  if (prototype_ && posed.world_from_prototype) {
    runs->push_back({0, &*prototype_, Pose()});
    const auto finish = std::find_if(finishes_.begin(), finishes_.end(),
                                     [&](const GpuFinish& known) { return known.name == posed.finish; });
    runs->back().lines = lines_.stamp();
    if (cut && section_->cuts_prototype) runs->back().cut = cut;
    if (!posed.finish.empty() && finish != finishes_.end())
      runs->back().finish = static_cast<int>(finish - finishes_.begin());
    if (posed.deviation.layer != 0 && posed.deviation.layer == deviation_) {
      runs->back().finish = static_cast<int>(finishes_.size()) - 1;
      runs->back().deviation = posed.deviation;
    }
  }
  for (const scene::PosedPart& part : posed.parts) {
    for (std::size_t i = 0; i < slots_.size(); ++i) {
      if (slots_[i].name != part.slot) continue;
      const auto variant = slots_[i].variants.find(part.variant);
      LIMN_CHECK(variant != slots_[i].variants.end());
      runs->push_back({static_cast<int>(i) + 1, &variant->second, from_world * part.world_from_part,
                       slots_[i].on_surface, -1, 0, part.material});
      if (cut && section_->cuts(part.slot)) runs->back().cut = cut;
      runs->back().volume = volumes_.find(part.slot, part.variant, part.window);
    }
  }
}

// What counts the lines on the part's cap, from a point of the scene.
Eigen::Vector4f GpuScene::hatch_of(const PlacedRun& placed) const {
  if (!placed.cut) return Eigen::Vector4f::Zero();
  const Pose owner_from_scene = placed.scene_from_owner.inverse();
  const Eigen::Vector3d across =
      scene::across_hatch(owner_from_scene.rotation * placed.cut->normal, placed.owner) / section_->hatch_m;
  Eigen::Vector4f out;
  out << (placed.scene_from_owner.rotation * across).cast<float>(),
      static_cast<float>(across.dot(owner_from_scene.translation));
  return out;
}

void GpuScene::place(const std::vector<PlacedRun>& runs) {
  std::fill(gpu_owners_.begin(), gpu_owners_.end(), GpuOwner());
  cut_.reset();
  volumes_.begin(owner_count());
  for (const PlacedRun& placed : runs) {
    GpuOwner& owner = gpu_owners_[static_cast<std::size_t>(placed.owner)];
    owner.owner_from_scene = placed.scene_from_owner.inverse().matrix().cast<float>();
    owner.lower << placed.run->p_lower.cast<float>(), 1.f;
    owner.upper << placed.run->p_upper.cast<float>(), placed.on_surface ? 1.f : 0.f;
    if (placed.material.base_colour) owner.colour = placed.material.base_colour->cast<float>().homogeneous();
    owner.metallic_roughness.x() = static_cast<float>(placed.material.metallic.value_or(-1));
    owner.metallic_roughness.y() = static_cast<float>(placed.material.roughness.value_or(-1));
    owner.hatch = hatch_of(placed);
    if (placed.cut) cut_ = placed.cut;
    volumes_.place(placed.owner, placed.volume, placed.scene_from_owner.inverse());
    if (placed.finish < 0) continue;
    const GpuFinish& finish = finishes_[static_cast<std::size_t>(placed.finish)];
    owner.metallic_roughness.z() = static_cast<float>(finish.material + 1);
    owner.metallic_roughness.w() = finish.for_viewer ? 1 : 0;
    if (placed.deviation.layer != 0) owner.colour.x() = static_cast<float>(placed.deviation.tolerance_m);
  }
  glNamedBufferSubData(*placements_, 0, static_cast<GLsizeiptr>(gpu_owners_.size() * sizeof(GpuOwner)),
                       gpu_owners_.data());
  volumes_.upload();
}

void GpuScene::set_deviation(const scene::DeviationLayer& layer) {
  if (!prototype_ || layer.triangles.size() != static_cast<std::size_t>(prototype_->count)) return;
  constexpr std::size_t k_most_words =
      (std::size_t{1} << 27) / sizeof(std::uint32_t);  // GL 4.5 guarantees it
  if (3 * layer.band_colours.size() + 2 * layer.triangles.size() + layer.values.size() > k_most_words)
    return log_warning("deviation: the CAD has too many triangles ({}) for colours in light.",
                       layer.triangles.size());
  // The layout of shaders/deviation.glsl: colours, triangles, values.
  std::vector<std::uint32_t> words;
  words.reserve(3 * layer.band_colours.size() + 2 * layer.triangles.size() + layer.values.size());
  for (const Eigen::Vector3f& colour : layer.band_colours)
    for (int i = 0; i < 3; ++i) words.push_back(std::bit_cast<std::uint32_t>(colour[i]));
  const auto first = static_cast<std::uint32_t>(3 * layer.band_colours.size() + 2 * layer.triangles.size());
  for (const scene::DeviationLayer::Triangle& triangle : layer.triangles) {
    words.push_back(first + triangle.first);
    words.push_back(triangle.divisions);
  }
  words.insert(words.end(), layer.values.begin(), layer.values.end());
  deviation_words_ = buffer_of(words);
  deviation_ = layer.number;
}

void GpuScene::bind(const Use& use) const {
  const std::pair<int, const GlName*> textures[] = {
      {k_corners_unit, &corner_texels_},     {k_normals_unit, &normal_texels_},
      {k_triangles_unit, &triangle_texels_}, {k_placements_unit, &placement_texels_},
      {k_colour_maps_unit, &colour_maps_},   {k_surface_maps_unit, &maps_},
      {k_brdf_lut_unit, &brdf_lut_}};
  for (const auto& [unit, texture] : textures) glBindTextureUnit(static_cast<GLuint>(unit), **texture);
  lines_.bind();
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, k_materials_buffer, *materials_);
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, k_deviation_buffer, *deviation_words_);
  use.program.set("u_has_cut_outs", has_cut_outs_);
  use.program.set("u_placement_count", owner_count());
  volumes_.bind();
  if (!section_) return;
  use.program.set("u_cut", coefficients(cut_));
  use.program.set("u_prototype_hatch",
                  is_prototype_cut_ ? gpu_owners_[0].hatch : Eigen::Vector4f(Eigen::Vector4f::Zero()));
  use.program.set("u_cap_colour", Eigen::Vector3f(section_->cap_colour.cast<float>()));
  use.program.set("u_hatch", Eigen::Vector2f(static_cast<float>(scene::k_hatch_line),
                                             static_cast<float>(scene::k_hatch_colour)));
}

std::array<Eigen::Vector3d, 8> bounds_of(const PlacedRun& placed, double margin_m) {
  std::array<Eigen::Vector3d, 8> corners;
  for (std::size_t k = 0; k < 8; ++k) {
    Eigen::Vector3d p;
    for (int axis = 0; axis < 3; ++axis)
      p[axis] = k >> axis & 1 ? placed.run->p_upper[axis] + margin_m : placed.run->p_lower[axis] - margin_m;
    corners[k] = placed.scene_from_owner * p;
  }
  return corners;
}

}  // namespace limn::projector
