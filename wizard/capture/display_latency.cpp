#include "wizard/capture/display_latency.h"

#include <algorithm>
#include <opencv2/core.hpp>
#include <vector>

#include "core/image_io.h"

namespace limn::wizard {
namespace {

constexpr double k_least_levels = 10;   // minimum of white minus black for a pixel that sees the light
constexpr double k_least_share = 1e-3;  // share of the image that must see the light

// The camera's mean grey levels for black and white, over the pixels where they differ.
struct Levels {
  cv::Mat mask;
  double black = 0, white = 0;
  double period_s = 0;  // frame period
  double lit_share(const cv::Mat& grey) const { return (cv::mean(grey, mask)[0] - black) / (white - black); }
};

// Changes the light and returns the last frame after `seconds`. Also measures the frame period.
Result<Frame> wait_until_settled(const FlashDevices& devices, bool white, double seconds, double* period_s) {
  LIMN_TRY(const Stamp shown_at, devices.show(white));
  LIMN_TRY(Frame frame, devices.next());
  while (seconds_between(shown_at, frame.captured_at) < seconds) {
    const Stamp before = frame.captured_at;
    LIMN_TRY(frame, devices.next());
    *period_s = seconds_between(before, frame.captured_at);
  }
  return frame;
}

Result<Levels> levels_of(const FlashDevices& devices, double limit_s) {
  Levels levels;
  LIMN_TRY(const Frame dark, wait_until_settled(devices, false, limit_s, &levels.period_s));
  LIMN_TRY(const Frame bright, wait_until_settled(devices, true, limit_s, &levels.period_s));
  const cv::Mat black = to_grey(dark.image), white = to_grey(bright.image);
  cv::Mat difference;
  cv::subtract(white, black, difference);
  double most = 0;
  cv::minMaxLoc(difference, nullptr, &most);
  levels.mask = difference > std::max(k_least_levels, most / 2);
  if (cv::countNonZero(levels.mask) < k_least_share * static_cast<double>(levels.mask.total()))
    return error(
        "{}: expected to see the display flash, found no difference between white and black. Point it at "
        "the surface that the display lights, and darken the room.",
        dark.camera);
  levels.black = cv::mean(black, levels.mask)[0];
  levels.white = cv::mean(white, levels.mask)[0];
  return levels;
}

// The interval in which a flash's light appeared, s after show().
struct Span {
  double low = 0, high = 0;
};

Result<Span> flash(const FlashDevices& devices, const Levels& levels, bool white, double limit_s) {
  LIMN_TRY(const Stamp shown_at, devices.show(white));
  double before_s = 0;
  while (before_s < limit_s) {
    LIMN_TRY(const Frame frame, devices.next());
    const double at_s = seconds_between(shown_at, frame.captured_at);
    if ((levels.lit_share(to_grey(frame.image)) > 0.5) == white) return Span{before_s, at_s};
    before_s = std::max(0.0, at_s);
  }
  return error(
      "{}",
      "display: expected its light to change with the image, found no change in time. Check its cable.");
}

// The interval that most flashes allow.
DisplayLatency most_agreed(const std::vector<Span>& spans) {
  DisplayLatency best;
  for (const Span& begins : spans) {
    const double low = begins.low;
    double high = begins.high;
    int count = 0;
    for (const Span& other : spans) {
      if (other.low > low || other.high <= low) continue;
      ++count;
      high = std::min(high, other.high);
    }
    if (count > best.flashes) best = {(low + high) / 2, (high - low) / 2, count};
  }
  return best;
}

}  // namespace

Result<DisplayLatency> measure_latency(const FlashDevices& devices, const FlashOptions& options) {
  LIMN_CHECK(options.flashes > 0 && options.limit_s > 0);
  LIMN_TRY(const Levels levels, levels_of(devices, options.limit_s));
  std::vector<Span> spans;
  for (int i = 0; i < options.flashes; ++i) {
    devices.wait(levels.period_s * i / options.flashes);
    LIMN_TRY(const Span span, flash(devices, levels, i % 2 == 1, options.limit_s));
    spans.push_back(span);
  }
  const DisplayLatency latency = most_agreed(spans);
  if (2 * latency.flashes < options.flashes)
    return error(
        "display: expected flashes that agree on one latency, found that {} of {} do. Make the camera's "
        "exposure shorter than its frame period, and switch off the display's image processing (game mode).",
        latency.flashes, options.flashes);
  return latency;
}

}  // namespace limn::wizard
