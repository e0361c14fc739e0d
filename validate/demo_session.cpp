#include "validate/demo_session.h"

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "core/data_folder.h"
#include "core/image_io.h"
#include "core/json_text.h"
#include "core/log.h"
#include "projector/renderer.h"
#include "sim/sensor_model.h"
#include "sim/trace.h"
#include "sim/truth.h"
#include "sim/virtual_rig.h"
#include "tracker/body_estimate.h"
#include "tracker/detector.h"
#include "tracker/marker_image.h"
#include "validate/demo_clay.h"
#include "validate/demo_painting.h"
#include "validate/demo_room.h"
#include "validate/light_chain.h"
#include "validate/metrics.h"
#include "wizard/capture/capture_plan.h"
#include "wizard/capture/virtual_capture.h"
#include "wizard/measure/solve_captures.h"

namespace limn::validate {
namespace {

namespace fs = std::filesystem;

constexpr int k_viewer_width = 1280, k_viewer_height = 960;
constexpr double k_viewer_fov_deg = 40;

constexpr double k_turn_deg = 40;
const Eigen::Vector3d k_move_m = Eigen::Vector3d(0.12, 0.08, 0.04).normalized() * 0.15;

// The limits of the first complete session.
constexpr double k_max_registration_mm = 0.5;
constexpr double k_max_composite_px = 1.0;
constexpr double k_min_mask_iou = 0.97;
constexpr double k_max_held_out_px = 0.40;

// Where the designer stands, in the door's frame (x right, y up, z towards the viewer): first behind the
// camera, then two steps to the left.
const Eigen::Vector3d k_p_designer(0.03, 0.32, 1.62);
const Eigen::Vector3d k_p_designer_left(-0.75, 0.35, 1.15);
const Eigen::Vector3d k_p_gaze(-0.04, 0.02, 0.0);

// The seconds that each step takes, in order.
class PhaseTimes {
 public:
  template <class Work>
  auto time(const std::string& name, Work work) {
    const auto begun = std::chrono::steady_clock::now();
    log_info("{} ...", name);
    auto result = work();
    add(name, seconds_between(begun, std::chrono::steady_clock::now()));
    return result;
  }
  void add(const std::string& name, double seconds) {
    for (auto& [known, sum] : seconds_) {
      if (known == name) {
        sum += seconds;
        return;
      }
    }
    seconds_.emplace_back(name, seconds);
  }
  const std::vector<std::pair<std::string, double>>& seconds() const { return seconds_; }

 private:
  std::vector<std::pair<std::string, double>> seconds_;
};

// What the session knows (never the ground truth), and the renderer that it draws with.
struct DemoSession {
  Rig rig;
  double held_out_px;  // held-out error of its calibration
  scene::Scene scene;
  std::vector<Body> bodies;
  tracker::Detector detector;
  projector::Renderer renderer;
};

// Where everything is at a moment according to the tracker, and what is shown there.
struct Moment {
  cv::Mat photograph;  // the room without projected light
  int markers = 0;
  int false_markers = 0;                       // detected markers that are not in the room
  std::vector<tracker::Detection> detections;  // in camera 0
  std::vector<Track> tracks;
  scene::PosedScene posed;
};

Imager designer_viewer(const Pose& world_from_prototype, const Eigen::Vector3d& p_viewer = k_p_designer) {
  const Pose viewer_from_prototype = looking_at(p_viewer, k_p_gaze, Eigen::Vector3d::UnitY());
  return viewer_imager(world_from_prototype * viewer_from_prototype.inverse(), k_viewer_width,
                       k_viewer_height, k_viewer_fov_deg);
}

Result<cv::Mat> photograph(sim::VirtualRig* room) {
  LIMN_TRY(const Frame frame, room->camera(0).next());
  return frame.image;
}

// Photographs the room without projected light and finds everything in the image.
Result<Moment> track_moment(DemoSession* session,
                            sim::VirtualRig* room,
                            const std::vector<std::string>& variants) {
  room->darken();
  Moment moment;
  LIMN_TRY(const Frame frame, room->camera(0).next());
  moment.photograph = frame.image;
  const Imager& camera = session->rig.cameras.at(0);
  moment.detections = session->detector.detect(to_grey(frame.image), &camera.lens);
  const auto& detections = moment.detections;
  moment.markers = static_cast<int>(detections.size());
  moment.false_markers =
      static_cast<int>(std::count_if(detections.begin(), detections.end(), [&](const auto& detection) {
        return !sim::world_from_marker(room->world(), detection.marker);
      }));
  const tracker::View view{&camera, detections};
  moment.tracks = tracker::observed(session->bodies, std::span(&view, 1), frame.captured_at);
  moment.posed = scene::posed(session->scene, moment.tracks, variants);
  if (!moment.posed.world_from_prototype || moment.posed.parts.size() != session->scene.slots.size()) {
    return error(
        "the simulated photograph: expected the prototype and {} slots, found {} markers that place {}.",
        session->scene.slots.size(), detections.size(), moment.posed.parts.size());
  }
  return moment;
}

std::vector<cv::Mat> drawn(projector::Renderer* renderer,
                           std::size_t projector_count,
                           const scene::PosedScene& posed,
                           const Imager& viewer) {
  std::vector<cv::Mat> images;
  for (std::size_t i = 0; i < projector_count; ++i) {
    images.push_back(renderer->projector_image(i, posed, viewer));
  }
  return images;
}

// A photograph of the room while these images are projected.
Result<cv::Mat> shone(sim::VirtualRig* room, const std::vector<cv::Mat>& images) {
  for (std::size_t i = 0; i < images.size(); ++i) {
    if (auto shown_at = room->projector(static_cast<int>(i)).show(images[i]); !shown_at)
      return shown_at.error();
  }
  return photograph(room);
}

// The room from another viewpoint while these images are projected: a simulated photograph.
cv::Mat photographed_from(const sim::World& world, const Imager& viewer, const std::vector<cv::Mat>& images) {
  sim::World world_of_viewer = world;
  world_of_viewer.rig.cameras = {viewer};
  return sim::photograph(world_of_viewer, sim::trace(world_of_viewer, 0), images, world.seed);
}

// The masks of all parts in one image; where they overlap, the later slot's.
cv::Mat merged_masks(const std::vector<projector::PartCoverage>& coverage, cv::Size size) {
  cv::Mat merged(size, CV_8U, cv::Scalar(0));
  for (const auto& part : coverage) part.mask.copyTo(merged, part.mask != 0);
  return merged;
}

cv::Mat merged_true_masks(const sim::Truth& truth, const scene::Scene& scene, const Imager& viewer) {
  cv::Mat merged(viewer.height, viewer.width, CV_8U, cv::Scalar(0));
  for (const scene::Slot& slot : scene.slots) {
    const cv::Mat mask = truth.part_mask(viewer, slot.name);
    mask.copyTo(merged, mask != 0);
  }
  return merged;
}

// Distance of the first part's outline in the camera's image from the ray-traced one, at twice the
// resolution.
double composite_error_px(DemoSession* session,
                          const sim::World& world,
                          const sim::Truth& truth,
                          const Moment& moment) {
  const auto doubled = [](const Imager& camera) {
    return resized(camera, 2 * camera.width, 2 * camera.height).value();
  };
  const auto coverage = session->renderer.coverage(moment.posed, doubled(session->rig.cameras[0]));
  const cv::Mat true_mask = truth.part_mask(doubled(world.rig.cameras[0]), coverage.at(0).slot);
  return outline_distance_px(coverage.at(0).mask, true_mask) / 2;
}

struct JudgedDots {
  TargetDots dots;
  Registration registration;
};

// The door with every dot in the colour of its error, over a photograph.
cv::Mat error_map(const cv::Mat& photograph, const sim::World& world, const JudgedDots& judged) {
  const auto& [dots, found] = judged;
  cv::Mat map = photograph / 3;
  for (std::size_t i = 0; i < dots.p_targets.size(); ++i) {
    const auto px = world.rig.cameras[0].project(world.world_from_prototype * dots.p_targets[i]);
    if (!px) continue;
    const double share =
        std::min(1.0, found.errors_mm[i] / k_max_registration_mm);  // green to red at the limit
    const cv::Scalar colour(40, 230 * std::min(1.0, 2 - 2 * share), 230 * std::min(1.0, 2 * share));
    cv::circle(map, cv::Point(cvRound(px->x()), cvRound(px->y())), 3, colour, cv::FILLED, cv::LINE_AA);
  }
  return map;
}

// One place of the door: its true pose, what the tracker finds, and how well the light fits then.
struct Place {
  std::string name;  // key in demo.json
  Moment moment;
  JudgedDots judged;
  LightChain chain;
};

Result<Place> judge_place(const std::string& name,
                          const Pose& world_from_prototype,
                          DemoSession* session,
                          sim::VirtualRig* room,
                          PhaseTimes* phases) {
  room->move("prototype", world_from_prototype);
  LIMN_TRY(Moment moment, phases->time("track", [&] { return track_moment(session, room, {}); }));
  const sim::World& world = room->world();
  TargetDots dots = phases->time("judge", [&] { return dots_on_prototype(world); });
  LIMN_TRY(Registration registration, phases->time("judge", [&] {
    return judge_light(session->scene, session->rig, world, dots, *moment.posed.world_from_prototype);
  }));
  LIMN_TRY(const LightChain chain, phases->time("judge", [&] {
    return light_chain(session->scene, session->rig, world, dots, session->bodies, moment.detections);
  }));
  return Place{name, std::move(moment), {std::move(dots), std::move(registration)}, chain};
}

// The door in place, moved by 150 mm, and turned by 40°.
std::vector<std::pair<std::string, Pose>> places_of(const Pose& world_from_prototype) {
  const Eigen::Vector3d d_up = Eigen::Vector3d::UnitZ();
  const Pose turn(exp_rotation(k_turn_deg * std::numbers::pi / 180 * d_up), Eigen::Vector3d::Zero());
  Pose moved = world_from_prototype, turned = world_from_prototype;
  moved.translation += k_move_m;
  turned.rotation = turn.rotation * turned.rotation;
  return {{"in_place", world_from_prototype}, {"moved", moved}, {"turned", turned}};
}

// Captures and calibrates, and sets up the session with the calibrated rig.
Result<DemoSession> calibrate(const fs::path& out,
                              sim::VirtualRig* room,
                              PhaseTimes* phases,
                              bool keep_captures) {
  const fs::path captures = out / "demo-captures", rig_folder = out / "rig";
  std::error_code ignored;
  fs::remove_all(captures, ignored);
  LIMN_TRY(const fs::path plan_file, data_file("config/plans/studio.json"));
  LIMN_TRY(const wizard::Plan plan, wizard::load_plan(plan_file));
  LIMN_TRY_STATUS(phases->time("capture", [&] { return wizard::capture_virtually(plan, room, captures); }));
  wizard::SolveCommandOptions solving;
  solving.captures = captures;
  solving.out = rig_folder;
  LIMN_TRY(const calib::Report report,
           phases->time("solve", [&] { return wizard::solve_captures(solving); }));
  if (!keep_captures) fs::remove_all(captures, ignored);
  const Rig& rig = report.solution.rig;
  scene::Scene scene = room->world().scene.value();
  auto bodies = scene::bodies(scene);
  const auto names = tracker::families_of(bodies);
  LIMN_TRY(tracker::Families families, tracker::Families::load(names));
  LIMN_TRY(projector::Renderer renderer, projector::Renderer::create(scene, rig));
  return DemoSession{rig,
                     report.assessment.held_out.rms_px,
                     std::move(scene),
                     std::move(bodies),
                     tracker::Detector(std::move(families)),
                     std::move(renderer)};
}

// What the demo measured.
struct DemoMeasurement {
  double held_out_px = 0;
  std::vector<Place> places;
  double composite_px = 0;
  double mask_iou = 0;
  std::vector<std::pair<std::string, double>> seconds;
};

std::string readable(std::string name) {
  std::replace(name.begin(), name.end(), '_', ' ');
  return name;
}

std::vector<DemoRow> rows_of(const DemoMeasurement& measured) {
  std::vector<DemoRow> rows;
  const auto at_most = [&](const std::string& what, double value, const char* unit, double limit) {
    rows.push_back({what, fmt::format("{:.3f} {}", value, unit), fmt::format("at most {:g} {}", limit, unit),
                    value <= limit});
  };
  at_most("calibration, held-out pose", measured.held_out_px, "px", k_max_held_out_px);
  for (const Place& place : measured.places) {
    const Registration& found = place.judged.registration;
    at_most(fmt::format("registration {}, RMS of {} points", readable(place.name), found.points),
            found.rms_mm, "mm", k_max_registration_mm);
    rows.push_back({fmt::format("registration {}, 95 % quantile", readable(place.name)),
                    fmt::format("{:.3f} mm", found.p95_mm), "", true});
    rows.push_back({fmt::format("registration {}, made of", readable(place.name)),
                    fmt::format("calibration {:.3f}, marker corners {:.3f}, pose {:.3f}, rendering {:.3f} mm",
                                place.chain.calibration_mm, place.chain.marker_corners_mm,
                                place.chain.prototype_pose_mm, place.chain.rendering_mm),
                    "", true});
  }
  int markers = 0, false_markers = 0;
  for (const Place& place : measured.places) {
    markers += place.moment.markers;
    false_markers += place.moment.false_markers;
  }
  rows.push_back({fmt::format("false markers among {}", markers), fmt::format("{}", false_markers), "none",
                  false_markers == 0});
  at_most("composite, outline of the mirror, RMS", measured.composite_px, "px", k_max_composite_px);
  rows.push_back({"on/off-surface mask, IoU", fmt::format("{:.4f}", measured.mask_iou),
                  fmt::format("at least {}", k_min_mask_iou), measured.mask_iou >= k_min_mask_iou});
  double total = 0;
  for (const auto& [name, seconds] : measured.seconds) {
    rows.push_back({"time: " + name, fmt::format("{:.1f} s", seconds), "", true});
    total += seconds;
  }
  rows.push_back({"time: all", fmt::format("{:.1f} s", total), "", true});
  return rows;
}

nlohmann::ordered_json json_of(const DemoMeasurement& measured) {
  nlohmann::ordered_json json = {{"held_out_px", measured.held_out_px}};
  for (const Place& place : measured.places) {
    const Registration& found = place.judged.registration;
    json["registration_mm"][place.name] = {
        {"rms", found.rms_mm}, {"p95", found.p95_mm}, {"points", found.points}, {"unlit", found.unlit}};
    json["chain_mm"][place.name] = {{"calibration", place.chain.calibration_mm},
                                    {"marker_corners", place.chain.marker_corners_mm},
                                    {"prototype_pose", place.chain.prototype_pose_mm},
                                    {"rendering", place.chain.rendering_mm}};
    json["markers"][place.name] = {{"found", place.moment.markers}, {"false", place.moment.false_markers}};
  }
  json["composite_px"] = measured.composite_px;
  json["mask_iou"] = measured.mask_iou;
  for (const auto& [name, seconds] : measured.seconds) json["seconds"][name] = seconds;
  return json;
}

// Images of the door in a dim room: finishes, lines, a section, and the deviation of its clay.
Result<std::vector<DemoImage>> dim_room_images(const fs::path& out,
                                               const DemoSession& session,
                                               const sim::World& world,
                                               const Moment& moment) {
  scene::Scene scene = session.scene;
  scene.room_image = studio(*moment.posed.world_from_prototype);
  LIMN_TRY_STATUS(add_clay_work(&scene));
  LIMN_TRY(projector::Renderer renderer, projector::Renderer::create(scene, session.rig));
  LIMN_TRY_STATUS(renderer.set_light({.compensation = projector::Compensation::geometry}));
  const DemoSubject subject{&scene,    &session.rig, &world,
                            &renderer, moment.posed, session::seen_markers(session.bodies, moment.tracks)};
  const DimRoom room(world);
  std::vector<DemoImage> images = painted_images(subject, room);
  const auto add = [&](std::vector<DemoImage> some) {
    for (DemoImage& image : some) images.push_back(std::move(image));
  };
  add(line_images(subject, room));
  add(cut_images(subject, room));
  const fs::path scan = out / "demo-scan";
  std::error_code ignored;
  fs::remove_all(scan, ignored);  // A demo that was killed left it.
  auto compared = deviation_images(subject, scan);
  fs::remove_all(scan, ignored);  // only the images made of it are kept
  if (!compared) return compared.error();
  add(std::move(*compared));
  return images;
}

// Images for people: what the renderer draws and what the simulator photographs.
Result<std::vector<DemoImage>> session_images(const fs::path& out,
                                              DemoSession* session,
                                              sim::VirtualRig* room,
                                              const Place& place) {
  const scene::PosedScene& posed = place.moment.posed;
  const Pose& world_from_prototype = *posed.world_from_prototype;
  const Imager viewer = designer_viewer(world_from_prototype);
  const Imager viewer_left = designer_viewer(world_from_prototype, k_p_designer_left);
  const Imager true_viewer_left = designer_viewer(room->world().world_from_prototype, k_p_designer_left);
  const std::size_t projector_count = session->rig.projectors.size();
  projector::Renderer& renderer = session->renderer;

  const std::string other_variant = session->scene.slots.at(0).variants.at(1).name;
  LIMN_TRY(const Moment swapped, track_moment(session, room, {other_variant}));
  LIMN_TRY_STATUS(renderer.set_contact_shadow(&session->scene));
  room->camera_effects(0).srgb = true;  // sRGB for people; measurements use linear images
  LIMN_TRY(const cv::Mat unlit, shone(room, {}));
  const auto images = drawn(&renderer, projector_count, posed, viewer);
  LIMN_TRY(const cv::Mat illuminated, shone(room, images));
  const auto images_swapped = drawn(&renderer, projector_count, swapped.posed, viewer);
  LIMN_TRY(const cv::Mat illuminated_swapped, shone(room, images_swapped));
  const auto images_left = drawn(&renderer, projector_count, posed, viewer_left);

  using projector::Composite;
  std::vector<DemoImage> demo_images = {
      {"unlit", "The room without projected light",
       "A simulated photograph: a clay door, its markers, the room's own light.", unlit},
      {"lit", "Lit", "The same with the projectors' light: trim line and mirror are projected onto the door.",
       illuminated},
      {"composite", "On the screen",
       "Camera image plus what light cannot show: the part of the mirror beyond the door.",
       renderer.composite(0, illuminated, posed, Composite::rest)},
      {"composite-full", "The whole parts on the screen",
       "Drawn over the photograph without projected light.",
       renderer.composite(0, unlit, posed, Composite::full)}};
  for (std::size_t i = 0; i < projector_count; ++i) {
    const std::string& name = session->rig.projectors[i].name;
    demo_images.push_back({name, name, "The image for this projector.", images[i]});
  }
  demo_images.push_back(
      {"error-map", "Error map",
       fmt::format(
           "Each dot is projected light, measured by the ray tracer: green is 0, red is {} mm or more.",
           k_max_registration_mm),
       error_map(unlit, room->world(), place.judged)});
  demo_images.push_back({"composite-swapped", "Another mirror",
                         "After the variant was changed, light and screen show the new mirror.",
                         renderer.composite(0, illuminated_swapped, swapped.posed, Composite::rest)});
  demo_images.push_back(
      {"from-the-left", "From the left",
       "The designer has walked to the left: the mirror is projected for the new viewpoint and "
       "seems to stand out from the door.",
       photographed_from(room->world(), true_viewer_left, images_left)});
  demo_images.push_back({"mask", "Mask",
                         "From the designer's viewpoint: white is projected, grey is left to the screen.",
                         merged_masks(renderer.coverage(posed, viewer), {viewer.width, viewer.height})});
  LIMN_TRY(std::vector<DemoImage> dim, dim_room_images(out, *session, room->world(), place.moment));
  for (DemoImage& image : dim) demo_images.push_back(std::move(image));
  return demo_images;
}

// Overlap of the masks from the designer's viewpoint with the ray-traced ones.
double mask_iou(DemoSession* session,
                const sim::World& world,
                const sim::Truth& truth,
                const Moment& moment) {
  const Imager viewer = designer_viewer(*moment.posed.world_from_prototype);
  const cv::Mat found =
      merged_masks(session->renderer.coverage(moment.posed, viewer), {viewer.width, viewer.height});
  const Imager true_viewer = designer_viewer(world.world_from_prototype);
  return label_iou(found, merged_true_masks(truth, session->scene, true_viewer));
}

}  // namespace

Result<DemoResult> play_demo(const fs::path& out, bool keep_captures) {
  LIMN_TRY(const fs::path world_file, data_file("config/worlds/studio.json"));
  LIMN_TRY(sim::World world, sim::load_world(world_file, tracker::marker_image));
  sim::VirtualRig room(std::move(world));
  PhaseTimes phases;
  LIMN_TRY(DemoSession session, calibrate(out, &room, &phases, keep_captures));
  DemoMeasurement measured;
  measured.held_out_px = session.held_out_px;
  const Pose in_place = room.world().world_from_prototype;
  for (const auto& [name, world_from_prototype] : places_of(in_place)) {
    LIMN_TRY(Place place, judge_place(name, world_from_prototype, &session, &room, &phases));
    measured.places.push_back(std::move(place));
  }
  room.move("prototype", in_place);
  const Moment& moment = measured.places.front().moment;
  const sim::World& truth_world = room.world();
  const sim::Truth truth(truth_world, sim::true_poses(truth_world));
  measured.composite_px =
      phases.time("judge", [&] { return composite_error_px(&session, truth_world, truth, moment); });
  measured.mask_iou = phases.time("judge", [&] { return mask_iou(&session, truth_world, truth, moment); });
  LIMN_TRY(auto images, phases.time("render", [&] {
    return session_images(out, &session, &room, measured.places.front());
  }));
  measured.seconds = phases.seconds();
  return DemoResult{rows_of(measured), json_text(json_of(measured), 2) + "\n", std::move(images)};
}

}  // namespace limn::validate
