#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "scene/posed_scene.h"
#include "scene/scene.h"
#include "scene/show_state.h"
#include "session/drawing/frame_description.h"
#include "session/frame_input.h"

namespace limn::session {

/// Effects that last for a moment: parts whose marker was lost fade out, and the names of variants that were
/// chosen just now are shown beside their markers.
class PartFading {
 public:
  /// The name of a variant that was chosen, and when.
  struct Label {
    std::string text;
    Stamp since;
  };

  explicit PartFading(const ComposeOptions& options) : options_(options) {}

  /// Notes what is shown from `at` on. Stamps must not go back.
  void note(const scene::Scene& scene,
            const scene::PosedScene& posed,
            const scene::ShowState& show_state,
            Stamp at);

  /// The parts that are fading at that moment; none while the whole scene fades.
  std::vector<FadingPart> fading_parts(Stamp at) const;
  /// The whole scene, while it fades because the prototype was lost.
  std::vector<FadingScene> gone_scene(Stamp at) const;

  /// The posed scene that was noted last.
  const scene::PosedScene& faded() const { return faded_; }
  /// When the part of a slot was lost; nullopt: not recently.
  std::optional<Stamp> lost_at(const std::string& slot) const;
  /// The label of a slot; null: its variant was not changed recently.
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
  double share_left(Stamp lost_at, Stamp at) const;
  void note_lost(const scene::PosedScene& posed, Stamp at);
  void note_variants(const scene::Scene& scene, const scene::ShowState& show_state, Stamp at);

  ComposeOptions options_;
  scene::PosedScene faded_;
  std::map<std::string, Fading> fading_;         // by slot
  std::optional<Gone> gone_;                     // the whole scene, if the prototype was lost
  std::map<std::string, std::string> variants_;  // last shown, by slot
  std::map<std::string, Label> labels_;
};

}  // namespace limn::session
