#pragma once

#include <array>
#include <cstddef>

#include "projector/gl.h"
#include "projector/shader.h"

namespace limn::projector {

/// Everything that passes read and write.
enum class Resource {
  scene,              ///< Triangles, materials and poses of parts: GpuScene.
  viewpoints,         ///< Visible triangles and positions of projectors and viewer: VisibilityBuffers.
  occlusion,          ///< Share of the projectors' light that arrives: OcclusionMaps.
  lens,               ///< Rays of the imager that is drawn: GpuLens.
  room_light,         ///< Light that parts are shaded by: RoomLighting.
  projector,          ///< Which projector is drawn: ProjectorIndex.
  hit_cache,          ///< What the centres of its pixels see, and their blending shares: HitCache.
  light_balance,      ///< How colours become light: LightBalance.
  albedo,             ///< Albedo of the prototype: PrototypeAlbedo.
  contact_shadow,     ///< Distance fields of parts: ContactShadow.
  composite_weights,  ///< How much of each part a composite draws: CompositeWeights.
  light,              ///< Linear light that earlier passes drew, as a texture.
  response,           ///< Table of the projector's display values, as a texture.
  camera_image,       ///< The image behind a composite, as a texture.
  target,             ///< The image that the pass draws.
  work_list,          ///< Pixels that the pass lists or processes: PixelList.
  deferred_list,      ///< Pixels that the pass leaves to a later one: PixelList.
  depth,              ///< Depth buffer of a projector's triangle ids: DepthOfIds.
  depth_edges,        ///< Depth discontinuities of one projector, as an image.
  all_depth_edges,    ///< Depth discontinuities of all projectors, as a texture.
  edge_marks,         ///< Blocks at whose depth edges another projector takes over, as an image.
  edge_rows,          ///< Distances to these blocks along rows, as an image.
  edge_fade,          ///< Feathering weights near these blocks, as an image.
};
constexpr std::size_t k_resource_count = static_cast<std::size_t>(Resource::edge_fade) + 1;

/// How a pass is about to use a resource.
struct Use {
  Resource as;
  GLenum access;  ///< GL_READ_ONLY, GL_WRITE_ONLY or GL_READ_WRITE
  const Program& program;
};

/// Something that passes read or write. It knows its slots in shaders/bindings.glsl and its uniforms.
class Bindable {
 public:
  virtual void bind(const Use& use) const = 0;

 protected:
  ~Bindable() = default;
  Bindable() = default;
  Bindable(const Bindable&) = default;
  Bindable& operator=(const Bindable&) = default;
};

/// The resources available to the passes of one drawing. Borrows all of them.
class Resources {
 public:
  Resources with(Resource as, const Bindable& resource) const {
    Resources more = *this;
    more.all_[static_cast<std::size_t>(as)] = &resource;
    return more;
  }
  Resources with(Resource as, const Bindable&& resource) const = delete;
  /// Null when it holds no such resource.
  const Bindable* find(Resource as) const { return all_[static_cast<std::size_t>(as)]; }

 private:
  std::array<const Bindable*, k_resource_count> all_ = {};
};

/// A texture bound to a texture unit.
class TextureAt final : public Bindable {
 public:
  TextureAt(int unit, const GlName& texture) : unit_(static_cast<GLuint>(unit)), texture_(*texture) {}
  void bind(const Use&) const override { glBindTextureUnit(unit_, texture_); }

 private:
  GLuint unit_, texture_;
};

/// A texture, or one layer of it, bound to an image unit.
class ImageAt final : public Bindable {
 public:
  ImageAt(int unit, const GlName& texture, GLenum format, int layer = 0)
      : unit_(static_cast<GLuint>(unit)), texture_(*texture), format_(format), layer_(layer) {}
  void bind(const Use& use) const override {
    glBindImageTexture(unit_, texture_, 0, GL_FALSE, layer_, use.access, format_);
  }

 private:
  GLuint unit_, texture_;
  GLenum format_;
  GLint layer_;
};

/// Which projector is drawn.
class ProjectorIndex final : public Bindable {
 public:
  explicit ProjectorIndex(int index) : index_(index) {}
  explicit ProjectorIndex(std::size_t index) : index_(static_cast<int>(index)) {}
  void bind(const Use& use) const override { use.program.set("u_projector", index_); }

 private:
  int index_;
};

}  // namespace limn::projector
