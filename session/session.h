#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/result.h"
#include "scene/actions.h"
#include "scene/show_state.h"
#include "session/drift_watch.h"
#include "session/frame_input.h"
#include "session/pen/pen_stroke.h"
#include "session/perception.h"
#include "session/recording.h"
#include "session/recovering_composer.h"
#include "session/scene_watch.h"
#include "session/section_rest.h"
#include "session/show_store.h"
#include "session/tablet_registry.h"
#include "session/telemetry.h"
#include "tracker/swapped_cameras.h"

namespace limn::session {

struct PrototypeComparison;

/// A repair (session/live_recalibration.h) that somebody asked for, and how far it is.
struct RecalibrationStatus {
  bool is_requested = false;
  std::string progress;  ///< for people; empty: none is running
};

/// The comparison of the prototype with its CAD (session/deviation_job.h): what somebody asked for, how far
/// it is, and the newest result.
struct DeviationStatus {
  bool is_scan_requested = false, is_comparison_requested = false, is_report_requested = false;
  std::string progress;                               ///< for people; empty: nothing runs
  std::shared_ptr<const PrototypeComparison> result;  ///< null: there is none
  std::string text;                                   ///< the result in words
  std::filesystem::path report;                       ///< folder of the newest report; empty: none
};

/// An edit that was applied, and who sent it.
struct Edited {
  scene::Edit edit;
  std::string source;
  std::size_t count = 0;  ///< number of edits applied so far, with this one
};

/// A live session: makes images from percepts and from what people change. Belongs to the thread whose GL
/// context is current.
class Session {
 public:
  /// Looks are read from the scene's folder `looks` and, with `keeps_looks`, written to it; damaged ones are
  /// reported and not changed. The same holds for pairings.json, drawn.json and the answers about units
  /// (show_store.h). `telemetry` and `recorder` may be null.
  static Result<Session> create(const SessionSetup& setup,
                                Telemetry* telemetry,
                                Recorder* recorder,
                                bool keeps_looks = true);

  using Drawing = RecoveringComposer::Drawing;
  /// From now on the session survives the loss of the GL context, and reports it.
  void survive_losses(Drawing drawing) { composer_.survive_losses(std::move(drawing)); }

  /// Receives new percepts; their control uses become edits. `moments`: number of calls of Perception::watch
  /// so far.
  void update_percepts(Percepts percepts, std::size_t moments);
  /// Applies an edit. Error, and nothing changes: it cannot be done. `source` says who sent it. `pair`
  /// without a marker uses the last one of waiting_markers().
  Status edit(const scene::Edit& edit, const std::string& source, Stamp at);

  /// Updates the position of a guest's tablet (world frame, m); nullopt: its window is closed. The viewpoint
  /// depends on it while ShowState::viewer names the guest, or the guest is among the scene's viewers.
  void note_tablet(const std::string& guest, const std::optional<Eigen::Vector3d>& p_eye_world, Stamp at);

  /// Projectors that give no light from now on because they are missing or fail, by name.
  void set_dark_projectors(std::vector<std::string> names);

  /// Shows another scene from now on, with the same markers and controls, but with parts that were edited,
  /// added or removed. A new variant is shown at once. Error, and nothing changes: markers or controls
  /// differ, or the scene cannot be drawn.
  Status replace_scene(scene::Scene scene, Stamp at);

  /// Continues with another rig of the same devices. Error: no renderer can be made for it; the session keeps
  /// its rig.
  Status replace_rig(Rig rig, Stamp at);
  /// Requests for a repair, and its progress.
  RecalibrationStatus& recalibration() { return recalibration_; }
  const RecalibrationStatus& recalibration() const { return recalibration_; }
  /// Requests for a comparison with the CAD, its progress and its result.
  DeviationStatus& deviation() { return deviation_; }
  const DeviationStatus& deviation() const { return deviation_; }
  /// Shows a deviation from the CAD from now on.
  void show_deviation(std::shared_ptr<const scene::DeviationLayer> layer);
  /// The drift that was last reported.
  const std::optional<Drift>& drift() const { return drift_.reported(); }
  /// What the session leaves out to keep real time, as a sentence for people; empty: nothing.
  const std::string& pace() const { return pace_; }
  void set_pace(std::string sentence) { pace_ = std::move(sentence); }
  /// Adds a message to the telemetry and to the log.
  void warn(Stamp at, const std::string& what);

  /// Shows the scene from `files` if it has changed, as replace_scene() does. If it cannot be loaded, this is
  /// reported and the parts stay as they were.
  void reload_changed_scene(SceneWatch* files, Stamp at);
  /// Reports what is left out of the scene, each once.
  void report_skipped(std::span<const scene::SkippedVariant> skipped_variants, Stamp at);

  /// The input for the frame with these times. Bodies are predicted to them here and nowhere else.
  FrameInput predict(const FrameTimes& times);
  /// Called with what a frame shows before it is drawn.
  using DescriptionListener = std::function<void(const FrameDescription&)>;
  /// Composes the projectors' images of a frame. `listener` may be empty.
  const ComposedFrame& compose(const FrameInput& input, const DescriptionListener& listener = {});
  /// Adds the composed frame to the recording, if there is one.
  void record_frame();
  /// predict(), compose() and record_frame() in one call, for callers that show nothing.
  const ComposedFrame& compose_and_record(Stamp now, Stamp shown_at);
  /// To be called when the composed frame is shown: checks whether a device has moved, and reports it.
  void check_drift(Stamp now);
  /// Has drawn lines written, and reports looks, pairings, drawn lines and units that could not be written.
  void report_unwritten(Stamp at);
  /// The files that the session keeps in the scene's folder.
  ShowStore& store() { return store_; }
  const ShowStore& store() const { return store_; }
  /// A screen's image for one eye (FrameComposer::screen): of what is chosen for all screens, or of `what`.
  cv::Mat screen() { return screen(show_state_.screen); }
  cv::Mat screen(scene::Screen what) { return screen(ScreenRequest{.what = what}).left; }
  EyeImages screen(const ScreenRequest& request);
  /// FrameComposer::free_surface; empty while there is no GL context, or the prototype has no pose.
  cv::Mat free_surface(std::size_t projector);

  /// The last composed frame.
  const ComposedFrame& composed() const { return composer_.composed(); }
  const scene::ShowState& show_state() const { return show_state_; }
  const Percepts& percepts() const { return percepts_; }
  /// The predicted tracks, for the newest frames and the newest predict().
  const Prediction& prediction() const { return prediction_; }
  const SessionSetup& setup() const { return setup_; }
  /// The number of scenes and rigs so far. It changes when setup().scene or setup().rig does.
  int scenes() const { return scenes_; }
  /// The newest edit.
  const std::optional<Edited>& last_edit() const { return last_edit_; }
  /// Guests whose tablet views have seen markers and are open.
  const std::set<std::string>& windows() const { return tablets_.windows(); }
  /// The measurements of the last frame: stamps, times, markers, lost bodies; the caller fills in the rest.
  /// record_ms is -1 without a recording.
  ShownFrame measured() const;

 private:
  void draw_with_pen(std::span<const Track> tracks);
  void request_deviation(const scene::DeviationRequest& request);
  void forget_deviation();
  Session(
      SessionSetup setup, FrameComposer composer, Telemetry* telemetry, Recorder* recorder, bool keeps_looks);
  void ask_units();

  SessionSetup setup_;
  RecoveringComposer composer_;
  ShowStore store_;
  Telemetry* telemetry_;
  Recorder* recorder_;
  std::set<std::string> left_out_;  // what report_skipped() has reported
  std::set<std::string> asked_;     // questions about units, each asked once
  scene::ShowState show_state_;
  Percepts percepts_;
  Prediction prediction_;
  std::size_t moments_ = 0;
  DriftNotices drift_;
  tracker::SwappedCamerasCheck swapped_;
  RecalibrationStatus recalibration_;
  DeviationStatus deviation_;
  std::string pace_;
  int scenes_ = 1;
  std::optional<Edited> last_edit_;
  std::vector<std::string> dark_projectors_;
  TabletRegistry tablets_;
  SectionRest section_rest_;
  PenStroke pen_;
  std::string pen_line_;  // that the pen draws; empty: none yet
  bool is_pen_refused_ = false;
  double paint_ms_ = 0, record_ms_ = 0;
};

}  // namespace limn::session
