#include "scene/meshes/gltf_materials.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "scene/files/named_file.h"

namespace limn::scene {
namespace {

using nlohmann::json;

const json& object_in(const json& parent, const char* key) {
  static const json k_none = json::object();
  const auto found = parent.find(key);
  return found == parent.end() || !found->is_object() ? k_none : *found;
}

const json& extension_of(const json& parent, const char* name) {
  return object_in(object_in(parent, "extensions"), name);
}

Eigen::Vector3f colour_in(const json& parent, const char* key, const Eigen::Vector3f& otherwise) {
  const auto found = parent.find(key);
  if (found == parent.end()) return otherwise;
  return {found->at(0).get<float>(), found->at(1).get<float>(), found->at(2).get<float>()};
}

// glTF counts v from the top row, rotates counter-clockwise in the image, then moves.
TexturePlace place_of(const json& use) {
  const json& transform = extension_of(use, "KHR_texture_transform");
  TexturePlace place;
  constexpr std::size_t k_most_sets = 1000;
  place.coordinates = static_cast<int>(
      std::min(whole_number(transform, "texCoord", whole_number(use, "texCoord", 0)), k_most_sets));
  if (transform.empty()) return place;
  const std::vector<float> offset = transform.value("offset", std::vector<float>{0, 0}),
                           scale = transform.value("scale", std::vector<float>{1, 1});
  const Eigen::Affine2f v_down = Eigen::Translation2f(0, 1) * Eigen::Scaling(1.F, -1.F);
  const Eigen::Affine2f in_file = Eigen::Translation2f(offset.at(0), offset.at(1)) *
                                  Eigen::Rotation2Df(-transform.value("rotation", 0.F)) *
                                  Eigen::Scaling(scale.at(0), scale.at(1));
  place.moved = v_down * in_file * v_down;
  return place;
}

// The image of a texture: the one that every program reads, or else one of an extension.
std::optional<std::size_t> image_of(const json& texture) {
  if (texture.contains("source")) return whole_number(texture, "source", 0);
  for (const char* name : {"EXT_texture_webp", "KHR_texture_basisu", "EXT_texture_avif", "MSFT_texture_dds"})
    if (extension_of(texture, name).contains("source"))
      return whole_number(extension_of(texture, name), "source", 0);
  return std::nullopt;
}

class Materials {
 public:
  Materials(GltfFile* file, MeshContent* content) : file_(*file), content_(*content) {}

  Status read() {
    LIMN_TRY_STATUS(read_images());
    for (const json& material : file_.root().value("materials", json::array())) {
      LIMN_TRY_STATUS(check_extensions(material));
      LIMN_TRY(MaterialSource source, read_material(material));
      content_.materials.push_back(std::move(source));
    }
    content_.materials.push_back({.metallic = 1, .roughness = 1});  // as glTF says for primitives without one
    if (!not_shown_.empty()) {
      std::string names;
      for (const std::string& name : not_shown_) names += (names.empty() ? "" : ", ") + name;
      content_.warnings.push_back(fmt::format(
          "{}: its materials are shown without {}, which Limn does not read.", file_.path().string(), names));
    }
    return {};
  }

 private:
  // "material 3 ('chrome')", for messages about the one that is read.
  std::string where(const json& material) const {
    const std::string name = material.value("name", std::string());
    return fmt::format("material {}{}", content_.materials.size(), name.empty() ? "" : " ('" + name + "')");
  }

  // Whether the extensions that are read have the form of an extension.
  Status check_extensions(const json& material) const {
    for (const auto& [name, value] : object_in(material, "extensions").items())
      if (shown_extensions().count(name) > 0 && !value.is_object())
        return file_.problem(
            fmt::format("{}: expected an object as {}, found {}", where(material), name, short_text(value)));
    return {};
  }

  static const std::set<std::string>& shown_extensions() {
    static const std::set<std::string> k_shown = {
        "KHR_materials_unlit", "KHR_materials_pbrSpecularGlossiness", "KHR_materials_emissive_strength",
        "KHR_materials_clearcoat"};
    return k_shown;
  }

  // A factor of an extension; a number outside its limits is moved to them, with a warning.
  float factor_in(const json& material, const json& extension, const char* key, float otherwise, float most) {
    const float found = extension.value(key, otherwise), used = std::clamp(found, 0.F, most);
    if (used != found)
      content_.warnings.push_back(fmt::format("{}: {}: expected {} from 0 to {}, found {}. {} is used.",
                                              file_.path().string(), where(material), key, most, found,
                                              used));
    return used;
  }

  Status read_images() {
    for (const json& image : file_.root().value("images", json::array())) {
      TextureUse use;
      const std::string uri = image.value("uri", std::string());
      if (image.contains("bufferView")) {
        LIMN_TRY(const std::string_view bytes, file_.view(whole_number(image, "bufferView", 0)));
        use.embedded = static_cast<int>(content_.images.size());
        content_.images.push_back({std::string(bytes), {}});
      } else if (uri.starts_with("data:")) {
        use.embedded = static_cast<int>(content_.images.size());
        content_.images.push_back({data_uri_bytes(uri).value_or(std::string()), {}});
      } else {
        use.name = uri;
      }
      images_.push_back(use);
    }
    return {};
  }

  Result<TextureUse> texture(const json& parent, const char* key) const {
    if (parent.contains(key) && !parent.at(key).is_object())
      return file_.problem(
          fmt::format("expected an object as {}, found {}", key, short_text(parent.at(key))));
    const json& use = object_in(parent, key);
    if (use.empty()) return TextureUse{};
    const json& texture = file_.root().at("textures").at(whole_number(use.at("index")));
    const auto image = image_of(texture);
    if (!image)
      return file_.problem(fmt::format("texture {}: expected an image, found none that Limn knows ({})",
                                       whole_number(use, "index", 0),
                                       short_text(object_in(texture, "extensions"))));
    if (*image >= images_.size())
      return file_.problem(fmt::format("expected image {}, found {} images", *image, images_.size()));
    TextureUse out = images_[*image];
    out.place = place_of(use);
    return out;
  }

  Status read_base(const json& material, MaterialSource* to) {
    const json& gloss = extension_of(material, "KHR_materials_pbrSpecularGlossiness");
    const json& surface = gloss.empty() ? object_in(material, "pbrMetallicRoughness") : gloss;
    const char* factor = gloss.empty() ? "baseColorFactor" : "diffuseFactor";
    to->base_colour = colour_in(surface, factor, to->base_colour);
    if (surface.contains(factor) && surface.at(factor).size() > 3)
      to->alpha = surface.at(factor).at(3).get<float>();
    LIMN_TRY(to->base, texture(surface, gloss.empty() ? "baseColorTexture" : "diffuseTexture"));
    if (!gloss.empty()) {
      to->metallic = 0;
      to->roughness = 1 - gloss.value("glossinessFactor", 1.F);
      if (gloss.contains("specularGlossinessTexture"))
        not_shown_.insert("the texture of specular and glossiness");
      return {};
    }
    to->metallic = surface.value("metallicFactor", 1.F);
    to->roughness = surface.value("roughnessFactor", 1.F);
    LIMN_TRY(to->metallic_roughness, texture(surface, "metallicRoughnessTexture"));
    return {};
  }

  Status read_coat(const json& material, MaterialSource::Coat* to) {
    const json& coat = extension_of(material, "KHR_materials_clearcoat");
    to->factor = factor_in(material, coat, "clearcoatFactor", 0, 1);
    if (to->factor == 0) return {};
    to->roughness = factor_in(material, coat, "clearcoatRoughnessFactor", 0, 1);
    LIMN_TRY(to->factor_map, texture(coat, "clearcoatTexture"));
    LIMN_TRY(to->roughness_map, texture(coat, "clearcoatRoughnessTexture"));
    LIMN_TRY(to->normals, texture(coat, "clearcoatNormalTexture"));
    to->normal_scale = object_in(coat, "clearcoatNormalTexture").value("scale", 1.F);
    return {};
  }

  Result<MaterialSource> read_material(const json& material) {
    MaterialSource out{.name = material.value("name", std::string())};
    LIMN_TRY_STATUS(read_base(material, &out));
    const auto mode = material.value("alphaMode", std::string("OPAQUE"));
    // Transparency (BLEND) is rounded at one half, because projected light cannot be transparent.
    if (mode != "OPAQUE") out.cut_below = mode == "MASK" ? material.value("alphaCutoff", 0.5F) : 0.5F;
    LIMN_TRY(out.normals, texture(material, "normalTexture"));
    LIMN_TRY(out.occlusion, texture(material, "occlusionTexture"));
    LIMN_TRY(out.emission, texture(material, "emissiveTexture"));
    out.normal_scale = object_in(material, "normalTexture").value("scale", 1.F);
    out.occlusion_strength = object_in(material, "occlusionTexture").value("strength", 1.F);
    constexpr float k_most_strength = 1e6F;  // far more than any light can show
    out.emitted = factor_in(material, extension_of(material, "KHR_materials_emissive_strength"),
                            "emissiveStrength", 1, k_most_strength) *
                  colour_in(material, "emissiveFactor", Eigen::Vector3f::Zero());
    LIMN_TRY_STATUS(read_coat(material, &out.coat));
    for (const auto& [name, value] : object_in(material, "extensions").items()) {
      if (name == "KHR_materials_unlit") out.unlit = true;
      if (shown_extensions().count(name) == 0) not_shown_.insert(name);
    }
    return out;
  }

  GltfFile& file_;
  MeshContent& content_;
  std::vector<TextureUse> images_;
  std::set<std::string> not_shown_;
};

}  // namespace

Status read_gltf_materials(GltfFile* file, MeshContent* content) { return Materials(file, content).read(); }

}  // namespace limn::scene
