#include "scene/scene.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <set>
#include <span>

#include "core/config.h"
#include "core/image_io.h"
#include "core/json_text.h"
#include "core/log.h"
#include "core/names.h"
#include "core/utf8.h"
#include "scene/actions.h"
#include "scene/marker_file.h"
#include "scene/meshes/mesh_content.h"
#include "scene/meshes/mesh_loading.h"
#include "scene/scene_loading.h"
#include "scene/slot_folder.h"
#include "scene/volume_part.h"
#include "scene/volumes/volume_name.h"

namespace limn::scene {
namespace {

namespace fs = std::filesystem;

// A file that the scene names. It is read only after the whole scene.json was found valid.
struct MeshFile {
  std::string where;
  fs::path path;
  std::optional<LengthUnit> units;  // absent: the file's own
  // A volume instead of a mesh, its size as a multiple of the file's, and its window.
  bool is_volume = false;
  double scale = 1;
  std::optional<GreyWindow> window = {};
};

struct Reader {
  std::vector<MeshFile> part_meshes;  // in the order of slots and variants
  std::optional<MeshFile> prototype_mesh;
  std::optional<fs::path> albedo_image;
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
    reader->albedo_image = node.path_inside();
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
  reader->prototype_mesh = read_mesh_file(node);
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
    reader->part_meshes.push_back(read_part_file(item));
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

// The section, and the control that its marker is.
void read_section_of(const ConfigNode& node, Reader* reader, Scene* scene) {
  Section section = read_section(node);
  const ConfigNode marker = node.at("marker");
  section.marker = read_carrier(marker, reader);
  if (is_constellation(section.marker))
    marker.problem("expected a square marker for the section, found a constellation.");
  for (const Control& control : scene->controls)
    if (control.marker == section.marker)
      marker.problem(fmt::format("expected a marker that nothing else uses, found {}, which a control uses.",
                                 section.marker.text()));
  for (const Viewer& viewer : scene->viewers)
    if (viewer.marker == section.marker)
      marker.problem(fmt::format("expected a marker that nothing else uses, found {}, which a viewer uses.",
                                 section.marker.text()));
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

// An object much too small or large for a prototype was most likely drawn in another unit.
Status check_size(const Mesh& mesh, std::optional<LengthUnit> given) {
  constexpr double k_smallest_m = 1e-3, k_largest_m = 20;
  constexpr double k_likely_from_m = 0.02, k_likely_to_m = 6;
  Eigen::AlignedBox3f box;
  for (const Eigen::Vector3f& p : mesh.positions) box.extend(p);
  const double size_m = box.diagonal().cast<double>().norm();
  if (size_m >= k_smallest_m && size_m <= k_largest_m) return {};
  const LengthUnit units = given.value_or(LengthUnit::metre);
  const double in_file = size_m / metres_per_unit(units);
  std::vector<std::string> likely;
  for (const LengthUnit unit : {LengthUnit::millimetre, LengthUnit::centimetre, LengthUnit::metre,
                                LengthUnit::inch, LengthUnit::foot}) {
    const double as_m = in_file * metres_per_unit(unit);
    if (as_m >= k_likely_from_m && as_m <= k_likely_to_m)
      likely.push_back(fmt::format("{} ({:.3g} m)", to_text(unit), as_m));
  }
  return error(
      "expected an object of 1 mm to 20 m, found {:.3g} m across in {}. {}", size_m,
      given ? "units \"" + to_text(units) + "\"" : "the unit that the file states",
      likely.empty() ? "Check the mesh's size and unit." : "Is its unit " + joined_names(likely) + "?");
}

// A variant that shows a volume.
Result<Variant> load_volume_variant(const std::string& name, const MeshFile& file) {
  LIMN_TRY(Volume volume, load_volume(file.path));
  Variant variant{name, {}};
  variant.volume = std::make_shared<const Volume>(scaled(std::move(volume), file.scale));
  variant.mesh = volume_box(*variant.volume);
  variant.window = file.window;
  return variant;
}

const Mesh& mesh_of(const Mesh& mesh) { return mesh; }
const Mesh& mesh_of(const Variant& variant) { return variant.mesh; }
const Mesh& mesh_of(const MeshWithVariants& meshes) { return meshes.mesh; }

// What was loaded from a file that the scene names (Mesh, MeshWithVariants or Variant), if it has the size of
// an object.
template <class Loaded>
Result<Loaded> checked(Result<Loaded> loaded, const MeshFile& file, const fs::path& scene_path) {
  if (!loaded) return error("{}: {}: {}", scene_path.string(), file.where, loaded.message());
  if (const Status size = check_size(mesh_of(*loaded), file.units); !size)
    return error("{}: {} ({}): {}", scene_path.string(), file.where, file.path.filename().string(),
                 size.message());
  return loaded;
}

// The name of a material variant of a file in its slot. Names are also written into file names, so that
// slashes and control characters are replaced.
std::string variant_name(const std::string& file_variant, const std::string& material_variant) {
  std::string name = file_variant + " " + material_variant;
  for (char& c : name)
    if (c == '/' || c == '\\' || static_cast<unsigned char>(c) < ' ') c = '-';
  return name;
}

Status load_albedo_image(const fs::path& path, const fs::path& scene_path, Prototype* prototype) {
  auto image = read_image(path, {.alpha = Alpha::ignored});
  if (!image) return error("{}: prototype.albedo: {}", scene_path.string(), image.message());
  prototype->albedo_image = std::move(image).value();
  if (prototype->albedo_image.channels() == 1) {
    const cv::Mat grey = prototype->albedo_image;
    cv::merge(std::vector<cv::Mat>{grey, grey, grey}, prototype->albedo_image);
  }
  if (prototype->mesh.uvs.empty()) {
    return error(
        "{}: prototype.albedo: expected a mesh with texture coordinates for the image, found one without. "
        "Give a number instead, or export the mesh with uv.",
        scene_path.string());
  }
  return {};
}

double longest_side(const Mesh& mesh) {
  Eigen::AlignedBox3f box;
  for (const Eigen::Vector3f& p : mesh.positions) box.extend(p);
  return static_cast<double>(box.sizes().maxCoeff());
}

// A guess of a mesh's unit: the first one that gives a part's usual size.
LengthUnit guessed_units(const Mesh& as_metres) {
  constexpr double k_least_m = 0.01, k_most_m = 3;
  for (const LengthUnit units :
       {LengthUnit::millimetre, LengthUnit::centimetre, LengthUnit::metre, LengthUnit::inch}) {
    const double size = longest_side(as_metres) * metres_per_unit(units);
    if (size >= k_least_m && size <= k_most_m) return units;
  }
  return LengthUnit::metre;
}

// A mesh whose coordinates were taken as metres, in its guessed unit.
Mesh scaled(Mesh mesh, LengthUnit units) {
  for (Eigen::Vector3f& p : mesh.positions) p *= static_cast<float>(metres_per_unit(units));
  return mesh;
}

// The units that people have given, by variant.
Result<std::map<std::string, LengthUnit>> load_units(const fs::path& file) {
  std::map<std::string, LengthUnit> units;
  std::error_code none;
  if (!fs::exists(file, none)) return units;
  LIMN_TRY(const Config config, Config::load(file, "limn.units/1"));
  config.root().only({"schema", "units"});
  const ConfigNode node = config.root().at("units");
  for (const std::string& name : node.keys()) units[name] = k_length_units.read(node.at(name));
  LIMN_TRY_STATUS(config.status());
  return units;
}

// A file's variants of a slot: that of its default materials, and those of its material variants.
struct FileVariants {
  Variant first;
  std::vector<MeshWithVariants::Variant> more;
};

// Imports a mesh from a slot's folder; `known_units` has the units that people have given, by variant.
Result<FileVariants> auto_import_mesh(const fs::path& file,
                                      const Slot& slot,
                                      std::span<const Variant> variants,
                                      const std::map<std::string, LengthUnit>& known_units,
                                      const std::stop_token& stop) {
  const std::string name = is_volume(file) ? volume_stem(file) : file.stem().string();
  if (!is_utf8(name))
    return error("{}: expected a file name in UTF-8, found other bytes. Rename the file.",
                 as_utf8(file.string()));
  if (find_named(slot.variants, name) || find_named(variants, name))
    return error(
        "{}: expected a file name that no other variant of slot '{}' has, found '{}' twice. Rename the file.",
        file.string(), slot.name, name);
  if (is_volume(file)) {
    LIMN_TRY(Variant volume, load_volume_variant(name, {"", file, {}, true}));
    if (const Status size = check_size(volume.mesh, {}); !size)
      return error("{}: {}", file.string(), size.message());
    return FileVariants{std::move(volume), {}};
  }
  const auto known = known_units.find(name);
  Variant::AutoImported import{std::nullopt, false};
  if (known != known_units.end()) import.units = known->second;
  import.is_guess = !import.units && !states_unit(file);
  LIMN_TRY(MeshWithVariants meshes,
           load_mesh_with_variants(file, import.is_guess ? LengthUnit::metre : import.units, stop));
  Mesh mesh = std::move(meshes.mesh);
  if (import.is_guess) import.units = guessed_units(mesh);
  if (import.is_guess) mesh = scaled(std::move(mesh), *import.units);
  if (const Status size = check_size(mesh, import.units); !size)
    return error("{}: {}", file.string(), size.message());
  Variant variant{name, std::move(mesh), import};
  if (import.is_guess) log_info("{}", units_question(slot, variant));
  return FileVariants{std::move(variant), std::move(meshes.variants)};
}

// What is left out of a scene: variants that cannot be loaded, and files that are none.
struct LeftOut {
  std::vector<SkippedVariant> variants, others;
};

// Adds a file's material variants to a slot's variants. One whose name is taken is left out.
void add_material_variants(const Slot& slot,
                           const fs::path& file,
                           const std::string& file_variant,
                           std::vector<MeshWithVariants::Variant> more,
                           std::vector<Variant>* variants,
                           LeftOut* left_out) {
  for (MeshWithVariants::Variant& variant : more) {
    const std::string name = variant_name(file_variant, variant.name);
    if (find_named(slot.variants, name) || find_named(*variants, name))
      left_out->others.push_back(
          {slot.name, name,
           fmt::format("{}: expected a name for its material variant '{}' that no other variant of slot '{}' "
                       "has, found '{}' twice. Rename one of them.",
                       as_utf8(file.string()), variant.name, slot.name, name)});
    else
      variants->push_back({name, std::move(variant.mesh), {}, file_variant});
  }
}

// Loads the variants that scene.json lists, and the meshes in slots/NAME/.
Status load_variants(std::span<const MeshFile> listed,
                     const fs::path& path,
                     const fs::path& scene_folder,
                     const std::stop_token& stop,
                     Slot* slot,
                     LeftOut* left_out) {
  std::vector<Variant> variants;
  for (std::size_t i = 0; i < listed.size(); ++i) {
    const std::string& name = slot->variants[i].name;
    if (listed[i].is_volume) {
      auto volume = checked(load_volume_variant(name, listed[i]), listed[i], path);
      if (volume)
        variants.push_back(std::move(*volume));
      else
        left_out->variants.push_back({slot->name, name, volume.message(), i == 0});
      continue;
    }
    auto meshes = checked(load_mesh_with_variants(listed[i].path, listed[i].units, stop), listed[i], path);
    if (!meshes) {
      left_out->variants.push_back({slot->name, name, meshes.message(), i == 0});
      continue;
    }
    variants.push_back({name, std::move(meshes->mesh)});
    add_material_variants(*slot, listed[i].path, name, std::move(meshes->variants), &variants, left_out);
  }
  const fs::path folder = scene_folder / "slots" / slot->name;
  LIMN_TRY(const auto known_units, load_units(folder / "units.json"));
  const SlotFolder files = list_slot_folder(folder);
  for (const fs::path& file : files.meshes) {
    auto found = auto_import_mesh(file, *slot, variants, known_units, stop);
    if (!found) {
      left_out->variants.push_back(
          {slot->name, as_utf8(is_volume(file) ? volume_stem(file) : file.stem().string()), found.message()});
      continue;
    }
    const std::string name = found->first.name;
    variants.push_back(std::move(found->first));
    add_material_variants(*slot, file, name, std::move(found->more), &variants, left_out);
  }
  for (const SlotFolder::Other& other : files.others)
    left_out->others.push_back({slot->name, as_utf8(other.path.filename().string()),
                                as_utf8(other.path.string()) + ": " + other.why});
  slot->variants = std::move(variants);
  return {};
}

// What lies in slots/ itself, and folders there that no slot is named after.
void find_strays(const Scene& scene, LeftOut* left_out) {
  const fs::path slots = scene.folder / "slots";
  const std::string names = joined_names(scene.slots);
  for (const fs::path& mesh : list_slot_folder(slots).meshes) {
    if (std::error_code none; fs::is_directory(mesh, none)) continue;  // a slot's folder with slices in it
    left_out->others.push_back(
        {"(none)", as_utf8(mesh.filename().string()),
         fmt::format("{}: expected meshes in a slot's folder ({}), found one beside them. Move it there.",
                     as_utf8(mesh.string()), names)});
  }
  for (const SlotFolder::Other& other : list_slot_folder(slots).others)
    if (std::error_code none;
        fs::is_directory(other.path, none) && !scene.find_slot(other.path.filename().string()))
      left_out->others.push_back(
          {"(none)", as_utf8(other.path.filename().string()),
           fmt::format("{}: expected a folder named after a slot ({}), found another name. Rename it.",
                       as_utf8(other.path.string()), names)});
}

Status load_files(const Reader& reader,
                  const fs::path& path,
                  const std::stop_token& stop,
                  Scene* scene,
                  LeftOut* left_out) {
  if (scene->prototype) {
    const MeshFile& file = *reader.prototype_mesh;
    LIMN_TRY(scene->prototype->mesh, checked(load_mesh(file.path, file.units, stop), file, path));
    for (Material& material : scene->prototype->mesh.materials)
      material.cut_below = 0;  // the physical prototype has no transparent parts
    if (reader.albedo_image) {
      LIMN_TRY_STATUS(load_albedo_image(*reader.albedo_image, path, &*scene->prototype));
    }
    for (Finish& finish : scene->finishes)
      if (const Status image = load_finish_image(!scene->prototype->mesh.uvs.empty(), &finish); !image)
        return error("{}: finishes: {}", path.string(), image.message());
    scene->drape = std::make_shared<const Drape>(scene->prototype->mesh);
    scene->outlines = std::make_shared<const Outlines>(scene->drape);
    if (const Status laid = lay_lines(*scene->drape, &scene->lines); !laid)
      return error("{}: lines: {}", path.string(), laid.message());
  }
  if (scene->room_image)
    if (const Status image = load_room_image(&*scene->room_image); !image)
      return error("{}: light.image: {}", path.string(), image.message());
  std::span<const MeshFile> listed = reader.part_meshes;
  for (Slot& slot : scene->slots) {
    const auto own = listed.first(slot.variants.size());
    listed = listed.subspan(own.size());
    LIMN_TRY_STATUS(load_variants(own, path, scene->folder, stop, &slot, left_out));
  }
  find_strays(*scene, left_out);
  return {};
}

}  // namespace

const Viewer* Scene::find_tablet(const std::string& guest) const {
  const Viewer* of_all = nullptr;
  for (const Viewer& viewer : viewers) {
    if (viewer.tablet == guest) return &viewer;
    if (viewer.tablet == "") of_all = &viewer;
  }
  return of_all;
}

const Slot* Scene::find_slot(const std::string& name) const { return find_named(slots, name); }

std::vector<std::string> finish_names(const Scene& scene) {
  std::vector<std::string> names;
  for (const Finish& finish : scene.finishes) names.push_back(finish.name);
  return names;
}

std::vector<std::string> first_lines(const Scene& scene) {
  std::vector<std::string> names;
  for (const Line& line : scene.lines)
    if (line.is_shown) names.push_back(line.name);
  return names;
}

std::string to_text(const SkippedVariant& skipped) {
  return fmt::format("{} of slot {} is left out: {}", skipped.variant, skipped.slot, skipped.why);
}

void leave_out_empty_slots(Scene* scene) {
  std::erase_if(scene->controls, [&](const Control& control) {
    const Slot* slot = scene->find_slot(control.slot);
    return slot && slot->variants.empty();
  });
  std::erase_if(scene->slots, [](const Slot& slot) { return slot.variants.empty(); });
  if (scene->section)
    std::erase_if(scene->section->slots,
                  [&](const std::string& name) { return scene->find_slot(name) == nullptr; });
}

Result<Scene> load_scene(const fs::path& path,
                         std::vector<SkippedVariant>* skipped_variants,
                         EmptySlots empty_slots) {
  return load_scene(path, skipped_variants, empty_slots, std::stop_token());
}

Result<Scene> load_scene(const fs::path& path,
                         std::vector<SkippedVariant>* skipped_variants,
                         EmptySlots empty_slots,
                         const std::stop_token& stop) {
  std::error_code code;
  const fs::path file = fs::is_directory(path, code) ? path / "scene.json" : path;
  LIMN_TRY(const Config config, Config::load(file, "limn.scene/1"));
  const ConfigNode root = config.root();
  root.only({"schema", "prototype", "slots", "controls", "viewer", "light", "finishes", "section", "lines"});
  Scene scene;
  Reader reader;
  scene.folder = config.folder();
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
  if (const auto node = root.find("section")) read_section_of(*node, &reader, &scene);
  LIMN_TRY_STATUS(config.status());
  if (const Status distinct = check_distinct(constellations(scene)); !distinct)
    return error("{}: {}", file.string(), distinct.message());
  LeftOut left_out;
  LIMN_TRY_STATUS(load_files(reader, file, stop, &scene, &left_out));
  if (!skipped_variants && !left_out.variants.empty()) return error("{}", left_out.variants[0].why);
  if (empty_slots == EmptySlots::left_out) leave_out_empty_slots(&scene);
  for (const auto& list : {left_out.variants, left_out.others})
    for (const SkippedVariant& skipped : list)
      skipped_variants ? skipped_variants->push_back(skipped) : log_warning("{}", to_text(skipped));
  return scene;
}

Result<Scene> load_usable_scene(const fs::path& path) {
  std::vector<SkippedVariant> skipped_variants;
  LIMN_TRY(Scene scene, load_scene(path, &skipped_variants));
  for (const SkippedVariant& skipped : skipped_variants) log_warning("{}", to_text(skipped));
  return scene;
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

Result<Imager> load_viewer(const fs::path& path) {
  LIMN_TRY(const Config config, Config::load(path, ""));
  Imager viewer = read_viewer_imager(config.root());
  LIMN_TRY_STATUS(config.status());
  return viewer;
}

std::vector<Body> bodies(const Scene& scene) {
  std::vector<Body> out;
  if (scene.prototype && !scene.prototype->markers.empty())
    out.push_back({"prototype", scene.prototype->markers});
  for (const Slot& slot : scene.slots)
    if (!slot.constellation) out.push_back({slot.name, {{slot.marker, slot.size_m, Pose()}}});
  for (std::size_t i = 0; i < scene.viewers.size(); ++i) {
    const Viewer& viewer = scene.viewers[i];
    if (viewer.marker && !viewer.constellation)
      out.push_back({viewer_body(i), {{*viewer.marker, viewer.marker_size_m, Pose()}}});
  }
  if (const auto& section = scene.section)
    out.push_back({section_body(), {{section->marker, section->size_m, Pose()}}});
  return out;
}

std::vector<Constellation> constellations(const Scene& scene) {
  std::vector<Constellation> out;
  if (scene.prototype && scene.prototype->constellation) out.push_back(*scene.prototype->constellation);
  for (const Slot& slot : scene.slots)
    if (slot.constellation) out.push_back(placed(*slot.constellation, slot.name, Pose()));
  for (std::size_t i = 0; i < scene.viewers.size(); ++i)
    if (const auto& balls = scene.viewers[i].constellation)
      out.push_back(placed(*balls, viewer_body(i), Pose()));
  return out;
}

std::vector<std::string> body_names(const Scene& scene) {
  std::vector<std::string> out;
  for (const Body& body : bodies(scene)) out.push_back(body.name);
  for (const Constellation& balls : constellations(scene)) out.push_back(balls.name);
  return out;
}

double first_marker_size_m(const Scene& scene) {
  const auto square = std::ranges::find_if(scene.slots, [](const Slot& slot) { return !slot.constellation; });
  return square == scene.slots.end() ? 0 : square->size_m;
}

std::string viewer_body(std::size_t viewer) { return fmt::format("(viewer {})", viewer); }

const std::string& section_body() {
  static const std::string name = "(section)";
  return name;
}

std::string loose_body(const MarkerName& marker) { return "(marker " + marker.text() + ")"; }

bool is_loose_body(const std::string& body) { return body.rfind("(marker ", 0) == 0; }

}  // namespace limn::scene
