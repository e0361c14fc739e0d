#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "limn/bodies.h"
#include "limn/export.h"
#include "limn/image.h"
#include "limn/pose.h"
#include "limn/rig.h"

namespace limn::LIMN_VERSIONED {
/// A place for one part, carried by a marker.
struct Slot {
  std::string name = {};
  std::vector<std::string> variants = {};  ///< the parts that it may show
};

/// A part in its place. Part frame: that of its mesh file, in metres.
struct PosedPart {
  std::string slot = {};
  std::string variant = {};
  Pose world_from_part = {};
};

/// The eye of somebody who looks.
struct Viewpoint {
  std::string viewer = {};
  Point3 p_world = {0, 0, 0};
  double weight = 1;
};

/// A scene at a moment. Change what you want to see elsewhere.
struct PosedScene {
  std::optional<Pose> world_from_prototype = {};  ///< none: not seen
  std::vector<PosedPart> parts = {};              ///< those that are seen
  std::vector<Viewpoint> viewpoints = {};         ///< the scene's viewers that are seen
};

/// The prototype and the parts of a scene.json, with the files that it names. It does not change, and a
/// copy costs nothing.
class LIMN_API Scene {
 public:
  /// `path` is the scene.json or its folder. Errors: a file that cannot be read; the message names it.
  static Scene load(const std::filesystem::path& path);

  bool has_prototype() const;
  std::vector<Slot> slots() const;
  /// What carries markers: `prototype` and each slot, with its name. For Tracker and locate_bodies().
  std::vector<Body> bodies() const;
  /// The families that a detector needs; its option `folder` is folder().
  std::vector<std::string> families() const;
  std::filesystem::path folder() const;

  /// The scene with the poses of tracks of bodies(). `variants[i]` is what slot i shows (absent: its
  /// first). Lost tracks are left out.
  PosedScene posed(std::span<const Track> tracks, std::span<const std::string> variants = {}) const;
  /// Reads a POSES.json (docs/formats.md).
  PosedScene load_poses(const std::filesystem::path& path) const;
  /// The viewer that `limn render` draws for: the scene's own, if it is seen, else the rig's first camera.
  /// Error: neither.
  Imager viewer(const PosedScene& posed, const Rig& rig) const;

  struct Impl;
  explicit Scene(std::shared_ptr<const Impl> impl);  ///< for the library itself
  const Impl& impl() const { return *impl_; }        ///< for the library itself

 private:
  std::shared_ptr<const Impl> impl_;
};

/// Where OpenGL 4.5 (core) comes from.
enum class GlContext {
  headless,  ///< a context of its own, through EGL; it becomes the current one of the thread with every
             ///< call
  current    ///< the caller's, which must be current at every call and when the renderer ends; its state is
             ///< changed
};

/// How a projector's image treats markers.
enum class MarkerLight {
  as_is,     ///< parts are painted over them
  keep_out,  ///< no light on them
  spotlight  ///< even white, for dark rooms
};

struct RendererOptions {
  GlContext context = GlContext::headless;
  bool compensate_geometry = false;  ///< divides out distance, incidence, vignetting and the scene's albedo
  bool even_black = false;           ///< hides the edges of overlaps in dark scenes; costs contrast
  MarkerLight marker_light = MarkerLight::as_is;
};

/// Which pixels of the parts a composite draws.
enum class Composite {
  rest,  ///< only what projected light cannot show
  full   ///< the whole parts
};

/// Draws a posed scene for a rig, pixel for pixel what `limn render` writes. Use it from one thread.
///
///     limn::Renderer renderer(scene, rig);
///     limn::Image image = renderer.draw_projector(0, posed, scene.viewer(posed, rig));
class LIMN_API Renderer {
 public:
  /// Errors: no OpenGL 4.5 (what was tried is in the message); more triangles than the driver takes.
  Renderer(const Scene& scene, const Rig& rig, const RendererOptions& options = {});
  Renderer(Renderer&&) noexcept;
  Renderer& operator=(Renderer&&) noexcept;
  ~Renderer();

  /// GL_RENDERER and GL_VERSION of the headless context; empty for the caller's.
  const std::string& gl_description() const;

  /// The image for a projector: display values by its measured response (gamma 2.2 without one). `view`
  /// parts appear as seen from the viewer's position. Error: no such projector.
  Image draw_projector(std::size_t projector, const PosedScene& posed, const Imager& viewer);
  /// The same into the caller's memory. Error: not of the projector's size, or grey.
  void draw_projector(std::size_t projector,
                      const PosedScene& posed,
                      const Imager& viewer,
                      const MutableImageView& out);
  /// The same, left on the GPU: the name of a texture (GL_RGBA8, first row first, of the projector's size),
  /// which keeps its contents until the next call for this projector. Without the treatment of markers.
  unsigned draw_projector_texture(std::size_t projector, const PosedScene& posed, const Imager& viewer);

  /// The parts drawn into an image of a camera of the rig, in its distorted pixels. Error: not of the
  /// camera's size.
  Image draw_composite(std::size_t camera, const ImageView& image, const PosedScene& posed, Composite what);
  /// Into the caller's memory, which may be the image's own.
  void draw_composite(std::size_t camera,
                      const ImageView& image,
                      const PosedScene& posed,
                      Composite what,
                      const MutableImageView& out);

  /// Prototype and parts as a virtual camera sees them, on a plain dark background.
  Image draw_view(const Imager& camera, const PosedScene& posed);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace limn::LIMN_VERSIONED
