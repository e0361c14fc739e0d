#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "scene/actions.h"
#include "scene/scene.h"
#include "scene/show_state.h"
#include "session/file_writer.h"

namespace limn::apps {

/// What of a session stays in its scene's folder: looks with their images and the page of all (looks/), which
/// marker carries which part (pairings.json), and answers about units (slots/SLOT/units.json). Files are
/// changed on a thread of its own, in order; each is either old or complete.
class ShowStore {
 public:
  /// `keeps`: false only reads.
  explicit ShowStore(bool keeps);

  /// A show state with the looks and pairings that are in the scene's folder. Damaged ones are named in the
  /// log and left alone.
  static scene::ShowState loaded(const scene::Scene& scene, scene::ShowState show_state);

  /// Keeps what an edit has changed. `look_image` is called for a look that was saved, at once; it may return
  /// an empty image.
  void keep(const scene::Scene& scene,
            const scene::ShowState& before,
            const scene::ShowState& after,
            const scene::Command& command,
            const std::function<cv::Mat()>& look_image);

  /// Whether something is not on the disk yet.
  bool is_busy() const { return writer_ && writer_->is_busy(); }
  /// Waits until all is.
  void finish();
  /// What could not be written since the last call.
  std::vector<std::string> failures();

 private:
  void keep_pairings(const scene::Scene& scene,
                     const scene::ShowState& before,
                     const scene::ShowState& after);
  void keep_unit(const scene::Scene& scene, const scene::Slot& slot, const scene::PartUnit& unit);
  void keep_looks(const std::filesystem::path& folder,
                  const scene::ShowState& before,
                  const scene::ShowState& after,
                  const std::function<cv::Mat()>& look_image);

  std::unique_ptr<FileWriter> writer_;  // null: only reads
};

}  // namespace limn::apps
