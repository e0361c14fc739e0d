#include "apps/documents/command_table.h"

#include <fmt/format.h>

namespace limn::apps {

std::vector<const CommandRow*> all_commands(const CommandRow& table) {
  std::vector<const CommandRow*> all = {&table};
  for (const CommandRow& command : table.commands)
    for (const CommandRow* inner : all_commands(command)) all.push_back(inner);
  return all;
}

std::string value_text(const OptionRow& option) {
  return option.choices.empty() ? option.value : fmt::format("{}", fmt::join(option.choices, "|"));
}

ValueKind value_kind(const std::string& word) {
  if (word == "FAMILY") return {ValueKind::known, {}, "families"};
  if (word == "ROOM") return {ValueKind::known, {}, "rooms"};
  if (word == "SLOT=VARIANT") return {ValueKind::known, {}, "slots"};
  if (word == "BENCH") return {ValueKind::known, {}, "benches"};
  if (word == "COMMAND") return {ValueKind::known, {}, "commands"};
  if (word == "FOLDER" || word == "CAPTURES") return {ValueKind::folders};
  if (word == "FILE" || word == "RIG" || word == "SCENE" || word == "SCAN") return {ValueKind::files};
  if (word == "IMAGE")
    return {ValueKind::files,
            {"png", "jpg", "jpeg", "pgm", "ppm", "pbm", "bmp", "tif", "tiff", "webp", "tga"}};
  if (word == "MESH")
    return {ValueKind::files,
            {"glb", "gltf", "obj", "stl", "ply", "3mf", "fbx", "step", "stp", "iges", "igs"}};
  if (word.starts_with("FILE.")) return {ValueKind::files, {word.substr(5)}};
  return {};
}

}  // namespace limn::apps
