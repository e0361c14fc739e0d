#include "validate/demo_clay.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "calib/surface/surface_samples.h"
#include "core/data_folder.h"
#include "core/image_writer.h"
#include "core/scale_resolution.h"
#include "scene/lines/drape.h"
#include "scene/meshes/scan_surface.h"
#include "session/deviation/prototype_comparison.h"
#include "sim/virtual_rig.h"
#include "wizard/capture/capture_plan.h"
#include "wizard/capture/virtual_backend.h"

namespace limn::validate {
namespace {

using Eigen::Vector3d;

// ---- Lines

// The place of the door's outer side at (x, y), in its frame (x right, y up, z towards the viewer).
Vector3d on_door(const scene::Drape& door, double x, double y) {
  const auto place = door.hit({x, y, 1}, -Vector3d::UnitZ(), 2);
  return place ? place->p : Vector3d(x, y, 0);
}

scene::Line named_line(const char* name, const Vector3d& colour, double width_m) {
  scene::Line line;
  line.name = name;
  line.style = {colour, width_m};
  return line;
}

Result<std::vector<scene::Line>> lines_on(const scene::Drape& door) {
  constexpr double k_every_m = 0.05, k_text_m = 0.022, k_number_m = 0.018;
  const Vector3d white(1, 1, 1), green(0.1, 1, 0.45), amber(1, 0.5, 0.05);
  std::vector<scene::Line> lines = {named_line("every 50 mm", white, 1.1e-3),
                                    named_line("name", amber, 1.8e-3), named_line("distance", green, 1.5e-3)};
  lines[0].repeated =
      scene::RepeatedLines{.spacing_m = k_every_m, .prototype_from_lines = {}, .half_size_m = {0.28, 1}};
  lines[1].text =
      scene::LineText{.text = "DOOR 12 C", .p_at = on_door(door, -0.21, 0.05), .height_m = k_text_m};
  lines[2].dimension = scene::LineDimension{
      .p_from = on_door(door, -0.2, -0.09), .p_to = on_door(door, 0.2, -0.09), .height_m = k_number_m};
  LIMN_TRY_STATUS(scene::lay_lines(door, &lines));
  return lines;
}

// ---- Section

// A plane through the mirror, whose side towards the designer is removed (the door's frame).
const scene::CutPlane k_cut_door = {Vector3d(-0.45, 0.1, 1).normalized(),
                                    Vector3d(-0.45, 0.1, 1).normalized().dot(Vector3d(-0.075, 0.17, 0.07))};

// ---- Deviation

constexpr double k_tolerance_m = 0.5e-3;
constexpr double k_scan_resolution = 0.6;

// Clay that was added to the door's outer side, or taken from it (m, the door's frame).
struct Bump {
  double x = 0, y = 0, radius = 0, height = 0;
};
constexpr Bump k_bumps[] = {
    {-0.16, -0.04, 0.045, 0.8e-3}, {0.00, -0.08, 0.05, -1.5e-3}, {0.17, -0.07, 0.045, 3e-3}};

double clay_over_cad(const Vector3d& p) {
  double sum = 0;
  for (const Bump& bump : k_bumps) {
    const double share =
        1 - (Eigen::Vector2d(bump.x, bump.y) - p.head<2>()).squaredNorm() / (bump.radius * bump.radius);
    if (share > 0) sum += bump.height * share * share;
  }
  return sum;
}

// The door with its bumps, finely divided, so that it has their shape.
scene::Mesh with_bumps(const scene::Mesh& door) {
  constexpr double k_side_m = 3e-3;
  constexpr std::size_t k_most = 1'000'000;
  scene::ScanSurface fine = calib::surface_samples(door, k_side_m, k_most).surface;
  for (std::size_t i = 0; i < fine.positions.size(); ++i)
    if (fine.normals[i].z() > 0.3F)
      fine.positions[i] +=
          static_cast<float>(clay_over_cad(fine.positions[i].cast<double>())) * fine.normals[i];
  scene::Mesh mesh = door;
  mesh.positions = fine.positions;
  mesh.triangles = fine.triangles;
  mesh.uvs.clear();
  mesh.second_uvs.clear();
  mesh.tangents.clear();
  mesh.colours.clear();
  mesh.triangle_materials.assign(mesh.triangles.size(), 0);
  mesh.normals = scene::normals_from_triangles(fine);
  return mesh;
}

sim::World with_bumps(const sim::World& world, const scene::Mesh& door) {
  sim::World out = world;
  out.find("prototype")->mesh = std::make_shared<const scene::Mesh>(with_bumps(door));
  for (sim::CameraEffects& effects : out.camera_effects) effects.srgb = false;  // cameras measure
  return out;
}

}  // namespace

Status add_clay_work(scene::Scene* scene) {
  LIMN_TRY(scene->lines, lines_on(scene::Drape(scene->prototype->mesh)));
  scene->section.emplace().slots = {scene->slots.at(0).name};
  return {};
}

std::vector<DemoImage> line_images(const DemoSubject& subject, const DimRoom& room) {
  scene::PosedScene posed = subject.posed;
  posed.parts.clear();
  for (const scene::Line& line : subject.scene->lines) posed.lines.push_back(line.name);
  return {
      {"lines", "Lines of light",
       "Section lines every 50 mm across the door's x axis, a text, and the distance of two points in mm, "
       "drawn on the surface.",
       room.photograph(painter_images(subject, posed))}};
}

std::vector<DemoImage> cut_images(const DemoSubject& subject, const DimRoom& room) {
  scene::PosedScene posed = subject.posed;
  const Pose& world_from_door = *posed.world_from_prototype;
  posed.cut = scene::transformed(world_from_door, k_cut_door);
  const cv::Scalar k_grey(58, 54, 50);
  return {{"cut", "Cut open in light",
           "The plane of a marker in the hand cuts the mirror open: its inside and the hatched cap are "
           "projected.",
           room.photograph(painter_images(subject, posed))},
          {"cut-on-screen", "Cut open on a screen",
           "A wall screen draws the door, too, and cuts it: the same plane, from the same viewpoint.",
           subject.renderer->view(painter_view(world_from_door), posed, k_grey)}};
}

Result<std::vector<DemoImage>> deviation_images(const DemoSubject& subject,
                                                const std::filesystem::path& folder) {
  const scene::Mesh& cad = subject.scene->prototype->mesh;
  const sim::World world = with_bumps(*subject.world, cad);
  // Smaller images suffice for this, and are quicker.
  sim::World scanned_world = world;
  Rig scanning_rig = *subject.rig;
  LIMN_TRY_STATUS(scale_resolution(k_scan_resolution, &scanned_world.rig));
  LIMN_TRY_STATUS(scale_resolution(k_scan_resolution, &scanning_rig));
  LIMN_TRY(const std::filesystem::path plan_file, data_file("config/plans/studio.json"));
  LIMN_TRY(const wizard::Plan plan, wizard::load_plan(plan_file));
  sim::VirtualRig rig(std::move(scanned_world), {.grab_waits_for_light = false});
  ImageWriter writer;
  LIMN_TRY(const session::ScannedPrototype scanned,
           session::scanned_in_place(scanning_rig, cad, *subject.posed.world_from_prototype, subject.markers,
                                     wizard::virtual_backend(plan, &rig, &writer), folder, {}));
  LIMN_TRY(const session::PrototypeComparison compared,
           session::compared_with_cad(scanned,
                                      {.cad = std::make_shared<const scene::Mesh>(cad),
                                       .cad_name = "the door's mesh",
                                       .tolerance_m = k_tolerance_m},
                                      {}));
  scene::PosedScene posed = subject.posed;
  posed.parts.clear();
  posed.deviation = {compared.layer->number, k_tolerance_m};
  subject.renderer->set_deviation(*compared.layer);
  return std::vector<DemoImage>{{"deviation", "Where the clay is not as its CAD",
                                 "A door with 0.8 mm and 3 mm too much clay and 1.5 mm too little in three "
                                 "places, scanned and compared: " +
                                     calib::deviation_text(compared.report.summary, k_tolerance_m),
                                 DimRoom(world).photograph(painter_images(subject, posed))}};
}

}  // namespace limn::validate
