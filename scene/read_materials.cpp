#include "scene/read_materials.h"

#include <assimp/GltfMaterial.h>
#include <assimp/material.h>
#include <assimp/scene.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <utility>

#include "core/image_io.h"
#include "core/log.h"

namespace limn::scene {
namespace {

namespace fs = std::filesystem;

Result<cv::Mat> embedded_texture(const aiTexture& texture, const fs::path& path, bool with_alpha) {
  if (texture.mHeight > 0) {
    static_assert(sizeof(aiTexel) == 4);  // b, g, r, a
    const cv::Mat bgra(static_cast<int>(texture.mHeight), static_cast<int>(texture.mWidth), CV_8UC4,
                       texture.pcData);
    if (with_alpha) return bgra.clone();
    cv::Mat bgr(bgra.size(), CV_8UC3);
    const int from_to[] = {0, 0, 1, 1, 2, 2};
    cv::mixChannels(&bgra, 1, &bgr, 1, from_to, 3);
    return bgr;
  }
  const cv::Mat bytes(1, static_cast<int>(texture.mWidth), CV_8U, texture.pcData);
  cv::Mat image = cv::imdecode(bytes, with_alpha ? cv::IMREAD_UNCHANGED : cv::IMREAD_COLOR);
  if (image.empty()) {
    return error(
        "{}: expected a PNG or JPEG as embedded texture, found {} bytes of something else. "
        "Export the mesh again.",
        path.string(), texture.mWidth);
  }
  if (image.depth() == CV_16U) image.convertTo(image, CV_8U, 1.0 / 257);
  return image;
}

// The path of a texture that a mesh names: as written, or else the bare file name beside the mesh.
fs::path texture_path(const std::string& name, const fs::path& mesh_path) {
  std::string slashes = name;
  std::replace(slashes.begin(), slashes.end(), '\\', '/');
  const fs::path folder = mesh_path.parent_path();
  const fs::path inside =
      fs::path(slashes).is_relative() ? folder / slashes : folder / fs::path(slashes).filename();
  return fs::exists(inside) ? inside : folder / fs::path(slashes).filename();
}

Result<cv::Mat> texture_beside(const fs::path& path, const fs::path& mesh_path, bool with_alpha) {
  auto image = read_image(path, {.alpha = with_alpha ? Alpha::kept : Alpha::ignored});
  if (!image) return error("{}: its texture cannot be read: {}", mesh_path.string(), image.message());
  return image;
}

// The alpha below which a glTF material has holes; 0: it has none. Transparency (alphaMode BLEND) is rounded
// at one half, because projected light cannot be transparent.
float cut_below(const aiMaterial& source) {
  aiString mode;
  if (source.Get(AI_MATKEY_GLTF_ALPHAMODE, mode) != AI_SUCCESS || mode == aiString("OPAQUE")) return 0;
  float cutoff = 0.5F;
  if (mode == aiString("MASK")) source.Get(AI_MATKEY_GLTF_ALPHACUTOFF, cutoff);
  return cutoff;
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

// Assimp's translation is for a rotation about the image's middle; glTF rotates about the upper left corner.
TexturePlace place_of(const aiMaterial& source, aiTextureType type) {
  TexturePlace out;
  source.Get(AI_MATKEY_UVWSRC(type, 0), out.coordinates);
  aiUVTransform of_middle;
  if (source.Get(AI_MATKEY_UVTRANSFORM(type, 0), of_middle) != AI_SUCCESS) return out;
  const Eigen::Vector2f scale(of_middle.mScaling.x, of_middle.mScaling.y);
  const float c = std::cos(of_middle.mRotation), s = -std::sin(of_middle.mRotation);
  const Eigen::Translation2f offset(of_middle.mTranslation.x - scale.x() / 2 * (1 - c + s),
                                    1 - scale.y() - of_middle.mTranslation.y + scale.y() / 2 * (s + c - 1));
  const Eigen::Affine2f v_down = Eigen::Translation2f(0, 1) * Eigen::Scaling(1.F, -1.F);
  const Eigen::Rotation2Df turn(of_middle.mRotation);
  out.moved = v_down * offset * turn * Eigen::Scaling(scale.x(), scale.y()) * v_down;
  return out;
}

// The images that a file's materials name. Each is read once and shared.
class Images {
 public:
  Images(const aiScene& scene, const fs::path& path) : scene_(scene), path_(path) {}

  // Reads 8-bit BGR, or BGRA if the image has alpha and `with_alpha` is set.
  Result<Texture> read(const aiString& name, bool with_alpha) {
    const auto known = known_.find({name.C_Str(), with_alpha});
    if (known != known_.end()) return known->second;
    const aiTexture* embedded = scene_.GetEmbeddedTexture(name.C_Str());
    const fs::path file = embedded ? path_ : texture_path(name.C_Str(), path_);
    LIMN_TRY(cv::Mat image, embedded ? embedded_texture(*embedded, path_, with_alpha)
                                     : texture_beside(file, path_, with_alpha));
    if (image.channels() == 1) cv::cvtColor(image, image, cv::COLOR_GRAY2BGR);
    return known_[{name.C_Str(), with_alpha}] = Texture{image, file.string()};
  }

 private:
  const aiScene& scene_;
  const fs::path& path_;
  std::map<std::pair<std::string, bool>, Texture> known_;
};

// Reads one material.
class MaterialReader {
 public:
  MaterialReader(const aiMaterial& source, std::string name, Images* images)
      : source_(source), place_(texture_place(source)), name_(std::move(name)), images_(*images) {}

  Result<Material> read(bool is_gltf) {
    Material material;
    aiColor4D colour(1, 1, 1, 1);
    if (source_.Get(AI_MATKEY_BASE_COLOR, colour) == AI_SUCCESS ||
        source_.Get(AI_MATKEY_COLOR_DIFFUSE, colour) == AI_SUCCESS) {
      material.base_colour = {colour.r, colour.g, colour.b};
    }
    int shading = 0;
    material.unlit =
        source_.Get(AI_MATKEY_SHADING_MODEL, shading) == AI_SUCCESS && shading == aiShadingMode_Unlit;
    source_.Get(AI_MATKEY_METALLIC_FACTOR, material.metallic);
    source_.Get(AI_MATKEY_ROUGHNESS_FACTOR, material.roughness);
    LIMN_TRY_STATUS(read_base_texture(colour.a, &material));
    if (is_gltf) read_maps(&material);
    return material;
  }

 private:
  // `alpha` multiplies the texture's alpha.
  Status read_base_texture(float alpha, Material* material) {
    const float below = cut_below(source_);
    const float texture_below = below > 0 ? below / std::max(alpha, 1e-6F) : 0;
    for (const aiTextureType type : {aiTextureType_BASE_COLOR, aiTextureType_DIFFUSE}) {
      aiString name;
      if (source_.GetTexture(type, 0, &name) != AI_SUCCESS || name.length == 0) continue;
      LIMN_TRY(const Texture texture, images_.read(name, below > 0));
      material->texture = texture.image;
      material->texture_file = texture.file;
      break;
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
    aiColor4D emitted(0, 0, 0, 1);
    source_.Get(AI_MATKEY_COLOR_EMISSIVE, emitted);
    material->emitted = {emitted.r, emitted.g, emitted.b};
    maps.metallic_roughness = map_of(aiTextureType_UNKNOWN, "metallic-roughness texture",
                                     fmt::format("with metalness {} and roughness {} all over",
                                                 material->metallic, material->roughness))
                                  .value_or(Texture{});
    maps.normals = map_of(aiTextureType_NORMALS, "normal texture", "smooth").value_or(Texture{});
    maps.occlusion =
        map_of(aiTextureType_LIGHTMAP, "occlusion texture", "in soft light everywhere").value_or(Texture{});
    source_.Get(AI_MATKEY_GLTF_TEXTURE_SCALE(aiTextureType_NORMALS, 0), maps.normal_scale);
    source_.Get(AI_MATKEY_GLTF_TEXTURE_STRENGTH(aiTextureType_LIGHTMAP, 0), maps.occlusion_strength);
    if (material->emitted.isZero()) return;
    if (const auto emission = map_of(aiTextureType_EMISSIVE, "emissive texture", "without light of its own"))
      maps.emission = *emission;
    else
      material->emitted.setZero();
  }

  // A texture without an image when the material names none. Nullopt when the image cannot be read; a warning
  // then says how the material is shown (`instead`).
  std::optional<Texture> map_of(aiTextureType type, const std::string& what, const std::string& instead) {
    aiString name;
    if (source_.GetTexture(type, 0, &name) != AI_SUCCESS || name.length == 0) return Texture{};
    note_place(type, what);
    auto texture = images_.read(name, false);
    if (texture) return std::move(texture).value();
    log_warning(
        "{}: expected a readable {}, found none ({}). The material is shown {}. Save the texture beside the "
        "mesh, or export the mesh again.",
        name_, what, texture.message(), instead);
    return std::nullopt;
  }

  // Warns when a texture's mapping differs from the one that all textures of the material are shown with.
  void note_place(aiTextureType type, const std::string& what) const {
    const TexturePlace own = place_of(source_, type);
    const bool is_moved = !own.moved.isApprox(place_.moved, 1e-5F);
    if (own.coordinates == place_.coordinates && !is_moved) return;
    log_warning(
        "{}: expected its {} in the texture coordinates of its first texture (set {}), found {}. All "
        "textures "
        "are shown in the first one's. Bake all textures into one set of coordinates.",
        name_, what, place_.coordinates,
        own.coordinates != place_.coordinates ? fmt::format("coordinates {}", own.coordinates)
                                              : std::string("another KHR_texture_transform"));
  }

  const aiMaterial& source_;
  TexturePlace place_;
  std::string name_;  // names of the file and the material, for messages
  Images& images_;
};

}  // namespace

TexturePlace texture_place(const aiMaterial& material) {
  for (const aiTextureType type : {aiTextureType_BASE_COLOR, aiTextureType_DIFFUSE, aiTextureType_UNKNOWN,
                                   aiTextureType_NORMALS, aiTextureType_LIGHTMAP, aiTextureType_EMISSIVE})
    if (material.GetTextureCount(type) > 0) return place_of(material, type);
  return {};
}

Result<std::vector<Material>> read_materials(const aiScene& scene, const fs::path& path, bool is_gltf) {
  std::vector<Material> materials;
  Images images(scene, path);
  for (unsigned i = 0; i < scene.mNumMaterials; ++i) {
    const aiMaterial& source = *scene.mMaterials[i];
    const std::string own = source.GetName().C_Str();
    const std::string name =
        fmt::format("{}: material {}", path.string(), own.empty() ? std::to_string(i) : "'" + own + "'");
    LIMN_TRY(Material material, MaterialReader(source, name, &images).read(is_gltf));
    materials.push_back(std::move(material));
  }
  return materials;
}

}  // namespace limn::scene
