#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/pose.h"
#include "scene/show_state.h"
#include "session/device_health.h"
#include "session/session.h"
#include "session/telemetry.h"

namespace limn::remote {

/// The session's part of the state that guests get ("The state" of docs/remote.md). Clients and comments are
/// added by StatePublisher.
struct SessionState {
  struct Slot {
    std::string name, variant;
    std::vector<std::string> variants;
    Eigen::Vector3d nudge_mm = Eigen::Vector3d::Zero();
    bool is_held = false;
    std::string tracking;  ///< "seen", "carried on" or "lost".
    std::string marker;
    /// What the shown variant's volume holds; absent: the variant is a mesh.
    struct Volume {
      float least = 0, most = 0;
      scene::GreyWindow window;  ///< As it is shown.
    };
    std::optional<Volume> volume = {};
    std::string material;                     ///< In the words of its action; empty: the file's material.
    std::vector<std::string> dropped;         ///< Variants whose unit can be chosen.
    std::optional<Pose> prototype_from_part;  ///< nullopt: the part is not shown.
  };
  struct Note {
    double at_s = 0;  ///< Since the session began.
    std::string text;
  };
  std::vector<Slot> slots;
  std::string prototype;  ///< Its tracking, as a slot's; empty: the scene has none.
  std::vector<std::string> looks;
  std::string look, other_look, deleted_look;
  bool blackout = false, frozen = false, grid = false, marker_states = false, split = false;
  double split_mm = 0;
  std::vector<std::string> finishes;           ///< Names of the scene's finishes.
  std::string finish;                          ///< The prototype's; empty: none.
  std::optional<scene::SectionState> section;  ///< Absent: the scene has none.
  std::vector<std::string> lines;              ///< Names of the scene's lines of light and of drawn ones.
  std::vector<std::string> lines_on;           ///< Those that are shown.
  std::vector<std::string> lines_drawn;        ///< Those that were drawn.
  std::string light;   ///< In the words of its action; empty: the scene's; `other`: not expressible in them.
  std::string screen;  ///< What was last chosen for all screens.
  std::vector<scene::Output> outputs;
  std::string viewer;   ///< The guest who is chosen as the viewer; empty: the scene's own viewer.
  std::string follows;  ///< The guest whose tablet is the viewpoint now; empty: none.
  std::vector<std::string> windows;  ///< Guests whose tablets can be the viewpoint.
  std::string repair;                ///< Progress of the recalibration; empty: none runs.
  /// The comparison of the prototype with its CAD.
  struct Deviation {
    std::string progress;  ///< Empty: none runs.
    std::string text;      ///< The result in words; empty: there is none.
    std::string report;    ///< The folder of the newest report; empty: none.
    bool is_shown = false, is_held = false, is_fitted = false;
    double tolerance_mm = 0;
    std::vector<scene::DeviationLayer::Mark> extremes;
  };
  Deviation deviation;
  std::string pace;  ///< What is left out to keep real time; empty: nothing.
  std::vector<std::string> projectors;
  std::vector<session::DeviceState> devices;
  std::vector<std::string> waiting;  ///< Loose markers that can be paired.
  std::vector<Note> notes;           ///< The newest last.
  std::optional<session::Edited> last_edit;
};

/// The state of a session. `begun_at` is when it began; the times of notes count from there.
SessionState session_state(const session::Session& session,
                           const session::Telemetry& telemetry,
                           const session::DeviceHealth& health,
                           Stamp begun_at);

/// A state in which poses that differ from the published ones by less than the tracker's jitter (0.05 mm,
/// 0.03 degrees) are the published ones.
SessionState without_jitter(SessionState state, const SessionState& published);

/// The members of the state message, without number, last_edit, guests and comments.
nlohmann::ordered_json to_json(const SessionState& state);

}  // namespace limn::remote
