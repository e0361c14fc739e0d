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

/// What a guest of the remote is published of a session, but for who is there: "The state" of docs/remote.md.
struct SessionState {
  struct Slot {
    std::string name, variant;
    std::vector<std::string> variants;
    Eigen::Vector3d nudge_mm = Eigen::Vector3d::Zero();
    bool is_held = false;
    std::string tracking;
    std::string marker;
    std::string material;  ///< as the action takes it; empty: as its file says
    std::vector<std::string> dropped;
    std::optional<Pose> prototype_from_part;  ///< absent: the part is not shown
  };
  struct Note {
    double at_s = 0;  ///< since the session began
    std::string text;
  };
  std::vector<Slot> slots;
  std::string prototype;  ///< its tracking; empty: the scene has none
  std::vector<std::string> looks;
  std::string look, other_look, deleted_look;
  bool blackout = false, frozen = false, grid = false, marker_states = false, split = false;
  double split_mm = 0;
  std::string light;   ///< as the action takes it; empty: the scene's own; `other`: one that it cannot say
  std::string screen;  ///< for all
  std::vector<scene::Output> outputs;
  std::string viewer, follows;       ///< whose tablet is to be the eye, and whose it is
  std::vector<std::string> windows;  ///< of guests whose tablets can be
  std::string repair;                ///< how far it is; empty: there is none
  std::vector<std::string> projectors;
  std::vector<apps::DeviceState> devices;
  std::vector<std::string> waiting;
  std::vector<Note> notes;  ///< the newest last
  std::optional<apps::Edited> last_edit;
};

/// `begun_at`: of the session, from which notes are dated.
SessionState session_state(const apps::Session& session,
                           const apps::Telemetry& telemetry,
                           const apps::DeviceHealth& health,
                           Stamp begun_at);

/// Poses that differ from `published` by what a tracker trembles (0.05 mm, 0.03 degrees) as they were
/// published.
SessionState without_jitter(SessionState state, const SessionState& published);

/// Its members of the message, but for number, last_edit, guests and comments.
nlohmann::ordered_json to_json(const SessionState& state);

}  // namespace limn::remote
