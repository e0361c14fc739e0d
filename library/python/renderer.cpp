#include "limn/renderer.h"

#include <memory>
#include <mutex>
#include <utility>

#include "library/python/calls.h"
#include "library/python/record.h"

namespace limn::python {
namespace {

void add_posed_scene(py::module_& module) {
  Record<Slot>(module, "Slot", "A place for one part, carried by a marker.")
      .field("name", &Slot::name, "Its name.")
      .field("variants", &Slot::variants, "The parts that it may show, a tuple of str.")
      .ended();
  Record<PosedPart>(module, "PosedPart", "A part in its place. Part frame: that of its mesh file, in metres.")
      .field("slot", &PosedPart::slot, "The slot's name.")
      .field("variant", &PosedPart::variant, "The variant's name.")
      .field("world_from_part", &PosedPart::world_from_part, "Where it is.")
      .init(
          [](std::string slot, std::string variant, const Pose& world_from_part) {
            return PosedPart{std::move(slot), std::move(variant), world_from_part};
          },
          py::arg("slot"), py::arg("variant"), py::arg("world_from_part"))
      .ended();
  Record<Viewpoint>(module, "Viewpoint", "The eye of somebody who looks.")
      .field("viewer", &Viewpoint::viewer, "The name of the scene's viewer.")
      .array<3>("p_world", &Viewpoint::p_world, "Where it is: m, shape (3,).")
      .field("weight", &Viewpoint::weight, "Beside the other viewpoints.")
      .init(
          [](std::string viewer, const Numbers<double, 3>& p_world, double weight) {
            return Viewpoint{std::move(viewer), p_world.values, weight};
          },
          py::arg("viewer"), py::arg("p_world"), py::arg("weight") = 1.0)
      .ended();
  Record<PosedScene>(module, "PosedScene",
                     R"(A scene at a moment. It does not change; to see something elsewhere, make another one:

    limn.PosedScene(posed.world_from_prototype, [limn.PosedPart("mirror", "sport", pose)]))")
      .field("world_from_prototype", &PosedScene::world_from_prototype, "None: not seen.")
      .field("parts", &PosedScene::parts, "Those that are seen, a tuple of PosedPart.")
      .field("viewpoints", &PosedScene::viewpoints,
             "The scene's viewers that are seen, a tuple of Viewpoint.")
      .init(
          [](const std::optional<Pose>& world_from_prototype, std::vector<PosedPart> parts,
             std::vector<Viewpoint> viewpoints) {
            return PosedScene{world_from_prototype, std::move(parts), std::move(viewpoints)};
          },
          py::arg("world_from_prototype") = py::none(), py::arg_v("parts", py::tuple(), "()"),
          py::arg_v("viewpoints", py::tuple(), "()"))
      .ended();
}

void add_scene(py::module_& module) {
  py::class_<Scene>(
      module, "Scene",
      R"(The prototype and the parts of a scene.json, with the files that it names. It does not change.)")
      .def_static(
          "load", released(&Scene::load), py::arg("path"),
          R"(`path` is the scene.json or its folder. Errors: a file that cannot be read; the message names it.)")
      .def_property_readonly("has_prototype", &Scene::has_prototype, "Whether the scene names a prototype.")
      .def_property_readonly(
          "slots", [](const Scene& scene) { return py::tuple(py::cast(scene.slots())); }, "A tuple of Slot.")
      .def_property_readonly(
          "bodies", [](const Scene& scene) { return py::tuple(py::cast(scene.bodies())); },
          R"(What carries markers: 'prototype' and each slot, with its name; a tuple of Body. For Tracker and
locate_bodies().)")
      .def_property_readonly(
          "families", [](const Scene& scene) { return py::tuple(py::cast(scene.families())); },
          "The families that a detector needs; its argument `folder` is this scene's.")
      .def_property_readonly("folder", &Scene::folder, "A pathlib.Path.")
      .def(
          "posed",
          [](const Scene& scene, const std::vector<Track>& tracks, const std::vector<std::string>& variants) {
            return without_gil([&] { return scene.posed(tracks, variants); });
          },
          py::arg("tracks"), py::arg_v("variants", py::tuple(), "()"),
          R"(The scene with the poses of tracks of `bodies`. variants[i] is what slot i shows (absent: its
first). Lost tracks are left out.)")
      .def(
          "load_poses",
          [](const Scene& scene, const std::filesystem::path& path) {
            return without_gil([&] { return scene.load_poses(path); });
          },
          py::arg("path"), "Reads a POSES.json (docs/formats.md).")
      .def(
          "viewer",
          [](const Scene& scene, const PosedScene& posed, const Rig& rig) {
            return without_gil([&] { return scene.viewer(posed, rig); });
          },
          py::arg("posed"), py::arg("rig"),
          R"(The viewer that `limn render` draws for: the scene's own, if it is seen, else the rig's first
camera. Error: neither.)")
      .def("__repr__", [](const Scene& scene) { return "<limn.Scene '" + scene.folder().string() + "'>"; });
}

// A renderer that several threads may use: they wait for each other.
class SharedRenderer {
 public:
  SharedRenderer(const Scene& scene, const Rig& rig, const RendererOptions& options)
      : cameras_(rig.cameras()),
        projectors_(rig.projectors()),
        renderer_(scene, rig, options),
        gl_description_(renderer_.gl_description()) {}

  // Calls draw(renderer) while other threads of Python run.
  template <class F>
  auto drawn(F&& draw) {
    return without_gil([&] {
      const std::lock_guard lock(mutex_);
      return draw(renderer_);
    });
  }

  const std::string& gl_description() const { return gl_description_; }
  ImageArray projector_image(std::size_t index) const { return image_for(projectors_, index); }
  ImageArray camera_image(std::size_t index) const { return image_for(cameras_, index); }

 private:
  // For an index that the rig lacks the renderer has a message, before it looks at the image.
  static ImageArray image_for(const std::vector<Imager>& imagers, std::size_t index) {
    if (index >= imagers.size()) return new_image(1, 1);
    return new_image(imagers[index].width(), imagers[index].height());
  }

  const std::vector<Imager> cameras_, projectors_;
  std::mutex mutex_;
  Renderer renderer_;
  const std::string gl_description_;
};

std::unique_ptr<SharedRenderer> new_renderer(const Scene& scene,
                                             const Rig& rig,
                                             GlContext context,
                                             bool compensate_geometry,
                                             bool even_black,
                                             MarkerLight marker_light) {
  const RendererOptions options = {context, compensate_geometry, even_black, marker_light};
  return without_gil([&] { return std::make_unique<SharedRenderer>(scene, rig, options); });
}

py::array draw_projector(SharedRenderer& renderer,
                         std::size_t projector,
                         const PosedScene& posed,
                         const Imager& viewer,
                         const std::optional<ImageArray>& out,
                         PixelFormat format) {
  const ImageArray image = out ? *out : renderer.projector_image(projector);
  const MutableImageView view = mutable_view_of(image, format);
  renderer.drawn([&](Renderer& own) { own.draw_projector(projector, posed, viewer, view); });
  return image.array;
}

py::array draw_composite(SharedRenderer& renderer,
                         std::size_t camera,
                         const ImageArray& image,
                         const PosedScene& posed,
                         Composite what,
                         const std::optional<ImageArray>& out,
                         PixelFormat format) {
  const ImageView behind = view_of(image, format);
  const ImageArray result = out ? *out : renderer.camera_image(camera);
  const MutableImageView view = mutable_view_of(result, format);
  renderer.drawn([&](Renderer& own) { own.draw_composite(camera, behind, posed, what, view); });
  return result.array;
}

void add_drawing(py::class_<SharedRenderer>& type) {
  type.def(
          "draw_projector", &draw_projector, py::arg("projector"), py::arg("posed"), py::arg("viewer"),
          py::kw_only(), py::arg("out") = py::none(), py::arg_v("format", PixelFormat::rgb, "'rgb'"),
          R"(The image for projector number `projector` of the rig: uint8, (height, width, 3), display values by
its measured response (gamma 2.2 without one). `view` parts appear as seen from the viewer's
position; its size does not matter. With `out` it is written there and `out` is returned; rows may
have gaps between them. format: 'rgb' or 'bgr'. Other threads of Python run meanwhile. Errors: no
such projector; a part or variant that the scene lacks; `out` not of the projector's size, or grey.)")
      .def(
          "draw_projector_texture",
          [](SharedRenderer& renderer, std::size_t projector, const PosedScene& posed, const Imager& viewer) {
            return renderer.drawn(
                [&](Renderer& own) { return own.draw_projector_texture(projector, posed, viewer); });
          },
          py::arg("projector"), py::arg("posed"), py::arg("viewer"),
          R"(The same, left on the GPU: the name of a texture (GL_RGBA8, first row first, of the projector's
size), which keeps its contents until the next call for this projector. Without the treatment of
markers. Error: a headless context.)")
      .def(
          "draw_composite", &draw_composite, py::arg("camera"), py::arg("image"), py::arg("posed"),
          py::arg("what"), py::kw_only(), py::arg("out") = py::none(),
          py::arg_v("format", PixelFormat::rgb, "'rgb'"),
          R"(The parts drawn into an image of camera number `camera` of the rig, in its distorted pixels: uint8,
(height, width, 3). what: 'rest', only what projected light cannot show, or 'full', the whole parts.
With `out` (which may be `image`) it is written there and `out` is returned. format: 'rgb' or 'bgr',
of a colour image and of the result. Other threads of Python run meanwhile. Errors: no such camera;
not of the camera's size; a part or variant that the scene lacks; a grey `out`.)")
      .def(
          "draw_view",
          [](SharedRenderer& renderer, const Imager& camera, const PosedScene& posed) {
            return owning(renderer.drawn([&](Renderer& own) { return own.draw_view(camera, posed); }));
          },
          py::arg("camera"), py::arg("posed"),
          R"(Prototype and parts as a virtual camera sees them, on a plain dark background: RGB, (height, width,
3). Errors: a camera without a size; a part or variant that the scene lacks.)");
}

}  // namespace

void add_renderer(py::module_& module) {
  add_posed_scene(module);
  add_scene(module);
  const RendererOptions defaults;
  py::class_<SharedRenderer> type(
      module, "Renderer",
      R"(Draws a posed scene for a rig. Projector images are, pixel for pixel, what `limn render` writes. In views
and composites this holds for a renderer's first one; after that only what moved is drawn again, and pixels on its
outline may differ, as they would with other samples. Threads that share one wait for each other.

    renderer = limn.Renderer(scene, rig)
    image = renderer.draw_projector(0, posed, scene.viewer(posed, rig)))");
  type.def(
          py::init(&new_renderer), py::arg("scene"), py::arg("rig"), py::kw_only(),
          py::arg_v("context", defaults.context, "'headless'"),
          py::arg("compensate_geometry") = defaults.compensate_geometry,
          py::arg("even_black") = defaults.even_black,
          py::arg_v("marker_light", defaults.marker_light, "'as_is'"),
          R"(context: 'headless': an OpenGL 4.5 context of its own, through EGL, without a display; it is current
only inside the calls. 'current': the caller's, which must be current at every call and when the
renderer ends; its state is changed. compensate_geometry: divides out distance, incidence,
vignetting and the scene's albedo. even_black: hides the edges of overlaps in dark scenes; costs
contrast. marker_light: 'as_is': parts are painted over markers; 'keep_out': no light on them;
'spotlight': even white, for dark rooms. Errors: no OpenGL 4.5 (the message says what was tried); a
projector without a size; more triangles than the driver takes.)")
      .def_property_readonly(
          "gl_description", &SharedRenderer::gl_description,
          R"(GL_RENDERER and GL_VERSION of the headless context; empty for the caller's.)");
  add_drawing(type);
}

}  // namespace limn::python
