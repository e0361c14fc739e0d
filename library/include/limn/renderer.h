#pragma once

// Scenes, and their images: what projectors show on the prototype, and what a screen shows over a camera's
// image.
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
  /// The parts that it may show.
  std::vector<std::string> variants = {};
};

/// A part in its place. Part frame: that of its mesh file, in metres.
struct PosedPart {
  std::string slot = {};
  std::string variant = {};
  Pose world_from_part = {};
};

/// The eye of somebody who looks.
struct Viewpoint {
  /// As scene.json names it.
  std::string viewer = {};
  /// m
  Point3 p_world = {0, 0, 0};
  /// Its share where several look.
  double weight = 1;
};

/// A scene at a moment. Change what you want in another place.
struct PosedScene {
  /// None: it is not seen.
  std::optional<Pose> world_from_prototype = {};
  /// Those that are seen.
  std::vector<PosedPart> parts = {};
  /// The scene's viewers that are seen.
  std::vector<Viewpoint> viewpoints = {};
};

/// The prototype and the parts of a scene.json, with the files that it names. It does not change, and a copy
/// costs nothing.
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

  /// The scene with the poses of tracks of bodies(). `variants[i]` is what slot i shows (absent: its first).
  /// Lost tracks are left out.
  PosedScene posed(std::span<const Track> tracks, std::span<const std::string> variants = {}) const;
  /// Reads a POSES.json (docs/formats.md). Error: a file that cannot be read, a slot or variant that the
  /// scene lacks.
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
  /// A context of the renderer's own, through EGL, without a display. It is current only inside the calls:
  /// the
  /// thread keeps the EGL context that it has, and any thread may call, one at a time. A thread on which a
  /// context of GLX is current cannot have it.
  headless,
  /// The caller's, of any kind. It must be current at every call and when the renderer ends. Its state
  /// (program, framebuffer, viewport, textures, blending) is changed.
  current
};

/// How a projector's image treats markers.
enum class MarkerLight {
  /// Parts are painted over them.
  as_is,
  /// No light on them.
  keep_out,
  /// Even white, for dark rooms.
  spotlight
};

struct RendererOptions {
  GlContext context = GlContext::headless;
  /// Divides out distance, incidence, vignetting and the scene's albedo.
  bool compensate_geometry = false;
  /// Hides the edges of overlaps in dark scenes; costs contrast.
  bool even_black = false;
  MarkerLight marker_light = MarkerLight::as_is;
};

/// Which pixels of the parts a composite draws.
enum class Composite {
  /// Only what projected light cannot show.
  rest,
  /// The whole parts.
  full
};

/// Draws a posed scene for a rig. Projector images are, pixel for pixel, what `limn render` writes. In views
/// and composites this holds for a renderer's first one; after that only what moved is drawn again, and
/// pixels on its outline may differ, as they would with other samples. Use it from one thread at a time.
///
///     limn::Renderer renderer(scene, rig);
///     const limn::Image image = renderer.draw_projector(0, posed, scene.viewer(posed, rig));
class LIMN_API Renderer {
 public:
  /// Errors: no OpenGL 4.5 (the message says what was tried); a projector without a size; more triangles than
  /// the driver takes.
  Renderer(const Scene& scene, const Rig& rig, const RendererOptions& options = {});
  Renderer(Renderer&&) noexcept;
  Renderer& operator=(Renderer&&) noexcept;
  ~Renderer();

  /// GL_RENDERER and GL_VERSION of the headless context; empty for the caller's.
  const std::string& gl_description() const;

  /// The image for a projector, by its place in Rig::projectors(): display values by its measured response
  /// (gamma 2.2 without one). `view` parts appear as seen from the viewer's position; its size does not
  /// matter. Errors: no such projector; a part or variant that the scene lacks.
  Image draw_projector(std::size_t projector, const PosedScene& posed, const Imager& viewer);
  /// The same into the caller's memory. Error: not of the projector's size, or grey.
  void draw_projector(std::size_t projector,
                      const PosedScene& posed,
                      const Imager& viewer,
                      const MutableImageView& out);
  /// The same, left on the GPU: the name of a texture (GL_RGBA8, first row first, of the projector's size),
  /// which keeps its contents until the next call for this projector. Without the treatment of markers.
  /// Error: a headless context.
  unsigned draw_projector_texture(std::size_t projector, const PosedScene& posed, const Imager& viewer);

  /// The parts drawn into an image of a camera, by its place in Rig::cameras(), in its distorted pixels. The
  /// result is in colour (sRGB). Errors: no such camera; not of the camera's size; a part or variant that the
  /// scene lacks.
  Image draw_composite(std::size_t camera, const ImageView& image, const PosedScene& posed, Composite what);
  /// Into the caller's memory, which may be the image's own. Error: grey.
  void draw_composite(std::size_t camera,
                      const ImageView& image,
                      const PosedScene& posed,
                      Composite what,
                      const MutableImageView& out);

  /// Prototype and parts as a virtual camera sees them, on a plain dark background. Errors: a camera without
  /// a size; a part or variant that the scene lacks.
  Image draw_view(const Imager& camera, const PosedScene& posed);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace limn::LIMN_VERSIONED
