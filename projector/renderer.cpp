#include "projector/renderer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <opencv2/imgproc.hpp>

#include "projector/contact_shadow.h"
#include "projector/gpu_scene.h"
#include "projector/light_layer.h"
#include "projector/parts_layer.h"
#include "projector/shader.h"
#include "projector/visibility_buffers.h"
#include "projector/composite_policy.h"

namespace limn::projector {
namespace {

constexpr int k_response_columns = 1025;
// Texture units; the scene takes unit 1, the sights four from k_sights_unit on.
constexpr int k_tangents_unit = 0, k_response_unit = 2, k_centre_unit = 3, k_image_unit = 4,
              k_sights_unit = 5, k_mixing_unit = 9, k_albedo_unit = 10, k_arriving_unit = 11,
              k_distances_unit = 12;
constexpr int k_arriving_side = 256;  // texels of a projector's map of arriving light
constexpr GLuint k_known_hits_image = 1, k_known_shares_image = 2;  // shaders/known.glsl
constexpr int k_each = 2, k_view = 3;  // overlays of parts treated each in its way, and of a virtual camera
// Steps of light that ask for more samples: beside light, and between blacks.
constexpr Smoothing k_light_edges, k_quick_edges{.samples = 4},
    k_dark_edges{.samples = 16, .least_step = 0.0001};
// The light where no room is known: soft, and a lamp, in the viewer's frame above and behind the left
// shoulder.
constexpr double k_soft_below = 0.15, k_soft_above = 0.35, k_lamp = 0.65;
const Eigen::Vector3d k_d_lamp_viewer = Eigen::Vector3d(-0.36, -0.64, -0.68).normalized();

// An image that is drawn into.
struct Canvas {
  int width = 0, height = 0;
  GlName texture, framebuffer;

  Canvas() = default;
  Canvas(int w, int h, GLenum format) : width(w), height(h) {
    texture = make_texture(GL_TEXTURE_2D, format, w, h);
    framebuffer = make_framebuffer();
    glNamedFramebufferTexture(*framebuffer, GL_COLOR_ATTACHMENT0, *texture, 0);
  }
};

// A byte an owner, in 255ths: how much of what light can show of its part a composite draws.
using Whole = std::array<GLuint, 64>;

Whole whole_of(Composite what) {
  Whole whole{};
  if (what == Composite::full) whole.fill(~0U);
  return whole;
}

Whole whole_of(std::span<const CompositePolicy> policies, std::span<const std::string> slots) {
  Whole whole{};
  for (std::size_t owner = 1; owner <= slots.size() && owner < 4 * whole.size(); ++owner)
    for (const CompositePolicy& treatment : policies)
      if (treatment.slot == slots[owner - 1])
        whole[owner / 4] |= static_cast<GLuint>(std::lround(255 * treatment.whole())) << owner % 4 * 8;
  return whole;
}

bool is_same(const Pose& a, const Pose& b) {
  return a.rotation.coeffs() == b.rotation.coeffs() && a.translation == b.translation;
}

bool is_same_prototype(const scene::PosedScene& a, const scene::PosedScene& b) {
  if (a.world_from_prototype.has_value() != b.world_from_prototype.has_value()) return false;
  return !a.world_from_prototype || is_same(*a.world_from_prototype, *b.world_from_prototype);
}

bool is_same(const scene::PosedScene& a, const scene::PosedScene& b) {
  return is_same_prototype(a, b) && a.light == b.light &&
         std::equal(a.parts.begin(), a.parts.end(), b.parts.begin(), b.parts.end(),
                    [](const auto& p, const auto& q) {
                      return p.slot == q.slot && p.variant == q.variant && p.material == q.material &&
                             is_same(p.world_from_part, q.world_from_part);
                    });
}

bool is_same(const LightOptions& a, const LightOptions& b) {
  return a.compensation == b.compensation && a.even_black == b.even_black && a.level == b.level;
}

bool is_same_lens(const Imager& a, const Imager& b) {
  return a.width == b.width && a.height == b.height && a.lens.model == b.lens.model &&
         a.lens.values == b.lens.values;
}

const ProjectorResponse* find_response(const Rig& rig, const std::string& projector) {
  const auto found = std::find_if(rig.responses.begin(), rig.responses.end(),
                                  [&](const ProjectorResponse& r) { return r.projector == projector; });
  return found == rig.responses.end() ? nullptr : &*found;
}

Status check_context() {
  if (epoxy_has_gl_extension("GL_ARB_direct_state_access") && epoxy_gl_version() >= 45) return {};
  return error("OpenGL: expected a current context of version 4.5 or later, found version {}.{}.",
               epoxy_gl_version() / 10, epoxy_gl_version() % 10);
}

// The mask and shares of the part of one owner in what coverage.frag wrote.
PartCoverage counted(const scene::PosedPart& part, const cv::Mat& seen, std::uint8_t owner) {
  constexpr std::uint8_t k_projected = 2;  // as in shaders/seen.glsl
  PartCoverage out{part.slot, part.variant, 0, 0, 0, cv::Mat::zeros(seen.size(), CV_8U)};
  int projected = 0;
  for (int row = 0; row < seen.rows; ++row) {
    for (int column = 0; column < seen.cols; ++column) {
      const auto& pixel = seen.at<cv::Vec2b>(row, column);
      if (pixel[0] != owner) continue;
      const bool is_projected = pixel[1] == k_projected;
      out.mask.at<std::uint8_t>(row, column) = is_projected ? 255 : 128;
      ++out.viewer_pixels;
      projected += is_projected;
    }
  }
  if (out.viewer_pixels > 0) {
    out.on_surface_share = static_cast<double>(projected) / out.viewer_pixels;
    out.off_surface_share = 1 - out.on_surface_share;
  }
  return out;
}

}  // namespace

struct Renderer::Impl {
  Rig rig;
  std::vector<std::string> slot_names;
  GpuScene scene;
  VisibilityBuffers visibility;
  std::optional<ContactShadow> contact_shadow;
  bool has_contact_shadow = false;
  Smoothing smoothing;
  Program points, blend, response, irradiance, lit, coverage, composite;
  LightLayer light_layer;
  std::optional<LightLayer> measured_light_layer;  // linked when it is asked for
  PartsLayer parts_layer;
  std::vector<GlName> responses;
  // Of the projectors' last images.
  struct Shown {
    Canvas display;
    GlName known_hits, known_shares;  // shaders/known.glsl
    GLuint known_stamp = 0;           // of its time
    scene::PosedScene posed;
    Pose imager_from_world;    // of the viewer
    cv::Mat image, clipped;  // once read back
    bool is_current = false;
    bool is_quick = false;
  };
  std::vector<Shown> shown;
  bool quick_motion = false;
  PassTimes times;
  LightOptions light_options;
  std::optional<SurfaceMixing> surface;     // its layers are on the GPU
  std::optional<double> level_by_geometry;  // of the first place that the prototype had
  std::optional<scene::Prototype> prototype;
  std::optional<scene::RoomLight> room;
  scene::RoomLight viewer_light;  // where no room is known
  GlName mixing, albedo, arriving;
  std::vector<cv::Mat> arriving_maps;  // as they are in the layers of `arriving`
  float mean_albedo = 0;
  GlName vertex_array;  // without attributes, for whole.vert

  // What was drawn last, so that the same is not drawn again.
  std::optional<scene::PosedScene> drawn;
  GLuint known_stamp = 1;  // another one once the prototype has moved or light arrives in another way
  // What is drawn of it from the projectors.
  bool is_prototype_seen = false, are_soft_edges_seen = false, are_surface_parts_seen = false;
  std::vector<PlacedRun> runs;
  PlacesByMode lit_rects;  // of the projector drawn last
  std::vector<cv::Rect> view_places, surface_places;
  Pose scene_from_world;
  enum class EyeKind { none, imager, parts_of_imager, eye };
  EyeKind eye_kind = EyeKind::none;
  Imager eye;
  std::vector<std::pair<Imager, GpuLens>> lenses;  // of cameras and viewers, the newest last
  std::map<std::tuple<int, int, GLenum>, Canvas> canvases;

  Impl(const scene::Scene& scene_in, const Rig& rig_in, VisibilityBuffers sights_in)
      : rig(rig_in),
        scene(scene_in),
        visibility(std::move(sights_in)),
        shown(rig_in.projectors.size()),
        prototype(scene_in.prototype),
        room(scene_in.light) {
    viewer_light.below_rgb.setConstant(k_soft_below);
    viewer_light.above_rgb.setConstant(k_soft_above);
    viewer_light.lamps.resize(1);
    viewer_light.lamps[0].strength_rgb.setConstant(k_lamp);
    vertex_array = make_vertex_array();
    for (const scene::Slot& slot : scene_in.slots) slot_names.push_back(slot.name);
    for (const Imager& projector : rig.projectors) {
      responses.push_back(make_texture(GL_TEXTURE_2D, GL_RGB32F, k_response_columns, 1));
      upload(responses.back(), response_table(find_response(rig, projector.name), k_response_columns));
    }
    mixing = make_texture(GL_TEXTURE_2D_ARRAY, GL_RGBA16F, 1, 1);
    const auto projectors = std::max<std::size_t>(1, rig.projectors.size());
    arriving = make_texture(GL_TEXTURE_2D_ARRAY, GL_R16F, k_arriving_side, k_arriving_side,
                            static_cast<int>(projectors));
    glTextureParameteri(*arriving, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
    glTextureParameteri(*arriving, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    arriving_maps.resize(rig.projectors.size());
    for (std::size_t i = 0; i < rig.projectors.size(); ++i)
      set_occlusion(i, cv::Mat(k_arriving_side, k_arriving_side, CV_32F, cv::Scalar(1)));
    const scene::Prototype surface_of = prototype.value_or(scene::Prototype{});
    const cv::Mat colours = fitting_texture(relative_albedo(surface_of), "the prototype's albedo");
    mean_albedo = static_cast<float>(mean_albedo_of(surface_of));
    albedo = make_texture(GL_TEXTURE_2D, GL_RGB32F, colours.cols, colours.rows);
    for (const GLenum filter : {GL_TEXTURE_MIN_FILTER, GL_TEXTURE_MAG_FILTER})
      glTextureParameteri(*albedo, filter, GL_LINEAR);
    for (const GLenum wrap : {GL_TEXTURE_WRAP_S, GL_TEXTURE_WRAP_T})
      glTextureParameteri(*albedo, wrap, GL_REPEAT);
    upload(albedo, colours);
  }

  // What programs that draw looks are made for: the scene's materials.
  std::string defined() const { return scene.has_surface_maps() ? "SURFACE_MAPS " : ""; }
  Status link_programs();
  bool set_occlusion(std::size_t index, const cv::Mat& map);
  const GpuLens& lens_of(const Imager& imager);
  const Canvas& canvas(int width, int height, GLenum format);
  // Of what projectors see: their own images need all, others whether the prototype hides a place from
  // them.
  enum class FromProjectors { nothing, prototype, all };
  void prepare(const scene::PosedScene& posed, FromProjectors needed);
  void look_from_eye(const Imager& viewer);
  void look_from_imager(const Imager& imager, bool parts_alone = false);
  void set_up(const Program& program, const GpuLens& lens, const Imager* viewer);
  void set_up_light(const Program& program, const scene::PosedScene& posed);
  void draw(const Program& program, const Canvas& into) const;
  void draw(const Program& program, const Canvas& into, const std::vector<cv::Rect>& places) const;
  template <class SetUp>
  cv::Mat laid_over(const cv::Mat& bgr,
                    const Imager& imager,
                    const scene::PosedScene& posed,
                    int kind,
                    const Whole& whole,
                    const SetUp& set_up_layer);
  cv::Mat composite_over(const Imager& imager,
                         const cv::Mat& image,
                         const scene::PosedScene& posed,
                         int kind,
                         const Whole& whole);
  // What was laid over an imager's images.
  struct Overlay {
    Imager imager;
    int kind = 0;
    Whole whole{};
    std::optional<scene::PosedScene> posed;  // of the parts
    std::vector<cv::Rect> places;            // where there may be some
    Canvas parts;
    GlName behind;  // the image
    Canvas out;
  };
  std::vector<Overlay> overlays;
  Overlay& overlay_of(const Imager& imager, int kind);
  Result<SurfaceMixing> measured(const MeasuredSurface& surface);
};

Status Renderer::Impl::link_programs() {
  const std::pair<Program*, const char*> drawn[] = {
      {&points, "points.frag"}, {&blend, "blend.frag"},       {&irradiance, "irradiance.frag"},
      {&lit, "lit.frag"},       {&coverage, "coverage.frag"}, {&composite, "composite.frag"}};
  for (const auto& [program, file] : drawn) {
    LIMN_TRY(*program, Program::link("whole.vert", file));
  }
  LIMN_TRY(light_layer, LightLayer::link(defined(), false));
  LIMN_TRY(response, Program::link_compute("light_response.comp"));
  LIMN_TRY(parts_layer, PartsLayer::link(defined()));
  return {};
}

// CV_32F of the texture's size. False when it is there already.
bool Renderer::Impl::set_occlusion(std::size_t index, const cv::Mat& map) {
  cv::Mat& known = arriving_maps[index];
  if (!known.empty() && cv::norm(known, map, cv::NORM_INF) == 0) return false;
  known = map;
  ++known_stamp;
  glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
  glTextureSubImage3D(*arriving, 0, 0, 0, static_cast<GLint>(index), map.cols, map.rows, 1, GL_RED, GL_FLOAT,
                      map.data);
  return true;
}

const GpuLens& Renderer::Impl::lens_of(const Imager& imager) {
  for (const auto& [known, lens] : lenses) {
    if (is_same_lens(known, imager)) return lens;
  }
  constexpr std::size_t k_most = 8;  // cameras and viewers of a session
  if (lenses.size() >= k_most) lenses.erase(lenses.begin());
  GpuLens lens{baked(imager), {}};
  lens.tangents = make_texture(GL_TEXTURE_2D, GL_RG32F, lens.baked.tangents.cols, lens.baked.tangents.rows);
  upload(lens.tangents, lens.baked.tangents);
  return lenses.emplace_back(imager, std::move(lens)).second;
}

const Canvas& Renderer::Impl::canvas(int width, int height, GLenum format) {
  auto& canvas = canvases[{width, height, format}];
  if (!canvas.texture) canvas = Canvas(width, height, format);
  return canvas;
}

void Renderer::Impl::prepare(const scene::PosedScene& posed, FromProjectors needed) {
  if (!drawn || !is_same(*drawn, posed)) {
    const bool stays = drawn && is_same_prototype(*drawn, posed);
    scene.placed(posed, &runs);
    scene_from_world = GpuScene::scene_from_world(posed);
    scene.place(runs);
    if (!stays) ++known_stamp;
    is_prototype_seen &= stays;
    are_soft_edges_seen &= stays;
    are_surface_parts_seen = false;
    eye_kind = EyeKind::none;
    drawn = posed;
  }
  const bool all = needed == FromProjectors::all;
  if (needed == FromProjectors::nothing || (is_prototype_seen && !all) ||
      (are_soft_edges_seen && are_surface_parts_seen))
    return;
  const PassTimes::Scope scope(&times, "ids from projectors");
  if (!is_prototype_seen || (all && !are_soft_edges_seen)) {
    visibility.draw_prototype_from_projectors(scene, runs, scene_from_world, all);
    is_prototype_seen = true;
    are_soft_edges_seen = all;
  }
  if (!all) return;
  visibility.draw_surface_parts_from_projectors(scene, runs, scene_from_world);
  are_surface_parts_seen = true;
}

void Renderer::Impl::look_from_eye(const Imager& viewer) {
  if (eye_kind == EyeKind::eye && is_same(eye.imager_from_world, viewer.imager_from_world)) return;
  const Pose scene_from_viewer = scene_from_world * viewer.imager_from_world.inverse();
  const PassTimes::Scope scope(&times, "ids from the eye");
  visibility.draw_from_eye(scene, runs, scene_from_world, scene_from_viewer.translation,
                      scene_from_viewer.rotation * -Eigen::Vector3d::UnitY());
  eye_kind = EyeKind::eye;
  eye = viewer;
}

void Renderer::Impl::look_from_imager(const Imager& imager, bool parts_alone) {
  const EyeKind wanted = parts_alone ? EyeKind::parts_of_imager : EyeKind::imager;
  if (eye_kind == wanted && is_same_lens(eye, imager) &&
      is_same(eye.imager_from_world, imager.imager_from_world)) {
    return;
  }
  const PassTimes::Scope scope(&times, "ids from a camera");
  visibility.draw_from_imager(scene, runs, scene_from_world, imager, lens_of(imager).baked, parts_alone);
  eye_kind = wanted;
  eye = imager;
}

// For what is `drawn`. `viewer` gives the lamp its place (shaders/look.glsl); null for programs without
// looks.
void Renderer::Impl::set_up(const Program& program, const GpuLens& lens, const Imager* viewer) {
  scene.bind();
  visibility.bind(program, k_sights_unit);
  program.bind("s_tangents", k_tangents_unit, lens.tangents);
  const cv::Mat& tangents = lens.baked.tangents;
  program.set("u_tangents",
              Eigen::Vector4f(static_cast<float>(lens.baked.step), static_cast<float>(tangents.cols),
                              static_cast<float>(tangents.rows), 0));
  program.set("u_has_cut_outs", scene.has_cut_outs());
  program.bind("s_arriving", k_arriving_unit, arriving);
  program.set("u_placement_count", scene.owner_count());
  if (!viewer) return;
  const Eigen::Quaterniond world_from_viewer = viewer->imager_from_world.rotation.inverse();
  viewer_light.d_up_world = world_from_viewer * -Eigen::Vector3d::UnitY();
  viewer_light.lamps[0].d_world = world_from_viewer * k_d_lamp_viewer;
  const std::optional<scene::RoomLight>& known = drawn->light ? drawn->light : room;
  const scene::RoomLight& light = known ? *known : viewer_light;
  const auto vector = [](const Eigen::Vector3d& v) { return Eigen::Vector4f(v.cast<float>().homogeneous()); };
  program.set("u_is_room_known", known.has_value());
  program.set("u_d_up", vector(scene_from_world.rotation * light.d_up_world));
  program.set("u_soft_below", vector(light.below_rgb));
  program.set("u_soft_above", vector(light.above_rgb));
  program.set("u_lamp_count", static_cast<int>(light.lamps.size()));
  for (std::size_t i = 0; i < light.lamps.size(); ++i) {
    const std::string at = fmt::format("[{}]", i);
    program.set(("u_d_lamps" + at).c_str(), vector(scene_from_world.rotation * light.lamps[i].d_world));
    program.set(("u_lamps" + at).c_str(), vector(light.lamps[i].strength_rgb));
  }
}

void Renderer::Impl::set_up_light(const Program& program, const scene::PosedScene& posed) {
  if (!level_by_geometry && prototype && posed.world_from_prototype)
    level_by_geometry = geometric_level(*prototype, rig, *posed.world_from_prototype);
  const bool by_measurement = light_options.compensation == Compensation::measured;
  const double level = by_measurement ? surface->level : level_by_geometry.value_or(1);
  program.set("u_compensation", static_cast<int>(light_options.compensation));
  program.set("u_even_black", light_options.even_black);
  program.set("u_level", static_cast<float>(light_options.level.value_or(level)));
  program.set("u_mean_mixing", by_measurement ? surface->mean : Eigen::Matrix3f(Eigen::Matrix3f::Identity()));
  program.set("u_witness", visibility.reference_camera());
  program.bind("s_mixing", k_mixing_unit, mixing);
  program.bind("s_albedo", k_albedo_unit, albedo);
}

// What an imager sees of a layer, over its image (BGR); the layer is drawn again only where it has changed.
// `kind` tells layers of one imager apart.
template <class SetUp>
cv::Mat Renderer::Impl::laid_over(const cv::Mat& bgr,
                                  const Imager& imager,
                                  const scene::PosedScene& posed,
                                  int kind,
                                  const Whole& whole,
                                  const SetUp& set_up_layer) {
  Overlay& overlay = overlay_of(imager, kind);
  if (!overlay.posed || overlay.whole != whole || !is_same(*overlay.posed, posed) ||
      !is_same(overlay.imager.imager_from_world, imager.imager_from_world)) {
    prepare(posed, kind == k_view ? FromProjectors::nothing : FromProjectors::prototype);
    look_from_imager(imager, kind != k_view && !has_contact_shadow);
    overlay.places = visibility.visible_rects(imager, lens_of(imager).baked, runs, scene_from_world, kind == k_view,
                                        has_contact_shadow ? ContactShadow::k_reach : 0);
    if (has_contact_shadow) contact_shadow->place(posed);
    const auto set_up_all = [&](const Program& program) {
      set_up(program, lens_of(imager), &imager);
      program.set("s_distances", k_distances_unit);
      if (has_contact_shadow) contact_shadow->bind(program, k_distances_unit);
      set_up_layer(program);
    };
    parts_layer.draw({.is_view = kind == k_view, .is_shadowed = has_contact_shadow},
                     {overlay.parts.texture, {imager.width, imager.height}}, overlay.places, smoothing,
                     std::cref(set_up_all), &times);
    overlay.posed = posed;
    overlay.imager = imager;
    overlay.whole = whole;
  }
  cv::Mat out = bgr.clone();
  for (const cv::Rect& place : overlay.places) upload(overlay.behind, out, place);
  composite.bind("s_centre", k_centre_unit, overlay.parts.texture);
  composite.bind("s_picture", k_image_unit, overlay.behind);
  {
    const PassTimes::Scope scope(&times, "over the picture");
    draw(composite, overlay.out, overlay.places);
  }
  for (const cv::Rect& place : overlay.places) read_back(overlay.out.framebuffer, place, &out);
  return out;
}

cv::Mat Renderer::Impl::composite_over(const Imager& imager,
                                       const cv::Mat& image,
                                       const scene::PosedScene& posed,
                                       int kind,
                                       const Whole& whole) {
  LIMN_CHECK(image.cols == imager.width && image.rows == imager.height && image.depth() == CV_8U);
  cv::Mat bgr = image;
  if (image.channels() == 1) cv::cvtColor(image, bgr, cv::COLOR_GRAY2BGR);
  return laid_over(bgr, imager, posed, kind, whole,
                   [&](const Program& program) { program.set_bits("u_whole", whole); });
}

// The one drawn for this imager before, or room for a new one.
Renderer::Impl::Overlay& Renderer::Impl::overlay_of(const Imager& imager, int kind) {
  for (Overlay& overlay : overlays)
    if (overlay.kind == kind && is_same_lens(overlay.imager, imager)) return overlay;
  constexpr std::size_t k_most = 8;  // cameras and virtual ones of a session
  if (overlays.size() >= k_most) overlays.erase(overlays.begin());
  const int width = imager.width, height = imager.height;
  return overlays.emplace_back(Overlay{imager,
                                       kind,
                                       {},
                                       std::nullopt,
                                       {},
                                       Canvas(width, height, GL_RGBA32F),
                                       make_texture(GL_TEXTURE_2D, GL_RGBA8, width, height),
                                       Canvas(width, height, GL_RGBA8)});
}

// Takes the surface's layers to the GPU.
Result<SurfaceMixing> Renderer::Impl::measured(const MeasuredSurface& measured) {
  const Imager& camera = measured.camera;
  scene::PosedScene bare;
  bare.world_from_prototype = measured.world_from_prototype;
  prepare(bare, FromProjectors::prototype);
  look_from_imager(camera);
  const Canvas& canvas = this->canvas(camera.width, camera.height, GL_R32F);
  std::vector<cv::Mat> irradiances;
  for (std::size_t i = 0; i < rig.projectors.size(); ++i) {
    set_up(irradiance, lens_of(camera), nullptr);
    irradiance.set("u_projector", static_cast<int>(i));
    draw(irradiance, canvas);
    irradiances.push_back(read_back(canvas.framebuffer, camera.width, camera.height, CV_32FC1, GL_RED));
  }
  LIMN_TRY(SurfaceMixing found, surface_mixing(measured, irradiances));
  visibility.draw_from_reference_camera(scene, runs, scene_from_world, camera, lens_of(camera).baked);
  mixing = make_texture(GL_TEXTURE_2D_ARRAY, GL_RGBA16F, camera.width, camera.height,
                        static_cast<int>(found.layers.size()));
  for (std::size_t i = 0; i < found.layers.size(); ++i)
    glTextureSubImage3D(*mixing, 0, 0, 0, static_cast<GLint>(i), camera.width, camera.height, 1, GL_RGBA,
                        GL_FLOAT, found.layers[i].data);
  found.layers.clear();
  return found;
}

void Renderer::Impl::draw(const Program& program, const Canvas& into) const {
  draw(program, into, {cv::Rect(0, 0, into.width, into.height)});
}

// Black outside of `places`.
void Renderer::Impl::draw(const Program& program,
                          const Canvas& into,
                          const std::vector<cv::Rect>& places) const {
  glBindFramebuffer(GL_FRAMEBUFFER, *into.framebuffer);
  glViewport(0, 0, into.width, into.height);
  glDisable(GL_DEPTH_TEST);
  glDisable(GL_BLEND);
  glDisable(GL_CULL_FACE);
  glDisable(GL_SCISSOR_TEST);
  const GLfloat black[4] = {0, 0, 0, 0};
  glClearNamedFramebufferfv(*into.framebuffer, GL_COLOR, 0, black);
  glEnable(GL_SCISSOR_TEST);
  glBindVertexArray(*vertex_array);
  program.use();
  for (const cv::Rect& place : places) {
    glScissor(place.x, place.y, place.width, place.height);
    glDrawArrays(GL_TRIANGLES, 0, 3);
  }
  glDisable(GL_SCISSOR_TEST);
}

Renderer::Renderer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Renderer::Renderer(Renderer&&) noexcept = default;
Renderer& Renderer::operator=(Renderer&&) noexcept = default;
Renderer::~Renderer() = default;

Result<Renderer> Renderer::create(const scene::Scene& scene, const Rig& rig) {
  LIMN_TRY_STATUS(check_context());
  LIMN_TRY_STATUS(GpuScene::check_fits(scene, GpuScene::most_triangles()));
  LIMN_TRY(VisibilityBuffers visibility, VisibilityBuffers::create(rig));
  auto impl = std::make_unique<Impl>(scene, rig, std::move(visibility));
  LIMN_TRY_STATUS(impl->link_programs());
  return Renderer(std::move(impl));
}

Status Renderer::set_light(const LightOptions& options, const MeasuredSurface* surface) {
  if (options.compensation == Compensation::measured) {
    LIMN_CHECK(surface != nullptr);
    LIMN_TRY_STATUS(check_fits(*surface, impl_->rig));
    if (!impl_->measured_light_layer) {
      LIMN_TRY(impl_->measured_light_layer, LightLayer::link(impl_->defined(), true));
    }
    LIMN_TRY(impl_->surface, impl_->measured(*surface));
  }
  if (options.compensation == Compensation::measured || !is_same(impl_->light_options, options))
    for (Impl::Shown& shown : impl_->shown) shown.is_current = false;
  impl_->light_options = options;
  return {};
}

void Renderer::set_occlusion(std::size_t index, const cv::Mat& map) {
  LIMN_CHECK(index < impl_->rig.projectors.size());
  LIMN_CHECK(map.empty() || map.type() == CV_32FC1 || map.type() == CV_8UC1);
  cv::Mat whole(k_arriving_side, k_arriving_side, CV_32F, cv::Scalar(1));
  if (!map.empty()) {
    map.convertTo(whole, CV_32F, map.depth() == CV_8U ? 1.0 / 255 : 1.0);
    const bool finer = std::max(map.cols, map.rows) > k_arriving_side;
    cv::resize(whole, whole, {k_arriving_side, k_arriving_side}, 0, 0,
               finer ? cv::INTER_AREA : cv::INTER_LINEAR);
    whole = cv::max(0.0, cv::min(1.0, whole));
  }
  if (!impl_->set_occlusion(index, whole)) return;
  for (Impl::Shown& shown : impl_->shown) shown.is_current = false;
}

void Renderer::set_smoothing(const Smoothing& smoothing) {
  LIMN_CHECK(smoothing.samples == 4 || smoothing.samples == 8);
  impl_->smoothing = smoothing;
}

void Renderer::set_quick_motion(bool wanted) { impl_->quick_motion = wanted; }

Status Renderer::set_contact_shadow(const scene::Scene* scene) {
  const bool wanted = scene != nullptr;
  if (wanted) LIMN_TRY_STATUS(impl_->parts_layer.link_shadowed());
  if (wanted && !impl_->contact_shadow) impl_->contact_shadow.emplace(*scene);
  if (impl_->has_contact_shadow != wanted)
    for (Impl::Overlay& overlay : impl_->overlays) overlay.posed.reset();
  impl_->has_contact_shadow = wanted;
  return {};
}

cv::Mat Renderer::clipped(std::size_t index) const { return impl_->shown.at(index).clipped; }

void Renderer::time_passes(bool wanted) { impl_->times.enable(wanted); }

std::vector<PassTime> Renderer::pass_times() { return impl_->times.taken(); }

unsigned Renderer::draw_projector(std::size_t index, const scene::PosedScene& posed, const Imager& viewer) {
  LIMN_CHECK(index < impl_->rig.projectors.size());
  const Imager& projector = impl_->rig.projectors[index];
  Impl::Shown& shown = impl_->shown[index];
  const bool is_still = shown.is_current && is_same(shown.posed, posed) &&
                        is_same(shown.imager_from_world, viewer.imager_from_world);
  if (is_still && !shown.is_quick) return *shown.display.texture;
  impl_->prepare(posed, Impl::FromProjectors::all);
  impl_->look_from_eye(viewer);
  const Canvas& centre = impl_->canvas(projector.width, projector.height, GL_RGBA32F);
  if (!shown.display.texture) {
    shown.display = Canvas(projector.width, projector.height, GL_RGBA8);
    shown.known_hits = make_texture(GL_TEXTURE_2D, GL_RGBA32UI, projector.width, projector.height);
    shown.known_shares = make_texture(GL_TEXTURE_2D, GL_RGBA32F, projector.width, projector.height);
    glClearTexImage(*shown.known_hits, 0, GL_RGBA_INTEGER, GL_UNSIGNED_INT, nullptr);
  }
  const LightOptions& options = impl_->light_options;
  const auto set_up = [&](const Program& program) {
    impl_->set_up(program, impl_->visibility.projector_lens(index), &viewer);
    program.set("u_projector", static_cast<int>(index));
    program.set_id("u_known_stamp", impl_->known_stamp);
    glBindImageTexture(k_known_hits_image, *shown.known_hits, 0, GL_FALSE, 0, GL_READ_WRITE, GL_RGBA32UI);
    glBindImageTexture(k_known_shares_image, *shown.known_shares, 0, GL_FALSE, 0, GL_READ_WRITE, GL_RGBA32F);
    impl_->set_up_light(program, posed);
  };
  PlacesByMode& places = impl_->lit_rects;
  if (options.even_black) {
    places.clear();
    places.both.push_back(impl_->visibility.prototype_rect(index, impl_->runs, impl_->scene_from_world));
  } else {
    impl_->visibility.lit_rects(index, impl_->runs, impl_->scene_from_world,
                               (impl_->scene_from_world * viewer.imager_from_world.inverse()).translation,
                               &impl_->view_places, &impl_->surface_places);
    places.divide(impl_->view_places, impl_->surface_places);
  }
  // Even black begins and ends within a pixel: it would be seen to jump.
  shown.is_quick = impl_->quick_motion && !is_still && !options.even_black;
  LightLayer& layer =
      options.compensation == Compensation::measured ? *impl_->measured_light_layer : impl_->light_layer;
  layer.draw({centre.texture, {projector.width, projector.height}, shown.known_stamp != impl_->known_stamp},
             places,
             options.even_black ? k_dark_edges
             : shown.is_quick   ? k_quick_edges
                                : k_light_edges,
             std::cref(set_up), &impl_->times);
  shown.known_stamp = impl_->known_stamp;
  {
    const PassTimes::Scope scope(&impl_->times, "response");
    set_up(impl_->response);
    impl_->response.set("u_is_balanced", options.compensation != Compensation::none || options.even_black);
    impl_->response.bind("s_centre", k_centre_unit, centre.texture);
    impl_->response.bind("s_response", k_response_unit, impl_->responses[index]);
    glClearTexImage(*shown.display.texture, 0, GL_RGBA, GL_UNSIGNED_BYTE, nullptr);
    glBindImageTexture(0, *shown.display.texture, 0, GL_FALSE, 0, GL_WRITE_ONLY, GL_RGBA8);
    layer.work_through_lit(impl_->response);
  }
  shown.posed = posed;
  shown.imager_from_world = viewer.imager_from_world;
  shown.image.release();
  shown.is_current = true;
  return *shown.display.texture;
}

cv::Mat Renderer::projector_image(std::size_t index, const scene::PosedScene& posed, const Imager& viewer) {
  draw_projector(index, posed, viewer);
  Impl::Shown& shown = impl_->shown[index];
  if (shown.image.empty()) {
    const Canvas& display = shown.display;
    const cv::Mat bgra = read_back(display.framebuffer, display.width, display.height, CV_8UC4, GL_BGRA);
    cv::cvtColor(bgra, shown.image, cv::COLOR_BGRA2BGR);
    cv::extractChannel(bgra, shown.clipped, 3);
  }
  return shown.image.clone();
}

cv::Mat Renderer::surface_points(std::size_t index, const scene::PosedScene& posed) {
  LIMN_CHECK(index < impl_->rig.projectors.size());
  const Imager& projector = impl_->rig.projectors[index];
  impl_->prepare(posed, Impl::FromProjectors::prototype);
  const Canvas& canvas = impl_->canvas(projector.width, projector.height, GL_RGBA32F);
  impl_->set_up(impl_->points, impl_->visibility.projector_lens(index), nullptr);
  impl_->points.set("u_projector", static_cast<int>(index));
  impl_->draw(impl_->points, canvas);
  const cv::Mat points = read_back(canvas.framebuffer, projector.width, projector.height, CV_32FC4, GL_RGBA);
  cv::Mat out(points.size(), CV_32FC3, cv::Scalar::all(std::numeric_limits<double>::quiet_NaN()));
  for (int row = 0; row < out.rows; ++row) {
    for (int column = 0; column < out.cols; ++column) {
      const auto& p = points.at<cv::Vec4f>(row, column);
      if (p[3] > 0) out.at<cv::Vec3f>(row, column) = {p[0], p[1], p[2]};
    }
  }
  return out;
}

cv::Mat Renderer::blend(std::size_t index, const scene::PosedScene& posed) {
  LIMN_CHECK(index < impl_->rig.projectors.size());
  const Imager& projector = impl_->rig.projectors[index];
  impl_->prepare(posed, Impl::FromProjectors::all);
  const Canvas& canvas = impl_->canvas(projector.width, projector.height, GL_RG32F);
  impl_->set_up(impl_->blend, impl_->visibility.projector_lens(index), nullptr);
  impl_->blend.set("u_projector", static_cast<int>(index));
  impl_->draw(impl_->blend, canvas);
  return read_back(canvas.framebuffer, projector.width, projector.height, CV_32FC2, GL_RG);
}

IlluminatedPatches Renderer::illuminated_patches(std::size_t camera, const scene::PosedScene& posed, int side_px) {
  LIMN_CHECK(camera < impl_->rig.cameras.size() && side_px > 0);
  const Imager& imager = impl_->rig.cameras[camera];
  impl_->prepare(posed, Impl::FromProjectors::prototype);
  impl_->look_from_imager(imager);
  const Canvas& canvas =
      impl_->canvas(std::max(1, imager.width / side_px), std::max(1, imager.height / side_px), GL_RGBA32F);
  const auto drawn = [&](int projector) {
    impl_->set_up(impl_->lit, impl_->lens_of(imager), nullptr);
    impl_->lit.set("u_projector", projector);
    impl_->lit.set("u_side", static_cast<float>(side_px));
    impl_->draw(impl_->lit, canvas);
    return read_back(canvas.framebuffer, canvas.width, canvas.height, CV_32FC4, GL_RGBA);
  };
  IlluminatedPatches patches{side_px, impl_->scene_from_world, drawn(-1), {}};
  for (std::size_t i = 0; i < impl_->rig.projectors.size(); ++i)
    patches.by_projector.push_back(drawn(static_cast<int>(i)));
  return patches;
}

cv::Mat Renderer::composite(std::size_t camera,
                            const cv::Mat& image,
                            const scene::PosedScene& posed,
                            Composite what) {
  LIMN_CHECK(camera < impl_->rig.cameras.size());
  return composite(impl_->rig.cameras[camera], image, posed, what);
}

cv::Mat Renderer::composite(std::size_t camera,
                            const cv::Mat& image,
                            const scene::PosedScene& posed,
                            std::span<const CompositePolicy> policies) {
  LIMN_CHECK(camera < impl_->rig.cameras.size());
  return composite(impl_->rig.cameras[camera], image, posed, policies);
}

cv::Mat Renderer::composite(const Imager& camera,
                            const cv::Mat& image,
                            const scene::PosedScene& posed,
                            Composite what) {
  return impl_->composite_over(camera, image, posed, static_cast<int>(what), whole_of(what));
}

cv::Mat Renderer::composite(const Imager& camera,
                            const cv::Mat& image,
                            const scene::PosedScene& posed,
                            std::span<const CompositePolicy> policies) {
  return impl_->composite_over(camera, image, posed, k_each, whole_of(policies, impl_->slot_names));
}

cv::Mat Renderer::view(const Imager& imager, const scene::PosedScene& posed, const cv::Scalar& background) {
  const cv::Mat plain(imager.height, imager.width, CV_8UC3, background);
  return impl_->laid_over(plain, imager, posed, k_view, {}, [&](const Program& program) {
    program.bind("s_albedo", k_albedo_unit, impl_->albedo);
    program.set("u_mean_albedo", impl_->mean_albedo);
  });
}

std::vector<PartCoverage> Renderer::coverage(const scene::PosedScene& posed, const Imager& viewer) {
  impl_->prepare(posed, Impl::FromProjectors::prototype);
  impl_->look_from_imager(viewer);
  const Canvas& canvas = impl_->canvas(viewer.width, viewer.height, GL_RG8);
  impl_->set_up(impl_->coverage, impl_->lens_of(viewer), &viewer);
  impl_->draw(impl_->coverage, canvas,
              impl_->visibility.visible_rects(viewer, impl_->lens_of(viewer).baked, impl_->runs,
                                        impl_->scene_from_world, false, 0));
  const cv::Mat seen = read_back(canvas.framebuffer, viewer.width, viewer.height, CV_8UC2, GL_RG);
  std::vector<PartCoverage> out;
  for (const scene::PosedPart& part : posed.parts) {
    const auto slot = std::find(impl_->slot_names.begin(), impl_->slot_names.end(), part.slot);
    const auto owner = static_cast<std::uint8_t>(slot - impl_->slot_names.begin() + 1);
    out.push_back(counted(part, seen, owner));
  }
  return out;
}

}  // namespace limn::projector
