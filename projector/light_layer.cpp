#include "projector/light_layer.h"

#include <algorithm>

#include "projector/renderer.h"

namespace limn::projector {
namespace {

// Adds what a rectangle has outside of others, and outside of what is there already.
void add_outside(const cv::Rect& place, std::span<const cv::Rect> others, std::vector<cv::Rect>* places) {
  if (place.empty()) return;
  for (const std::span<const cv::Rect> taken : {others, std::span<const cv::Rect>(*places)}) {
    for (const cv::Rect& other : taken) {
      const cv::Rect both = place & other;
      if (both.empty()) continue;
      const int left = place.x, top = place.y, right = place.br().x, bottom = place.br().y;
      for (const cv::Rect& piece : {cv::Rect({left, top}, cv::Point(right, both.y)),
                                    cv::Rect({left, both.br().y}, cv::Point(right, bottom)),
                                    cv::Rect({left, both.y}, cv::Point(both.x, both.br().y)),
                                    cv::Rect({both.br().x, both.y}, cv::Point(right, both.br().y))})
        add_outside(piece, others, places);
      return;
    }
  }
  places->push_back(place);
}

}  // namespace

void PlacesByMode::clear() {
  for (std::vector<cv::Rect>* places : {&view, &surface, &both}) places->clear();
}

void PlacesByMode::divide(std::span<const cv::Rect> of_view, std::span<const cv::Rect> of_surface) {
  clear();
  for (const cv::Rect& v : of_view)
    for (const cv::Rect& s : of_surface) add_outside(v & s, {}, &both);
  for (const cv::Rect& v : of_view) add_outside(v, both, &view);
  for (const cv::Rect& s : of_surface) add_outside(s, both, &surface);
}

Result<LightLayer> LightLayer::link(const std::string& looks, bool by_measurement) {
  LightLayer layer;
  const std::string balance = by_measurement ? "BY_MEASUREMENT " : "", drawing = looks + balance;
  LIMN_TRY(layer.hits_, Program::link_compute("light_hits.comp"));
  LIMN_TRY(layer.unknown_, Program::link_compute("light_unknown.comp"));
  LIMN_TRY(layer.listed_hits_, Program::link_compute("light_hits.comp", "LISTED"));
  LIMN_TRY(layer.shares_, Program::link_compute("light_shares.comp", balance));
  LIMN_TRY(layer.where_edges_, Program::link_compute("edges.comp", "KNOWN_SHARES"));
  LIMN_TRY(layer.rest_, Program::link_compute("light_rest.comp", drawing + "VIEW_PARTS SURFACE_PARTS"));
  const char* modes[] = {"VIEW_PARTS", "SURFACE_PARTS", "VIEW_PARTS SURFACE_PARTS"};
  for (std::size_t i = 0; i < layer.modes_.size(); ++i) {
    ByMode& mode = layer.modes_[i];
    LIMN_TRY(mode.where, Program::link_compute("light_where.comp", modes[i]));
    LIMN_TRY(mode.centre, Program::link_compute("light_centre.comp", drawing + modes[i]));
    LIMN_TRY(mode.edges, Program::link_compute("light_edges.comp", drawing + modes[i]));
  }
  return layer;
}

void LightLayer::draw(const Target& target,
                      const PlacesByMode& places,
                      const Smoothing& smoothing,
                      const std::function<void(const Program&)>& set_up,
                      PassTimes* times) {
  const int pixels = target.size.area();
  const auto for_modes = [&](const auto& draw_mode) {
    for (std::size_t i = 0; i < modes_.size(); ++i)
      if (modes_[i].is_used) draw_mode(modes_[i], *places.each()[i]);
  };
  for (std::size_t i = 0; i < modes_.size(); ++i) modes_[i].is_used = !places.each()[i]->empty();
  const auto work_through = [&](const PixelList& list, const Program& program) {
    set_up(program);
    glBindImageTexture(0, *target.light, 0, GL_FALSE, 0, GL_READ_WRITE, GL_RGBA32F);
    list.work_through(program);
  };
  for_modes(
      [&](ByMode&, const std::vector<cv::Rect>& parted) { clear_light(target.light, target.size, parted); });
  {
    const PassTimes::Scope scope(times, "what is lit");
    const Program& program = target.is_unknown ? hits_ : unknown_;
    set_up(program);
    rest_list_.start(pixels);
    rest_list_.bind();
    for_modes([&](ByMode&, const std::vector<cv::Rect>& parted) { look_through(program, parted); });
    if (!target.is_unknown) work_through(rest_list_, listed_hits_);
  }
  {
    const PassTimes::Scope scope(times, "where there may be light");
    for_modes([&](ByMode& mode, const std::vector<cv::Rect>& parted) {
      mode.lit.start(pixels);
      mode.lit.bind();
      set_up(mode.where);
      look_through(mode.where, parted);
    });
  }
  {
    const PassTimes::Scope scope(times, "light at pixel centres");
    rest_list_.start(pixels);
    rest_list_.bind_as_rest();
    for_modes([&](ByMode& mode, const std::vector<cv::Rect>&) { work_through(mode.lit, mode.centre); });
    work_through(rest_list_, shares_);
  }
  {
    const PassTimes::Scope scope(times, "where edges are");
    rest_list_.start(pixels);
    rest_list_.bind_as_rest();
    where_edges_.bind("s_centre", k_edges_unit, target.light);
    where_edges_.set("u_least_step", static_cast<float>(smoothing.least_step));
    for_modes([&](ByMode& mode, const std::vector<cv::Rect>& parted) {
      mode.at_edges.start(pixels);
      mode.at_edges.bind();
      look_through(where_edges_, parted);
    });
    work_through(rest_list_, shares_);
  }
  const PassTimes::Scope scope(times, "light at edges");
  rest_list_.start(pixels);
  rest_list_.bind_as_rest();
  for_modes([&](ByMode& mode, const std::vector<cv::Rect>&) {
    mode.edges.set("u_samples", smoothing.samples);
    work_through(mode.at_edges, mode.edges);
  });
  rest_.set("u_samples", smoothing.samples);
  work_through(rest_list_, rest_);
}

void LightLayer::work_through_lit(const Program& program) const {
  for (const ByMode& mode : modes_) {
    if (!mode.is_used) continue;
    mode.lit.work_through(program);
    mode.at_edges.work_through(program);
  }
}

}  // namespace limn::projector
