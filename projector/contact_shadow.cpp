#include "projector/contact_shadow.h"

#include <Eigen/Geometry>
#include <algorithm>

#include "projector/bindings.h"
#include "projector/cap_counter.h"
#include "scene/meshes/mesh_bvh.h"

namespace limn::projector {
namespace {

// Distance fields side by side in the texture: GL 4.5 guarantees 2048 texels for each side.
constexpr int k_most_in_a_row = 32;

}  // namespace

DistanceField distance_field(const scene::Mesh& mesh, double farthest_m) {
  DistanceField field;
  if (mesh.triangles.empty()) return field;
  Eigen::AlignedBox3f box;
  for (const auto& triangle : mesh.triangles)
    for (const std::uint32_t corner : triangle) box.extend(mesh.positions[corner]);
  const Eigen::Vector3f margin = Eigen::Vector3f::Constant(static_cast<float>(farthest_m));
  field.p_lower = box.min() - margin;
  field.p_upper = box.max() + margin;
  const Eigen::Vector3f step = (field.p_upper - field.p_lower) / (DistanceField::k_nodes - 1);
  const scene::MeshBvh surface(mesh);
  field.distances.reserve(static_cast<std::size_t>(DistanceField::k_nodes) * DistanceField::k_nodes *
                          DistanceField::k_nodes);
  for (int z = 0; z < DistanceField::k_nodes; ++z)
    for (int y = 0; y < DistanceField::k_nodes; ++y) {
      double before = farthest_m;
      for (int x = 0; x < DistanceField::k_nodes; ++x) {
        const Eigen::Vector3f p = field.p_lower + step.cwiseProduct(Eigen::Vector3i(x, y, z).cast<float>());
        // A step along x changes the distance by at most the step.
        const double at_most = std::min(farthest_m, before + 1.001 * static_cast<double>(step.x()));
        const auto found = surface.nearest(p.cast<double>(), at_most);
        before = found ? found->distance : farthest_m;
        field.distances.push_back(static_cast<float>(before));
      }
    }
  return field;
}

ContactShadow::ContactShadow(const scene::Scene& scene) {
  constexpr int k_nodes = DistanceField::k_nodes;
  section_ = scene.section;
  std::vector<DistanceField> all;
  for (const scene::Slot& slot : scene.slots) {
    SlotFields& fields = slots_.emplace_back(SlotFields{slot.name, {}});
    if (slot.mode != scene::Mode::view) continue;
    for (const scene::Variant& variant : slot.variants) {
      DistanceField field = distance_field(variant.mesh, k_reach);
      if (field.distances.empty()) continue;
      const int index = static_cast<int>(all.size());
      GpuField& gpu = fields.variants[variant.name];
      gpu.lower << field.p_lower, 1;
      const Eigen::Vector3f size = field.p_upper - field.p_lower;
      for (int axis = 0; axis < 3; ++axis) gpu.nodes_per_m[axis] = (k_nodes - 1) / size[axis];
      gpu.first.head<2>() << static_cast<float>(k_nodes * (index % k_most_in_a_row)),
          static_cast<float>(k_nodes * (index / k_most_in_a_row));
      all.push_back(std::move(field));
    }
  }
  const int count = std::max(1, static_cast<int>(all.size()));
  distances_ = make_texture(GL_TEXTURE_3D, GL_R16F, k_nodes * std::min(count, k_most_in_a_row),
                            k_nodes * (1 + (count - 1) / k_most_in_a_row), k_nodes);
  for (const GLenum filter : {GL_TEXTURE_MIN_FILTER, GL_TEXTURE_MAG_FILTER})
    glTextureParameteri(*distances_, filter, GL_LINEAR);
  glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
  for (int i = 0; i < static_cast<int>(all.size()); ++i)
    glTextureSubImage3D(*distances_, 0, k_nodes * (i % k_most_in_a_row), k_nodes * (i / k_most_in_a_row), 0,
                        k_nodes, k_nodes, k_nodes, GL_RED, GL_FLOAT,
                        all[static_cast<std::size_t>(i)].distances.data());
  shown_fields_.resize(slots_.size() + 1);
  fields_ = make_buffer(shown_fields_.data(), shown_fields_.size() * sizeof(GpuField));
}

void ContactShadow::place(const scene::PosedScene& posed) {
  std::fill(shown_fields_.begin(), shown_fields_.end(), GpuField());
  for (const scene::PosedPart& part : posed.parts)
    for (std::size_t i = 0; i < slots_.size(); ++i) {
      if (slots_[i].name != part.slot) continue;
      const auto field = slots_[i].variants.find(part.variant);
      if (field == slots_[i].variants.end()) continue;
      shown_fields_[i + 1] = field->second;
      if (posed.cut && section_ && section_->cuts(part.slot))
        shown_fields_[i + 1].cut =
            coefficients(scene::transformed(part.world_from_part.inverse(), *posed.cut));
    }
  glNamedBufferSubData(*fields_, 0, static_cast<GLsizeiptr>(shown_fields_.size() * sizeof(GpuField)),
                       shown_fields_.data());
}

void ContactShadow::bind(const Use& use) const {
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, k_distance_fields_buffer, *fields_);
  glBindTextureUnit(k_distances_unit, *distances_);
  use.program.set("u_free", static_cast<float>(k_free));
  use.program.set("u_widening", static_cast<float>(k_widening));
}

}  // namespace limn::projector
