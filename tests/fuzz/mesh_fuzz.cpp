// Meshes with their textures. The first line is the ending of the mesh's name, such as .obj. Lines of %%
// divide the rest into the mesh and the files beside it: mesh.mtl, texture.png, mesh.bin. A .3mf may be given
// as its XML only, because an archive's checksums would reject every mutation inside it. What assimp and
// Draco read is left out, because assimp crashes on damaged files; the program tries every mesh in a child
// process first.
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "core/log.h"
#include "exchange/zip.h"
#include "scene/files/gltf_file.h"
#include "scene/meshes/mesh_formats.h"
#include "scene/meshes/mesh_from_content.h"
#include "tests/fuzz/fuzz_file.h"

namespace {

using namespace limn;
namespace fs = std::filesystem;

fs::path written(std::string_view bytes, const std::string& name) {
  return test::fuzzed_file(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size(), name);
}

// The text up to the separator, which is removed from `rest` together with it.
std::string_view cut_at(std::string_view separator, std::string_view* rest) {
  const std::size_t end = std::min(rest->find(separator), rest->size());
  const std::string_view first = rest->substr(0, end);
  rest->remove_prefix(std::min(end + separator.size(), rest->size()));
  return first;
}

fs::path written_mesh(std::string_view bytes, const std::string& ending) {
  if (ending != ".3mf" || bytes.starts_with("PK")) return written(bytes, "mesh" + ending);
  const auto packed = exchange::zipped({{"3D/3dmodel.model", std::string(bytes), true}});
  return written(packed.value(), "mesh.3mf");
}

// Whether assimp (glTF 1.0) or Draco reads the file.
bool is_for_library(const fs::path& path, std::string_view bytes) try {
  if (bytes.find("draco") != std::string_view::npos) return true;
  const auto gltf = scene::GltfFile::open(path);
  return gltf && gltf->version() == 1;
} catch (const nlohmann::json::exception&) {
  return false;
}

void check_image(const cv::Mat& image) {
  LIMN_CHECK(image.empty() || image.type() == CV_8UC3 || image.type() == CV_8UC4);
}

void check_material(const scene::Material& material) {
  LIMN_CHECK(material.base_colour.allFinite() && material.emitted.allFinite());
  LIMN_CHECK(std::isfinite(material.metallic) && std::isfinite(material.roughness));
  LIMN_CHECK(std::isfinite(material.maps.normal_scale) && std::isfinite(material.maps.occlusion_strength));
  const scene::SurfaceMaps& maps = material.maps;
  for (const cv::Mat* image : {&material.texture, &maps.metallic_roughness.image, &maps.normals.image,
                               &maps.occlusion.image, &maps.emission.image})
    check_image(*image);
}

void check_mesh(const scene::Mesh& mesh) {
  const std::size_t count = mesh.positions.size();
  LIMN_CHECK(mesh.metres_per_unit > 0 && mesh.normals.size() == count);
  for (const auto* uvs : {&mesh.uvs, &mesh.second_uvs}) {
    LIMN_CHECK(uvs->empty() || uvs->size() == count);
    for (const auto& uv : *uvs) LIMN_CHECK(uv.allFinite());
  }
  LIMN_CHECK(mesh.colours.empty() || mesh.colours.size() == count);
  LIMN_CHECK(mesh.tangents.empty() || mesh.tangents.size() == count);
  for (const auto& position : mesh.positions) LIMN_CHECK(position.allFinite());
  for (const auto& normal : mesh.normals) LIMN_CHECK(std::abs(normal.norm() - 1) < 1e-3F);
  for (const auto& colour : mesh.colours) LIMN_CHECK(colour.allFinite() && colour.minCoeff() >= 0);
  for (const auto& tangent : mesh.tangents) LIMN_CHECK(tangent.allFinite());
  LIMN_CHECK(!mesh.triangles.empty() && mesh.triangle_materials.size() == mesh.triangles.size());
  for (const auto& triangle : mesh.triangles)
    for (const std::uint32_t vertex : triangle) LIMN_CHECK(vertex < count);
  for (const std::uint16_t material : mesh.triangle_materials) LIMN_CHECK(material < mesh.materials.size());
  for (const scene::Material& material : mesh.materials) check_material(material);
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  set_log_level(LogLevel::quiet);
  std::string_view rest(reinterpret_cast<const char*>(bytes), size);
  const std::string ending(cut_at("\n", &rest));
  static const std::vector<std::string> k_endings = {".obj", ".stl", ".ply", ".gltf", ".glb", ".3mf"};
  if (std::find(k_endings.begin(), k_endings.end(), ending) == k_endings.end()) return 0;
  const std::string_view mesh_bytes = cut_at("\n%%\n", &rest);
  const fs::path path = written_mesh(mesh_bytes, ending);
  for (const char* beside : {"mesh.mtl", "texture.png", "mesh.bin"}) written(cut_at("\n%%\n", &rest), beside);
  if ((ending == ".glb" || ending == ".gltf") && is_for_library(path, mesh_bytes)) return 0;
  const auto content = scene::read_mesh_content(path);
  test::check_read(content, path);
  if (!content) return 0;
  const auto units = scene::states_unit(path) ? std::nullopt : std::optional(scene::LengthUnit::millimetre);
  const auto meshes = scene::meshes_from_content(*content, path, units);
  test::check_read(meshes, path);
  if (!meshes) return 0;
  check_mesh(meshes->mesh);
  for (const auto& variant : meshes->variants) check_mesh(variant.mesh);
  return 0;
}
