#include "scene/meshes/mesh_formats.h"

#include <algorithm>
#include <iterator>

#include "scene/meshes/cad_file.h"
#include "scene/meshes/read_3mf.h"
#include "scene/meshes/read_gltf.h"
#include "scene/meshes/read_obj.h"
#include "scene/meshes/read_ply.h"
#include "scene/meshes/read_stl.h"
#include "scene/meshes/read_with_assimp.h"

namespace limn::scene {
namespace {

namespace fs = std::filesystem;

struct MeshFormat {
  const char* end;
  Result<MeshContent> (*read)(const fs::path& path);
  bool states_unit;
};

constexpr MeshFormat k_mesh_formats[] = {
    {".glb", read_gltf, true},         {".gltf", read_gltf, true},        {".obj", read_obj, false},
    {".stl", read_stl, false},         {".ply", read_ply, false},         {".3mf", read_3mf, true},
    {".fbx", read_with_assimp, true},  {".dae", read_with_assimp, true},  {".amf", read_with_assimp, true},
    {".3ds", read_with_assimp, false}, {".off", read_with_assimp, false}, {".lwo", read_with_assimp, false},
    {".x", read_with_assimp, false},   {".ac", read_with_assimp, false},  {".step", read_cad, true},
    {".stp", read_cad, true},          {".iges", read_cad, true},         {".igs", read_cad, true}};

const MeshFormat* format_of(const fs::path& path) {
  const std::string end = lower_extension(path);
  const auto* const known = std::find_if(std::begin(k_mesh_formats), std::end(k_mesh_formats),
                                         [&](const MeshFormat& f) { return end == f.end; });
  return known == std::end(k_mesh_formats) ? nullptr : known;
}

}  // namespace

Result<MeshContent> read_mesh_content(const fs::path& path) {
  const MeshFormat* format = format_of(path);
  if (format) return format->read(path);
  return error("{}: expected a mesh file ({}), found '{}'. Export it as one of these.", path.string(),
               mesh_formats(), path.extension().string());
}

bool states_unit(const fs::path& path) {
  const MeshFormat* format = format_of(path);
  return format && format->states_unit;
}

bool is_mesh_name(const fs::path& path) { return format_of(path) != nullptr; }

std::string mesh_formats() {
  std::string text;
  for (const MeshFormat& format : k_mesh_formats)
    text += (text.empty()                              ? ""
             : &format == std::end(k_mesh_formats) - 1 ? " or "
                                                       : ", ") +
            std::string(format.end);
  return text;
}

}  // namespace limn::scene
