#include "wizard/device_checks.h"

#include <fmt/ranges.h>

#include <algorithm>

namespace limn::wizard {
namespace {

class Checks {
 public:
  Checks(const calib::CaptureSet& captures, const WizardBackend& backend, const WizardListener& listener)
      : captures_(captures), backend_(backend), listener_(listener) {}

  Status look_at_light() {
    step(WizardStep::outputs, WizardState::runs, "");
    LIMN_TRY(out.light, measure_exposure(captures_, backend_.capture));
    if (listener_.on_light) listener_.on_light(out.light);
    report_progress(
        WizardStep::outputs, unseen(out.light),
        fmt::format("{} of {} projectors seen", captures_.projectors.size() - unseen(out.light).size(),
                    captures_.projectors.size()));
    std::vector<std::string> advice;
    double bright = 255, saturated = 0, blur_px = 0;
    for (const ExposureReading& seen : out.light) {
      const auto more = seen.advice();
      advice.insert(advice.end(), more.begin(), more.end());
      if (seen.lit <= 0) continue;
      bright = std::min(bright, seen.bright);
      saturated = std::max(saturated, seen.saturated);
      blur_px = std::max(blur_px, seen.blur_px);
    }
    report_progress(WizardStep::exposure, advice,
                    fmt::format("grey level {:.0f}, {:.1f} % saturated, edge blur {:.1f} px", bright,
                                100 * saturated, blur_px));
    return {};
  }

  Status measure_latency() {
    step(WizardStep::latency, WizardState::runs, "");
    std::vector<std::string> words, problems;
    for (std::size_t i = 0; i < captures_.projectors.size(); ++i) {
      out.latency.emplace_back();
      const auto camera = best_camera(captures_.projectors[i].name);
      if (!camera) continue;
      const auto measured = wizard::measure_latency(backend_.flashes(static_cast<int>(i), *camera));
      if (!measured) {
        problems.push_back(fmt::format("{}: {}", captures_.projectors[i].name, measured.message()));
        continue;
      }
      out.latency.back() = *measured;
      backend_.use_latency(static_cast<int>(i), measured->seconds + measured->within_s);
      words.push_back(fmt::format("{} {:.1f} ms", captures_.projectors[i].name, 1e3 * measured->seconds));
    }
    report_progress(WizardStep::latency, problems, fmt::format("{}", fmt::join(words, ", ")));
    return {};
  }

  CheckedDevices out;

 private:
  // The camera that sees most of a projector's light; none if no camera sees it.
  std::optional<int> best_camera(const std::string& projector) const {
    double most = 0;
    std::optional<int> best;
    for (std::size_t i = 0; i < out.light.size(); ++i) {
      if (out.light[i].projector != projector || out.light[i].lit <= most) continue;
      most = out.light[i].lit;
      best = static_cast<int>(i % captures_.cameras.size());
    }
    return best;
  }

  void step(WizardStep which, WizardState state, const std::string& words) {
    if (listener_.step) listener_.step(which, state, words);
  }

  // Ends a step: reports its problems, or else its result.
  void report_progress(WizardStep which, const std::vector<std::string>& problems, const std::string& words) {
    for (const std::string& problem : problems) listener_.say("advice: " + problem);
    listener_.say(fmt::format("{}: {}", to_text(which), words));
    step(which, problems.empty() ? WizardState::done : WizardState::fails,
         problems.empty() ? words : fmt::format("{}", fmt::join(problems, "\n")));
  }

  const calib::CaptureSet& captures_;
  const WizardBackend& backend_;
  const WizardListener& listener_;
};

}  // namespace

Result<CheckedDevices> check_devices(const calib::CaptureSet& captures,
                                     const WizardBackend& backend,
                                     const WizardListener& listener) {
  Checks checks(captures, backend, listener);
  LIMN_TRY_STATUS(checks.look_at_light());
  LIMN_TRY_STATUS(checks.measure_latency());
  return std::move(checks.out);
}

}  // namespace limn::wizard
