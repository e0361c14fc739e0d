#include "scene/meshes/read_materials.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <string_view>
#include <tuple>
#include <utility>

#include "core/file.h"
#include "core/image_io.h"
#include "core/log.h"
#include "scene/files/named_file.h"

namespace limn::scene {
namespace {

namespace fs = std::filesystem;

Alpha alpha_of(bool with_alpha) { return with_alpha ? Alpha::kept : Alpha::ignored; }

// An error for formats of textures that no image reader knows, with the way out.
Status check_texture_format(std::string_view bytes, const std::string& where) {
  if (bytes.starts_with("\xabKTX 20"))
    return error(
        "{}: expected a PNG, JPEG or WebP as texture, found a KTX2 texture (KHR_texture_basisu), which Limn "
        "does "
        "not read. Switch KTX2 or Basis Universal off when you export it.",
        where);
  if (bytes.starts_with("DDS "))
    return error(
        "{}: expected a PNG, JPEG or WebP as texture, found a DDS texture, which Limn does not read. Export "
        "PNG, "
        "JPEG or WebP textures.",
        where);
  return {};
}

Result<cv::Mat> embedded_texture(const EmbeddedImage& embedded, const fs::path& path, bool with_alpha) {
  if (!embedded.pixels.empty()) {
    if (with_alpha) return embedded.pixels.clone();
    cv::Mat bgr;
    cv::cvtColor(embedded.pixels, bgr, cv::COLOR_BGRA2BGR);
    return bgr;
  }
  LIMN_TRY_STATUS(check_texture_format(embedded.bytes, path.string()));
  return decode_image(embedded.bytes, path.string() + ": embedded texture", {.alpha = alpha_of(with_alpha)});
}

Result<cv::Mat> texture_beside(const fs::path& path, const fs::path& mesh_path, bool with_alpha) {
  const auto bytes = read_file(path);
  Result<cv::Mat> image = cv::Mat();
  if (const Status known = bytes ? check_texture_format(*bytes, path.string()) : Status(bytes.error());
      !known)
    image = known.error();
  else
    image = decode_image(*bytes, path.string(), {.alpha = alpha_of(with_alpha)});
  if (!image) {
    const bool is_webp = bytes && bytes->starts_with("RIFF");
    return error("{}: its texture cannot be read: {}{}", mesh_path.string(), image.message(),
                 is_webp
                     ? " If that does not help, switch WebP (EXT_texture_webp) off when you export the mesh."
                     : "");
  }
  return image;
}

// Gives holes the colour of the nearest opaque texel, because texture filtering mixes the two. False when the
// whole texture is a hole.
bool spread_into_holes(float below, cv::Mat* bgra) {
  cv::Mat alpha, labels, distances;
  cv::extractChannel(*bgra, alpha, 3);
  const cv::Mat is_hole = alpha < 255 * below;
  if (cv::countNonZero(is_hole) == is_hole.rows * is_hole.cols) return false;
  cv::distanceTransform(is_hole, distances, labels, cv::DIST_L2, cv::DIST_MASK_5, cv::DIST_LABEL_PIXEL);
  std::vector<cv::Vec4b> colours(static_cast<std::size_t>(bgra->total()) + 1);
  const auto label = [&](int row, int column) {
    return static_cast<std::size_t>(labels.at<int>(row, column));
  };
  for (const bool holes_now : {false, true})
    for (int row = 0; row < bgra->rows; ++row)
      for (int column = 0; column < bgra->cols; ++column) {
        if ((is_hole.at<std::uint8_t>(row, column) != 0) != holes_now) continue;
        cv::Vec4b& texel = bgra->at<cv::Vec4b>(row, column);
        cv::Vec4b& nearest = colours[label(row, column)];
        if (!holes_now)
          nearest = texel;
        else
          texel = {nearest[0], nearest[1], nearest[2], texel[3]};
      }
  return true;
}

// The images that a file's materials name. Each is read once and shared.
class Images {
 public:
  Images(const MeshContent& content, const fs::path& path) : content_(content), path_(path) {}

  // Reads 8-bit BGR, or BGRA if the image has alpha and `with_alpha` is set.
  Result<Texture> read(const TextureUse& use, bool with_alpha) {
    const bool is_embedded = use.embedded >= 0;
    const fs::path file = is_embedded ? path_ : path_of(use);
    const auto key = std::make_tuple(file.string(), use.embedded, with_alpha);
    if (const auto known = known_.find(key); known != known_.end()) return known->second;
    const auto number = static_cast<std::size_t>(use.embedded);
    if (is_embedded && number >= content_.images.size())
      return error("{}: expected {} embedded images or more, found {}.", path_.string(), number + 1,
                   content_.images.size());
    LIMN_TRY(cv::Mat image, is_embedded ? embedded_texture(content_.images[number], path_, with_alpha)
                                        : texture_beside(file, path_, with_alpha));
    if (image.channels() == 1) cv::cvtColor(image, image, cv::COLOR_GRAY2BGR);
    return known_[key] = Texture{image, file.string()};
  }

 private:
  // The file that a texture's name means; where there is none, the name beside the mesh, for messages.
  fs::path path_of(const TextureUse& use) const {
    const fs::path beside = path_.parent_path();
    for (const fs::path& folder : {use.folder.empty() ? beside : use.folder, beside}) {
      const auto found = find_named_file(folder, use.name);
      if (!found) continue;
      if (found->is_other_case)
        log_info("{}: names the texture {}; {} is used", path_.string(), use.name, found->path.string());
      return found->path;
    }
    std::string slashes = percent_decoded(trimmed(use.name));
    std::replace(slashes.begin(), slashes.end(), '\\', '/');
    return beside / fs::path(slashes).filename();
  }

  const MeshContent& content_;
  const fs::path& path_;
  std::map<std::tuple<std::string, int, bool>, Texture> known_;
};

// Reads one material.
class MaterialReader {
 public:
  MaterialReader(const MaterialSource& source, std::string name, Images* images)
      : source_(source), places_(texture_places(source)), name_(std::move(name)), images_(*images) {}

  Result<Material> read() {
    LIMN_TRY_STATUS(check_numbers());
    Material material;
    material.base_colour = source_.base_colour;
    material.unlit = source_.unlit;
    material.metallic = source_.metallic;
    material.roughness = source_.roughness;
    LIMN_TRY_STATUS(read_base_texture(&material));
    read_maps(&material);
    read_coat(&material.coat);
    return material;
  }

 private:
  Status check_numbers() const {
    const MaterialSource& s = source_;
    const bool is_finite = s.base_colour.allFinite() && s.emitted.allFinite() && std::isfinite(s.alpha) &&
                           std::isfinite(s.metallic) && std::isfinite(s.roughness) &&
                           std::isfinite(s.normal_scale) && std::isfinite(s.occlusion_strength) &&
                           std::isfinite(s.coat.factor) && std::isfinite(s.coat.roughness) &&
                           std::isfinite(s.coat.normal_scale);
    if (is_finite) return {};
    return error(
        "{}: expected finite numbers for its colours and factors, found NaN or infinity. Repair or "
        "export the mesh again.",
        name_);
  }

  Status read_base_texture(Material* material) {
    const float below = source_.cut_below, alpha = source_.alpha;
    const float texture_below = below > 0 ? below / std::max(alpha, 1e-6F) : 0;
    if (source_.base.is_there()) {
      LIMN_TRY(const Texture texture, images_.read(source_.base, below > 0));
      material->texture = texture.image;
      material->texture_file = texture.file;
    }
    if (below <= 0) return {};
    const bool has_alpha = material->texture.channels() == 4;
    if (has_alpha) material->texture = material->texture.clone();  // each material fills its own holes
    const bool is_seen = has_alpha ? spread_into_holes(texture_below, &material->texture) : alpha >= below;
    if (is_seen && has_alpha) material->cut_below = texture_below;
    if (is_seen) return {};
    if (has_alpha) cv::cvtColor(material->texture, material->texture, cv::COLOR_BGRA2BGR);
    log_warning(
        "{}: expected an alpha of {} or more somewhere in its texture and base colour, found less "
        "everywhere. "
        "It is shown as opaque. Raise the alpha where the part shall be visible.",
        name_, below);
    return {};
  }

  void read_maps(Material* material) {
    SurfaceMaps& maps = material->maps;
    material->emitted = source_.emitted;
    maps.metallic_roughness = map_of(source_.metallic_roughness, "metallic-roughness texture",
                                     fmt::format("with metalness {} and roughness {} all over",
                                                 material->metallic, material->roughness))
                                  .value_or(Texture{});
    maps.normals = map_of(source_.normals, "normal texture", "smooth").value_or(Texture{});
    maps.occlusion =
        map_of(source_.occlusion, "occlusion texture", "in soft light everywhere").value_or(Texture{});
    maps.normal_scale = source_.normal_scale;
    maps.occlusion_strength = source_.occlusion_strength;
    if (material->emitted.isZero()) return;
    if (const auto emission = map_of(source_.emission, "emissive texture", "without light of its own"))
      maps.emission = *emission;
    else
      material->emitted.setZero();
  }

  void read_coat(Clearcoat* coat) {
    const MaterialSource::Coat& source = source_.coat;
    if (source.factor == 0) return;
    auto factor = map_of(source.factor_map, "clearcoat texture", "without its clearcoat");
    if (!factor) return;
    coat->factor = source.factor;
    coat->roughness = source.roughness;
    coat->factor_map = *std::move(factor);
    coat->roughness_map = map_of(source.roughness_map, "clearcoat roughness texture",
                                 fmt::format("with a clearcoat of roughness {} all over", source.roughness))
                              .value_or(Texture{});
    coat->normals =
        map_of(source.normals, "clearcoat normal texture", "with a smooth clearcoat").value_or(Texture{});
    coat->normal_scale = source.normal_scale;
    if (source.normals.is_there() && !is_same_place(source.normals.place, tangent_place(source_)))
      log_warning(
          "{}: expected its clearcoat normal texture in the texture coordinates of its normal texture, found "
          "others. Its relief is shown along the directions of the normal texture. Bake both into one set of "
          "coordinates.",
          name_);
  }

  // A texture without an image when the material names none. Nullopt when the image cannot be read; a warning
  // then says how the material is shown (`instead`).
  std::optional<Texture> map_of(const TextureUse& use, const std::string& what, const std::string& instead) {
    if (!use.is_there()) return Texture{};
    const bool is_second = place_of(use, what) == 1;
    auto texture = images_.read(use, false);
    if (texture) texture->in_second_uvs = is_second;
    if (texture) return std::move(texture).value();
    log_warning(
        "{}: expected a readable {}, found none ({}). The material is shown {}. Save the texture beside the "
        "mesh, or export the mesh again.",
        name_, what, texture.message(), instead);
    return std::nullopt;
  }

  // Which of the material's mappings a texture has. Warns when it is another, and is shown with the first.
  std::size_t place_of(const TextureUse& use, const std::string& what) const {
    const auto same = std::find_if(places_.begin(), places_.end(), [&](const TexturePlace& place) {
      return is_same_place(place, use.place);
    });
    if (same != places_.end()) return static_cast<std::size_t>(same - places_.begin());
    log_warning(
        "{}: expected at most two mappings of its textures (texture coordinates and KHR_texture_transform), "
        "found a third one for its {} (coordinates {}). It is shown in those of the first texture (set {}). "
        "Bake its textures into two sets of coordinates.",
        name_, what, use.place.coordinates, places_[0].coordinates);
    return 0;
  }

  const MaterialSource& source_;
  std::vector<TexturePlace> places_;
  std::string name_;  // names of the file and the material, for messages
  Images& images_;
};

}  // namespace

std::vector<const TextureUse*> texture_uses(const MaterialSource& material) {
  const MaterialSource::Coat& coat = material.coat;
  std::vector<const TextureUse*> uses;
  for (const TextureUse* use :
       {&material.base, &material.metallic_roughness, &material.normals, &material.occlusion,
        &material.emission, &coat.factor_map, &coat.roughness_map, &coat.normals})
    if (use->is_there()) uses.push_back(use);
  return uses;
}

bool is_same_place(const TexturePlace& a, const TexturePlace& b) {
  return a.coordinates == b.coordinates && a.moved.isApprox(b.moved, 1e-5F);
}

std::vector<TexturePlace> texture_places(const MaterialSource& material) {
  std::vector<TexturePlace> places;
  for (const TextureUse* use : texture_uses(material)) {
    const bool is_known = std::any_of(places.begin(), places.end(), [&](const TexturePlace& place) {
      return is_same_place(place, use->place);
    });
    if (!is_known && places.size() < 2) places.push_back(use->place);
  }
  if (places.empty()) places.emplace_back();
  return places;
}

TexturePlace tangent_place(const MaterialSource& material) {
  for (const TextureUse* use : {&material.normals, &material.coat.normals})
    if (use->is_there()) return use->place;
  return texture_places(material)[0];
}

Result<std::vector<Material>> read_materials(const MeshContent& content, const fs::path& path) {
  std::vector<Material> materials;
  Images images(content, path);
  std::vector<bool> is_used(content.materials.size(), false);
  for (const MeshPiece& piece : content.pieces) {
    is_used[piece.material] = true;
    for (const std::size_t material : piece.variant_materials) is_used[material] = true;
  }
  for (std::size_t i = 0; i < content.materials.size(); ++i) {
    if (!is_used[i]) {  // its textures are not needed
      materials.emplace_back();
      continue;
    }
    const MaterialSource& source = content.materials[i];
    const std::string name = fmt::format("{}: material {}", path.string(),
                                         source.name.empty() ? std::to_string(i) : "'" + source.name + "'");
    LIMN_TRY(Material material, MaterialReader(source, name, &images).read());
    materials.push_back(std::move(material));
  }
  return materials;
}

}  // namespace limn::scene
