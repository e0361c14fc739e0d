#include "scene/variant_loading.h"

#include <Eigen/Geometry>
#include <map>

#include "core/log.h"
#include "core/names.h"
#include "core/utf8.h"
#include "scene/meshes/mesh_formats.h"
#include "scene/part_units.h"
#include "scene/slot_folder.h"
#include "scene/volume_part.h"
#include "scene/volumes/volume_name.h"

namespace limn::scene {
namespace {

namespace fs = std::filesystem;

// An object much too small or large for a prototype was most likely drawn in another unit.
Status check_size(const Mesh& mesh, std::optional<LengthUnit> given) {
  constexpr double k_smallest_m = 1e-3, k_largest_m = 20;
  constexpr double k_likely_from_m = 0.02, k_likely_to_m = 6;
  Eigen::AlignedBox3f box;
  for (const Eigen::Vector3f& p : mesh.positions) box.extend(p);
  const double size_m = box.diagonal().cast<double>().norm();
  if (size_m >= k_smallest_m && size_m <= k_largest_m) return {};
  const LengthUnit units = given.value_or(LengthUnit::metre);
  const double in_file = size_m / metres_per_unit(units);
  std::vector<std::string> likely;
  for (const LengthUnit unit : {LengthUnit::millimetre, LengthUnit::centimetre, LengthUnit::metre,
                                LengthUnit::inch, LengthUnit::foot}) {
    const double as_m = in_file * metres_per_unit(unit);
    if (as_m >= k_likely_from_m && as_m <= k_likely_to_m)
      likely.push_back(fmt::format("{} ({:.3g} m)", to_text(unit), as_m));
  }
  return error(
      "expected an object of 1 mm to 20 m, found {:.3g} m across in {}. {}", size_m,
      given ? "units \"" + to_text(units) + "\"" : "the unit that the file states",
      likely.empty() ? "Check the mesh's size and unit." : "Is its unit " + joined_names(likely) + "?");
}

// A variant that shows a volume.
Result<Variant> load_volume_variant(const std::string& name, const MeshFile& file) {
  LIMN_TRY(Volume volume, load_volume(file.path));
  Variant variant{name, {}};
  variant.volume = std::make_shared<const Volume>(scaled(std::move(volume), file.scale));
  variant.mesh = volume_box(*variant.volume);
  variant.window = file.window;
  return variant;
}

const Mesh& mesh_of(const Mesh& mesh) { return mesh; }
const Mesh& mesh_of(const Variant& variant) { return variant.mesh; }
const Mesh& mesh_of(const MeshWithVariants& meshes) { return meshes.mesh; }

// What was loaded from a file that the scene names (Mesh, MeshWithVariants or Variant), if it has the size of
// an object.
template <class Loaded>
Result<Loaded> checked(Result<Loaded> loaded, const MeshFile& file, const fs::path& scene_path) {
  if (!loaded) return error("{}: {}: {}", scene_path.string(), file.where, loaded.message());
  if (const Status size = check_size(mesh_of(*loaded), file.units); !size)
    return error("{}: {} ({}): {}", scene_path.string(), file.where, file.path.filename().string(),
                 size.message());
  return loaded;
}

// The name of a material variant of a file in its slot. Names are also written into file names, so that
// slashes and control characters are replaced.
std::string variant_name(const std::string& file_variant, const std::string& material_variant) {
  std::string name = file_variant + " " + material_variant;
  for (char& c : name)
    if (c == '/' || c == '\\' || static_cast<unsigned char>(c) < ' ') c = '-';
  return name;
}

// A file's variants of a slot: that of its default materials, and those of its material variants.
struct FileVariants {
  Variant first;
  std::vector<MeshWithVariants::Variant> more;
};

// Imports a mesh from a slot's folder; `known_units` has the units that people have given, by variant.
Result<FileVariants> auto_import_mesh(const fs::path& file,
                                      const Slot& slot,
                                      std::span<const Variant> variants,
                                      const std::map<std::string, LengthUnit>& known_units,
                                      const CadWait& wait) {
  const std::string name = is_volume(file) ? volume_stem(file) : file.stem().string();
  if (!is_utf8(name))
    return error("{}: expected a file name in UTF-8, found other bytes. Rename the file.",
                 as_utf8(file.string()));
  if (find_named(slot.variants, name) || find_named(variants, name))
    return error(
        "{}: expected a file name that no other variant of slot '{}' has, found '{}' twice. Rename the file.",
        file.string(), slot.name, name);
  if (is_volume(file)) {
    LIMN_TRY(Variant volume, load_volume_variant(name, {"", file, {}, true}));
    if (const Status size = check_size(volume.mesh, {}); !size)
      return error("{}: {}", file.string(), size.message());
    return FileVariants{std::move(volume), {}};
  }
  const auto known = known_units.find(name);
  Variant::AutoImported import{std::nullopt, false};
  if (known != known_units.end()) import.units = known->second;
  import.is_guess = !import.units && !states_unit(file);
  LIMN_TRY(MeshWithVariants meshes,
           load_mesh_with_variants(file, import.is_guess ? LengthUnit::metre : import.units, wait));
  Mesh mesh = std::move(meshes.mesh);
  if (import.is_guess) import.units = guessed_units(mesh);
  if (import.is_guess) mesh = scaled(std::move(mesh), *import.units);
  if (const Status size = check_size(mesh, import.units); !size)
    return error("{}: {}", file.string(), size.message());
  Variant variant{name, std::move(mesh), import};
  if (import.is_guess) log_info("{}", units_question(slot, variant));
  return FileVariants{std::move(variant), std::move(meshes.variants)};
}

// Adds a file's material variants to a slot's variants. One whose name is taken is left out.
void add_material_variants(const Slot& slot,
                           const fs::path& file,
                           const std::string& file_variant,
                           std::vector<MeshWithVariants::Variant> more,
                           std::vector<Variant>* variants,
                           LeftOut* left_out) {
  for (MeshWithVariants::Variant& variant : more) {
    const std::string name = variant_name(file_variant, variant.name);
    if (find_named(slot.variants, name) || find_named(*variants, name))
      left_out->others.push_back(
          {slot.name, name,
           fmt::format("{}: expected a name for its material variant '{}' that no other variant of slot '{}' "
                       "has, found '{}' twice. Rename one of them.",
                       as_utf8(file.string()), variant.name, slot.name, name)});
    else
      variants->push_back({name, std::move(variant.mesh), {}, file_variant});
  }
}

}  // namespace

Result<Mesh> load_listed_mesh(const MeshFile& file, const fs::path& scene_path, const CadWait& wait) {
  return checked(load_mesh(file.path, file.units, wait), file, scene_path);
}

Status load_variants(std::span<const MeshFile> listed,
                     const fs::path& path,
                     const fs::path& scene_folder,
                     const CadWait& wait,
                     Slot* slot,
                     LeftOut* left_out) {
  std::vector<Variant> variants;
  for (std::size_t i = 0; i < listed.size(); ++i) {
    const std::string& name = slot->variants[i].name;
    if (listed[i].is_volume) {
      auto volume = checked(load_volume_variant(name, listed[i]), listed[i], path);
      if (volume)
        variants.push_back(std::move(*volume));
      else
        left_out->variants.push_back({slot->name, name, volume.message(), i == 0});
      continue;
    }
    auto meshes = checked(load_mesh_with_variants(listed[i].path, listed[i].units, wait), listed[i], path);
    if (!meshes) {
      left_out->variants.push_back({slot->name, name, meshes.message(), i == 0});
      continue;
    }
    variants.push_back({name, std::move(meshes->mesh)});
    add_material_variants(*slot, listed[i].path, name, std::move(meshes->variants), &variants, left_out);
  }
  const fs::path folder = scene_folder / "slots" / slot->name;
  LIMN_TRY(const auto known_units, load_units(folder / "units.json"));
  const SlotFolder files = list_slot_folder(folder);
  for (const fs::path& file : files.meshes) {
    auto found = auto_import_mesh(file, *slot, variants, known_units, wait);
    if (!found) {
      left_out->variants.push_back(
          {slot->name, as_utf8(is_volume(file) ? volume_stem(file) : file.stem().string()), found.message()});
      continue;
    }
    const std::string name = found->first.name;
    variants.push_back(std::move(found->first));
    add_material_variants(*slot, file, name, std::move(found->more), &variants, left_out);
  }
  for (const SlotFolder::Other& other : files.others)
    left_out->others.push_back({slot->name, as_utf8(other.path.filename().string()),
                                as_utf8(other.path.string()) + ": " + other.why});
  slot->variants = std::move(variants);
  return {};
}

void find_strays(const Scene& scene, LeftOut* left_out) {
  const fs::path slots = scene.folder / "slots";
  const std::string names = joined_names(scene.slots);
  for (const fs::path& mesh : list_slot_folder(slots).meshes) {
    if (std::error_code none; fs::is_directory(mesh, none)) continue;  // a slot's folder with slices in it
    left_out->others.push_back(
        {"(none)", as_utf8(mesh.filename().string()),
         fmt::format("{}: expected meshes in a slot's folder ({}), found one beside them. Move it there.",
                     as_utf8(mesh.string()), names)});
  }
  for (const SlotFolder::Other& other : list_slot_folder(slots).others)
    if (std::error_code none;
        fs::is_directory(other.path, none) && !scene.find_slot(other.path.filename().string()))
      left_out->others.push_back(
          {"(none)", as_utf8(other.path.filename().string()),
           fmt::format("{}: expected a folder named after a slot ({}), found another name. Rename it.",
                       as_utf8(other.path.string()), names)});
}

}  // namespace limn::scene
