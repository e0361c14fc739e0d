#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "core/result.h"
#include "scene/scene.h"

namespace limn::scene {

/// The longest side of the box around a mesh, m.
double longest_side(const Mesh& mesh);

/// A guess of the unit of a mesh whose coordinates were taken as metres: the first one that gives a part's
/// usual size.
LengthUnit guessed_units(const Mesh& as_metres);

/// A mesh whose coordinates were taken as metres, in its guessed unit.
Mesh scaled(Mesh mesh, LengthUnit units);

/// The units that people have given, by variant (units.json). No file: none.
Result<std::map<std::string, LengthUnit>> load_units(const std::filesystem::path& file);

/// A question for people about an auto-imported variant whose unit is a guess, with the way to answer it;
/// empty for other variants.
std::string units_question(const Slot& slot, const Variant& variant);
/// The text of slots/NAME/units.json with one more unit.
std::string units_json(const Slot& slot, const std::string& variant, LengthUnit units);

}  // namespace limn::scene
