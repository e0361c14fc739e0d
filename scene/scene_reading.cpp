#include "scene/scene_reading.h"

#include <algorithm>
#include <array>
#include <map>
#include <set>

#include "core/names.h"
#include "scene/actions.h"
#include "scene/marker_file.h"
#include "scene/meshes/mesh_formats.h"
#include "scene/meshes/mesh_loading.h"
#include "scene/volume_part.h"

namespace limn::scene {
namespace {

struct Reader {
  SceneFiles* files;
  std::map<std::string, std::string> marker_users;  // marker -> its key in scene.json
};

MarkerName read_marker_name(const ConfigNode& node) {
  const auto name = MarkerName::parse(node.text());
  if (!name) node.problem(name.message());
  return name ? *name : MarkerName{};
}

// A marker can be used once only.
void claim(const MarkerName& name, const ConfigNode& node, Reader* reader) {
  const auto [user, fresh] = reader->marker_users.try_emplace(name.text(), node.where());
  if (!fresh)
    node.problem(fmt::format("expected a marker that nothing else uses, found {}, which {} uses already.",
                             name.text(), user->second));
}

MarkerName read_carrier(const ConfigNode& node, Reader* reader) {
  MarkerName name = read_marker_name(node);
  claim(name, node, reader);
  return name;
}

// The balls that a marker's name means; nullopt for a square marker. A file without a constellation is a
// problem of `node`.
std::optional<Constellation> read_constellation(const MarkerName& name, const ConfigNode& node) {
  if (!is_constellation(name)) return std::nullopt;
  auto balls = load_constellation(node.path_inside(name.id));
  if (!balls) node.problem(balls.message());
  return balls ? *balls : Constellation{};
}

void refuse_size(const ConfigNode& node) {
  if (const auto size = node.find("size_mm"))
    size->problem(
        "expected no side of a marker beside a constellation, whose file states all sizes. Remove it.");
}

MeshFile read_mesh_file(const ConfigNode& node) {
  const ConfigNode mesh = node.at("mesh");
  MeshFile file{mesh.where(), mesh.path_inside(), {}};
  if (node.find("units") || !states_unit(file.path)) file.units = k_length_units.read(node.at("units"));
  return file;
}

// A part's mesh or volume.
MeshFile read_part_file(const ConfigNode& node) {
  constexpr double k_largest_scale = 1e6;  // a cell as large as a person
  const auto volume = node.find("volume");
  if (volume && node.find("mesh")) volume->problem("expected either \"mesh\" or \"volume\", found both.");
  for (const char* key : {"units", "scale", "window"})
    if (const auto other = node.find(key); other && (key == std::string("units")) == volume.has_value())
      other->problem(volume ? "expected no unit beside a volume, whose file states it. Remove it."
                            : "expected it beside \"volume\" only. Remove it.");
  if (!volume) return read_mesh_file(node);
  MeshFile file{volume->where(), volume->path_inside(), {}, true};
  if (const auto scale = node.find("scale")) file.scale = scale->positive(k_largest_scale);
  if (const auto window = node.find("window")) file.window = read_grey_window(*window);
  return file;
}

double read_size_m(const ConfigNode& node) { return node.at("size_mm").positive(k_largest_marker_mm) * 1e-3; }

void read_albedo(const ConfigNode& node, Prototype* prototype, Reader* reader) {
  if (node.is_string()) {
    reader->files->albedo_image = node.path_inside();
    return;
  }
  prototype->albedo = node.number();
  if (prototype->albedo < 0 || prototype->albedo > 1) {
    node.problem(
        fmt::format("expected a share of light from 0 to 1, or a PNG, found {}.", prototype->albedo));
  }
}

void read_marker_file(const ConfigNode& node, Prototype* prototype, Reader* reader) {
  auto markers = load_marker_file(node.path_inside());
  if (!markers) return node.problem(markers.message());
  for (const BodyMarker& marker : *markers) claim(marker.marker, node, reader);
  prototype->markers = std::move(*markers);
}

void read_prototype_marker(const ConfigNode& node, Prototype* prototype, Reader* reader) {
  node.only({"name", "size_mm", "prototype_from_marker"});
  const MarkerName name = read_carrier(node.at("name"), reader);
  const Pose prototype_from_marker = node.at("prototype_from_marker").pose();
  if (const auto balls = read_constellation(name, node.at("name"))) {
    refuse_size(node);
    prototype->constellation = placed(*balls, "prototype", prototype_from_marker);
  } else {
    prototype->markers.push_back({name, read_size_m(node), prototype_from_marker});
  }
}

Prototype read_prototype(const ConfigNode& node, Reader* reader) {
  node.only({"mesh", "units", "markers", "albedo"});
  Prototype prototype;
  reader->files->prototype_mesh = read_mesh_file(node);
  const auto markers = node.find("markers");
  if (markers && markers->is_string()) {
    read_marker_file(*markers, &prototype, reader);
  } else if (markers) {
    for (const ConfigNode& item : markers->items()) read_prototype_marker(item, &prototype, reader);
    if (prototype.constellation && markers->items().size() > 1)
      markers->problem(
          "expected either square markers or one constellation on the prototype, found more beside a "
          "constellation. Learn all balls as one constellation, and remove the others.");
  }
  if (const auto albedo = node.find("albedo")) read_albedo(*albedo, &prototype, reader);
  return prototype;
}

void read_variants(const ConfigNode& node, Slot* slot, Reader* reader) {
  std::set<std::string> names;
  for (const ConfigNode& item : node.items()) {
    item.only({"name", "mesh", "units", "volume", "scale", "window"});
    Variant variant{item.at("name").text(), {}};
    if (!names.insert(variant.name).second) {
      item.at("name").problem(fmt::format("expected a unique name, found '{}' twice.", variant.name));
    }
    reader->files->part_meshes.push_back(read_part_file(item));
    slot->variants.push_back(std::move(variant));
  }
  if (slot->variants.empty()) node.problem("expected at least one variant, found none.");
}

Slot read_slot(const ConfigNode& node, Reader* reader) {
  node.only({"name", "marker", "size_mm", "marker_from_part", "mode", "stick_to_surface", "variants"});
  Slot slot;
  slot.name = node.at("name").text();
  if (slot.name == "prototype" || slot.name.empty() || slot.name.find_first_of("/\\") != std::string::npos) {
    node.at("name").problem(fmt::format(
        "expected a name without slashes other than 'prototype' (files are named after it), found '{}'.",
        slot.name));
  }
  slot.marker = read_carrier(node.at("marker"), reader);
  slot.constellation = read_constellation(slot.marker, node.at("marker"));
  if (slot.constellation)
    refuse_size(node);
  else
    slot.size_m = read_size_m(node);
  slot.marker_from_part = node.at("marker_from_part").pose();
  if (const auto mode = node.find("mode")) {
    slot.mode = mode->choice({"view", "surface"}) == "surface" ? Mode::surface : Mode::view;
  }
  if (const auto stick = node.find("stick_to_surface")) slot.stick_to_surface = stick->boolean();
  read_variants(node.at("variants"), &slot, reader);
  return slot;
}

std::vector<Slot> read_slots(const ConfigNode& node, Reader* reader) {
  std::vector<Slot> slots;
  std::set<std::string> names;
  for (const ConfigNode& item : node.items()) {
    slots.push_back(read_slot(item, reader));
    if (!names.insert(slots.back().name).second) {
      item.at("name").problem(fmt::format("expected a unique name, found '{}' twice.", slots.back().name));
    }
  }
  return slots;
}

ActionId read_action(const ConfigNode& node) {
  const std::string name = node.text();
  if (const Action* action = find_action(name)) return action->id;
  node.problem(fmt::format("expected an action ({}), found '{}'.", action_names(), name));
  return {};
}

Control read_control(const ConfigNode& node, const Scene& scene) {
  node.only({"marker", "action", "slot", "gesture"});
  Control control;
  control.marker = read_marker_name(node.at("marker"));
  if (is_constellation(control.marker))
    node.at("marker").problem("expected a square marker for a control, found a constellation.");
  control.action = read_action(node.at("action"));
  if (const auto gesture = node.find("gesture")) control.gesture = k_gestures.read(*gesture);
  if (const auto slot = node.find("slot")) {
    control.slot = slot->text();
    const bool is_line = control.action == ActionId::line;
    if (is_line ? find_named(scene.lines, control.slot) == nullptr : !scene.find_slot(control.slot))
      slot->problem(
          fmt::format("expected the name of a {}, found '{}'.", is_line ? "line" : "slot", control.slot));
  }
  return control;
}

std::vector<Finish> read_finishes(const ConfigNode& node, const Scene& scene) {
  std::vector<Finish> finishes;
  for (const ConfigNode& item : node.items()) {
    Finish finish = read_finish(item);
    if (find_named(finishes, finish.name))
      item.at("name").problem(fmt::format("expected a unique name, found '{}' twice.", finish.name));
    finishes.push_back(std::move(finish));
  }
  if (!scene.prototype) node.problem("expected a prototype to paint, found a scene without.");
  return finishes;
}

// The marker of a section or pen: a square one that nothing else uses.
MarkerName read_own_marker(const ConfigNode& node, const char* what, const Scene& scene, Reader* reader) {
  const MarkerName marker = read_carrier(node, reader);
  if (is_constellation(marker))
    node.problem(fmt::format("expected a square marker for the {}, found a constellation.", what));
  const auto refuse = [&](const char* user) {
    node.problem(fmt::format("expected a marker that nothing else uses, found {}, which a {} uses.",
                             marker.text(), user));
  };
  if (std::ranges::find(scene.controls, marker, &Control::marker) != scene.controls.end()) refuse("control");
  if (std::ranges::find(scene.viewers, std::optional(marker), &Viewer::marker) != scene.viewers.end())
    refuse("viewer");
  return marker;
}

// The section, and the control that its marker is.
void read_section_of(const ConfigNode& node, Reader* reader, Scene* scene) {
  Section section = read_section(node);
  section.marker = read_own_marker(node.at("marker"), "section", *scene, reader);
  std::vector<std::string> names;
  for (const Slot& slot : scene->slots) names.push_back(slot.name);
  section.slots = names;
  if (const auto slots = node.find("slots")) {
    section.slots.clear();
    for (const ConfigNode& item : slots->items()) {
      section.slots.push_back(item.text());
      if (!scene->find_slot(section.slots.back()))
        item.problem(fmt::format("expected a slot of the scene ({}), found '{}'.", joined_names(scene->slots),
                                 section.slots.back()));
    }
  }
  scene->controls.push_back(
      {section.marker, ActionId::section, "", Gesture::cover, k_section_changes.text(SectionChange::cover)});
  scene->section = std::move(section);
}

Pen read_pen_of(const ConfigNode& node, const Scene& scene, Reader* reader) {
  Pen pen = read_pen(node);
  pen.marker = read_own_marker(node.at("marker"), "pen", scene, reader);
  if (!scene.prototype) node.problem("expected a prototype to draw on, found a scene without.");
  return pen;
}

bool line_of_slot_exists(const Line& line, const Scene& scene) {
  return line.outline_of.empty() || scene.find_slot(line.outline_of) != nullptr;
}

std::vector<Line> read_lines(const ConfigNode& node, const Scene& scene) {
  std::vector<Line> lines;
  for (const ConfigNode& item : node.items()) {
    Line line = read_line(item);
    if (find_named(lines, line.name))
      item.at("name").problem(fmt::format("expected a unique name, found '{}' twice.", line.name));
    lines.push_back(std::move(line));
    if (lines.size() > k_most_lines)
      node.problem(fmt::format("expected at most {} lines, found more.", k_most_lines));
    if (lines.size() > k_most_lines) break;
    if (!line_of_slot_exists(lines.back(), scene))
      item.at("outline").at("slot").problem(
          fmt::format("expected the name of a slot, found '{}'.", lines.back().outline_of));
  }
  if (!scene.prototype) node.problem("expected a prototype for the lines, found a scene without.");
  return lines;
}

// A guest's name, or true for every guest.
std::string read_tablet(const ConfigNode& node) {
  if (!node.is_string()) {
    if (!node.boolean()) node.problem("expected true or a guest's name, found false.");
    return "";
  }
  if (node.text().empty()) node.problem("expected true or a guest's name, found an empty text.");
  return node.text();
}

Viewer read_viewer(const ConfigNode& node, const Scene& scene) {
  node.only({"fixed", "marker", "tracked", "tablet", "size_mm", "eye_mm", "weight"});
  Viewer viewer;
  if (const auto weight = node.find("weight")) viewer.weight = weight->positive();
  if (const auto fixed = node.find("fixed")) viewer.fixed = read_viewer_imager(*fixed);
  if (const auto marker = node.find("marker")) {
    viewer.marker = read_marker_name(*marker);
    viewer.constellation = read_constellation(*viewer.marker, *marker);
    if (viewer.constellation) refuse_size(node);
  }
  if (const auto tablet = node.find("tablet")) viewer.tablet = read_tablet(*tablet);
  if (const auto tracked = node.find("tracked")) {
    viewer.is_tracked = tracked->boolean();
    if (!viewer.is_tracked) tracked->problem("expected true, or no such key, found false.");
  }
  const int kinds =
      viewer.fixed.has_value() + viewer.marker.has_value() + viewer.is_tracked + viewer.tablet.has_value();
  if (kinds != 1) {
    constexpr std::array<const char*, 5> k_found = {"none", "one", "two", "three", "all"};
    node.problem(fmt::format("expected one of \"fixed\", \"marker\", \"tracked\" and \"tablet\", found {}.",
                             k_found[static_cast<std::size_t>(kinds)]));
  }
  if (const auto size = viewer.constellation ? std::nullopt : node.find("size_mm"))
    viewer.marker_size_m = 1e-3 * size->positive(k_largest_marker_mm);
  else if (!viewer.constellation)
    viewer.marker_size_m = first_marker_size_m(scene);
  if (const auto eye = node.find("eye_mm")) viewer.p_eye_marker = 1e-3 * eye->vector3();
  return viewer;
}

// Reads one viewer or a list of viewers.
std::vector<Viewer> read_viewers(const ConfigNode& node, const Scene& scene) {
  if (!node.is_array()) return {read_viewer(node, scene)};
  std::vector<Viewer> viewers;
  std::set<MarkerName> markers;
  std::set<std::string> tablets;
  for (const ConfigNode& item : node.items()) {
    viewers.push_back(read_viewer(item, scene));
    const auto& marker = viewers.back().marker;
    if (marker && !markers.insert(*marker).second)
      item.at("marker").problem(
          fmt::format("expected a marker that no other viewer uses, found {} twice.", marker->text()));
    const auto& tablet = viewers.back().tablet;
    if (tablet && !tablets.insert(*tablet).second)
      item.at("tablet").problem("expected each guest once, found the same guest twice.");
  }
  return viewers;
}

}  // namespace

Imager read_viewer_imager(const ConfigNode& node) {
  node.only({"schema", "world_from_viewer", "size", "fov_deg"});
  const Pose world_from_viewer = node.at("world_from_viewer").pose();
  const auto [width, height] = node.at("size").image_size();
  double fov_deg = node.at("fov_deg").positive();
  if (fov_deg >= 180) {
    node.at("fov_deg").problem(fmt::format("expected less than 180 degrees, found {}.", fov_deg));
    fov_deg = 60;
  }
  if (!(fov_deg > 0)) fov_deg = 60;  // the problem is already recorded
  return viewer_imager(world_from_viewer, width, height, fov_deg);
}

Scene read_scene(const ConfigNode& root, SceneFiles* files) {
  root.only(
      {"schema", "prototype", "slots", "controls", "viewer", "light", "finishes", "section", "lines", "pen"});
  Scene scene;
  Reader reader{files, {}};
  if (const auto node = root.find("prototype")) scene.prototype = read_prototype(*node, &reader);
  scene.slots = read_slots(root.at("slots"), &reader);
  if (const auto node = root.find("lines")) scene.lines = read_lines(*node, scene);
  if (const auto controls = root.find("controls")) {
    for (const ConfigNode& item : controls->items()) scene.controls.push_back(read_control(item, scene));
  }
  if (const auto node = root.find("viewer")) scene.viewers = read_viewers(*node, scene);
  if (const auto node = root.find("light")) {
    scene.light = read_room_light(*node, true);
    if (const auto image = node->find("image"))
      scene.room_image = read_room_image(*image, scene.light->d_up_world);
  }
  if (const auto node = root.find("finishes")) scene.finishes = read_finishes(*node, scene);
  if (const auto node = root.find("pen")) scene.pen = read_pen_of(*node, scene, &reader);
  if (const auto node = root.find("section")) read_section_of(*node, &reader, &scene);
  return scene;
}

}  // namespace limn::scene
