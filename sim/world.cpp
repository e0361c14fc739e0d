#include "sim/world.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <opencv2/core.hpp>
#include <set>
#include <utility>

#include "core/config.h"
#include "core/names.h"

namespace limn::sim {
namespace {

// The print of a marker: reflectance of paper and ink, and the white margin as a share of the marker's side.
struct MarkerPaper {
  double white = 0.85;
  double black = 0.04;
  double margin = 0.15;
};

double share(const ConfigNode& node) {
  const double value = node.number();
  if (value < 0 || value > 1) node.problem(fmt::format("expected a share from 0 to 1, found {}.", value));
  return value;
}

double not_negative(const ConfigNode& node) {
  const double value = node.number();
  if (value < 0) node.problem(fmt::format("expected a number that is not negative, found {}.", value));
  return value;
}

// A number that is not negative and at most `most`, so that a blur of this size can be computed.
double at_most(double most, const ConfigNode& node) {
  const double value = not_negative(node);
  if (value > most) node.problem(fmt::format("expected at most {}, found {}.", most, value));
  return value;
}

// {"model": …, "values": […]}
Lens read_lens(const ConfigNode& node) {
  node.only({"model", "values"});
  auto lens = Lens::create(node.at("model").text(), node.at("values").numbers(-1));
  if (!lens) node.problem(lens.message());
  return lens ? *lens : Lens{};
}

// Reads either the pose itself, or a viewpoint and a target.
Pose read_imager_pose(const ConfigNode& node) {
  if (const auto pose = node.find("imager_from_world")) return pose->pose();
  const Eigen::Vector3d p_imager = node.at("eye_m").vector3(), p_target = node.at("target_m").vector3();
  const Eigen::Vector3d d = p_target - p_imager;
  if (d.norm() < 1e-6 || d.head<2>().norm() < 1e-6 * d.norm()) {
    node.at("target_m")
        .problem(
            "expected a target that is neither at eye_m nor vertically above or below it, found one that is. "
            "Give imager_from_world instead.");
    return {};
  }
  return looking_at(p_imager, p_target, Eigen::Vector3d::UnitZ());
}

Imager read_imager(const ConfigNode& node) {
  Imager imager;
  imager.name = node.at("name").text();
  if (imager.name.empty() || imager.name.starts_with('.') || imager.name.find('/') != std::string::npos)
    node.at("name").problem(fmt::format(
        "expected a name without slashes that does not begin with a dot (files are named after it), found "
        "'{}'.",
        imager.name));
  const auto [width, height] = node.at("size").image_size();
  imager.width = width;
  imager.height = height;
  imager.lens = read_lens(node.at("lens"));
  imager.imager_from_world = read_imager_pose(node);
  return imager;
}

// Reads three rows of [red, green, blue] for the camera's red, green and blue. The result is BGR x BGR.
Eigen::Matrix3d read_sensitivity(const ConfigNode& node) {
  Eigen::Matrix3d rgb = Eigen::Matrix3d::Identity();
  const auto rows = node.items();
  if (rows.size() != 3) node.problem("expected three rows of three numbers.");
  for (std::size_t i = 0; i < std::min<std::size_t>(rows.size(), 3); ++i)
    rgb.row(static_cast<Eigen::Index>(i)) = rows[i].vector3();
  if (rgb.minCoeff() < 0) node.problem("expected numbers that are not negative.");
  return rgb.reverse();
}

CameraEffects read_camera_effects(const ConfigNode& node) {
  node.only({"name", "size", "lens", "imager_from_world", "eye_m", "target_m", "colour", "exposure", "psf_px",
             "vignetting", "full_well_e", "read_noise", "black_level", "shake_px", "flicker", "encoding",
             "sensitivity", "sees"});
  CameraEffects effects;
  effects.exposure = node.at("exposure").positive();
  if (const auto v = node.find("colour")) effects.colour = v->boolean();
  if (const auto v = node.find("psf_px")) effects.psf_px = at_most(100, *v);
  if (const auto v = node.find("vignetting")) effects.vignetting = share(*v);
  if (const auto v = node.find("full_well_e")) effects.full_well_e = not_negative(*v);
  if (const auto v = node.find("read_noise")) effects.read_noise = not_negative(*v);
  if (const auto v = node.find("black_level")) effects.black_level = not_negative(*v);
  if (const auto v = node.find("shake_px")) effects.shake_px = at_most(10, *v);
  if (const auto v = node.find("flicker")) effects.flicker = share(*v);
  if (const auto v = node.find("encoding")) effects.srgb = v->choice({"linear", "srgb"}) == "srgb";
  if (const auto v = node.find("sensitivity")) effects.sensitivity = read_sensitivity(*v);
  if (const auto v = node.find("sees"); v && k_spectra.read(*v) == Spectrum::infrared && effects.colour)
    v->problem("expected visible light for a colour camera, found infrared. Remove \"colour\".");
  return effects;
}

void read_defocus(const ConfigNode& node, ProjectorEffects* effects) {
  node.only({"focus_m", "aperture_m"});
  effects->focus_m = node.at("focus_m").positive();
  effects->aperture_m = at_most(1, node.at("aperture_m"));
}

ProjectorEffects read_projector_effects(const ConfigNode& node) {
  node.only({"name", "size", "lens", "imager_from_world", "eye_m", "target_m", "illuminance_at_1m", "gamma",
             "channel_gamma", "s_curve", "black_level", "vignetting", "defocus", "falloff", "incidence"});
  ProjectorEffects effects;
  effects.illuminance_at_1m = node.at("illuminance_at_1m").positive();
  if (const auto v = node.find("gamma")) effects.gamma = v->positive();
  if (const auto v = node.find("channel_gamma")) {
    effects.channel_gamma = v->vector3().reverse();
    if (effects.channel_gamma.minCoeff() <= 0) v->problem("expected three positive numbers.");
  }
  if (const auto v = node.find("s_curve")) effects.s_curve = share(*v);
  if (const auto v = node.find("black_level")) effects.black_level = share(*v);
  if (const auto v = node.find("vignetting")) effects.vignetting = share(*v);
  if (const auto v = node.find("defocus")) read_defocus(*v, &effects);
  if (const auto v = node.find("falloff")) effects.falloff = v->boolean();
  if (const auto v = node.find("incidence")) effects.incidence = v->boolean();
  return effects;
}

void own_name(const ConfigNode& node, const std::string& name, std::set<std::string>* names) {
  if (!names->insert(name).second)
    node.at("name").problem(fmt::format("expected a unique name, found '{}' twice.", name));
}

void read_devices(const ConfigNode& root, World* world) {
  std::set<std::string> names;
  for (const ConfigNode& node : root.at("cameras").items()) {
    world->rig.cameras.push_back(read_imager(node));
    if (const auto sees = node.find("sees")) world->rig.cameras.back().sees = k_spectra.read(*sees);
    world->camera_effects.push_back(read_camera_effects(node));
    own_name(node, world->rig.cameras.back().name, &names);
  }
  for (const ConfigNode& node : root.at("projectors").items()) {
    world->rig.projectors.push_back(read_imager(node));
    world->projector_effects.push_back(read_projector_effects(node));
    own_name(node, world->rig.projectors.back().name, &names);
  }
}

Room read_room(const ConfigNode& node) {
  node.only({"ambient", "lamps"});
  Room room;
  room.ambient = not_negative(node.at("ambient"));
  if (const auto lamps = node.find("lamps"))
    for (const ConfigNode& item : lamps->items()) {
      item.only({"p_world", "illuminance_at_1m", "radius_m"});
      Lamp lamp{item.at("p_world").vector3(), not_negative(item.at("illuminance_at_1m")), 0};
      if (const auto radius = item.find("radius_m")) lamp.radius_m = not_negative(*radius);
      room.lamps.push_back(lamp);
    }
  return room;
}

std::shared_ptr<const scene::Mesh> sheet_mesh(double width_m, double height_m) {
  auto mesh = std::make_shared<scene::Mesh>();
  const auto x = static_cast<float>(width_m / 2), y = static_cast<float>(height_m / 2);
  mesh->positions = {{-x, -y, 0}, {x, -y, 0}, {x, y, 0}, {-x, y, 0}};
  mesh->normals.assign(4, {0, 0, -1});
  mesh->uvs = {{0, 1}, {1, 1}, {1, 0}, {0, 0}};
  mesh->triangles = {{0, 2, 1}, {0, 3, 2}};
  mesh->triangle_materials = {0, 0};
  return mesh;
}

std::shared_ptr<const scene::Mesh> box_mesh(const Eigen::Vector3d& size) {
  auto mesh = std::make_shared<scene::Mesh>();
  for (int axis = 0; axis < 3; ++axis)
    for (const float side : {-1.0F, 1.0F}) {
      const auto first = static_cast<std::uint32_t>(mesh->positions.size());
      Eigen::Vector3f n = Eigen::Vector3f::Zero();
      n[axis] = side;
      const int right = (axis + 1) % 3, up = (axis + 2) % 3;
      for (const auto& [a, b] : {std::pair{-1.0F, -1.0F}, {1.0F, -1.0F}, {1.0F, 1.0F}, {-1.0F, 1.0F}}) {
        Eigen::Vector3f p = n;
        p[right] = a * side;
        p[up] = b;
        mesh->positions.push_back(p.cwiseProduct(size.cast<float>() / 2));
        mesh->normals.push_back(n);
      }
      mesh->triangles.push_back({first, first + 1, first + 2});
      mesh->triangles.push_back({first, first + 2, first + 3});
    }
  mesh->triangle_materials.assign(mesh->triangles.size(), 0);
  return mesh;
}

// Adds a sphere whose triangles' volume is that of the sphere: the faces of an icosahedron, each divided in
// four several times.
void add_sphere(const Eigen::Vector3d& p, double radius, scene::Mesh* mesh) {
  constexpr int k_divisions = 4;        // 5120 triangles: the outline deviates by .0006 of the radius at most
  constexpr double k_volume = 1.00061;  // the radius's factor
  const double g = 0.5 * (1 + std::sqrt(5.0));
  std::vector<Eigen::Vector3d> d = {{-1, g, 0}, {1, g, 0}, {-1, -g, 0}, {1, -g, 0},
                                    {0, -1, g}, {0, 1, g}, {0, -1, -g}, {0, 1, -g},
                                    {g, 0, -1}, {g, 0, 1}, {-g, 0, -1}, {-g, 0, 1}};
  using Triangle = std::array<std::uint32_t, 3>;
  std::vector<Triangle> faces = {{0, 11, 5}, {0, 5, 1},  {0, 1, 7},   {0, 7, 10}, {0, 10, 11},
                                 {1, 5, 9},  {5, 11, 4}, {11, 10, 2}, {10, 7, 6}, {7, 1, 8},
                                 {3, 9, 4},  {3, 4, 2},  {3, 2, 6},   {3, 6, 8},  {3, 8, 9},
                                 {4, 9, 5},  {2, 4, 11}, {6, 2, 10},  {8, 6, 7},  {9, 8, 1}};
  for (Eigen::Vector3d& one : d) one.normalize();
  for (int i = 0; i < k_divisions; ++i) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middles;
    const auto middle = [&](std::uint32_t a, std::uint32_t b) {
      const auto [at, is_new] = middles.try_emplace(std::minmax(a, b), static_cast<std::uint32_t>(d.size()));
      if (is_new) d.push_back((d[a] + d[b]).normalized());
      return at->second;
    };
    std::vector<Triangle> finer;
    for (const auto& [a, b, c] : faces) {
      const std::uint32_t ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
      finer.insert(finer.end(), {{a, ab, ca}, {b, bc, ab}, {c, ca, bc}, {ab, bc, ca}});
    }
    faces = std::move(finer);
  }
  const auto first = static_cast<std::uint32_t>(mesh->positions.size());
  for (const Eigen::Vector3d& one : d) {
    mesh->positions.push_back((p + k_volume * radius * one).cast<float>());
    mesh->normals.push_back(one.cast<float>());
  }
  for (const auto& [a, b, c] : faces) mesh->triangles.push_back({first + a, first + b, first + c});
  mesh->triangle_materials.resize(mesh->triangles.size(), 0);
}

// Reads a number or [red, green, blue].
Eigen::Vector3d read_albedo(const ConfigNode& node) {
  if (!node.is_array()) return Eigen::Vector3d::Constant(share(node));
  const Eigen::Vector3d rgb = node.vector3();
  if (rgb.minCoeff() < 0 || rgb.maxCoeff() > 1)
    node.problem(fmt::format("expected shares from 0 to 1, found [{}, {}, {}].", rgb.x(), rgb.y(), rgb.z()));
  return rgb.reverse();
}

Object read_object(const ConfigNode& node, const Pose& world_from_prototype) {
  node.only({"name", "rectangle_m", "box_m", "world_from_object", "moves_with_prototype", "albedo"});
  Object object;
  object.name = node.at("name").text();
  object.world_from_object = node.at("world_from_object").pose();
  if (const auto moves = node.find("moves_with_prototype"); moves && moves->boolean())
    object.prototype_from_object = world_from_prototype.inverse() * object.world_from_object;
  object.albedo = read_albedo(node.at("albedo"));
  Eigen::Vector3d size = Eigen::Vector3d::Ones();
  if (const auto rectangle = node.find("rectangle_m")) {
    const std::vector<double> sides = rectangle->numbers(2);
    if (sides.size() == 2) size.head<2>() = Eigen::Vector2d(sides[0], sides[1]);
  } else {
    size = node.at("box_m").vector3();
  }
  if (size.minCoeff() <= 0) {
    node.problem("expected positive sides, in metres.");
    size.setOnes();
  }
  object.mesh = node.find("rectangle_m") ? sheet_mesh(size.x(), size.y()) : box_mesh(size);
  return object;
}

BallPaint read_ball_paint(const ConfigNode& node) {
  node.only({"albedo", "retroreflection"});
  BallPaint paint;
  if (const auto albedo = node.find("albedo")) paint.albedo = share(*albedo);
  if (const auto factor = node.find("retroreflection")) paint.retroreflection = at_most(1e4, *factor);
  return paint;
}

MarkerPaper read_paper(const ConfigNode& node) {
  node.only({"white", "black", "margin"});
  return {share(node.at("white")), share(node.at("black")), share(node.at("margin"))};
}

// Where a slot's marker stands: on the prototype, or somewhere in the world.
struct SlotPlace {
  std::string slot;
  Pose pose;
  bool on_prototype = false;
};

std::vector<SlotPlace> read_slot_places(const ConfigNode& node) {
  std::vector<SlotPlace> places;
  for (const std::string& slot : node.keys()) {
    const ConfigNode place = node.at(slot);
    place.only({"prototype_from_marker", "world_from_marker"});
    const auto on_prototype = place.find("prototype_from_marker");
    places.push_back({slot, on_prototype ? on_prototype->pose() : place.at("world_from_marker").pose(),
                      on_prototype.has_value()});
  }
  return places;
}

// A marker that carries no part of the scene.
struct LoosePlace {
  BodyMarker marker;
  bool on_prototype = false;
};

std::vector<LoosePlace> read_loose_places(const ConfigNode& node) {
  std::vector<LoosePlace> places;
  for (const ConfigNode& item : node.items()) {
    item.only({"name", "size_mm", "prototype_from_marker", "world_from_marker"});
    const auto name = MarkerName::parse(item.at("name").text());
    if (!name) item.at("name").problem(name.message());
    const auto on_prototype = item.find("prototype_from_marker");
    places.push_back({{name ? *name : MarkerName{}, 1e-3 * item.at("size_mm").positive(k_largest_marker_mm),
                       on_prototype ? on_prototype->pose() : item.at("world_from_marker").pose()},
                      on_prototype.has_value()});
  }
  return places;
}

// A marker's image in sufficient resolution, with its white margin.
struct Plate {
  cv::Mat image;
  double side_m;
};

Plate plate_of(const MarkerDrawing& drawing, double size_m, const MarkerPaper& paper) {
  constexpr int k_fine_px = 400;  // least resolution; the margin is rounded to whole pixels of it
  const cv::Mat& marker = drawing.image;
  const int scale = std::max(1, (k_fine_px + marker.cols - 1) / marker.cols);
  cv::Mat fine, sheet;
  fine.create(marker.rows * scale, marker.cols * scale, CV_8U);
  for (int r = 0; r < fine.rows; ++r)
    for (int c = 0; c < fine.cols; ++c)
      fine.at<std::uint8_t>(r, c) = marker.at<std::uint8_t>(r / scale, c / scale);
  const int margin = static_cast<int>(std::lround(paper.margin * fine.cols));
  cv::copyMakeBorder(fine, sheet, margin, margin, margin, margin, cv::BORDER_CONSTANT, cv::Scalar(255));
  return {sheet, size_m / drawing.square_share() * sheet.cols / fine.cols};
}

Status add_plate(World& world,
                 const BodyMarker& marker,
                 bool on_prototype,
                 const MarkerImage& draw,
                 const MarkerPaper& paper) {
  LIMN_TRY(const MarkerDrawing drawing, draw(marker.marker));
  const cv::Mat& image = drawing.image;
  LIMN_CHECK(image.type() == CV_8UC1 && image.rows == image.cols && image.rows > 0);
  const Plate plate = plate_of(drawing, marker.size_m, paper);
  const Pose place =
      on_prototype ? world.world_from_prototype * marker.body_from_marker : marker.body_from_marker;
  Object object = sheet("marker-" + marker.marker.text(), plate.side_m, plate.side_m, plate.image, place);
  object.albedo.setConstant(paper.white);
  object.ink_albedo = paper.black;
  if (on_prototype) object.prototype_from_object = marker.body_from_marker;
  world.markers.push_back({marker.marker, marker.size_m, object.name});
  world.objects.push_back(std::move(object));
  return {};
}

Status add_slot_markers(World& world,
                        const std::vector<SlotPlace>& places,
                        const MarkerImage& draw,
                        const MarkerPaper& paper,
                        const std::string& file) {
  for (const SlotPlace& place : places) {
    const scene::Slot* slot = world.scene->find_slot(place.slot);
    if (slot == nullptr)
      return error(
          "{}: slot_markers: expected slots of the scene, found '{}'. Compare with the scene's scene.json.",
          file, place.slot);
    if (slot->constellation) {
      add_balls(world, slot->marker, *slot->constellation, place.pose, place.on_prototype);
      continue;
    }
    LIMN_TRY_STATUS(
        add_plate(world, {slot->marker, slot->size_m, place.pose}, place.on_prototype, draw, paper));
  }
  return {};
}

Status add_scene(World& world,
                 const std::vector<SlotPlace>& places,
                 const MarkerImage& draw,
                 const MarkerPaper& paper,
                 const std::string& file) {
  if (world.scene->prototype) {
    const scene::Prototype& prototype = *world.scene->prototype;
    Object object;
    object.name = "prototype";
    object.mesh = std::make_shared<scene::Mesh>(prototype.mesh);
    object.world_from_object = world.world_from_prototype;
    object.prototype_from_object = Pose();
    object.albedo.setConstant(prototype.albedo_image.empty() ? prototype.albedo : 1.0);
    object.texture = prototype.albedo_image;
    world.objects.push_back(std::move(object));
    if (const auto& balls = prototype.constellation)
      add_balls(world, {k_constellation_family, "prototype"}, *balls, Pose(), true);
    for (const BodyMarker& marker : prototype.markers)
      LIMN_TRY_STATUS(add_plate(world, marker, true, draw, paper));
  }
  return add_slot_markers(world, places, draw, paper, file);
}

}  // namespace

const Object* World::find(const std::string& object) const { return find_named(objects, object); }

Object* World::find(const std::string& object) { return find_named(objects, object); }

Result<World> load_world(const std::filesystem::path& path,
                         const MarkerImage& marker_image,
                         std::vector<scene::SkippedVariant>* skipped_variants) {
  LIMN_TRY(const Config config, Config::load(path, "limn.world/1"));
  const ConfigNode root = config.root();
  root.only({"schema", "seed", "scene", "world_from_prototype", "slot_markers", "loose_markers",
             "marker_paper", "balls", "cameras", "projectors", "room", "objects"});
  World world;
  read_devices(root, &world);
  world.room = read_room(root.at("room"));
  if (const auto seed = root.find("seed")) world.seed = static_cast<std::uint64_t>(seed->integer());
  if (const auto node = root.find("world_from_prototype")) world.world_from_prototype = node->pose();
  if (const auto objects = root.find("objects")) {
    std::set<std::string> names;
    for (const ConfigNode& node : objects->items()) {
      world.objects.push_back(read_object(node, world.world_from_prototype));
      own_name(node, world.objects.back().name, &names);
    }
  }
  MarkerPaper paper;
  if (const auto node = root.find("marker_paper")) paper = read_paper(*node);
  if (const auto node = root.find("balls")) world.ball_paint = read_ball_paint(*node);
  std::vector<SlotPlace> places;
  std::vector<LoosePlace> loose;
  if (const auto markers = root.find("loose_markers")) loose = read_loose_places(*markers);
  std::filesystem::path scene_folder;
  if (const auto node = root.find("scene")) {
    scene_folder = config.folder() / node->text();
    root.at("world_from_prototype");
    if (const auto markers = root.find("slot_markers")) places = read_slot_places(*markers);
  }
  LIMN_TRY_STATUS(config.status());
  if (!scene_folder.empty()) {
    const std::filesystem::path folder = scene_folder.lexically_normal();
    LIMN_TRY(world.scene, skipped_variants ? scene::load_scene(folder, skipped_variants)
                                           : scene::load_usable_scene(folder));
    LIMN_TRY_STATUS(add_scene(world, places, marker_image, paper, path.string()));
  }
  for (const LoosePlace& place : loose)
    LIMN_TRY_STATUS(add_plate(world, place.marker, place.on_prototype, marker_image, paper));
  return world;
}

World without_effects(World world) {
  for (CameraEffects& camera : world.camera_effects)
    camera = {.colour = camera.colour, .exposure = camera.exposure};
  for (ProjectorEffects& projector : world.projector_effects)
    projector = {.illuminance_at_1m = projector.illuminance_at_1m};
  return world;
}

Object sheet(const std::string& name,
             double width_m,
             double height_m,
             const cv::Mat& image,
             const Pose& world_from_sheet) {
  Object object;
  object.name = name;
  object.mesh = sheet_mesh(width_m, height_m);
  object.world_from_object = world_from_sheet;
  object.albedo.setConstant(0.85);
  object.ink_albedo = image.empty() ? 0 : 0.04;
  object.texture = image;
  object.sharp_texture = true;
  return object;
}

Status add_marker(World& world,
                  const BodyMarker& marker,
                  bool attached_to_prototype,
                  const MarkerImage& marker_image) {
  return add_plate(world, marker, attached_to_prototype, marker_image, {});
}

void add_balls(World& world,
               const MarkerName& name,
               const Constellation& balls,
               const Pose& pose,
               bool attached_to_prototype) {
  auto mesh = std::make_shared<scene::Mesh>();
  for (const Eigen::Vector3d& p : balls.p_balls) add_sphere(p, balls.radius_m, mesh.get());
  Object object;
  object.name = "marker-" + name.text();
  object.mesh = std::move(mesh);
  object.albedo.setConstant(world.ball_paint.albedo);
  object.retroreflection = world.ball_paint.retroreflection;
  object.world_from_object = attached_to_prototype ? world.world_from_prototype * pose : pose;
  if (attached_to_prototype) object.prototype_from_object = pose;
  world.markers.push_back({name, 2 * reach_of(balls), object.name});
  world.objects.push_back(std::move(object));
}

void move_prototype(World& world, const Pose& world_from_prototype) {
  world.world_from_prototype = world_from_prototype;
  for (Object& object : world.objects)
    if (object.prototype_from_object)
      object.world_from_object = world_from_prototype * *object.prototype_from_object;
}

scene::PosedScene true_poses(const World& world, std::span<const std::string> variants) {
  if (!world.scene) return {};
  std::vector<Track> tracks;
  const auto add = [&](const std::string& body, const Pose& world_from_body) {
    Track track;
    track.body = body;
    track.world_from_body = world_from_body;
    tracks.push_back(track);
  };
  if (world.scene->prototype) add("prototype", world.world_from_prototype);
  for (const scene::Slot& slot : world.scene->slots)
    if (const auto pose = world_from_marker(world, slot.marker)) add(slot.name, *pose);
  for (std::size_t i = 0; i < world.scene->viewers.size(); ++i)
    if (const auto& marker = world.scene->viewers[i].marker)
      if (const auto pose = world_from_marker(world, *marker)) add(scene::viewer_body(i), *pose);
  return scene::posed(*world.scene, tracks, variants);
}

std::optional<Pose> world_from_marker(const World& world, const MarkerName& marker) {
  for (const PlacedMarker& placed : world.markers)
    if (placed.marker == marker)
      if (const Object* object = world.find(placed.object)) return object->world_from_object;
  return std::nullopt;
}

}  // namespace limn::sim
