#include "session/part_fading.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace limn::session {
namespace {

constexpr double k_fading_gamma = 2.2;  // accurate enough to mix fading images

// base + share * (with - base), in linear light.
cv::Mat mixed(const cv::Mat& base, const cv::Mat& with, double share) {
  std::array<float, 256> light{};
  for (int i = 0; i < 256; ++i)
    light[static_cast<std::size_t>(i)] = static_cast<float>(std::pow(i / 255.0, k_fading_gamma));
  cv::Mat out(base.size(), base.type());
  const auto bytes = [](const cv::Mat& m, int row) { return m.ptr<std::uint8_t>(row); };
  for (int row = 0; row < base.rows; ++row) {
    const std::uint8_t *a = bytes(base, row), *b = bytes(with, row);
    std::uint8_t* c = out.ptr<std::uint8_t>(row);
    for (int i = 0; i < 3 * base.cols; ++i) {
      if (a[i] == b[i]) {
        c[i] = a[i];
        continue;
      }
      const double sum = light[a[i]] + share * (light[b[i]] - light[a[i]]);
      c[i] = cv::saturate_cast<std::uint8_t>(255 * std::pow(sum, 1 / k_fading_gamma));
    }
  }
  return out;
}

}  // namespace

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

cv::Mat PartFading::image(std::size_t projector,
                          const Imager& viewer,
                          Stamp at,
                          projector::Renderer* renderer) const {
  cv::Mat image = renderer->projector_image(projector, faded_, viewer);
  if (gone_) {
    const double share = 1 - seconds_between(gone_->lost_at, at) / options_.fade_s;
    return share <= 0 ? image
                      : mixed(image, renderer->projector_image(projector, gone_->posed, viewer), share);
  }
  for (const auto& [slot, fading] : fading_) {
    const double share = 1 - seconds_between(fading.lost_at, at) / options_.fade_s;
    if (share <= 0) continue;
    scene::PosedScene with = faded_;
    with.parts.push_back(fading.part);
    image = mixed(image, renderer->projector_image(projector, with, viewer), share);
  }
  return image;
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
