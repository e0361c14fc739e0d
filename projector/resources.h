#pragma once

#include <array>
#include <cstddef>

#include "projector/gl.h"
#include "projector/shader.h"

namespace limn::projector {

/// What passes read and write.
enum class Resource {
  scene,              ///< triangles, materials and where parts stand: GpuScene
  viewpoints,         ///< what projectors and the eye see, and from where: Sights
  occlusion,          ///< how much of the projectors' light arrives: OcclusionMaps
  lens,               ///< rays of the imager that is drawn: GpuLens
  room_light,         ///< what parts are shaded by: RoomLighting
  projector,          ///< which projector is drawn: ProjectorIndex
  hit_cache,          ///< what the centres of its pixels see, and their shares of the light: HitCache
  light_balance,      ///< how colours become light: LightBalance
  albedo,             ///< of the prototype: PrototypeAlbedo
  contact_shadow,     ///< distances from parts: ContactShadow
  composite_weights,  ///< how much of each part a composite draws: CompositeWeights
  light,              ///< linear light that earlier passes drew, as a texture
  response,           ///< display values of the projector, as a texture
  camera_image,       ///< what a composite is laid over, as a texture
  target,             ///< what the pass draws, as an image
  work_list,          ///< pixels that the pass lists: PixelList
  deferred_list,      ///< pixels that the pass leaves to another one: PixelList
  depth,              ///< of a projector's ids: DepthOfIds
  depth_edges,        ///< of one projector, as an image
  all_depth_edges,    ///< of all projectors, as a texture
  edge_marks,         ///< blocks beside whose depth edges another projector goes on, as an image
  edge_rows,          ///< distances to them along rows, as an image
  edge_fade,          ///< light that the projector keeps beside them, as an image
};
constexpr std::size_t k_resource_count = static_cast<std::size_t>(Resource::edge_fade) + 1;

/// How a pass is about to use a resource.
struct Use {
  Resource as;
  GLenum access;  ///< GL_READ_ONLY, GL_WRITE_ONLY or GL_READ_WRITE
  const Program& program;
};

/// Something that passes read or write. It knows its places in shaders/bindings.glsl and its uniforms.
class Bindable {
 public:
  virtual void bind(const Use& use) const = 0;

 protected:
  ~Bindable() = default;
  Bindable() = default;
  Bindable(const Bindable&) = default;
  Bindable& operator=(const Bindable&) = default;
};

/// What there is for passes of one drawing. Borrows all of it.
class Resources {
 public:
  Resources with(Resource as, const Bindable& resource) const {
    Resources more = *this;
    more.all_[static_cast<std::size_t>(as)] = &resource;
    return more;
  }
  Resources with(Resource as, const Bindable&& resource) const = delete;
  /// Null when there is none.
  const Bindable* find(Resource as) const { return all_[static_cast<std::size_t>(as)]; }

 private:
  std::array<const Bindable*, k_resource_count> all_ = {};
};

/// A texture at its unit.
class TextureAt final : public Bindable {
 public:
  TextureAt(int unit, const GlName& texture) : unit_(static_cast<GLuint>(unit)), texture_(*texture) {}
  void bind(const Use&) const override { glBindTextureUnit(unit_, texture_); }

 private:
  GLuint unit_, texture_;
};

/// A texture, or one layer of it, at its image unit.
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
