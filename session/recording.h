#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/frame.h"
#include "core/image_writer.h"
#include "core/result.h"
#include "core/rig.h"
#include "scene/actions.h"
#include "session/frame_composer.h"

namespace limn::apps {

/// What a session's images depend on beside frames and edits.
struct SessionSetup {
  Rig rig;
  scene::Scene scene;
  PerceptionOptions watch;
  ComposeOptions paint;
  std::vector<std::string> screens = {};  ///< names of displays that are no projectors
};

/// Writes a session's folder (limn.session/1): rig and scene as they were, frames as the JPEG that a camera
/// sent, others as PNG, and events.jsonl, what happened in its order: frames watched, edits, where a tablet
/// looked from that was followed, images painted with their poses. Frames are written on a thread of their
/// own; when the disk is full or too slow for them the recording ends there, complete up
/// to that moment, and says so, and the session goes on. Safe from several threads.
class Recorder {
 public:
  /// Error: the folder cannot be written, or holds a session already.
  static Result<std::unique_ptr<Recorder>> create(const std::filesystem::path& folder,
                                                  const SessionSetup& setup);

  /// Frames of one moment, as Watcher::watch takes them.
  void watched(std::span<const Frame> frames);
  /// The scene's files have changed: they are copied as they are now.
  void shown(const scene::Scene& scene);
  /// Another rig from now on; returns it as replay will read it, to the last bit. `moments` as of edited().
  Rig mended(Rig rig, std::size_t moments);
  /// `moments` counts the calls of watched() that the session knew of.
  void edited(const scene::Edit& edit, const std::string& source, std::size_t moments);
  /// Where a guest's tablet looks from that is followed; nullopt: nowhere any more.
  void saw(const std::string& guest, const std::optional<Eigen::Vector3d>& p_eye_world, Stamp at);
  /// `moments` as of edited().
  void painted(const ComposedFrame& painted, std::size_t moments);

  /// Why it ended before the session, if it did.
  std::optional<std::string> ended() const;
  /// Waits until all is on disk.
  Status finish();

 private:
  explicit Recorder(const std::filesystem::path& folder);
  void write(const nlohmann::ordered_json& event);  // call with mutex_ held
  void end(const std::string& why);                 // likewise

  std::filesystem::path folder_;
  ImageWriter images_;
  mutable std::mutex mutex_;
  std::ofstream events_;
  std::size_t frames_ = 0, scenes_ = 1, rigs_ = 1;
  std::optional<std::string> ended_;
};

/// Of 8-bit images, to tell whether two are the same.
std::uint64_t fingerprint(std::span<const cv::Mat> images);

/// A line of events.jsonl that replay compares: shown_at and the tracks, numbers in full.
nlohmann::ordered_json pose_log(const ComposedFrame& painted);

/// Reads a frame's file, but its camera's name and its stamp, as it was watched. Error: damaged, or none.
Result<Frame> load_frame(const std::filesystem::path& file);

/// Reads what a session was set up with. Error: no session, another schema, a damaged file.
Result<SessionSetup> load_setup(const std::filesystem::path& folder);

}  // namespace limn::apps
