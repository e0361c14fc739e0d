#include "scene/part_units.h"

#include <Eigen/Geometry>
#include <nlohmann/json.hpp>

#include "core/config.h"
#include "core/json_text.h"

namespace limn::scene {

double longest_side(const Mesh& mesh) {
  Eigen::AlignedBox3f box;
  for (const Eigen::Vector3f& p : mesh.positions) box.extend(p);
  return static_cast<double>(box.sizes().maxCoeff());
}

LengthUnit guessed_units(const Mesh& as_metres) {
  constexpr double k_least_m = 0.01, k_most_m = 3;
  for (const LengthUnit units :
       {LengthUnit::millimetre, LengthUnit::centimetre, LengthUnit::metre, LengthUnit::inch}) {
    const double size = longest_side(as_metres) * metres_per_unit(units);
    if (size >= k_least_m && size <= k_most_m) return units;
  }
  return LengthUnit::metre;
}

Mesh scaled(Mesh mesh, LengthUnit units) {
  for (Eigen::Vector3f& p : mesh.positions) p *= static_cast<float>(metres_per_unit(units));
  return mesh;
}

Result<std::map<std::string, LengthUnit>> load_units(const std::filesystem::path& file) {
  std::map<std::string, LengthUnit> units;
  std::error_code none;
  if (!std::filesystem::exists(file, none)) return units;
  LIMN_TRY(const Config config, Config::load(file, "limn.units/1"));
  config.root().only({"schema", "units"});
  const ConfigNode node = config.root().at("units");
  for (const std::string& name : node.keys()) units[name] = k_length_units.read(node.at(name));
  LIMN_TRY_STATUS(config.status());
  return units;
}

std::string units_question(const Slot& slot, const Variant& variant) {
  if (!variant.auto_imported || !variant.auto_imported->is_guess) return {};
  return fmt::format(
      "{} of slot '{}' is assumed to be in {}, {:.0f} mm long. Is that right? If not: units {} {} UNIT",
      variant.name, slot.name, to_text(*variant.auto_imported->units), 1e3 * longest_side(variant.mesh),
      slot.name, variant.name);
}

std::string units_json(const Slot& slot, const std::string& variant, LengthUnit units) {
  nlohmann::ordered_json all = nlohmann::ordered_json::object();
  for (const Variant& known : slot.variants)
    if (known.auto_imported && !known.auto_imported->is_guess && known.auto_imported->units)
      all[known.name] = to_text(*known.auto_imported->units);
  all[variant] = to_text(units);
  return json_text(nlohmann::ordered_json({{"schema", "limn.units/1"}, {"units", all}}), 2) + "\n";
}

}  // namespace limn::scene
