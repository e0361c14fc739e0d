#include "session/stillness.h"

#include <algorithm>

namespace limn::session {
namespace {

constexpr double k_trembles_m = 0.5e-3, k_trembles_rad = 1e-3;
constexpr double k_stays_m = 0.1e-3;  // an eighth of a projector pixel at 1280 pixels per metre

// Whether no corner of the box moves noticeably between the two poses.
bool stays(const Eigen::AlignedBox3d& box, const Pose& before, const Pose& now) {
  double most_m = 0;
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector3d p = box.corner(static_cast<Eigen::AlignedBox3d::CornerType>(i));
    most_m = std::max(most_m, (now * p - before * p).norm());
  }
  return most_m < k_stays_m;
}

}  // namespace

bool is_elsewhere(const Pose& before, const Pose& now) {
  return (before.translation - now.translation).norm() > k_trembles_m ||
         angle_between(before.rotation, now.rotation) > k_trembles_rad;
}

void keep_still(const std::optional<Pose>& shown,
                const Eigen::AlignedBox3d& box,
                std::vector<Track>* tracks) {
  if (!shown || box.isEmpty()) return;
  for (Track& track : *tracks)
    if (track.body == "prototype" && stays(box, *shown, track.world_from_body))
      track.world_from_body = *shown;
}

void keep_parts_still(const scene::PosedScene& shown,
                      const scene::PartBoxes& boxes,
                      scene::PosedScene* posed) {
  const auto& before = shown.world_from_prototype;
  const auto& now = posed->world_from_prototype;
  if (before.has_value() != now.has_value() || (now && !is_same(*before, *now))) return;
  for (scene::PosedPart& part : posed->parts) {
    const auto was = std::find_if(shown.parts.begin(), shown.parts.end(), [&](const scene::PosedPart& other) {
      return other.slot == part.slot && other.variant == part.variant;
    });
    const Eigen::AlignedBox3d* box = boxes.find(part.slot, part.variant);
    if (was == shown.parts.end() || !box || box->isEmpty()) continue;
    if (stays(*box, was->world_from_part, part.world_from_part)) part.world_from_part = was->world_from_part;
  }
}

void keep_cut_still(const scene::PosedScene& shown,
                    const Eigen::Vector3d& p_middle,
                    scene::PosedScene* posed) {
  constexpr double k_reach_m = 0.5;
  if (!shown.cut || !posed->cut) return;
  const double turned_m = k_reach_m * (shown.cut->normal - posed->cut->normal).norm();
  const double shifted_m = std::abs(height_over(*shown.cut, p_middle) - height_over(*posed->cut, p_middle));
  if (turned_m + shifted_m < k_stays_m) posed->cut = shown.cut;
}

Pose steadied(std::optional<Pose>* held, std::vector<Track>* tracks) {
  const auto prototype = std::find_if(tracks->begin(), tracks->end(), [](const Track& track) {
    return track.body == "prototype" && track.tracking != TrackingState::lost;
  });
  if (prototype == tracks->end()) return Pose();
  const Pose world_from_prototype = prototype->world_from_body;
  if (!*held || is_elsewhere(**held, world_from_prototype)) *held = world_from_prototype;
  const Pose turned_from_world = **held * world_from_prototype.inverse();
  for (Track& track : *tracks) track.world_from_body = turned_from_world * track.world_from_body;
  prototype->world_from_body = **held;  // to the last bit
  return turned_from_world;
}

}  // namespace limn::session
