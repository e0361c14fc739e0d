#include "nodes/node_frames.h"

#include <algorithm>
#include <array>
#include <utility>

#include "core/median.h"
#include "core/names.h"
#include "core/stopwatch.h"
#include "projector/gl.h"
#include "session/recording.h"

namespace limn::nodes {
namespace {

constexpr double k_farthest_s = 0.25;
constexpr std::size_t k_draw_times = 15;  // whose median is reported: single slow frames do not count
constexpr double k_late_decay =
    0.98;  // the largest distance from the wanted moment shrinks by it with each frame

cv::Mat dimmed(const cv::Mat& image, double share) {
  cv::Mat out;
  if (!image.empty()) image.convertTo(out, image.type(), std::clamp(share, 0.0, 1.0));
  return out;
}

}  // namespace

Result<std::unique_ptr<NodeFrames>> NodeFrames::create(LoadedSetup setup,
                                                       const std::string& node,
                                                       NodeDisplays* displays) {
  std::unique_ptr<NodeFrames> out(new NodeFrames(std::move(setup), displays));
  const session::SessionSetup& session = out->setup_.session;
  for (const device::DisplayConfig& config : out->setup_.devices.displays) {
    const Imager* projector = find_named(session.rig.projectors, config.name);
    if (config.host != node || !projector) continue;
    const auto index = static_cast<std::size_t>(projector - session.rig.projectors.data());
    out->outputs_.push_back({.config = config, .projector = index});
  }
  LIMN_TRY(session::FrameDrawer drawer,
           session::FrameDrawer::create(&session.scene, &session.rig, session::draw_options(session.paint)));
  out->drawer_ = std::make_unique<session::FrameDrawer>(std::move(drawer));
  out->drawer_->use_deviation(session.deviation);
  return out;
}

void NodeFrames::adopt(std::uint64_t run, std::uint64_t revision) {
  setup_.run = run;
  setup_.revision = revision;
}

void NodeFrames::use_deviation(const std::shared_ptr<const scene::DeviationLayer>& layer) {
  setup_.session.deviation = layer;
  drawer_->use_deviation(layer);
}

void NodeFrames::show(const Moment& moment,
                      const std::optional<ClockEstimate>& clock,
                      const Wait& wait,
                      AppendLog* log) {
  if (moment.setup != setup_.revision) return;
  const bool is_black = moment.frame.is_black;
  const Stamp begun = now();
  for (Output& output : outputs_) output.image = drawer_->image(moment.frame, output.projector);
  if (!std::exchange(is_checked_, true))
    if (const Status checked = projector::check_gl_memory("the projectors' images"); !checked)
      problem_ = checked.message();
  draw_ms_.push_back(milliseconds_since(begun));
  if (draw_ms_.size() > k_draw_times) draw_ms_.pop_front();

  // A moment that is farther away comes from a clock that is not known yet, or has stepped.
  const Stamp wanted = clock && !is_black
                           ? std::min(clock->to_local(moment.frame.shown_at), shifted(now(), k_farthest_s))
                           : now();
  std::vector<Output*> in_order;
  for (Output& output : outputs_) in_order.push_back(&output);
  std::ranges::sort(in_order, {}, [&](const Output* output) { return output->schedule.call_at(wanted); });
  late_ms_ *= k_late_decay;
  for (Output* output : in_order) {
    if (!is_black && output->schedule.is_too_late(wanted, now())) ++missed_;
    if (const Stamp call_at = output->schedule.call_at(wanted); call_at > now() && !wait(call_at)) return;
    Stamp shown_at;
    show_image(output->image, output, &shown_at);
    if (!output->problem.empty()) continue;
    const double late_s = seconds_between(wanted, shown_at);
    if (!is_black) late_ms_ = std::max(late_ms_, 1e3 * std::abs(late_s));
    const std::array<cv::Mat, 2> eyes = {output->image.left, output->image.right};
    const auto ns = [](Stamp at) { return at.time_since_epoch().count(); };
    log->add(fmt::format("{},{},{},{},{:016x}\n", moment.frame.number, output->config.name,
                         ns(moment.frame.shown_at), clock ? ns(clock->to_other(shown_at)) : 0,
                         session::fingerprint(eyes)),
             shown_at);
  }
  shown_ = moment.frame.number;
}

void NodeFrames::show_image(const EyeImages& image, Output* output, Stamp* shown_at) {
  const auto show = [&]() -> Result<Stamp> {
    LIMN_TRY(device::Display * display, displays_->display(output->config));
    return display->show_eyes(image);
  };
  const Stamp called_at = now();
  const Result<Stamp> shown = show();
  output->problem = shown ? std::string() : shown.message();
  if (!shown) return;
  output->schedule.note(called_at, *shown);
  *shown_at = *shown;
}

void NodeFrames::dim(double share) {
  for (Output& output : outputs_) {
    Stamp shown_at;
    if (!output.image.left.empty())
      show_image({dimmed(output.image.left, share), dimmed(output.image.right, share)}, &output, &shown_at);
  }
}

void NodeFrames::report(const std::optional<ClockEstimate>& clock, Health* health) const {
  health->shown = shown_;
  health->missed = missed_;
  health->draw_ms = median(std::vector<double>(draw_ms_.begin(), draw_ms_.end()));
  health->late_ms = late_ms_;
  if (!problem_.empty()) health->problems.push_back(problem_);
  for (const Output& output : outputs_) {
    health->latency_s = std::max(health->latency_s, output.schedule.latency_s());
    if (const auto period_s = output.schedule.refresh_s(); period_s && clock)
      health->refreshes.push_back({clock->to_other(output.schedule.last_shown_at()), *period_s});
    if (!output.problem.empty()) health->problems.push_back(output.problem);
  }
}

}  // namespace limn::nodes
