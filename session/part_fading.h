#pragma once

#include <map>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>

#include "core/imager.h"
#include "projector/renderer.h"
#include "scene/posed_scene.h"
#include "scene/scene.h"
#include "scene/show_state.h"
#include "session/frame_input.h"

namespace limn::apps {

/// What is left of what was shown a moment ago: light of parts whose marker was lost goes away softly, and
/// names of variants that were chosen lately stand by their markers.
class PartFading {
 public:
  /// The variant that a slot shows since a moment.
  struct Label {
    std::string text;
    Stamp since;
  };

  explicit PartFading(const ComposeOptions& options) : options_(options) {}

  /// What is shown from `at` on. Stamps must not go back.
  void note(const scene::Scene& scene,
            const scene::PosedScene& posed,
            const scene::ShowState& show_state,
            Stamp at);

  /// A projector's image of the parts that were noted last, and of those that fade a share.
  cv::Mat image(std::size_t projector, const Imager& viewer, Stamp at, projector::Renderer* renderer) const;

  /// What was noted last.
  const scene::PosedScene& shown() const { return shown_; }
  /// When the part of a slot was lost, if that was lately.
  std::optional<Stamp> lost_at(const std::string& slot) const;
  /// Null: it shows that variant for long.
  const Label* label(const std::string& slot) const;

 private:
  struct Fading {
    scene::PosedPart part;
    Stamp lost_at;
  };
  struct Gone {
    scene::PosedScene posed;
    Stamp lost_at;
  };
  void note_lost(const scene::PosedScene& posed, Stamp at);
  void note_variants(const scene::Scene& scene, const scene::ShowState& show_state, Stamp at);

  ComposeOptions options_;
  scene::PosedScene shown_;
  std::map<std::string, Fading> fading_;         // by slot
  std::optional<Gone> gone_;                     // all, since the prototype was lost
  std::map<std::string, std::string> variants_;  // last shown
  std::map<std::string, Label> labels_;
};

}  // namespace limn::apps
