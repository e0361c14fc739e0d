#include "projector/cap_counter.h"

#include <cmath>

#include "projector/bindings.h"

namespace limn::projector {
namespace {

constexpr Defines k_section = {Define::section}, k_count = {Define::section, Define::count_cap};

// The plane that cuts a part, in the part's frame.
scene::CutPlane cut_in_owner(const PlacedRun& placed) {
  return scene::transformed(placed.scene_from_owner.inverse(), *placed.cut);
}

void set_triangles(const Program& program, const PlacedRun& placed, const PinholeView& pinhole) {
  const Eigen::Matrix4d clip_from_owner =
      clip_from_pinhole(pinhole) * (pinhole.pinhole_from_scene * placed.scene_from_owner).matrix();
  program.set("u_clip_from_owner", Eigen::Matrix4f(clip_from_owner.cast<float>()));
  program.set("u_cut_in_owner", coefficients(cut_in_owner(placed)));
}

}  // namespace

Eigen::Vector4f coefficients(const std::optional<scene::CutPlane>& cut) {
  if (!cut) return {0, 0, 0, -1};
  Eigen::Vector4f out;
  out << cut->normal.cast<float>(), static_cast<float>(-cut->offset_m);
  return out;
}

bool is_removed(const PlacedRun& placed, const Eigen::AlignedBox3d& box) {
  if (!placed.cut) return false;
  const scene::CutPlane cut = cut_in_owner(placed);
  const double reach = cut.normal.cwiseAbs().dot(0.5 * box.sizes());
  return scene::height_over(cut, box.center()) > reach;
}

Result<CapCounter> CapCounter::create(int width, int height) {
  CapCounter out;
  LIMN_TRY(out.ids_, Program::link("ids_open.vert", "ids_open.frag", k_section));
  LIMN_TRY(out.count_, Program::link("ids_open.vert", "cap_count.frag", k_count));
  LIMN_TRY(out.cap_, Program::link("fullscreen.vert", "cap_ids.frag", k_section));
  out.counts_ = make_texture(GL_TEXTURE_2D, GL_R16F, width, height);
  out.framebuffer_ = make_framebuffer();
  glNamedFramebufferTexture(*out.framebuffer_, GL_COLOR_ATTACHMENT0, *out.counts_, 0);
  out.vertex_array_ = make_vertex_array();
  return out;
}

const Program& CapCounter::ids_program(const PlacedRun& placed, const PinholeView& pinhole) const {
  set_triangles(ids_, placed, pinhole);
  return ids_;
}

void CapCounter::begin_count(const GpuScene& scene,
                             const PlacedRun& placed,
                             const PinholeView& pinhole,
                             const cv::Rect& texels) const {
  glBindFramebuffer(GL_FRAMEBUFFER, *framebuffer_);
  glEnable(GL_SCISSOR_TEST);
  glScissor(texels.x, texels.y, texels.width, texels.height);
  const GLfloat none[4] = {0, 0, 0, 0};
  glClearNamedFramebufferfv(*framebuffer_, GL_COLOR, 0, none);
  glDisable(GL_DEPTH_TEST);
  glDisable(GL_CULL_FACE);
  glEnable(GL_BLEND);
  glBlendEquation(GL_FUNC_ADD);
  glBlendFunc(GL_ONE, GL_ONE);
  scene.bind({Resource::scene, GL_READ_ONLY, count_});
  set_triangles(count_, placed, pinhole);
  count_.use();
}

void CapCounter::end_count(const PlacedRun& placed,
                           const PinholeView& pinhole,
                           const GlName& framebuffer) const {
  glDisable(GL_BLEND);
  glBindFramebuffer(GL_FRAMEBUFFER, *framebuffer);
  glEnable(GL_DEPTH_TEST);
  const scene::CutPlane cut = scene::transformed(pinhole.pinhole_from_scene, *placed.cut);
  cap_.set("u_cut_in_pinhole", coefficients(cut));
  const auto focal = static_cast<float>(pinhole.focal);
  cap_.set("u_focal_centre", Eigen::Vector4f(focal, focal, static_cast<float>(pinhole.centre.x()),
                                             static_cast<float>(pinhole.centre.y())));
  cap_.set("u_near", static_cast<float>(k_near));
  cap_.set_id("u_owner", static_cast<unsigned>(placed.owner));
  glBindTextureUnit(k_cap_count_unit, *counts_);
  cap_.use();
  glBindVertexArray(*vertex_array_);
  glDrawArrays(GL_TRIANGLES, 0, 3);
  glDisable(GL_SCISSOR_TEST);
}

}  // namespace limn::projector
