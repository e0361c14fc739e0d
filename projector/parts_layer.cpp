#include "projector/parts_layer.h"

#include <algorithm>
#include <utility>

#include "projector/renderer.h"

namespace limn::projector {

Result<PartsLayer> PartsLayer::link(const std::string& looks) {
  PartsLayer layer;
  layer.looks_ = looks;
  LIMN_TRY(layer.plain_, Both::link(looks));
  LIMN_TRY(layer.where_edges_, Program::link_compute("edges.comp"));
  return layer;
}

Status PartsLayer::link_shadowed() {
  if (shadowed_) return {};
  LIMN_TRY(shadowed_, Both::link(looks_ + "CONTACT_SHADOW"));
  return {};
}

auto PartsLayer::Both::link(const std::string& defined) -> Result<Both> {
  Both out;
  const std::pair<Program*, const char*> computed[] = {
      {&out.parts.where, "parts_where.comp"}, {&out.parts.centre, "parts_centre.comp"},
      {&out.parts.edges, "parts_edges.comp"}, {&out.view.where, "view_where.comp"},
      {&out.view.centre, "view_centre.comp"}, {&out.view.edges, "view_edges.comp"}};
  for (const auto& [program, file] : computed) {
    LIMN_TRY(*program, Program::link_compute(file, defined));
  }
  LIMN_TRY(out.parts.rest, Program::link_compute("parts_rest.comp", defined));
  return out;
}

void PartsLayer::draw(What what,
                      const Target& target,
                      const std::vector<cv::Rect>& places,
                      const Smoothing& smoothing,
                      const std::function<void(const Program&)>& set_up,
                      PassTimes* times) {
  Both& both = what.is_shadowed ? *shadowed_ : plain_;
  const Programs& programs = what.is_view ? both.view : both.parts;
  // Where places lie over each other pixels are listed again.
  const int room = target.size.area() * static_cast<int>(std::max<std::size_t>(1, places.size()));
  const auto over_places = [&](const Program& program) {
    list_.start(room);
    list_.bind();
    look_through(program, places);
  };
  const auto work_through = [&](const PixelList& pixels, const Program& program) {
    set_up(program);
    glBindImageTexture(0, *target.light, 0, GL_FALSE, 0, GL_WRITE_ONLY, GL_RGBA32F);
    pixels.work_through(program);
  };
  clear_light(target.light, target.size, places);
  {
    const PassTimes::Scope scope(times, "where there may be light");
    set_up(programs.where);
    over_places(programs.where);
  }
  {
    const PassTimes::Scope scope(times, "light at pixel centres");
    work_through(list_, programs.centre);
  }
  {
    const PassTimes::Scope scope(times, "where edges are");
    where_edges_.bind("s_centre", k_edges_unit, target.light);
    where_edges_.set("u_least_step", static_cast<float>(smoothing.least_step));
    over_places(where_edges_);
  }
  const PassTimes::Scope scope(times, "light at edges");
  programs.edges.set("u_samples", smoothing.samples);
  rest_list_.start(room);
  rest_list_.bind_as_rest();
  work_through(list_, programs.edges);
  if (!programs.rest) return;
  programs.rest->set("u_samples", smoothing.samples);
  work_through(rest_list_, *programs.rest);
}

}  // namespace limn::projector
