#pragma once

#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/append_log.h"
#include "core/result.h"
#include "nodes/node_devices.h"
#include "nodes/setup_loader.h"
#include "nodes/timing/clock_estimator.h"
#include "nodes/timing/display_schedule.h"
#include "session/drawing/frame_drawer.h"

namespace limn::nodes {

/// Draws a session's frames for the projectors that are plugged into this node. An OpenGL context must be
/// current at every call and at destruction.
class NodeFrames {
 public:
  /// `node`: this machine's name. Error: the scene cannot be drawn here. A display that cannot be opened is
  /// tried again at each frame, and a problem until then.
  static Result<std::unique_ptr<NodeFrames>> create(LoadedSetup setup,
                                                    const std::string& node,
                                                    NodeDisplays* displays);

  /// Waits until a moment; false: something came that cannot wait.
  using Wait = std::function<bool(Stamp until)>;
  /// Draws a frame and shows it so that its light appears at FrameDescription::shown_at of the host's clock;
  /// a black one at once. If `wait` returns false, the rest of the frame is left out. `log`: one line for
  /// each image that was shown. A moment of another setup is ignored.
  void show(const Moment& moment,
            const std::optional<ClockEstimate>& clock,
            const Wait& wait,
            AppendLog* log);
  /// From now on the setup counts as that of another run or revision, whose files and devices are the same.
  void adopt(std::uint64_t run, std::uint64_t revision);
  /// Frames may show this deviation from the CAD from now on.
  void use_deviation(const std::shared_ptr<const scene::DeviationLayer>& layer);
  /// Shows the last images with this share of their light.
  void dim(double share);

  bool belongs_to(std::uint64_t run, std::uint64_t revision) const {
    return setup_.run == run && setup_.revision == revision;
  }
  bool has_projectors() const { return !outputs_.empty(); }
  /// Copies what it knows of frames and displays. `clock`: the host's.
  void report(const std::optional<ClockEstimate>& clock, Health* health) const;

 private:
  struct Output {
    device::DisplayConfig config;
    std::size_t projector = 0;  // index in the rig
    EyeImages image = {};
    DisplaySchedule schedule = {};
    std::string problem = {};
  };
  NodeFrames(LoadedSetup setup, NodeDisplays* displays) : setup_(std::move(setup)), displays_(displays) {}
  void show_image(const EyeImages& image, Output* output, Stamp* shown_at);

  LoadedSetup setup_;
  NodeDisplays* displays_;
  std::unique_ptr<session::FrameDrawer> drawer_;
  std::vector<Output> outputs_;
  std::uint64_t shown_ = 0, missed_ = 0;
  std::deque<double> draw_ms_;  // the last ones
  double late_ms_ = 0;
  bool is_checked_ = false;  // whether the first frame's images found room
  std::string problem_;      // if not
};

/// The first line of the log that NodeFrames::show writes.
constexpr std::string_view k_shown_log_header = "frame,projector,wanted_at_ns,shown_at_ns,fingerprint\n";

}  // namespace limn::nodes
