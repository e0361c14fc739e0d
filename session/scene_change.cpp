#include "session/scene_change.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/gesture.h"
#include "core/names.h"
#include "scene/actions.h"

namespace limn::session {
namespace {

std::vector<std::string> variant_names(const scene::Slot& slot) {
  std::vector<std::string> names;
  for (const scene::Variant& variant : slot.variants) names.push_back(variant.name);
  return names;
}

// Whether both scenes have the same markers on the same bodies, and the same controls.
bool have_same_markers(const scene::Scene& a, const scene::Scene& b) {
  const auto carriers = [](const scene::Scene& scene) {
    std::string text;
    for (const Body& body : scene::bodies(scene)) {
      text += body.name + ":";
      for (const BodyMarker& marker : body.markers) {
        const Eigen::Quaterniond& q = marker.body_from_marker.rotation;
        const Eigen::Vector3d& t = marker.body_from_marker.translation;
        text += fmt::format(" {} {} {} {} {} {} {} {} {}", marker.marker.text(), marker.size_m, q.w(), q.x(),
                            q.y(), q.z(), t.x(), t.y(), t.z());
      }
      text += "\n";
    }
    for (const Constellation& balls : scene::constellations(scene)) {
      text += fmt::format("{}: {}", balls.name, balls.radius_m);
      for (const Eigen::Vector3d& p : balls.p_balls) text += fmt::format(" {} {} {}", p.x(), p.y(), p.z());
      text += "\n";
    }
    for (const scene::Control& control : scene.controls)
      text += fmt::format("{} {} {} {} {}\n", control.marker.text(), scene::action_of(control.action).name,
                          control.slot, k_gestures.text(control.gesture), control.value);
    return text;
  };
  return carriers(a) == carriers(b);
}

}  // namespace

Status check_same_markers(const scene::Scene& now, const scene::Scene& next) {
  if (have_same_markers(now, next)) return {};
  return error(
      "{}: expected the markers, slots and controls that the session began with, found others. Start a "
      "new session to use them; this one continues with the parts as they were.",
      (next.folder / "scene.json").string());
}

bool has_same_prototype(const scene::Scene& now, const scene::Scene& next) {
  if (!now.prototype || !next.prototype) return now.prototype.has_value() == next.prototype.has_value();
  const scene::Mesh &a = now.prototype->mesh, &b = next.prototype->mesh;
  return a.triangles == b.triangles && a.positions == b.positions;
}

std::vector<scene::SkippedVariant> keep_old_variants(const scene::Scene& now, LoadedScene* loaded) {
  std::vector<scene::SkippedVariant> kept, left_out;
  for (const scene::SkippedVariant& skipped : loaded->skipped_variants) {
    const scene::Slot* before = now.find_slot(skipped.slot);
    scene::Slot* slot = find_named(loaded->scene.slots, skipped.slot);
    const scene::Variant* old = before ? find_named(before->variants, skipped.variant) : nullptr;
    if (!slot || !old || find_named(slot->variants, skipped.variant)) {
      left_out.push_back(skipped);
      continue;
    }
    const auto place =
        std::min(old - before->variants.data(), static_cast<std::ptrdiff_t>(slot->variants.size()));
    const auto same_file = std::find_if_not(
        old + 1, before->variants.data() + before->variants.size(),
        [&](const scene::Variant& variant) { return variant.default_variant == skipped.variant; });
    slot->variants.insert(slot->variants.begin() + place, old, same_file);
    kept.push_back(skipped);
  }
  loaded->skipped_variants = std::move(left_out);
  scene::leave_out_empty_slots(&loaded->scene);
  return kept;
}

scene::ShowState with_variants_of(const scene::Scene& next,
                                  const scene::Scene& now,
                                  scene::ShowState show_state) {
  for (std::size_t i = 0; i < next.slots.size(); ++i) {
    const std::vector<std::string> names = variant_names(next.slots[i]), before = variant_names(now.slots[i]);
    const auto is_in = [](const std::string& name, const std::vector<std::string>& list) {
      return std::find(list.begin(), list.end(), name) != list.end();
    };
    std::string& shown = show_state.slots[i].variant;
    for (const std::string& name : names)
      if (!is_in(name, before) && find_named(next.slots[i].variants, name)->default_variant.empty())
        shown = name;
    if (!is_in(shown, names)) shown = names.front();
  }
  if (!find_named(next.finishes, show_state.finish)) show_state.finish.clear();
  std::erase_if(show_state.lines, [&](const std::string& name) {
    return !find_named(next.lines, name) && !find_named(show_state.drawn, name);
  });
  for (const scene::Line& line : next.lines)
    if (line.is_shown && !find_named(now.lines, line.name)) show_state.lines.push_back(line.name);
  return show_state;
}

}  // namespace limn::session
