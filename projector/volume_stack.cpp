#include "projector/volume_stack.h"

#include <Eigen/Geometry>
#include <algorithm>

#include "projector/bindings.h"
#include "scene/volume_part.h"

namespace limn::projector {
namespace {

// Width, height and depth of the texture for all volumes; 0 without any.
Eigen::Vector3i stack_size(const scene::Scene& scene) {
  Eigen::Vector3i size = Eigen::Vector3i::Zero();
  for (const scene::Slot& slot : scene.slots)
    for (const scene::Variant& variant : slot.variants) {
      if (!variant.volume) continue;
      const auto& own = variant.volume->size;
      size = {std::max(size.x(), own[0]), std::max(size.y(), own[1]), size.z() + own[2]};
    }
  return size;
}

}  // namespace

Status VolumeStack::check_fits(const scene::Scene& scene) {
  if (!scene.section) return {};
  constexpr double k_most_gib = 2;
  GLint most = 0;
  glGetIntegerv(GL_MAX_3D_TEXTURE_SIZE, &most);
  const Eigen::Vector3i size = stack_size(scene);
  const double gib = size.cast<double>().prod() * sizeof(float) / (1 << 30);
  if (size.maxCoeff() <= most && gib <= k_most_gib) return {};
  return error(
      "scene: expected volumes that fit together into a texture of {} texels along each axis and {} GiB, "
      "found {} "
      "x {} x {} ({:.1f} GiB; one lies on top of the other). Show fewer volumes, or resample them.",
      most, k_most_gib, size.x(), size.y(), size.z(), gib);
}

VolumeStack::VolumeStack(const scene::Scene& scene) {
  const Eigen::Vector3i size = stack_size(scene);
  if (!scene.section || size.z() == 0) return;
  texels_ = make_texture(GL_TEXTURE_3D, GL_R32F, size.x(), size.y(), size.z());
  glTextureParameteri(*texels_, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
  glTextureParameteri(*texels_, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
  const Eigen::Vector3d texel = size.cast<double>().cwiseInverse();
  int first = 0;  // the layer where a volume begins
  for (const scene::Slot& slot : scene.slots)
    for (const scene::Variant& variant : slot.variants) {
      if (!variant.volume) continue;
      const scene::Volume& volume = *variant.volume;
      const Eigen::Vector3i own(volume.size[0], volume.size[1], volume.size[2]);
      glTextureSubImage3D(*texels_, 0, 0, 0, first, own.x(), own.y(), own.z(), GL_RED, GL_FLOAT,
                          volume.values.data());
      // The centre of a texel is half a texel from its edge.
      const Eigen::Vector3d lower(0.5, 0.5, first + 0.5);
      const Eigen::Vector3d upper = lower + (own - Eigen::Vector3i::Ones()).cast<double>();
      const Eigen::Affine3d texture_from_voxel = Eigen::Scaling(texel) * Eigen::Translation3d(lower);
      indices_[slot.name][variant.name] = static_cast<int>(volumes_.size());
      volumes_.push_back({scene::shown_window(variant, {}),
                          texture_from_voxel * volume.part_from_voxel.inverse(), lower.cwiseProduct(texel),
                          upper.cwiseProduct(texel)});
      first += own.z();
    }
}

StackedVolume VolumeStack::find(const std::string& slot,
                                const std::string& variant,
                                const std::optional<scene::GreyWindow>& chosen) const {
  const auto in_slot = indices_.find(slot);
  if (in_slot == indices_.end()) return {};
  const auto found = in_slot->second.find(variant);
  if (found == in_slot->second.end()) return {};
  return {found->second, chosen.value_or(volumes_[static_cast<std::size_t>(found->second)].window)};
}

void VolumeStack::begin(int owners) {
  const auto count = static_cast<std::size_t>(is_empty() ? 0 : owners);
  GpuPlace none;
  for (Eigen::Vector4f& row : none.rows) row.setZero();
  const bool is_new = gpu_places_.size() != count;
  gpu_places_.assign(count, none);
  if (!is_new || count == 0) return;
  places_ = make_buffer(gpu_places_.data(), count * sizeof(GpuPlace));
  place_texels_ = make_texels(places_, GL_RGBA32F);
}

void VolumeStack::place(int owner, const StackedVolume& shown, const Pose& owner_from_scene) {
  if (shown.index < 0) return;
  const Entry& volume = volumes_[static_cast<std::size_t>(shown.index)];
  GpuPlace& place = gpu_places_[static_cast<std::size_t>(owner)];
  const Eigen::Matrix4d texture_from_scene = volume.texture_from_part.matrix() * owner_from_scene.matrix();
  for (int i = 0; i < 3; ++i) place.rows[i] = texture_from_scene.row(i).transpose().cast<float>();
  place.lower << volume.lower.cast<float>(), static_cast<float>(1 / shown.window.width);
  place.upper << volume.upper.cast<float>(), static_cast<float>(shown.window.level - shown.window.width / 2);
}

void VolumeStack::upload() {
  if (is_empty()) return;
  glNamedBufferSubData(*places_, 0, static_cast<GLsizeiptr>(gpu_places_.size() * sizeof(GpuPlace)),
                       gpu_places_.data());
}

void VolumeStack::bind() const {
  if (is_empty()) return;
  glBindTextureUnit(k_volumes_unit, *texels_);
  glBindTextureUnit(k_volume_places_unit, *place_texels_);
}

}  // namespace limn::projector
