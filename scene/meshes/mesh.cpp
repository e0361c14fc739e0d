#include "scene/meshes/mesh.h"

#include <algorithm>
#include <array>
#include <mutex>
#include <numeric>

#include "scene/meshes/cad_file.h"
#include "scene/meshes/mesh_content.h"
#include "scene/meshes/mesh_formats.h"
#include "scene/meshes/mesh_from_content.h"
#include "scene/meshes/mesh_loading.h"
#include "scene/meshes/mesh_trial.h"

namespace limn::scene {
namespace {

namespace fs = std::filesystem;

// One mesh is read at a time, because assimp's logger is global and a process is copied for the trial.
Result<MeshContent> read_safely(const fs::path& path) {
  static std::mutex one_at_a_time;
  const std::lock_guard lock(one_at_a_time);
  LIMN_TRY_STATUS(try_mesh_reader(path));
  return read_mesh_content(path);
}

Result<MeshContent> load_content(const fs::path& path, const CadWait& wait) {
  if (!is_mesh_name(path)) return read_mesh_content(path).error();
  std::error_code none;
  if (!fs::is_regular_file(path, none))
    return error("{}: expected a mesh file, found no file. Check the name.", path.string());
  if (is_cad_name(path)) {
    LIMN_TRY(CadGlb glb, cad_as_glb(path, {}, wait));
    auto triangles = read_safely(glb.path);
    if (!triangles) {  // what was kept has been damaged since
      fs::remove(glb.path, none);
      LIMN_TRY(glb, cad_as_glb(path, {}, wait));
      LIMN_TRY(triangles, read_safely(glb.path));
    }
    return with_cad_unit(std::move(*triangles), glb);
  }
  return read_safely(path);
}

}  // namespace

double metres_per_unit(LengthUnit units) {
  switch (units) {
    case LengthUnit::metre:
      return 1;
    case LengthUnit::centimetre:
      return 0.01;
    case LengthUnit::millimetre:
      return 0.001;
    case LengthUnit::inch:
      return 0.0254;
    case LengthUnit::foot:
      break;
  }
  return 0.3048;
}

Result<Mesh> load_mesh(const fs::path& path, std::optional<LengthUnit> units) {
  return load_mesh(path, units, CadWait());
}

Result<Mesh> load_mesh(const fs::path& path, std::optional<LengthUnit> units, const CadWait& wait) {
  LIMN_TRY(MeshContent content, load_content(path, wait));
  if (!content.variants.empty())
    content.warnings.push_back(fmt::format(
        "{}: its {} material variants are not used here; it has the materials that the file uses by default.",
        path.string(), content.variants.size()));
  content.variants.clear();
  for (MeshPiece& piece : content.pieces) piece.variant_materials.clear();
  LIMN_TRY(MeshWithVariants meshes, meshes_from_content(std::move(content), path, units));
  return std::move(meshes.mesh);
}

Result<MeshWithVariants> load_mesh_with_variants(const fs::path& path, std::optional<LengthUnit> units) {
  return load_mesh_with_variants(path, units, CadWait());
}

Result<MeshWithVariants> load_mesh_with_variants(const fs::path& path,
                                                 std::optional<LengthUnit> units,
                                                 const CadWait& wait) {
  LIMN_TRY(MeshContent content, load_content(path, wait));
  return meshes_from_content(std::move(content), path, units);
}

std::vector<std::uint32_t> first_at_place(const Mesh& mesh) {
  std::vector<std::uint32_t> by_place(mesh.positions.size()), place(mesh.positions.size());
  std::iota(by_place.begin(), by_place.end(), 0U);
  const auto coordinates = [&](std::uint32_t i) {
    const Eigen::Vector3f& p = mesh.positions[i];
    return std::array<float, 3>{p.x(), p.y(), p.z()};
  };
  std::sort(by_place.begin(), by_place.end(),
            [&](std::uint32_t i, std::uint32_t k) { return coordinates(i) < coordinates(k); });
  for (std::size_t i = 0; i < by_place.size(); ++i) {
    const bool is_same = i > 0 && coordinates(by_place[i]) == coordinates(by_place[i - 1]);
    place[by_place[i]] = is_same ? place[by_place[i - 1]] : by_place[i];
  }
  return place;
}

}  // namespace limn::scene
