#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/file_writer.h"
#include "scene/actions.h"
#include "scene/scene.h"
#include "scene/show_state.h"

namespace limn::session {

/// Keeps what a session leaves of a scene: looks with their images and an overview page (looks/), which
/// marker carries which part (pairings.json), the lines that were drawn (drawn.json), all where
/// scene/kept_files.h says, and answers about units (slots/SLOT/units.json in the scene's folder). Files are
/// changed on a thread of its own, in order; each file is either old or complete.
class ShowStore {
 public:
  /// `keeps`: false: nothing is written.
  explicit ShowStore(bool keeps);
  ~ShowStore() { finish(); }
  ShowStore(ShowStore&&) = default;
  ShowStore& operator=(ShowStore&&) = default;

  /// The show state with the scene's looks, pairings and drawn lines. Damaged ones are reported in the log
  /// and not changed.
  static scene::ShowState loaded(const scene::Scene& scene, scene::ShowState show_state);

  /// Saves what an edit has changed. `look_image` is called at once for a look that was saved; it may return
  /// an empty image.
  void keep(const scene::Scene& scene,
            const scene::ShowState& before,
            const scene::ShowState& after,
            const scene::Command& command,
            const std::function<cv::Mat()>& look_image);

  /// Writes what waits: drawn lines are written twice a second at most, since a stroke comes in many edits.
  void keep_waiting();
  /// Whether something is not on the disk yet.
  bool is_busy() const { return writer_ && writer_->is_busy(); }
  /// Waits until all is on the disk.
  void finish();
  /// Messages about what could not be written since the last call.
  std::vector<std::string> failures();

 private:
  void keep_pairings(const scene::Scene& scene,
                     const scene::ShowState& before,
                     const scene::ShowState& after);
  void keep_drawn(const scene::Scene& scene, const scene::ShowState& before, const scene::ShowState& after);
  void write_drawn();
  void keep_unit(const scene::Scene& scene, const scene::Slot& slot, const scene::PartUnit& unit);
  void keep_looks(const std::filesystem::path& folder,
                  const scene::ShowState& before,
                  const scene::ShowState& after,
                  const std::function<cv::Mat()>& look_image);

  // The drawn lines that are not written yet.
  struct Drawn {
    std::filesystem::path file;
    std::vector<scene::DrawnLine> lines;
    std::vector<std::string> shown;
  };
  std::optional<Drawn> waiting_;
  std::chrono::steady_clock::time_point drawn_written_at_ = {};

  std::unique_ptr<FileWriter> writer_;  // null: only reads
};

}  // namespace limn::session
