#include "scene/meshes/gltf_variants.h"

#include <algorithm>
#include <nlohmann/json.hpp>

namespace limn::scene {
namespace {

using nlohmann::json;

constexpr const char* k_extension = "KHR_materials_variants";
constexpr std::size_t k_most_variants = 64;  // each is a mesh of its own

// The list at a key of the extension of `parent`; null when it does not have the extension.
Result<const json*> list_in(const GltfFile& file, const json& parent, const char* key) {
  const auto extensions = parent.find("extensions");
  if (extensions == parent.end() || !extensions->contains(k_extension)) return nullptr;
  const json& extension = extensions->at(k_extension);
  if (!extension.is_object() || !extension.contains(key) || !extension.at(key).is_array())
    return file.problem(
        fmt::format("expected {} with a list \"{}\", found {}", k_extension, key, short_text(extension)));
  return &extension.at(key);
}

}  // namespace

Result<std::vector<std::string>> read_variant_names(const GltfFile& file) {
  std::vector<std::string> names;
  LIMN_TRY(const json* variants, list_in(file, file.root(), "variants"));
  if (!variants) return names;
  if (variants->size() > k_most_variants)
    return file.problem(fmt::format("{}: expected at most {} variants, found {}", k_extension,
                                    k_most_variants, variants->size()));
  for (const json& variant : *variants) {
    const std::string given = variant.value("name", std::string());
    const std::string base = given.empty() ? fmt::format("variant {}", names.size() + 1) : given;
    std::string name = base;
    for (int again = 2; std::find(names.begin(), names.end(), name) != names.end(); ++again)
      name = fmt::format("{} {}", base, again);
    names.push_back(std::move(name));
  }
  return names;
}

Status read_variant_materials(const GltfFile& file,
                              const json& primitive,
                              std::size_t materials,
                              MeshPiece* piece) {
  LIMN_TRY(const json* mappings, list_in(file, primitive, "mappings"));
  if (!mappings) return {};
  const std::size_t variants = piece->variant_materials.size();
  for (const json& mapping : *mappings) {
    const std::size_t material = whole_number(mapping.at("material"));
    if (material >= materials)
      return file.problem(
          fmt::format("{}: expected one of {} materials, found number {}", k_extension, materials, material));
    for (const json& item : mapping.at("variants")) {
      const std::size_t variant = whole_number(item);
      if (variant >= variants)
        return file.problem(
            fmt::format("{}: expected one of {} variants, found number {}", k_extension, variants, variant));
      piece->variant_materials[variant] = material;
    }
  }
  return {};
}

}  // namespace limn::scene
