#include <draco/compression/decode.h>

#include "scene/meshes/draco_mesh.h"

namespace limn::scene {
namespace {

Result<DracoMesh> decoded(std::string_view bytes, const std::map<std::string, std::size_t>& ids) {
  draco::DecoderBuffer buffer;
  buffer.Init(bytes.data(), bytes.size());
  draco::Decoder decoder;
  auto read = decoder.DecodeMeshFromBuffer(&buffer);
  if (!read.ok()) return error("Draco: {}", read.status().error_msg());
  const draco::Mesh& mesh = *read.value();
  DracoMesh out;
  for (const auto& [name, id] : ids) {
    const draco::PointAttribute* attribute = mesh.GetAttributeByUniqueId(static_cast<std::uint32_t>(id));
    if (!attribute) return error("Draco: no attribute {} for {}", id, name);
    const auto components = static_cast<std::size_t>(attribute->num_components());
    std::vector<float>& values = out.attributes[name];
    values.assign(static_cast<std::size_t>(mesh.num_points()) * components, 0);
    out.components[name] = components;
    for (draco::PointIndex point(0); point < mesh.num_points(); ++point)
      attribute->ConvertValue<float>(attribute->mapped_index(point), static_cast<std::int8_t>(components),
                                     &values[point.value() * components]);
  }
  out.indices.reserve(3 * static_cast<std::size_t>(mesh.num_faces()));
  for (draco::FaceIndex face(0); face < mesh.num_faces(); ++face)
    for (const draco::PointIndex& point : mesh.face(face)) out.indices.push_back(point.value());
  return out;
}

}  // namespace
}  // namespace limn::scene

extern "C" __attribute__((visibility("default"))) void limn_decode_draco(
    std::string_view bytes,
    const std::map<std::string, std::size_t>& ids,
    limn::Result<limn::scene::DracoMesh>* mesh) {
  *mesh = limn::scene::decoded(bytes, ids);
}
