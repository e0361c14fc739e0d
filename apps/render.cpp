#include "apps/render.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "apps/output_files.h"
#include "core/config.h"
#include "core/file.h"
#include "core/image_io.h"
#include "core/json_text.h"
#include "core/log.h"
#include "core/names.h"
#include "core/print.h"
#include "core/rig.h"
#include "device/gl_context.h"
#include "projector/renderer.h"
#include "scene/posed_scene.h"
#include "scene/scene.h"
#include "scene/viewpoint.h"
#include "tracker/balls/ball_finder.h"
#include "tracker/balls/constellation_pose.h"
#include "tracker/body_estimate.h"
#include "tracker/camera_encoding.h"
#include "tracker/detector.h"
#include "tracker/family.h"
#include "tracker/marker_light.h"

namespace limn::apps {
namespace {

// Images in the order of the rig's cameras; empty where none was given.
using Frames = std::vector<cv::Mat>;

// A camera file without a size (OpenCV's calibration sometimes writes none) takes the size of its image.
Status accept(const cv::Mat& image, const std::string& file, Imager* camera) {
  if (camera->width == 0 && camera->height == 0) {
    camera->width = image.cols;
    camera->height = image.rows;
  }
  if (image.cols == camera->width && image.rows == camera->height) return {};
  return error("{}: expected an image of {}'s size {}x{}, found {}x{}. Give the image as the camera took it.",
               file, camera->name, camera->width, camera->height, image.cols, image.rows);
}

Result<Frames> read_frames(const std::vector<std::string>& arguments, Rig* rig) {
  Frames frames(rig->cameras.size());
  for (const std::string& argument : arguments) {
    const auto equals = argument.find('=');
    if (equals == std::string::npos) {
      return usage_error("--frame {}: expected CAMERA=IMAGE, such as camera0=photo.png.", argument);
    }
    const std::string name = argument.substr(0, equals), file = argument.substr(equals + 1);
    Imager* camera = find_named(rig->cameras, name);
    if (!camera) {
      return usage_error("--frame {}: expected a camera of the rig ({}), found '{}'.", argument,
                         joined_names(rig->cameras), name);
    }
    LIMN_TRY(cv::Mat image, read_image(file, {.used_bits = k_found_in_image}));
    LIMN_TRY_STATUS(accept(image, file, camera));
    frames[static_cast<std::size_t>(camera - rig->cameras.data())] = std::move(image);
  }
  return frames;
}

Result<std::vector<Track>> find_bodies(const scene::Scene& scene, const Rig& rig, const Frames& frames) {
  const std::vector<Body> bodies = scene::bodies(scene);
  const std::vector<std::string> names = tracker::families_of(bodies);
  LIMN_TRY(const tracker::Families families, tracker::Families::load(names, scene.folder));
  const std::vector<Constellation> constellations = scene::constellations(scene);
  std::vector<std::vector<tracker::Detection>> detections(frames.size());
  std::vector<std::vector<tracker::Ball>> balls(frames.size());
  std::vector<tracker::View> views;
  std::vector<tracker::BallView> ball_views;
  std::size_t marker_count = 0;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (frames[i].empty()) continue;
    const tracker::Encoding encoding = tracker::encoding_of(rig, rig.cameras[i]);
    tracker::Detector detector(families, {.encoding = encoding});
    detections[i] = detector.detect(to_grey(frames[i]), &rig.cameras[i].lens);
    if (!constellations.empty())
      balls[i] = tracker::BallFinder({.encoding = encoding}).find(to_grey(frames[i]), rig.cameras[i].lens);
    marker_count += detections[i].size();
    views.push_back({&rig.cameras[i], detections[i]});
    ball_views.push_back({&rig.cameras[i], balls[i]});
  }
  std::vector<Track> tracks = tracker::observed(bodies, views, Stamp{});
  std::ranges::move(tracker::observed(constellations, ball_views, Stamp{}), std::back_inserter(tracks));
  if (tracks.empty()) {
    return error(
        "frames: expected a marker of the scene's {} bodies, found {} markers of its families and none that "
        "the scene names. Check light, focus and marker names.",
        bodies.size() + constellations.size(), marker_count);
  }
  return tracks;
}

void report_missing(const scene::Scene& scene, const scene::PosedScene& posed) {
  if (scene.prototype && !posed.world_from_prototype) {
    log_warning("render: the prototype was not found; parts are drawn without it");
  }
  for (const scene::Slot& slot : scene.slots) {
    const bool placed = std::any_of(posed.parts.begin(), posed.parts.end(),
                                    [&](const scene::PosedPart& p) { return p.slot == slot.name; });
    if (!placed) log_warning("render: slot '{}' was not found; its part is not drawn", slot.name);
  }
}

// Warns about input whose images are surely not intended.
void report_odd(const scene::Scene& scene,
                const Rig& rig,
                const scene::PosedScene& posed,
                const Imager& viewer) {
  if (!scene.prototype || !posed.world_from_prototype) return;
  const std::vector<Eigen::Vector3f>& points = scene.prototype->mesh.positions;
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3f& p : points) box.extend(p.cast<double>());
  const Eigen::Vector3d p_eye =
      (viewer.imager_from_world * *posed.world_from_prototype).inverse().translation;
  if (box.contains(p_eye))
    log_warning("render: the viewpoint is inside the prototype's bounds; view parts will look wrong");
  const auto sees = [&](const Imager& imager) {
    const Pose imager_from_prototype = imager.imager_from_world * *posed.world_from_prototype;
    return std::any_of(points.begin(), points.end(), [&](const Eigen::Vector3f& p) {
      const Eigen::Vector3d at = imager_from_prototype * p.cast<double>();
      const auto px = at.z() > 0 ? imager.lens.project(at) : std::nullopt;
      return px && imager.contains(*px);
    });
  };
  if (!sees(viewer)) log_warning("render: the viewer does not see the prototype");
  for (const Imager& projector : rig.projectors)
    if (!sees(projector))
      log_warning("render: {} does not reach the prototype; its image is black", projector.name);
}

Result<scene::PosedScene> place(const RenderOptions& options,
                                const scene::Scene& scene,
                                const Rig& rig,
                                const Frames& frames) {
  if (!options.poses.empty()) return scene::load_poses(options.poses, scene);
  LIMN_TRY(const std::vector<Track> tracks, find_bodies(scene, rig, frames));
  for (const Track& track : tracks) {
    print_out("{}: {} marker{}, {:.2f} px\n", track.body, track.marker_count,
              track.marker_count == 1 ? "" : "s", track.rms_px);
  }
  return scene::posed(scene, tracks);
}

// Error: the poses name a variant that cannot be loaded, or no variant where the first one cannot be.
Status check_posed(const std::filesystem::path& poses,
                   std::span<const scene::SkippedVariant> skipped_variants) {
  LIMN_TRY(const Config config, Config::load(poses, ""));
  const auto slots = config.root().find("slots");
  for (const scene::SkippedVariant& skipped : skipped_variants) {
    const auto slot = slots ? slots->find(skipped.slot) : std::nullopt;
    const auto variant = slot ? slot->find("variant") : std::nullopt;
    const bool is_shown =
        slot && (variant ? variant->is_string() && variant->text() == skipped.variant : skipped.is_first);
    if (is_shown) return error("{}", skipped.why);
  }
  return {};
}

// Error: a slot that was found would show a variant that cannot be loaded.
Status check_placed(const scene::Scene& scene,
                    const scene::PosedScene& posed,
                    std::span<const scene::SkippedVariant> skipped_variants) {
  for (const scene::SkippedVariant& skipped : skipped_variants) {
    const bool is_placed =
        std::any_of(posed.parts.begin(), posed.parts.end(),
                    [&](const scene::PosedPart& part) { return part.slot == skipped.slot; });
    if (skipped.is_first && (is_placed || !scene.find_slot(skipped.slot))) return error("{}", skipped.why);
  }
  return {};
}

// The only viewer, or one at the viewpoint that several share.
Result<Imager> viewer_of_files(std::span<const std::filesystem::path> files,
                               const scene::Scene& scene,
                               const scene::PosedScene& posed,
                               const Eigen::Vector3d& d_up_world) {
  std::vector<scene::Viewpoint> eyes;
  for (const std::filesystem::path& file : files) {
    LIMN_TRY(const Imager viewer, scene::load_viewer(file));
    if (files.size() == 1) return viewer;
    eyes.push_back({fmt::format("viewer{}", eyes.size()), viewer.imager_from_world.inverse().translation, 1});
  }
  const auto p_middle = scene::middle_of(scene, posed);
  if (!p_middle) {
    return error(
        "--viewer: expected one viewer, because neither the prototype nor a part was found that {} viewers "
        "could look at together.",
        files.size());
  }
  const scene::SharedViewpoint shared = scene::updated_viewpoint({}, eyes, *p_middle, 0);
  for (const scene::SharedViewpoint::Share& share : shared.shares)
    print_out("{}: {:.0f} % of the shared viewpoint{}\n", share.viewer, 100 * share.share,
              share.viewer == shared.leader ? ", leads" : "");
  const auto viewer = scene::viewer_at(*shared.p_world(), scene, posed, d_up_world);
  if (!viewer)
    return error("--viewer: expected viewers at a distance from what they look at, found it in its middle.");
  return *viewer;
}

Result<Imager> choose_viewer(const RenderOptions& options,
                             const scene::Scene& scene,
                             const scene::PosedScene& posed,
                             const Rig& rig) {
  const Eigen::Vector3d d_up_world =
      rig.cameras.empty() ? Eigen::Vector3d(0, -1, 0)
                          : rig.cameras[0].imager_from_world.rotation.inverse() * Eigen::Vector3d(0, -1, 0);
  if (!options.viewers.empty()) return viewer_of_files(options.viewers, scene, posed, d_up_world);
  if (const auto viewer = scene::viewer_of(scene, posed, d_up_world)) return *viewer;
  if (rig.cameras.empty()) {
    return usage_error(
        "--viewer: expected a viewer file, because neither the scene has a viewer nor the rig a camera.");
  }
  if (!scene.viewers.empty())
    log_warning("render: none of the scene's viewers is visible; {} is used instead", rig.cameras[0].name);
  return rig.cameras[0];
}

Status write_coverage(const std::vector<projector::PartCoverage>& parts,
                      const Imager& viewer,
                      nlohmann::ordered_json light,
                      const std::filesystem::path& out) {
  nlohmann::ordered_json json;
  json["schema"] = "limn.coverage/1";
  json["viewer"] = {{"name", viewer.name}, {"size", {viewer.width, viewer.height}}};
  json["light"] = std::move(light);
  json["parts"] = nlohmann::ordered_json::array();
  for (const projector::PartCoverage& part : parts) {
    const std::string mask = "mask-" + part.slot + ".png";
    json["parts"].push_back({{"part", part.slot},
                             {"variant", part.variant},
                             {"viewer_pixels", part.viewer_pixels},
                             {"on_surface", part.on_surface_share},
                             {"off_surface", part.off_surface_share},
                             {"mask", mask}});
    LIMN_TRY_STATUS(write_png(out / mask, part.mask));
    print_out("{} ({}): {} viewer pixels, {:.1f} % by light, {:.1f} % on the screen\n", part.slot,
              part.variant, part.viewer_pixels, 100 * part.on_surface_share, 100 * part.off_surface_share);
  }
  return write_file(out / "coverage.json", json_text(json, 2) + "\n");
}

// The image without lens distortion: the same focal length, the principal point in the middle.
cv::Mat undistorted(const cv::Mat& image, const Imager& imager) {
  cv::Mat map(image.size(), CV_32FC2);
  for (int row = 0; row < map.rows; ++row)
    for (int column = 0; column < map.cols; ++column) {
      const Eigen::Vector3d d((column - 0.5 * (map.cols - 1)) / imager.lens.fx(),
                              (row - 0.5 * (map.rows - 1)) / imager.lens.fy(), 1);
      const auto px = imager.lens.project(d);
      map.at<cv::Vec2f>(row, column) =
          px ? cv::Vec2f(static_cast<float>(px->x()), static_cast<float>(px->y())) : cv::Vec2f(-10, -10);
    }
  cv::Mat out;
  cv::remap(image, out, map, cv::noArray(), cv::INTER_LINEAR, cv::BORDER_CONSTANT);
  return out;
}

// With frames: the cameras that have one. With poses alone: all cameras, over black.
Status write_composites(projector::Renderer* renderer,
                        const RenderOptions& options,
                        const Rig& rig,
                        const Frames& frames,
                        const scene::PosedScene& posed) {
  for (std::size_t i = 0; i < rig.cameras.size(); ++i) {
    const Imager& camera = rig.cameras[i];
    cv::Mat behind = frames[i];
    if (behind.empty() && options.frames.empty() && camera.width > 0) {
      behind = cv::Mat::zeros(camera.height, camera.width, CV_8UC3);
    }
    if (behind.empty()) continue;
    const auto file = options.out / ("composite-" + camera.name + ".png");
    const cv::Mat image = renderer->composite(i, behind, posed, options.composite);
    LIMN_TRY_STATUS(write_png(file, options.undistorted ? undistorted(image, camera) : image));
  }
  return {};
}

// The view of a virtual camera, or of two on a line through its position, the left one's image on the left.
Status write_view(const RenderOptions& options,
                  const scene::PosedScene& posed,
                  projector::Renderer* renderer) {
  LIMN_TRY(const Imager camera, scene::load_viewer(options.view));
  const cv::Scalar background(40, 36, 34);  // a dark room
  if (!options.stereo_mm)
    return write_png(options.out / "view.png", renderer->view(camera, posed, background));
  cv::Mat eyes[2];
  for (int eye = 0; eye < 2; ++eye) {
    Imager at_eye = camera;  // moves the camera: imager_from_world's translation has the opposite sign
    at_eye.imager_from_world.translation.x() += (eye == 0 ? 0.5 : -0.5) * 1e-3 * *options.stereo_mm;
    eyes[eye] = renderer->view(at_eye, posed, background);
  }
  cv::Mat both;
  cv::hconcat(eyes, 2, both);
  return write_png(options.out / "view.png", both);
}

// The images that are written must not replace the frames.
Status check_images(const RenderOptions& options, const Rig& rig, const scene::Scene& scene) {
  std::vector<NamedFile> written, frames;
  const auto add = [&](const std::string& name) {
    written.push_back({"--out", options.out / (name + ".png")});
  };
  for (const Imager& camera : rig.cameras) add("composite-" + camera.name);
  for (const Imager& projector : rig.projectors) {
    add("projector-" + projector.name);
    add("clipped-" + projector.name);
  }
  for (const scene::Slot& slot : scene.slots) add("mask-" + slot.name);
  add("view");
  for (const std::string& frame : options.frames)
    frames.push_back({"--frame", frame.substr(frame.find('=') + 1)});
  return check_outputs(written, frames);
}

}  // namespace

Status run_render(const RenderOptions& options) {
  if (options.frames.empty() && options.poses.empty()) {
    return usage_error(
        "expected --frame CAMERA=IMAGE or --poses POSES.json to place the scene, found neither.");
  }
  if (options.stereo_mm && options.view.empty())
    return usage_error(
        "--stereo: expected --view VIEWER.json with it, which places the cameras, found none.");
  if (options.stereo_mm && !(*options.stereo_mm > 0 && *options.stereo_mm < 1000)) {
    return usage_error(
        "--stereo: expected a distance of two cameras in millimetres (people's eyes: about 63), found {}.",
        *options.stereo_mm);
  }
  LIMN_TRY(Rig rig, load_rig(options.rig));
  std::vector<scene::SkippedVariant> skipped_variants;
  LIMN_TRY(const scene::Scene scene, scene::load_scene(options.scene, &skipped_variants));
  if (!options.poses.empty()) LIMN_TRY_STATUS(check_posed(options.poses, skipped_variants));
  LIMN_TRY_STATUS(check_images(options, rig, scene));
  LIMN_TRY(const Frames frames, read_frames(options.frames, &rig));
  LIMN_TRY(const scene::PosedScene posed, place(options, scene, rig, frames));
  if (options.poses.empty()) LIMN_TRY_STATUS(check_placed(scene, posed, skipped_variants));
  for (const scene::SkippedVariant& skipped : skipped_variants)
    log_warning("render: {}", scene::to_text(skipped));
  LIMN_TRY(const Imager viewer, choose_viewer(options, scene, posed, rig));
  report_missing(scene, posed);
  report_odd(scene, rig, posed, viewer);
  LIMN_TRY_STATUS(make_folder(options.out));

  LIMN_TRY(const device::GlContext context, device::GlContext::create());
  log_info("render: {}", context.description());
  LIMN_TRY(projector::Renderer renderer, projector::Renderer::create(scene, rig));
  LIMN_TRY_STATUS(set_light(options.light, options.rig, rig, scene, posed, &renderer));
  if (options.contact_shadow) LIMN_TRY_STATUS(renderer.set_contact_shadow(&scene));
  const bool is_balanced =
      options.light.compensation != projector::Compensation::none || options.light.even_black;
  const std::vector<Body> bodies = scene::bodies(scene);
  const std::vector<Track> tracks = scene::tracks_of(scene, posed);
  for (std::size_t i = 0; i < rig.projectors.size(); ++i) {
    const auto file = options.out / ("projector-" + rig.projectors[i].name + ".png");
    const cv::Mat image = renderer.projector_image(i, posed, viewer);
    const cv::Mat mask = tracker::marker_mask(rig.projectors[i], bodies, tracks);
    LIMN_TRY_STATUS(write_png(file, tracker::with_marker_light(image, mask, options.marker_light)));
    if (is_balanced)
      LIMN_TRY_STATUS(
          write_png(options.out / ("clipped-" + rig.projectors[i].name + ".png"), renderer.clipped(i)));
  }
  LIMN_TRY_STATUS(write_composites(&renderer, options, rig, frames, posed));
  if (!options.view.empty()) LIMN_TRY_STATUS(write_view(options, posed, &renderer));
  const std::vector<projector::PartCoverage> coverage = renderer.coverage(posed, viewer);
  for (const projector::PartCoverage& part : coverage)
    if (part.viewer_pixels == 0)
      log_warning(
          "render: the viewer sees nothing of '{}': the prototype hides it, or the viewer is behind it or "
          "looks elsewhere",
          part.slot);
  return write_coverage(coverage, viewer, light_report(options.light, rig, renderer), options.out);
}

}  // namespace limn::apps
