#include "wizard/measure/scan_alignment.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <optional>

#include "calib/surface/global_registration.h"
#include "core/config.h"
#include "core/file.h"
#include "core/image_io.h"
#include "core/json_text.h"
#include "core/log.h"
#include "core/names.h"
#include "core/rig.h"
#include "core/stopwatch.h"
#include "scene/marker_file.h"
#include "scene/meshes/mesh_formats.h"
#include "scene/meshes/scan_preview.h"
#include "scene/scene.h"
#include "tracker/body_pose.h"
#include "tracker/detector.h"
#include "tracker/family.h"

namespace limn::wizard {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;

constexpr int k_image_width = 1200, k_image_height = 800;
constexpr double k_residual_reach_m = 0.02;  // points further from the mesh belong to another object
constexpr double k_colour_limit_mm = 2;      // end of the residual map's colour scale
constexpr double k_symmetric = 0.9;  // share of the best pose's points; a warning if a rival pose fits more
constexpr std::size_t k_most_printed = 12;  // number of differences printed; all are in align.json

// A pose and how it was found.
struct Start {
  Pose world_from_prototype;
  std::optional<Matrix6d> covariance;  // if it comes from markers or from a file that states it
  std::string how;
  std::vector<std::string> free_directions = {};  // if a file states them
};

// Six rows of six numbers.
Matrix6d matrix_of(const ConfigNode& node) {
  Matrix6d matrix = Matrix6d::Zero();
  const std::vector<ConfigNode> rows = node.items();
  if (rows.size() != 6) {
    node.problem(fmt::format("expected 6 rows of 6 numbers, found {} rows.", rows.size()));
    return matrix;
  }
  for (int r = 0; r < 6; ++r) {
    const std::vector<double> row = rows[static_cast<std::size_t>(r)].numbers(6);
    for (std::size_t c = 0; c < row.size(); ++c) matrix(r, static_cast<int>(c)) = row[c];
  }
  return matrix;
}

Result<Start> start_from_file(const fs::path& path) {
  LIMN_TRY(const Config config, Config::load(path, ""));
  Start start{config.root().at("world_from_prototype").pose(), std::nullopt, "start"};
  if (const auto rows = config.root().find("covariance")) start.covariance = matrix_of(*rows);
  if (const auto free = config.root().find("free_directions"))
    for (const ConfigNode& direction : free->items()) start.free_directions.push_back(direction.text());
  LIMN_TRY_STATUS(config.status());
  return start;
}

Result<Start> start_from_picks(const fs::path& path, double metres_per_unit) {
  LIMN_TRY(const Config config, Config::load(path, "limn.picks/1"));
  const ConfigNode root = config.root();
  root.only({"schema", "pairs"});
  std::vector<calib::Pick> picks;
  for (const ConfigNode& pair : root.at("pairs").items()) {
    pair.only({"cad", "scan_m"});
    picks.push_back({pair.at("cad").vector3() * metres_per_unit, pair.at("scan_m").vector3()});
  }
  LIMN_TRY_STATUS(config.status());
  const auto pose = calib::pose_from_picks(picks);
  if (!pose) return error("{}: {}", path.string(), pose.message());
  return Start{*pose, std::nullopt, "points"};
}

// A --frame argument CAMERA=PICTURE: the camera, and the image, which has the camera's size.
struct Shot {
  const Imager* camera = nullptr;
  cv::Mat image;
};
Result<Shot> read_shot(const std::string& argument, const Rig& rig) {
  const auto equals = argument.find('=');
  const std::string name = argument.substr(0, equals);
  const Imager* camera = find_named(rig.cameras, name);
  if (equals == std::string::npos || camera == nullptr)
    return usage_error("--frame {}: expected CAMERA=PICTURE with a camera of the rig.", argument);
  LIMN_TRY(cv::Mat image, read_grey_image(argument.substr(equals + 1)));
  if (image.cols != camera->width || image.rows != camera->height)
    return error("{}: expected an image of {}'s size {}x{}, found {}x{}.", argument.substr(equals + 1), name,
                 camera->width, camera->height, image.cols, image.rows);
  return Shot{camera, std::move(image)};
}

// The pose of a body from its markers in all frames.
Result<Track> track_in_frames(const AlignOptions& command, const Body& body, const fs::path& family_folder) {
  LIMN_TRY(const Rig rig, load_rig(command.rig));
  LIMN_TRY(tracker::Families families,
           tracker::Families::load(tracker::families_of({&body, 1}), family_folder));
  tracker::Detector detector(std::move(families));
  std::vector<Shot> shots;
  std::vector<std::vector<tracker::Detection>> detections;
  for (const std::string& frame : command.frames) {
    LIMN_TRY(Shot shot, read_shot(frame, rig));
    detections.push_back(detector.detect(shot.image, &shot.camera->lens));
    shots.push_back(std::move(shot));
  }
  std::vector<tracker::View> views;
  for (std::size_t i = 0; i < shots.size(); ++i) views.push_back({shots[i].camera, detections[i]});
  const auto track = tracker::world_from_body(body, views, Stamp{});
  if (!track)
    return error(
        "--frame: expected markers of the prototype in the images, found none of its {}. Check light and "
        "focus.",
        body.markers.size());
  return *track;
}

Result<Start> start_from_markers(const AlignOptions& command) {
  if (command.rig.empty() || command.frames.empty())
    return usage_error("--scene: the markers of its prototype need --rig RIG and --frame CAMERA=PICTURE.");
  LIMN_TRY(const scene::Scene scene, scene::load_usable_scene(command.scene));
  const std::vector<Body> bodies = scene::bodies(scene);
  const Body* body = find_named(bodies, "prototype");
  if (body == nullptr || body->markers.empty())
    return error("{}: expected markers on the prototype (prototype.markers), found none.",
                 command.scene.string());
  LIMN_TRY(const Track track, track_in_frames(command, *body, scene.folder));
  log_info("align: start from {} markers, {:.2f} px", track.marker_count, track.rms_px);
  return Start{track.world_from_body, track.covariance, fmt::format("{} markers", track.marker_count)};
}

// Writes the poses of the body's markers on the CAD, which stands at `world_from_prototype`.
Status write_markers(const AlignOptions& command, const Pose& world_from_prototype) {
  LIMN_TRY(std::vector<BodyMarker> markers, scene::load_marker_file(command.body));
  LIMN_TRY(const Track track, track_in_frames(command, {"body", markers}, command.body.parent_path()));
  const Pose prototype_from_body = world_from_prototype.inverse() * track.world_from_body;
  for (BodyMarker& marker : markers) marker.body_from_marker = prototype_from_body * marker.body_from_marker;
  return write_file(command.out / "markers.json", scene::marker_file_json(markers));
}

// Whether the scene's markers give the start. Without frames, or with frames for another body, the scene only
// gives its mesh.
bool starts_from_markers(const AlignOptions& command) {
  const bool is_mesh_alone = command.mesh.empty() && (command.frames.empty() || !command.body.empty());
  return !command.scene.empty() && !is_mesh_alone;
}

Status check_options(const AlignOptions& command) {
  if (command.mesh.empty() && command.scene.empty())
    return usage_error(
        "expected a CAD file (--mesh and --units) or a --scene with a prototype, found neither.");
  if (!command.body.empty() && (command.rig.empty() || command.frames.empty() || command.scan.empty()))
    return usage_error("--body: expected --scan, --rig and --frame CAMERA=PICTURE with it.");
  if (!command.mesh.empty() && !command.units && !scene::states_unit(command.mesh))
    return usage_error(
        "--units: expected m, cm, mm, in or ft of the CAD, whose format states no unit, found none.");
  const int starts = !command.start.empty() + !command.points.empty() + starts_from_markers(command);
  if (starts > 1) return usage_error("expected one of --start, --points, --scene, found {}.", starts);
  if (command.scan.empty() && command.scene.empty())
    return usage_error(
        "expected --scan SCAN.ply, or --scene, --rig and --frame to get the pose from markers alone.");
  if (!command.is_aligned && starts == 0)
    return usage_error("--no-align: expected the pose with it (--start, --points, or --scene with --frame).");
  return {};
}

Result<std::optional<Start>> start_of(const AlignOptions& command, double metres_per_unit) {
  using Maybe = std::optional<Start>;
  Result<Start> start = Start{};
  if (!command.start.empty())
    start = start_from_file(command.start);
  else if (!command.points.empty())
    start = start_from_picks(command.points, metres_per_unit);
  else if (starts_from_markers(command))
    start = start_from_markers(command);
  else
    return Maybe();
  if (!start) return start.error();
  return Maybe(*start);
}

Result<MeshAligned> align(const AlignOptions& command,
                          const scene::Mesh& mesh,
                          const scene::MeshBvh& index,
                          const scene::ScanSurface& scan,
                          const std::optional<Start>& start) {
  MeshAligned result;
  const calib::RegistrationOptions options{.free_stddev_m = command.free_stddev_m};
  if (start && !command.is_aligned) {
    result.registration.world_from_prototype = start->world_from_prototype;
    if (start->covariance) result.registration.covariance = *start->covariance;
    result.registration.free_directions = start->free_directions;
    result.how = "given";
  } else if (start) {
    LIMN_TRY(result.registration,
             calib::refined_registration(mesh, index, scan, start->world_from_prototype, options));
    result.how = start->how;
  } else {
    log_info("align: no start given; the whole scan is searched");
    const auto found = calib::global_registration(mesh, index, scan, options);
    if (!found) return error("{}: {}", command.scan.string(), found.message());
    result.registration = found->registration;
    result.how = "search";
    if (found->rival_share > k_symmetric) {
      const double turn =
          angle_between(found->rival->rotation, found->registration.world_from_prototype.rotation);
      result.warnings.push_back(fmt::format(
          "another pose, turned by {:.0f} degrees, fits {:.0f} % as many points: the shape is symmetric or "
          "too little of it was scanned. Check the images, or give --start.",
          turn * 180 / M_PI, 100 * found->rival_share));
    }
  }
  return result;
}

std::vector<std::string> free_warnings(const calib::Registration& registration) {
  std::vector<std::string> warnings;
  for (const std::string& free : registration.free_directions)
    warnings.push_back(fmt::format(
        "the scanned shape does not determine a {} (prototype's axes): that part of the pose comes from "
        "the start alone. Scan more of it, or use markers.",
        free));
  return warnings;
}

std::string text_of(const calib::Difference& d) {
  return fmt::format(
      "{:.1f} cm2 at ({:.0f}, {:.0f}, {:.0f}) mm of the prototype: the scan lies {:.1f} mm {} the CAD "
      "(up to {:.1f} mm)",
      1e4 * d.area_m2, 1e3 * d.p_prototype.x(), 1e3 * d.p_prototype.y(), 1e3 * d.p_prototype.z(),
      1e3 * std::abs(d.mean_m), d.mean_m > 0 ? "outside" : "inside", 1e3 * std::abs(d.worst_m));
}

std::string text_of(const calib::ScanSize& size) {
  return fmt::format(
      "the scan is {:.4f} times as large as the CAD (standard deviation {:.4f}): the calibration's board may "
      "have "
      "another size than its text says, or the model was built larger or smaller. Measure a length on the "
      "model, "
      "and the board (limn solve --board-measured).",
      size.ratio, size.stddev);
}

nlohmann::ordered_json json_of(const MeshAligned& aligned,
                               const std::vector<calib::Difference>& differences,
                               double seconds) {
  const calib::Registration& a = aligned.registration;
  nlohmann::ordered_json json;
  json["schema"] = "limn.align/1";
  json["start"] = aligned.how;
  json["world_from_prototype"] = to_json(a.world_from_prototype);
  json["covariance"] = nlohmann::ordered_json::array();
  for (int r = 0; r < 6; ++r) {
    std::vector<double> row;
    for (int c = 0; c < 6; ++c) row.push_back(a.covariance(r, c));
    json["covariance"].push_back(row);
  }
  json["rms_mm"] = 1e3 * a.rms_m;
  json["points"] = {{"near", a.near}, {"used", a.used}, {"scan", aligned.overlap.scan_points}};
  json["size_ratio"] = aligned.size.ratio;
  json["size_ratio_stddev"] = aligned.size.stddev;
  json["near_mm"] = 1e3 * aligned.overlap.near_m;
  json["scan_share_near"] = aligned.overlap.scan_share;
  json["cad_share_near"] = aligned.overlap.mesh_share;
  json["free_directions"] = a.free_directions;
  json["differences"] = nlohmann::ordered_json::array();
  for (const calib::Difference& d : differences)
    json["differences"].push_back({{"prototype_m", {d.p_prototype.x(), d.p_prototype.y(), d.p_prototype.z()}},
                                   {"area_mm2", 1e6 * d.area_m2},
                                   {"mean_mm", 1e3 * d.mean_m},
                                   {"worst_mm", 1e3 * d.worst_m}});
  json["warnings"] = aligned.warnings;
  json["seconds"] = seconds;
  return json;
}

// The scan's points near the mesh, coloured by their residuals, in the prototype's frame.
scene::ScanSurface coloured(const scene::ScanSurface& scan,
                            const std::vector<float>& residuals,
                            const Pose& world_from_prototype) {
  std::vector<bool> keep;
  for (const float residual : residuals) keep.push_back(!std::isnan(residual));
  scene::ScanSurface part = scan;
  const Pose inverse = world_from_prototype.inverse();
  for (auto& p : part.positions) p = (inverse * p.cast<double>()).cast<float>();
  for (auto& n : part.normals) n = (inverse.rotation * n.cast<double>()).cast<float>();
  part.colours_rgb.clear();
  for (const float residual : residuals)
    part.colours_rgb.push_back(scene::signed_colour_rgb(
        std::isnan(residual) ? 0 : 1e3 * static_cast<double>(residual) / k_colour_limit_mm));
  return scene::with_vertices_kept(part, keep);
}

Status write_images(const scene::ScanSurface& map, const fs::path& out) {
  Vector3d d_seen = Vector3d::Zero();
  for (const auto& n : map.normals) d_seen += n.cast<double>();
  d_seen.normalize();
  const Vector3d up = std::abs(d_seen.y()) < 0.9 ? Vector3d::UnitY() : Vector3d::UnitZ();
  const std::string caption = "scan and CAD: red is outside the CAD, blue inside";
  for (const auto& [name, turn] : {std::pair{"residual.png", 0.0}, std::pair{"residual-side.png", 0.9}}) {
    const Vector3d d_from = Eigen::AngleAxisd(turn, up) * d_seen;
    const auto viewer = scene::preview_viewer(map, d_from, up, k_image_width, k_image_height);
    LIMN_TRY_STATUS(write_png(out / name, scene::with_scale(scene::draw_scan_preview(map, viewer),
                                                            -k_colour_limit_mm, k_colour_limit_mm, caption)));
  }
  return {};
}

Status write_pose(const Pose& world_from_prototype, const fs::path& out) {
  const nlohmann::ordered_json poses = {{"world_from_prototype", to_json(world_from_prototype)}};
  return write_file(out / "poses.json", json_text(poses, 2) + "\n");
}

// Writes the pose that the markers alone give.
Result<MeshAligned> written_markers_pose(const Start& start, const AlignOptions& command, double seconds) {
  MeshAligned aligned;
  aligned.registration.world_from_prototype = start.world_from_prototype;
  if (start.covariance) aligned.registration.covariance = *start.covariance;
  aligned.how = start.how;
  LIMN_TRY_STATUS(make_folder(command.out));
  LIMN_TRY_STATUS(write_file(command.out / "align.json", json_text(json_of(aligned, {}, seconds), 2) + "\n"));
  LIMN_TRY_STATUS(write_pose(start.world_from_prototype, command.out));
  return aligned;
}

// The mesh to align with the scan: the CAD file, or the scene's prototype.
Result<scene::Mesh> mesh_of(const AlignOptions& command) {
  if (!command.mesh.empty()) return scene::load_mesh(command.mesh, command.units);
  LIMN_TRY(scene::Scene scene, scene::load_usable_scene(command.scene));
  if (!scene.prototype) return error("{}: expected a prototype, found none.", command.scene.string());
  return std::move(scene.prototype->mesh);
}

}  // namespace

Result<ScanOnMesh> aligned_scan(const AlignOptions& command) {
  LIMN_TRY_STATUS(check_options(command));
  if (command.scan.empty())
    return usage_error("expected --scan SCAN.ply or a folder of limn scan, found none.");
  LIMN_TRY_STATUS(reported(command.report_stage, {.name = "read"}));
  ScanOnMesh found;
  LIMN_TRY(scene::Mesh read, mesh_of(command));
  found.mesh = std::make_unique<const scene::Mesh>(std::move(read));
  const scene::Mesh& mesh = *found.mesh;
  LIMN_TRY(const auto start, start_of(command, command.mesh.empty() ? 1 : mesh.metres_per_unit));
  found.file = fs::is_directory(command.scan) ? command.scan / "mesh.ply" : command.scan;
  LIMN_TRY(found.scan, scene::load_ply(found.file, scene::metres_per_unit(command.scan_units)));
  if (const Status sizes = calib::comparable_sizes(mesh, found.scan); !sizes)
    return error("{}: {}", (command.mesh.empty() ? command.scene : command.mesh).string(), sizes.message());
  LIMN_TRY_STATUS(reported(command.report_stage, {.name = "align"}));
  found.index = std::make_unique<const scene::MeshBvh>(mesh);
  LIMN_TRY(found.aligned, align(command, mesh, *found.index, found.scan, start));
  found.aligned.overlap =
      calib::overlap(mesh, *found.index, found.scan, found.aligned.registration.world_from_prototype);
  return found;
}

void measure_size(const scene::Mesh& mesh,
                  const scene::MeshBvh& index,
                  const scene::ScanSurface& scan,
                  MeshAligned* aligned) {
  if (const auto size = calib::scan_size(mesh, index, scan, aligned->registration)) aligned->size = *size;
  if (calib::contradicts(aligned->size)) aligned->warnings.push_back(text_of(aligned->size));
}

Result<MeshAligned> align_scan(const AlignOptions& command) {
  const auto begun = std::chrono::steady_clock::now();
  LIMN_TRY_STATUS(check_options(command));
  if (command.scan.empty()) {
    LIMN_TRY(const scene::Mesh mesh, mesh_of(command));
    LIMN_TRY(const auto start, start_of(command, command.mesh.empty() ? 1 : mesh.metres_per_unit));
    if (!start)
      return usage_error(
          "--scene: without --scan the markers of its prototype need --rig RIG and --frame "
          "CAMERA=PICTURE.");
    return written_markers_pose(*start, command, 1e-3 * milliseconds_since(begun));
  }
  LIMN_TRY(ScanOnMesh found, aligned_scan(command));
  const scene::Mesh& mesh = *found.mesh;
  const scene::MeshBvh& index = *found.index;
  const scene::ScanSurface& scan = found.scan;
  const fs::path& file = found.file;
  MeshAligned aligned = std::move(found.aligned);
  LIMN_TRY_STATUS(reported(command.report_stage, {.name = "compare"}));
  for (std::string& warning : free_warnings(aligned.registration))
    aligned.warnings.push_back(std::move(warning));
  measure_size(mesh, index, scan, &aligned);
  const auto residuals = calib::residuals(index, scan, aligned.registration, k_residual_reach_m);
  const auto differences =
      calib::differences(scan, residuals, aligned.registration, {.least_m = 1e-3 * command.least_mm});
  for (std::size_t i = 0; i < std::min(k_most_printed, differences.size()); ++i)
    aligned.warnings.push_back(text_of(differences[i]));
  if (differences.size() > k_most_printed)
    aligned.warnings.push_back(
        fmt::format("{} smaller regions also differ: see align.json", differences.size() - k_most_printed));

  LIMN_TRY_STATUS(reported(command.report_stage, {.name = "write"}));
  LIMN_TRY_STATUS(make_folder(command.out));
  const scene::ScanSurface map = coloured(scan, residuals, aligned.registration.world_from_prototype);
  LIMN_TRY_STATUS(scene::save_ply(map, command.out / "residual.ply"));
  LIMN_TRY_STATUS(write_images(map, command.out));
  LIMN_TRY_STATUS(
      write_file(command.out / "align.json",
                 json_text(json_of(aligned, differences, 1e-3 * milliseconds_since(begun)), 2) + "\n"));
  LIMN_TRY_STATUS(write_pose(aligned.registration.world_from_prototype, command.out));
  if (!command.body.empty())
    LIMN_TRY_STATUS(write_markers(command, aligned.registration.world_from_prototype));
  if (const Status same = calib::check_overlap(aligned.overlap); !same)
    return error("{}: {} The files in {} show what was found.", file.string(), same.message(),
                 command.out.string());
  return aligned;
}

}  // namespace limn::wizard
