#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <memory>
#include <mutex>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/frame.h"
#include "core/image_writer.h"
#include "core/result.h"
#include "core/rig.h"
#include "scene/actions.h"
#include "session/frame_composer.h"

namespace limn::session {

/// Everything that a session's images depend on besides frames and edits.
struct SessionSetup {
  Rig rig;
  scene::Scene scene;
  PerceptionOptions watch;
  ComposeOptions paint;
  std::vector<std::string> screens = {};  ///< names of the displays that are not projectors
  /// The newest deviation from the CAD, for machines that draw described frames; null: none.
  std::shared_ptr<const scene::DeviationLayer> deviation = {};
  bool follows_pen = true;  ///< The scene's pen draws; not in a replay, whose strokes were recorded as edits.
};

/// The file of SessionSetup::deviation in a setup's folder.
inline constexpr std::string_view k_deviation_file = "deviation";

/// Writes that file alone; load_deviation() reads it. Errors: the folder cannot be written; the file is
/// missing or damaged.
Status save_deviation(const scene::DeviationLayer& layer, const std::filesystem::path& folder);
Result<std::shared_ptr<const scene::DeviationLayer>> load_deviation(const std::filesystem::path& folder);

/// Writes rig/, scene/, session.json and, if there is one, the file `deviation`; load_setup() reads them.
/// Error: the folder cannot be written.
Status save_setup(const SessionSetup& setup, const std::filesystem::path& folder);

/// Writes the recording of a session (limn.session/1): the rig and the scene as they were at its start; the
/// camera frames, as the camera's own JPEG or else as PNG; and events.jsonl, which lists what happened in its
/// order: perceived frames, edits, positions of tablets that the viewpoint depends on, and composed frames
/// with their poses. Frames are written on a thread of their own. When the disk is full or too slow, the
/// recording ends: it is complete up to that moment, ended() says why, and the session goes on. Safe from
/// several threads.
class Recorder {
 public:
  /// Error: the folder cannot be written, or holds a session already. Then the folder is as it was.
  static Result<std::unique_ptr<Recorder>> create(const std::filesystem::path& folder,
                                                  const SessionSetup& setup);

  /// Records the frames of one moment and what other tracking systems and nodes have sent, as they are passed
  /// to Perception::watch.
  void record_frames(std::span<const Frame> frames, const FeedInput& input = {});
  /// To be called when the scene's files have changed: copies them as they are now.
  void record_scene(const scene::Scene& scene);
  /// Records the rig that is used from now on; returns it as a replay will read it, to the last bit.
  /// `moments`: as in edited().
  Rig record_rig(Rig rig, std::size_t moments);
  /// Records the deviation from the CAD that is shown from now on. `moments`: as in edited().
  void record_deviation(const scene::DeviationLayer& layer, std::size_t moments);
  /// Records an edit. `moments`: the number of calls of watched() whose percepts the session had received.
  void record_edit(const scene::Edit& edit, const std::string& source, std::size_t moments);
  /// Records the position (world frame, m) of a guest's tablet that the viewpoint depends on; nullopt: it has
  /// none any more.
  void record_tablet(const std::string& guest, const std::optional<Eigen::Vector3d>& p_eye_world, Stamp at);
  /// Records which projectors give no light from now on.
  void record_dark_projectors(const std::vector<std::string>& names);
  /// Records a composed frame. `moments`: as in edited().
  void record_images(const ComposedFrame& composed, std::size_t moments);

  /// Why the recording ended before the session; nullopt: it did not.
  std::optional<std::string> ended() const;
  /// Waits until all is on disk.
  Status finish();

 private:
  explicit Recorder(const std::filesystem::path& folder);
  // Writes the setup and opens the log; on an error parts of it may be in the folder.
  static Result<std::unique_ptr<Recorder>> begin(const std::filesystem::path& folder,
                                                 const SessionSetup& setup);
  // Call these with mutex_ held. The first one is false when the recording has ended.
  bool queue_images(std::span<const Frame> frames, nlohmann::ordered_json* list);
  void write(const nlohmann::ordered_json& event);
  void end(const std::string& why);

  std::filesystem::path folder_;
  ImageWriter images_;
  mutable std::mutex mutex_;
  std::ofstream events_;
  std::size_t frames_ = 0, scenes_ = 1, rigs_ = 1, deviations_ = 0;
  std::optional<std::string> ended_;
};

/// A hash of 8-bit images, to tell whether two images are the same.
std::uint64_t fingerprint(std::span<const cv::Mat> images);

/// The part of a line of events.jsonl that a replay compares: stamps, tracks and parts, with all digits.
nlohmann::ordered_json pose_log(const ComposedFrame& composed);

/// Reads the poses of other tracking systems and the detections of nodes' cameras in a `watch` event, without
/// their images; throws nlohmann::json::exception on a damaged one.
FeedInput recorded_feeds(const nlohmann::ordered_json& event);

/// Reads the image of a recorded frame; the camera's name and the stamp are not in the file. Error: the file
/// is damaged or missing.
Result<Frame> load_frame(const std::filesystem::path& file);

/// Reads the setup of a recorded session. Error: no session, another schema, a damaged file.
Result<SessionSetup> load_setup(const std::filesystem::path& folder);

}  // namespace limn::session
