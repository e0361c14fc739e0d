#include "projector/visibility_buffers.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "projector/bindings.h"

namespace limn::projector {
namespace {

// Texels of the id image for each pixel of the imager, along one axis. More texels find thinner triangles.
constexpr double k_oversampling = 1.5;
// Side of the viewer's id image, texels.
constexpr int k_viewer_ids_side = 2560;
// Nodes of the pixel maps. A cell is 4 to 5 px wide; interpolation differs from the lens by at most 0.01 px.
constexpr int k_map_columns = 321, k_map_rows = 241;
constexpr double k_on_surface = 0.002;  // m, as in shaders/on_surface.glsl
// Share of the image's smaller side over which a projector fades towards its border.
constexpr double k_soft_border = 0.1;

Pose imager_from_scene(const Imager& imager, const Pose& scene_from_world) {
  return imager.imager_from_world * scene_from_world.inverse();
}

bool is_prototype(const PlacedRun& placed) { return placed.owner == 0; }
bool is_any(const PlacedRun&) { return true; }
bool is_part(const PlacedRun& placed) { return placed.owner != 0; }
bool is_view_part(const PlacedRun& placed) { return placed.owner != 0 && !placed.on_surface; }
bool is_surface_part(const PlacedRun& placed) { return placed.owner != 0 && placed.on_surface; }

// The tangents spanned by the runs for which `wanted` is true; empty when there are none.
TangentRect spanned_by(const Pose& pinhole_from_scene,
                       const std::vector<PlacedRun>& runs,
                       bool (*wanted)(const PlacedRun&)) {
  TangentRect rect = tangents_spanned(pinhole_from_scene, {});
  for (const PlacedRun& run : runs)
    if (wanted(run)) rect = united(rect, tangents_spanned(pinhole_from_scene, bounds_of(run)));
  return rect;
}

Eigen::AlignedBox3d box_of(const std::vector<PlacedRun>& runs, bool (*wanted)(const PlacedRun&)) {
  Eigen::AlignedBox3d box;
  for (const PlacedRun& run : runs)
    if (wanted(run))
      for (const Eigen::Vector3d& p : bounds_of(run)) box.extend(p);
  return box;
}

// The tangents, in the pinhole view, of the part of the viewer's frustum through a part's box that lies
// between the nearest and the farthest depth of the prototype. The prototype's tangents when the box reaches
// behind the viewer.
TangentRect spanned_behind(const Pose& pinhole_from_scene,
                           const PlacedRun& part,
                           const std::vector<PlacedRun>& runs,
                           const Eigen::Vector3d& p_viewer) {
  const std::array<Eigen::Vector3d, 8> corners = bounds_of(part);
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : corners) middle += p / static_cast<double>(corners.size());
  const Eigen::Vector3d d = (middle - p_viewer).normalized();
  double nearest = 1e9, farthest = 0;
  for (const PlacedRun& run : runs) {
    if (!is_prototype(run)) continue;
    for (const Eigen::Vector3d& p : bounds_of(run)) {
      nearest = std::min(nearest, d.dot(p - p_viewer));
      farthest = std::max(farthest, d.dot(p - p_viewer));
    }
  }
  std::array<Eigen::Vector3d, 16> out;
  for (std::size_t k = 0; k < corners.size(); ++k) {
    const double depth = d.dot(corners[k] - p_viewer);
    if (depth < 0.01 || nearest < 0.01) return spanned_by(pinhole_from_scene, runs, is_prototype);
    out[2 * k] = p_viewer + nearest / depth * (corners[k] - p_viewer);
    out[2 * k + 1] = p_viewer + farthest / depth * (corners[k] - p_viewer);
  }
  return tangents_spanned(pinhole_from_scene, out);
}

// The tangents that a pinhole view covers.
TangentRect covered(const PinholeView& pinhole) {
  return {(Eigen::Vector2d::Constant(-0.5) - pinhole.centre) / pinhole.focal,
          (Eigen::Vector2d(pinhole.width, pinhole.height).array() - 0.5 - pinhole.centre.array()).matrix() /
              pinhole.focal};
}

std::array<Eigen::Vector3d, 8> corners_of(const Eigen::AlignedBox3d& box) {
  std::array<Eigen::Vector3d, 8> corners;
  for (int k = 0; k < 8; ++k)
    corners[static_cast<std::size_t>(k)] = box.corner(static_cast<Eigen::AlignedBox3d::CornerType>(k));
  return corners;
}

// Whether the front faces of a mesh hide all its back faces from a pinhole, so that these need not be drawn.
bool hides_back_faces(const PlacedRun& placed, const Pose& pinhole_from_owner) {
  const Eigen::AlignedBox3d box(placed.run->p_lower, placed.run->p_upper);
  return placed.run->is_solid && box.exteriorDistance(pinhole_from_owner.inverse().translation) > k_near;
}

cv::Rect whole_of(const PinholeView& pinhole) { return {0, 0, pinhole.width, pinhole.height}; }

// The texels of a pinhole view that contain `rect`.
cv::Rect texels_of(const PinholeView& pinhole, const TangentRect& rect) {
  if (rect.is_empty()) return {};
  const auto texel = [&](const Eigen::Vector2d& tangent) {
    const Eigen::Vector2d at = pinhole.focal * tangent + pinhole.centre;
    return cv::Point(static_cast<int>(std::floor(at.x())), static_cast<int>(std::floor(at.y())));
  };
  return cv::Rect(texel(rect.lower) - cv::Point(1, 1), texel(rect.upper) + cv::Point(3, 3)) &
         whole_of(pinhole);
}

}  // namespace

GpuLens::GpuLens(const Imager& imager) : baked(projector::baked(imager)) {
  tangents = make_texture(GL_TEXTURE_2D, GL_RG32F, baked.tangents.cols, baked.tangents.rows);
  upload(tangents, baked.tangents);
}

void GpuLens::bind(const Use& use) const {
  glBindTextureUnit(k_tangents_unit, *tangents);
  use.program.set("u_tangents",
                  Eigen::Vector4f(static_cast<float>(baked.step), static_cast<float>(baked.tangents.cols),
                                  static_cast<float>(baked.tangents.rows), 0));
}

struct VisibilityBuffers::GpuViewpoint {
  Eigen::Matrix4f pinhole_from_scene;
  Eigen::Vector4f focal_centre, p_origin, size, map, quality, vignetting, focus;

  GpuViewpoint(const PinholeView& pinhole, int first_layer) {
    pinhole_from_scene = pinhole.pinhole_from_scene.matrix().cast<float>();
    const auto focal = static_cast<float>(pinhole.focal);
    focal_centre << focal, focal, pinhole.centre.cast<float>();
    p_origin << pinhole.pinhole_from_scene.inverse().translation.cast<float>(),
        static_cast<float>(first_layer);
    size << static_cast<float>(pinhole.width), static_cast<float>(pinhole.height), 0, 0;
    map.setZero();
    quality << focal, 0, 0, 0;
    vignetting.setZero();
    focus.setZero();
  }
  void of_imager(const Imager& imager) {
    size.tail<2>() << static_cast<float>(imager.width), static_cast<float>(imager.height);
    quality.x() = static_cast<float>(imager.lens.fx());
    quality.y() = static_cast<float>(k_soft_border * std::min(imager.width, imager.height));
  }
  void with_map(const TangentRect& whole, int layer) {
    const Eigen::Vector2d nodes(k_map_columns - 1, k_map_rows - 1);
    map << whole.lower.cast<float>(), nodes.cwiseQuotient(whole.upper - whole.lower).cast<float>();
    quality.z() = static_cast<float>(layer);
  }
  void with_focus(const Focus& known, const Imager& imager) {
    // px, at a distance of 1 m from a lens focused at infinity.
    const double disc = known.aperture_m * imager.lens.fx();
    focus.head<2>() << static_cast<float>(disc / known.distance_m), static_cast<float>(disc);
  }
  void with_response(const ProjectorResponse& response) {
    if (response.black_level) quality.w() = static_cast<float>(response.black_level->value);
    if (!response.vignetting) return;
    const Vignetting& v = *response.vignetting;
    vignetting << v.tilt.cast<float>(), static_cast<float>(v.r2), static_cast<float>(v.r4);
  }
};

Result<VisibilityBuffers> VisibilityBuffers::create(const Rig& rig, bool has_section) {
  VisibilityBuffers visibility;
  const std::vector<Imager>& projectors = rig.projectors;
  LIMN_TRY(visibility.program_, Program::link("ids.vert", "ids.frag"));
  LIMN_TRY(visibility.cut_program_, Program::link("ids_cut.vert", "ids_cut.frag"));
  visibility.projectors_ = projectors;
  visibility.responses_ = rig.responses;
  visibility.focuses_ = rig.focuses;
  const int count = static_cast<int>(projectors.size()) + 1;  // plus the reference camera
  visibility.pixel_maps_ = make_texture(GL_TEXTURE_2D_ARRAY, GL_RG32F, k_map_columns, k_map_rows, count);
  for (std::size_t i = 0; i < projectors.size(); ++i) {
    GpuLens lens(projectors[i]);
    visibility.upload_pixel_map(static_cast<int>(i), projectors[i], lens.baked.rect);
    const Eigen::Vector2d extent =
        k_oversampling * projectors[i].lens.fx() * (lens.baked.rect.upper - lens.baked.rect.lower);
    visibility.ids_width_ =
        std::clamp(static_cast<int>(extent.x()) + 8, visibility.ids_width_, 2 * k_viewer_ids_side);
    visibility.ids_height_ =
        std::clamp(static_cast<int>(extent.y()) + 8, visibility.ids_height_, 2 * k_viewer_ids_side);
    visibility.lenses_.push_back(std::move(lens));
  }
  visibility.projector_ids_ =
      make_texture(GL_TEXTURE_2D_ARRAY, GL_R32UI, visibility.ids_width_, visibility.ids_height_, 2 * count);
  glClearTexImage(*visibility.projector_ids_, 0, GL_RED_INTEGER, GL_UNSIGNED_INT, nullptr);
  visibility.surface_places_.resize(projectors.size());
  visibility.viewer_ids_ =
      make_texture(GL_TEXTURE_2D_ARRAY, GL_R32UI, k_viewer_ids_side, k_viewer_ids_side, 2);
  visibility.depth_ =
      make_texture(GL_TEXTURE_2D, GL_DEPTH_COMPONENT32F, std::max(k_viewer_ids_side, visibility.ids_width_),
                   std::max(k_viewer_ids_side, visibility.ids_height_));
  if (projectors.size() > 1) {
    LIMN_TRY(visibility.edge_feathering_,
             EdgeFeathering::create(static_cast<int>(projectors.size()), visibility.ids_width_,
                                    visibility.ids_height_));
  }
  if (has_section) {
    LIMN_TRY(visibility.cap_counter_, CapCounter::create(k_viewer_ids_side, k_viewer_ids_side));
  }
  visibility.framebuffer_ = make_framebuffer();
  glNamedFramebufferTexture(*visibility.framebuffer_, GL_DEPTH_ATTACHMENT, *visibility.depth_, 0);
  const std::vector<std::byte> empty((projectors.size() + 2) * sizeof(GpuViewpoint));
  visibility.viewpoints_ = make_buffer(empty.data(), empty.size());
  visibility.viewpoint_texels_ = make_texels(visibility.viewpoints_, GL_RGBA32F);
  return visibility;
}

void VisibilityBuffers::draw(const GpuScene& scene,
                             const std::vector<PlacedRun>& runs,
                             bool (*wanted)(const PlacedRun&),
                             const PinholeView& pinhole,
                             const cv::Rect& within,
                             const GlName& ids,
                             int layer) {
  const bool has_caps = *ids == *viewer_ids_;  // what lies on the surface shows none
  glNamedFramebufferTextureLayer(*framebuffer_, GL_COLOR_ATTACHMENT0, *ids, 0, layer);
  glBindFramebuffer(GL_FRAMEBUFFER, *framebuffer_);
  glViewport(0, 0, pinhole.width, pinhole.height);
  glEnable(GL_SCISSOR_TEST);  // only texels that are read are cleared
  glScissor(within.x, within.y, within.width, within.height);
  const GLuint nothing[4] = {};
  const float farthest = 0;
  glClearNamedFramebufferuiv(*framebuffer_, GL_COLOR, 0, nothing);
  glClearNamedFramebufferfv(*framebuffer_, GL_DEPTH, 0, &farthest);
  glDisable(GL_SCISSOR_TEST);
  glClipControl(GL_LOWER_LEFT, GL_ZERO_TO_ONE);
  glEnable(GL_DEPTH_TEST);
  glDepthMask(GL_TRUE);
  glDepthFunc(GL_GREATER);
  glCullFace(GL_FRONT);  // rows run downwards, so that GL takes back faces for front faces
  glDisable(GL_BLEND);
  for (const PlacedRun& placed : runs) {
    if (!wanted(placed)) continue;
    const bool is_cut = placed.cut && (placed.owner != 0 || scene.is_prototype_cut());
    const Pose pinhole_from_owner = pinhole.pinhole_from_scene * placed.scene_from_owner;
    (!is_cut && hides_back_faces(placed, pinhole_from_owner) ? glEnable : glDisable)(GL_CULL_FACE);
    const Eigen::Matrix4d clip_from_owner = clip_from_pinhole(pinhole) * pinhole_from_owner.matrix();
    const Program& program = is_cut                     ? cap_counter_->ids_program(placed, pinhole)
                             : placed.run->has_cut_outs ? cut_program_
                                                        : program_;
    scene.bind({Resource::scene, GL_READ_ONLY, program});
    program.use();
    program.set("u_has_cut_outs", placed.run->has_cut_outs);
    program.set("u_focal", static_cast<float>(pinhole.focal));
    program.set("u_clip_from_owner", Eigen::Matrix4f(clip_from_owner.cast<float>()));
    glBindVertexArray(scene.vertex_array());
    const auto draw_all = [&] { draw_triangles(placed, pinhole); };
    draw_all();
    const cv::Rect texels =
        within & texels_of(pinhole, tangents_spanned(pinhole.pinhole_from_scene, bounds_of(placed)));
    if (is_cut && has_caps && !texels.empty())
      cap_counter_->draw_cap(scene, placed, pinhole, texels, framebuffer_, draw_all);
  }
  glDisable(GL_DEPTH_TEST);
  glDisable(GL_CULL_FACE);
  glFlush();  // softpipe makes drawn ids visible to compute programs only after a flush
}

// Draws the triangles of a mesh that may be visible; consecutive clusters in one call.
void VisibilityBuffers::draw_triangles(const PlacedRun& placed, const PinholeView& pinhole) const {
  const TangentRect rect = covered(pinhole);
  const Pose pinhole_from_owner = pinhole.pinhole_from_scene * placed.scene_from_owner;
  const auto draw_some = [](int first, int count) {
    if (count > 0) glDrawArrays(GL_TRIANGLES, 3 * first, 3 * count);
  };
  int first = placed.run->first, count = 0;
  for (const TriangleRun::Cluster& cluster : placed.run->clusters) {
    if (intersected(rect, tangents_spanned(pinhole_from_owner, corners_of(cluster.box))).is_empty()) continue;
    if (cluster.first != first + count) {
      draw_some(first, count);
      first = cluster.first;
      count = 0;
    }
    count += cluster.count;
  }
  draw_some(first, count);
}

void VisibilityBuffers::send(int index, const GpuViewpoint& viewpoint) {
  glNamedBufferSubData(*viewpoints_, static_cast<GLintptr>(sizeof(GpuViewpoint)) * index,
                       sizeof(GpuViewpoint), &viewpoint);
}

void VisibilityBuffers::upload_pixel_map(int layer, const Imager& imager, const TangentRect& rect) {
  const cv::Mat map = pixel_map(imager, rect, k_map_columns, k_map_rows);
  glTextureSubImage3D(*pixel_maps_, 0, 0, 0, layer, map.cols, map.rows, 1, GL_RG, GL_FLOAT, map.data);
}

// It covers the prototype, because nothing else is illuminated.
PinholeView VisibilityBuffers::projector_pinhole_view(std::size_t projector,
                                                      const std::vector<PlacedRun>& runs,
                                                      const Pose& scene_from_world) const {
  const Pose pose = imager_from_scene(projectors_[projector], scene_from_world);
  return pinhole_view_over(pose,
                           intersected(lenses_[projector].baked.rect, spanned_by(pose, runs, is_prototype)),
                           k_oversampling * projectors_[projector].lens.fx(), ids_width_, ids_height_);
}

void VisibilityBuffers::draw_prototype_from_projectors(const GpuScene& scene,
                                                       const std::vector<PlacedRun>& runs,
                                                       const Pose& scene_from_world,
                                                       bool with_soft_edges) {
  for (std::size_t i = 0; i < projectors_.size(); ++i) {
    const PinholeView pinhole = projector_pinhole_view(i, runs, scene_from_world);
    const int layer = 2 * static_cast<int>(i);
    draw(scene, runs, is_prototype, pinhole, whole_of(pinhole), projector_ids_, layer);
    if (with_soft_edges && edge_feathering_)
      edge_feathering_->find_edges(static_cast<int>(i), depth_, pinhole);
    GpuViewpoint viewpoint(pinhole, layer);
    viewpoint.of_imager(projectors_[i]);
    viewpoint.with_map(lenses_[i].baked.rect, static_cast<int>(i));
    for (const ProjectorResponse& response : responses_)
      if (response.projector == projectors_[i].name) viewpoint.with_response(response);
    for (const Focus& focus : focuses_)
      if (focus.projector == projectors_[i].name) viewpoint.with_focus(focus, projectors_[i]);
    send(static_cast<int>(i), viewpoint);
  }
  if (!with_soft_edges || !edge_feathering_) return;
  edge_feathering_->feather(Resources().with(Resource::scene, scene).with(Resource::viewpoints, *this));
}

void VisibilityBuffers::draw_surface_parts_from_projectors(const GpuScene& scene,
                                                           const std::vector<PlacedRun>& runs,
                                                           const Pose& scene_from_world) {
  for (std::size_t i = 0; i < projectors_.size(); ++i) {
    const PinholeView pinhole = projector_pinhole_view(i, runs, scene_from_world);
    const int layer = 2 * static_cast<int>(i) + 1;
    cv::Rect& place = surface_places_[i];
    if (!place.empty())
      glClearTexSubImage(*projector_ids_, 0, place.x, place.y, layer, place.width, place.height, 1,
                         GL_RED_INTEGER, GL_UNSIGNED_INT, nullptr);
    place = texels_of(pinhole, spanned_by(pinhole.pinhole_from_scene, runs, is_surface_part));
    if (!place.empty()) draw(scene, runs, is_surface_part, pinhole, place, projector_ids_, layer);
  }
}

void VisibilityBuffers::draw_from_imager(const GpuScene& scene,
                                         const std::vector<PlacedRun>& runs,
                                         const Pose& scene_from_world,
                                         const Imager& imager,
                                         const BakedLens& lens) {
  const Pose pose = imager_from_scene(imager, scene_from_world);
  draw_within(scene, runs, scene_from_world, imager, intersected(lens.rect, spanned_by(pose, runs, is_any)));
}

void VisibilityBuffers::draw_from_imager_over(const GpuScene& scene,
                                              const std::vector<PlacedRun>& runs,
                                              const Pose& scene_from_world,
                                              const Imager& imager,
                                              const BakedLens& lens,
                                              const std::vector<PlacedRun>& over,
                                              double around_m) {
  const Pose pose = imager_from_scene(imager, scene_from_world);
  TangentRect rect = tangents_spanned(pose, {});
  for (const PlacedRun& run : over) rect = united(rect, tangents_spanned(pose, bounds_of(run, around_m)));
  // `visible_rects` has a margin (pixels_of), and samples read some pixels beyond it.
  constexpr double k_margin_px = 16;
  const Eigen::Vector2d margin(k_margin_px / imager.lens.fx(), k_margin_px / imager.lens.fy());
  if (!rect.is_empty()) rect = {rect.lower - margin, rect.upper + margin};
  draw_within(scene, runs, scene_from_world, imager, intersected(lens.rect, rect));
}

void VisibilityBuffers::draw_within(const GpuScene& scene,
                                    const std::vector<PlacedRun>& runs,
                                    const Pose& scene_from_world,
                                    const Imager& imager,
                                    const TangentRect& rect) {
  const Pose pose = imager_from_scene(imager, scene_from_world);
  const PinholeView pinhole =
      pinhole_view_over(pose, rect, k_oversampling * imager.lens.fx(), k_viewer_ids_side, k_viewer_ids_side);
  draw(scene, runs, is_prototype, pinhole, whole_of(pinhole), viewer_ids_, 0);
  draw(scene, runs, is_part, pinhole, whole_of(pinhole), viewer_ids_, 1);
  GpuViewpoint viewpoint(pinhole, 0);
  viewpoint.of_imager(imager);
  send(viewer(), viewpoint);
}

void VisibilityBuffers::draw_from_reference_camera(const GpuScene& scene,
                                                   const std::vector<PlacedRun>& runs,
                                                   const Pose& scene_from_world,
                                                   const Imager& camera,
                                                   const BakedLens& lens) {
  const Pose pose = imager_from_scene(camera, scene_from_world);
  const PinholeView pinhole =
      pinhole_view_over(pose, intersected(lens.rect, spanned_by(pose, runs, is_prototype)),
                        k_oversampling * camera.lens.fx(), ids_width_, ids_height_);
  const int layer = 2 * viewer();
  draw(scene, runs, is_prototype, pinhole, whole_of(pinhole), projector_ids_, layer);
  upload_pixel_map(viewer(), camera, lens.rect);
  GpuViewpoint viewpoint(pinhole, layer);
  viewpoint.of_imager(camera);
  viewpoint.with_map(lens.rect, viewer());
  send(reference_camera(), viewpoint);
}

void VisibilityBuffers::draw_from_viewer(const GpuScene& scene,
                                         const std::vector<PlacedRun>& runs,
                                         const Pose& scene_from_world,
                                         const Eigen::Vector3d& p_viewer_scene,
                                         const Eigen::Vector3d& d_up_scene) {
  const Eigen::AlignedBox3d prototype = box_of(runs, is_prototype), parts = box_of(runs, is_view_part),
                            box = parts.isEmpty() ? prototype : parts;
  const Pose pose = box.isEmpty() ? Pose() : looking_at(p_viewer_scene, box.center(), d_up_scene);
  double focal = 1;
  for (const Imager& projector : projectors_) {
    const Eigen::Vector3d p_projector =
        (imager_from_scene(projector, scene_from_world).inverse()).translation;
    const double distance = prototype.isEmpty() ? 1 : std::max(0.05, prototype.exteriorDistance(p_projector));
    const double farthest = prototype.isEmpty() ? 1
                                                : (prototype.center() - p_viewer_scene).norm() +
                                                      0.5 * prototype.diagonal().norm();
    focal = std::max(focal, k_oversampling * projector.lens.fx() * farthest / distance);
  }
  const PinholeView pinhole = pinhole_view_over(pose, spanned_by(pose, runs, is_view_part), focal,
                                                k_viewer_ids_side, k_viewer_ids_side);
  draw(scene, runs, is_prototype, pinhole, whole_of(pinhole), viewer_ids_, 0);
  draw(scene, runs, is_part, pinhole, whole_of(pinhole), viewer_ids_, 1);
  send(viewer(), GpuViewpoint(pinhole, 0));
}

cv::Rect VisibilityBuffers::prototype_rect(std::size_t projector,
                                           const std::vector<PlacedRun>& runs,
                                           const Pose& scene_from_world) const {
  const Pose pose = imager_from_scene(projectors_[projector], scene_from_world);
  return pixels_of(projectors_[projector], lenses_[projector].baked, spanned_by(pose, runs, is_prototype));
}

std::vector<cv::Rect> VisibilityBuffers::visible_rects(const Imager& imager,
                                                       const BakedLens& lens,
                                                       const std::vector<PlacedRun>& runs,
                                                       const Pose& scene_from_world,
                                                       bool prototype_too,
                                                       double around_m) const {
  const Pose pose = imager_from_scene(imager, scene_from_world);
  std::vector<cv::Rect> places;
  for (const PlacedRun& run : runs) {
    if (!prototype_too && is_prototype(run)) continue;
    const cv::Rect place = pixels_of(imager, lens, tangents_spanned(pose, bounds_of(run, around_m)));
    if (!place.empty()) places.push_back(place);
  }
  return places;
}

void VisibilityBuffers::light_rects(std::size_t projector,
                                    const std::vector<PlacedRun>& runs,
                                    const Pose& scene_from_world,
                                    const Eigen::Vector3d& p_viewer_scene,
                                    std::vector<cv::Rect>* of_view,
                                    std::vector<cv::Rect>* of_surface) const {
  const Pose pose = imager_from_scene(projectors_[projector], scene_from_world);
  const cv::Rect whole = prototype_rect(projector, runs, scene_from_world);
  of_view->clear();
  of_surface->clear();
  for (const PlacedRun& part : runs) {
    if (!is_part(part)) continue;
    const TangentRect rect = part.on_surface ? tangents_spanned(pose, bounds_of(part, k_on_surface))
                                             : spanned_behind(pose, part, runs, p_viewer_scene);
    const cv::Rect place = whole & pixels_of(projectors_[projector], lenses_[projector].baked, rect);
    if (!place.empty()) (part.on_surface ? of_surface : of_view)->push_back(place);
  }
}

void VisibilityBuffers::bind(const Use& use) const {
  glBindTextureUnit(k_viewpoints_unit, *viewpoint_texels_);
  glBindTextureUnit(k_projector_ids_unit, *projector_ids_);
  glBindTextureUnit(k_viewer_ids_unit, *viewer_ids_);
  glBindTextureUnit(k_pixel_maps_unit, *pixel_maps_);
  if (edge_feathering_) glBindTextureUnit(k_edge_fade_unit, *edge_feathering_->fade());
  use.program.set("u_projector_count", static_cast<int>(projectors_.size()));
  use.program.set("u_viewer", viewer());
  use.program.set("u_reference_camera", reference_camera());
}

}  // namespace limn::projector
