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
#include "session/perception.h"
#include "session/recording.h"
#include "session/recovering_composer.h"
#include "session/scene_watch.h"
#include "session/show_store.h"
#include "session/swapped_cameras.h"
#include "session/tablet_registry.h"
#include "session/telemetry.h"

namespace limn::apps {

/// An edit that was done, and whose it was.
struct Edited {
  scene::Edit edit;
  std::string source;
  std::size_t count = 0;  ///< of all that were done so far
};

/// Names parts that could not be loaded. `telemetry` may be null.
void tell(std::span<const scene::SkippedVariant> skipped_variants, Stamp at, Telemetry* telemetry);

/// The projector side of a live session with all that people can do to it: what was watched and edited ->
/// images. Belongs to the thread whose GL context is current.
class Session {
 public:
  /// Looks are read from the scene's folder `looks` and, with `keeps_looks`, written to it; damaged ones are
  /// named and left alone. Likewise pairings.json, and the answers about units (show_store.h). `telemetry`
  /// and `recorder` may be null.
  static Result<Session> create(const SessionSetup& setup,
                                Telemetry* telemetry,
                                Recorder* recorder,
                                bool keeps_looks = true);

  using Drawing = RecoveringComposer::Drawing;
  /// From now on it goes on when the GL context is lost, and people are told.
  void survive_losses(Drawing drawing) { composer_.survive_losses(std::move(drawing)); }

  /// What a watcher knows now; its control uses become edits. `moments`: calls of watch() so far.
  void take(Percepts watched, std::size_t moments);
  /// An edit of a person; one that cannot be done is told, and nothing changes. `source` says whose. `pair`
  /// without a marker means the one that glows (waiting_markers).
  Status edit(const scene::Edit& edit, const std::string& source, Stamp at);

  /// Where a guest's tablet looks from; nullopt: its window is closed. Frames go by it while
  /// ShowState::viewer names the guest, or the guest is among the scene's viewers.
  void see(const std::string& guest, const std::optional<Eigen::Vector3d>& p_eye_world, Stamp at);

  /// Shows another scene from now on, with the same markers and controls: parts that were edited, added or
  /// taken away; a new variant is shown at once. Error, and nothing changes: markers or controls differ, or
  /// it cannot be drawn.
  Status show(scene::Scene scene, Stamp at);

  /// Goes on with another rig of the same devices. Error, and nothing changes: it cannot be drawn for.
  Status mend(Rig rig, Stamp at);
  /// Whether somebody asked for a repair (session/live_recalibration.h) since the last call.
  bool take_recalibration_request() { return std::exchange(recalibration_requested_, false); }
  /// How far a repair is, in words; empty: there is none.
  const std::string& recalibration_progress() const { return recalibration_progress_; }
  void set_recalibration_progress(std::string how_far) { recalibration_progress_ = std::move(how_far); }
  /// What has moved, as far as people were told.
  const std::optional<Drift>& drift() const { return drift_.told(); }
  /// Tells people, on the page and in the log.
  void warn(Stamp at, const std::string& what);

  /// The same, when `files` have changed; what cannot be loaded is told of and the parts stay as they were.
  void show_news(SceneWatch* files, Stamp at);

  /// What the frame for these moments is composed of; every body is predicted to them here and nowhere else.
  FrameInput predict(const FrameTimes& times);
  /// The projectors' images of a frame.
  const ComposedFrame& compose(const FrameInput& input);
  /// A frame goes into the recording, if there is one.
  void record_frame();
  /// The three of them, for who shows nothing.
  const ComposedFrame& paint(Stamp now, Stamp shown_at);
  /// To be called when what was painted is shown: tells of a device that was nudged.
  void look_for_drift(Stamp now);
  /// Tells what could not be written of looks, pairings and units.
  void tell_unwritten(Stamp at);
  /// Whether looks, pairings or units are not on the disk yet.
  bool is_writing() const { return store_.is_busy(); }
  /// Waits until they are.
  void finish_writing() { store_.finish(); }
  /// A screen's image (Painter::screen), of what was chosen for all or of `what`.
  cv::Mat screen() { return screen(show_state_.screen); }
  cv::Mat screen(scene::Screen what);
  /// As of Painter; empty while there is nothing to draw with, or no prototype is seen.
  cv::Mat free_surface(std::size_t projector);

  /// What was painted last.
  const ComposedFrame& painted() const { return composer_.painted(); }
  const scene::ShowState& show_state() const { return show_state_; }
  const Percepts& watched() const { return watched_; }
  /// Where bodies are, as of the newest frames and of the newest predict().
  const Prediction& prediction() const { return prediction_; }
  const SessionSetup& setup() const { return setup_; }
  /// How many scenes were shown so far, the first one included, and rigs: another number, another
  /// setup().scene or setup().rig.
  int scenes() const { return scenes_; }
  /// The newest edit.
  const std::optional<Edited>& last_edit() const { return last_edit_; }
  /// Guests whose windows have seen markers and are open.
  const std::set<std::string>& windows() const { return tablets_.windows(); }
  /// What the last paint() was made of and cost: stamps, times, markers, lost bodies; the rest is the
  /// caller's. record_ms is -1 without a recording.
  ShownFrame measured() const;

 private:
  Session(
      SessionSetup setup, FrameComposer composer, Telemetry* telemetry, Recorder* recorder, bool keeps_looks);
  Status show_if_whole(SceneNews news, Stamp at);
  void ask_units();

  SessionSetup setup_;
  RecoveringComposer composer_;
  ShowStore store_;
  Telemetry* telemetry_;
  Recorder* recorder_;
  std::set<std::string> asked_;  // about units
  scene::ShowState show_state_;
  Percepts watched_;
  Prediction prediction_;
  std::size_t moments_ = 0;
  DriftNotices drift_;
  SwappedCamerasCheck swapped_;
  bool recalibration_requested_ = false;
  std::string recalibration_progress_;
  int scenes_ = 1;
  std::optional<Edited> last_edit_;
  TabletRegistry tablets_;
  double paint_ms_ = 0, record_ms_ = 0;
};

}  // namespace limn::apps
