// The actions on a part.
#include <algorithm>

#include "core/names.h"
#include "scene/action_functions.h"
#include "scene/command_text.h"

namespace limn::scene::apply {
namespace {

std::vector<std::string> variant_names(const Slot& slot) {
  std::vector<std::string> names;
  for (const Variant& variant : slot.variants) names.push_back(variant.name);
  return names;
}

void step_variant(Change* change, int steps) {
  std::string& variant = change->chosen().variant;
  variant = stepped(variant_names(change->slot()), variant, steps);
}

}  // namespace

Status next_variant(Change* change, std::monostate) {
  step_variant(change, 1);
  return {};
}

Status previous_variant(Change* change, std::monostate) {
  step_variant(change, -1);
  return {};
}

Status choose_variant(Change* change, const std::string& variant) {
  const std::vector<std::string> names = variant_names(change->slot());
  if (std::find(names.begin(), names.end(), variant) == names.end())
    return error("{}: expected a variant of slot '{}' ({}), found '{}'.", change->name, change->slot().name,
                 listed(names), variant);
  change->chosen().variant = variant;
  return {};
}

Status nudge(Change* change, const Eigen::Vector3d& mm) {
  ShowState::Slot& slot = change->chosen();
  slot.nudge += 1e-3 * mm;
  if (slot.pin)
    slot.pin->prototype_from_part =
        slot.pin->prototype_from_part * Pose(Eigen::Quaterniond::Identity(), 1e-3 * mm);
  return {};
}

Status place(Change* change, const Pose& prototype_from_part) {
  change->chosen().nudge.setZero();
  change->chosen().pin = Pin{prototype_from_part, std::nullopt};
  return {};
}

Status release(Change* change, std::monostate) {
  change->chosen().nudge.setZero();
  change->chosen().pin.reset();
  return {};
}

Status pair(Change* change, const std::optional<MarkerName>& marker) {
  if (!marker)
    return error(
        "{}: expected a marker that carries nothing and lies still, found none. Lay one down for a second.",
        change->name);
  if (const Status can = check_carrier(change->scene, change->show_state, *marker, change->slot_index); !can)
    return error("{}: {}", change->name, can.message());
  change->chosen().pin.reset();
  if (*marker == change->slot().marker)
    change->chosen().marker.reset();
  else
    change->chosen().marker = *marker;
  return {};
}

Status unpair(Change* change, std::monostate) { return pair(change, change->slot().marker); }

Status set_unit(Change* change, const PartUnit& wanted) {
  std::vector<std::string> dropped;
  for (const Variant& variant : change->slot().variants)
    if (variant.auto_imported) dropped.push_back(variant.name);
  if (std::find(dropped.begin(), dropped.end(), wanted.part) == dropped.end())
    return error("{}: expected a part that was dropped into slot '{}' ({}) and its unit, found '{}'.",
                 change->name, change->slot().name, listed(dropped), wanted.words);
  return {};
}

Status set_material(Change* change, const MaterialOverride& material) {
  change->chosen().material = material;
  return {};
}

Status set_window(Change* change, const std::optional<GreyWindow>& window) {
  const std::vector<Variant>& variants = change->slot().variants;
  if (std::none_of(variants.begin(), variants.end(), [](const Variant& v) { return v.volume != nullptr; }))
    return error("{}: expected a slot with a volume (NIfTI, DICOM), found slot '{}' with meshes only.",
                 change->name, change->slot().name);
  change->chosen().window = window;
  return {};
}

}  // namespace limn::scene::apply
