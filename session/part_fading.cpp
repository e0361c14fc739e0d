#include "session/part_fading.h"

#include <algorithm>

namespace limn::session {
void PartFading::note(const scene::Scene& scene,
                      const scene::PosedScene& posed,
                      const scene::ShowState& show_state,
                      Stamp at) {
  note_lost(posed, at);
  note_variants(scene, show_state, at);
  faded_ = posed;
}

void PartFading::note_lost(const scene::PosedScene& posed, Stamp at) {
  const auto find = [](const scene::PosedScene& where, const std::string& slot) {
    return std::find_if(where.parts.begin(), where.parts.end(),
                        [&](const scene::PosedPart& part) { return part.slot == slot; });
  };
  for (const scene::PosedPart& part : faded_.parts)
    if (find(posed, part.slot) == posed.parts.end()) fading_[part.slot] = {part, at};
  for (const scene::PosedPart& part : posed.parts) fading_.erase(part.slot);
  if (posed.world_from_prototype)
    gone_.reset();
  else if (faded_.world_from_prototype)
    gone_ = {faded_, at};
  std::erase_if(fading_, [&](const auto& entry) {
    return seconds_between(entry.second.lost_at, at) > std::max(options_.fade_s, options_.lost_s);
  });
}

void PartFading::note_variants(const scene::Scene& scene, const scene::ShowState& show_state, Stamp at) {
  for (std::size_t i = 0; i < scene.slots.size(); ++i) {
    const std::string& slot = scene.slots[i].name;
    const std::string& variant = show_state.slots[i].variant;
    const auto shown = variants_.find(slot);
    if (shown != variants_.end() && shown->second != variant) labels_[slot] = {variant, at};
    variants_[slot] = variant;
  }
  std::erase_if(
      labels_, [&](const auto& entry) { return seconds_between(entry.second.since, at) > options_.label_s; });
}

std::vector<FadingPart> PartFading::fading_parts(Stamp at) const {
  std::vector<FadingPart> out;
  if (gone_) return out;
  for (const auto& [slot, fading] : fading_)
    if (const double share = share_left(fading.lost_at, at); share > 0) out.push_back({fading.part, share});
  return out;
}

std::vector<FadingScene> PartFading::gone_scene(Stamp at) const {
  const double share = gone_ ? share_left(gone_->lost_at, at) : 0;
  return share > 0 ? std::vector<FadingScene>{{gone_->posed, share}} : std::vector<FadingScene>();
}

double PartFading::share_left(Stamp lost_at, Stamp at) const {
  return 1 - seconds_between(lost_at, at) / options_.fade_s;
}

std::optional<Stamp> PartFading::lost_at(const std::string& slot) const {
  const auto found = fading_.find(slot);
  return found == fading_.end() ? std::nullopt : std::optional(found->second.lost_at);
}

const PartFading::Label* PartFading::label(const std::string& slot) const {
  const auto found = labels_.find(slot);
  return found == labels_.end() ? nullptr : &found->second;
}

}  // namespace limn::session
