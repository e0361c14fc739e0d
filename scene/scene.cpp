#include "scene/scene.h"

#include <algorithm>
#include <opencv2/core.hpp>
#include <span>

#include "core/config.h"
#include "core/image_io.h"
#include "core/log.h"
#include "core/names.h"
#include "scene/actions.h"
#include "scene/scene_loading.h"
#include "scene/scene_reading.h"
#include "scene/variant_loading.h"

namespace limn::scene {
namespace {

namespace fs = std::filesystem;

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

Status load_files(
    const SceneFiles& files, const fs::path& path, const CadWait& wait, Scene* scene, LeftOut* left_out) {
  if (scene->prototype) {
    const MeshFile& file = *files.prototype_mesh;
    LIMN_TRY(scene->prototype->mesh, load_listed_mesh(file, path, wait));
    for (Material& material : scene->prototype->mesh.materials)
      material.cut_below = 0;  // the physical prototype has no transparent parts
    if (files.albedo_image) {
      LIMN_TRY_STATUS(load_albedo_image(*files.albedo_image, path, &*scene->prototype));
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
  std::span<const MeshFile> listed = files.part_meshes;
  for (Slot& slot : scene->slots) {
    const auto own = listed.first(slot.variants.size());
    listed = listed.subspan(own.size());
    LIMN_TRY_STATUS(load_variants(own, path, scene->folder, wait, &slot, left_out));
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
  return load_scene(path, skipped_variants, empty_slots, CadWait());
}

Result<Scene> load_scene(const fs::path& path,
                         std::vector<SkippedVariant>* skipped_variants,
                         EmptySlots empty_slots,
                         const CadWait& wait) {
  std::error_code code;
  const fs::path file = fs::is_directory(path, code) ? path / "scene.json" : path;
  LIMN_TRY(const Config config, Config::load(file, "limn.scene/1"));
  SceneFiles files;
  Scene scene = read_scene(config.root(), &files);
  scene.folder = config.folder();
  LIMN_TRY_STATUS(config.status());
  if (const Status distinct = check_distinct(constellations(scene)); !distinct)
    return error("{}: {}", file.string(), distinct.message());
  LeftOut left_out;
  LIMN_TRY_STATUS(load_files(files, file, wait, &scene, &left_out));
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
  if (const auto& pen = scene.pen) out.push_back({pen_body(), {{pen->marker, pen->size_m, Pose()}}});
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

const std::string& pen_body() {
  static const std::string name = "(pen)";
  return name;
}

std::string loose_body(const MarkerName& marker) { return "(marker " + marker.text() + ")"; }

bool is_loose_body(const std::string& body) { return body.rfind("(marker ", 0) == 0; }

}  // namespace limn::scene
