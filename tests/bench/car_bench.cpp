#include "tests/bench/car_bench.h"

#include <fmt/core.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>
#include <numbers>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <random>

#include "calib/capture.h"
#include "core/file.h"
#include "core/least_squares.h"
#include "core/linear_algebra.h"
#include "sim/ray_scene.h"
#include "sim/sensor_model.h"
#include "sim/trace.h"
#include "sim/truth.h"
#include "tests/calib/true_rig.h"
#include "tracker/marker_image.h"
#include "wizard/capture/virtual_capture.h"
#include "wizard/measure/solve_captures.h"

namespace limn::test {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int k_poses = 20;
constexpr double k_car_m = 2.6;  // from the cameras to the car
constexpr double k_length_m = 4.2, k_height_m = 1.4;
constexpr double k_pixel_m = 0.0024;  // of the projectors, on the car
constexpr auto k_scene_pose = "pose20";
constexpr size_t k_cost_poses = k_poses;

// ---- the true rig; world: x along the car, y down, z away from the devices; origin between the cameras ----

Imager imager(const std::string& name, int width, int height, double f, double k1, const Pose& pose) {
  return {
      name, width, height,
      Lens::create("LENSMODEL_OPENCV4", {f, f, (width - 1) / 2.0 + 0.004 * width,
                                         (height - 1) / 2.0 - 0.003 * height, k1, -0.3 * k1, 0.0003, -0.0002})
          .value(),
      pose};
}

Rig true_rig() {
  const Vector3d down(0, 1, 0), up = -down;
  Rig rig;
  rig.cameras.push_back(
      imager("camera0", 1224, 1024, 1224, -0.08, looking_at({-1.1, -0.2, 0}, {-1.0, 0, k_car_m}, up)));
  rig.cameras.push_back(
      imager("camera1", 2048, 1500, 2048, -0.06, looking_at({1.1, 0.1, 0.1}, {1.0, 0, k_car_m}, up)));
  constexpr double k_throw_m = 4;
  const double f = k_throw_m / k_pixel_m;
  for (const double side : {-1.0, 1.0})
    rig.projectors.push_back(
        imager(side < 0 ? "projector0" : "projector1", 1920, 1200, f, 0.02 * side,
               looking_at({1.3 * side, -0.9, k_car_m - k_throw_m}, {0.1 * side, 0, k_car_m}, up)));
  return rig;
}

// A side of a car, bulged by 0.2 m towards the devices; its frame is the world's at its place.
scene::Mesh car_mesh() {
  constexpr std::uint32_t k_columns = 168, k_rows = 56;
  scene::Mesh mesh;
  const auto at = [](double s, double t) {
    const double x = (s - 0.5) * k_length_m, y = (t - 0.5) * k_height_m;
    return Vector3d(x, y, -0.2 * std::cos(1.8 * y) + 0.02 * x * x + 0.02 * std::sin(4 * x));
  };
  for (std::uint32_t row = 0; row <= k_rows; ++row) {
    for (std::uint32_t column = 0; column <= k_columns; ++column) {
      const double s = static_cast<double>(column) / k_columns, t = static_cast<double>(row) / k_rows,
                   h = 1e-4;
      mesh.positions.push_back(at(s, t).cast<float>());
      mesh.normals.push_back(
          (at(s, t + h) - at(s, t - h)).cross(at(s + h, t) - at(s - h, t)).normalized().cast<float>());
    }
  }
  for (std::uint32_t row = 0; row < k_rows; ++row) {
    for (std::uint32_t column = 0; column < k_columns; ++column) {
      const std::uint32_t a = row * (k_columns + 1) + column, c = a + k_columns + 2;
      mesh.triangles.push_back({a, a + 1, c});
      mesh.triangles.push_back({a, c, c - 1});
    }
  }
  mesh.triangle_materials.assign(mesh.triangles.size(), 0);
  return mesh;
}

const Pose k_world_from_car(Eigen::Quaterniond::Identity(), Vector3d(0, 0, k_car_m));

calib::Board board() { return calib::Board::parse("charuco:11x8:80mm").value(); }

// Boards alternate between the halves, so that no camera sees the other's.
std::vector<Pose> board_poses() {
  std::mt19937_64 rng(36);
  std::uniform_real_distribution<double> even(-1, 1);
  const Pose middle(Eigen::Quaterniond::Identity(),
                    Vector3d(-board().width_m() / 2, -board().height_m() / 2, 0));
  std::vector<Pose> poses;
  for (int pose = 0; pose < k_poses; ++pose) {
    const double around = 2.4 * pose, tilt = 0.45 + 0.12 * even(rng), side = pose % 2 == 0 ? -1 : 1;
    const int place = pose / 2;
    const Vector3d p(side * (0.85 + 0.35 * (place % 3) + 0.05 * even(rng)),
                     0.3 * (place / 3 % 3 - 1) + 0.08 * even(rng), k_car_m - 0.1 + 0.25 * even(rng));
    poses.push_back(
        Pose(exp_rotation({tilt * std::cos(around), tilt * std::sin(around), 0.3 * even(rng)}), p) * middle);
  }
  return poses;
}

sim::World empty_room() {
  sim::World world;
  world.rig = true_rig();
  const sim::CameraEffects eye{
      .exposure = 0.9, .psf_px = 0.6, .full_well_e = 15000, .read_noise = 1, .black_level = 4};
  world.camera_effects = {eye, eye};
  const sim::ProjectorEffects light{
      .illuminance_at_1m = 17, .gamma = 2.2, .black_level = 0.002, .focus_m = 4, .aperture_m = 0.01};
  world.projector_effects = {light, light};
  world.room.ambient = 0.03;
  return world;
}

// The car with twelve markers of 120 mm, most of them where both cameras or both halves are seen.
sim::World car_world() {
  sim::World world = empty_room();
  const auto mesh = std::make_shared<const scene::Mesh>(car_mesh());
  sim::Object car;
  car.name = "car";
  car.mesh = mesh;
  car.world_from_object = k_world_from_car;
  car.albedo = {0.6, 0.6, 0.6};
  world.objects = {car};
  int id = 0;
  for (const double x : {-1.7, -0.9, -0.15, 0.15, 0.9, 1.7}) {
    for (const double y : {-0.35, 0.3}) {
      const Vector3d p(x, y,
                       k_car_m - 0.2 * std::cos(1.8 * y) + 0.02 * x * x + 0.02 * std::sin(4 * x) - 0.03);
      const BodyMarker marker{{"apriltag_36h11", std::to_string(id++)},
                              0.12,
                              Pose(exp_rotation({0.2 * y, 0.1 * x, 0.05 * x}), p)};
      const Status added = sim::add_marker(world, marker, false, tracker::marker_image);
      if (!added.ok()) fmt::print(stderr, "{}\n", added.message());
    }
  }
  return world;
}

// ---- captures ----

Status capture(const calib::CaptureSet& plan, int pose, const sim::World& world) {
  std::vector<sim::Samples> samples;
  for (int camera = 0; camera < 2; ++camera) samples.push_back(sim::trace(world, camera));
  std::vector<cv::Mat> shown(2);
  std::uint64_t seed = 1 + 1000 * static_cast<std::uint64_t>(pose);
  const calib::CaptureBackend backend{.show = [&](int projector, const cv::Mat& image) -> Status {
                                        shown = {cv::Mat(), cv::Mat()};
                                        shown[static_cast<size_t>(projector)] = image.clone();
                                        return {};
                                      },
                                      .grab = [&](int camera) -> Result<cv::Mat> {
                                        return sim::photograph(world, samples[static_cast<size_t>(camera)],
                                                               shown, seed++);
                                      }};
  return calib::capture_pose(plan, pose, backend);
}

Status make_captures(const fs::path& folder) {
  if (fs::exists(folder / "complete")) return {};
  fs::remove_all(folder);
  const sim::World room = empty_room();
  std::vector<calib::CapturedDevice> cameras, projectors;
  for (const Imager& i : room.rig.cameras) cameras.push_back({i.name, i.width, i.height});
  for (const Imager& i : room.rig.projectors) projectors.push_back({i.name, i.width, i.height});
  const calib::CaptureSet plan = calib::plan_captures(folder, cameras, projectors, board());
  LIMN_TRY_STATUS(calib::begin_captures(plan));
  const std::vector<Pose> boards = board_poses();
  for (int pose = 0; pose < k_poses; ++pose) {
    sim::World world = room;
    world.objects = {wizard::board_object(plan.board, boards[static_cast<size_t>(pose)])};
    LIMN_TRY_STATUS(capture(plan, pose, world));
    fmt::print(stderr, "captured pose {}\n", pose);
  }
  LIMN_TRY_STATUS(capture(plan, k_poses, car_world()));
  return write_file(folder / "complete", "");
}

// ---- judging ----

struct KnownPoint {
  Vector3d p_car;
  size_t camera = 0;
  Vector2d px;
};

// The pose of a rigid thing from points that several calibrated cameras see, by Gauss and Newton.
Pose measured_pose(const Rig& calibrated, const std::vector<KnownPoint>& points, Pose world_from_car) {
  constexpr int k_steps = 20;
  for (int step = 0; step < k_steps; ++step) {
    Matrix6d normal = Matrix6d::Zero();
    Vector6d gradient = Vector6d::Zero();
    for (const KnownPoint& point : points) {
      const Imager& camera = calibrated.cameras[point.camera];
      const auto px = camera.project(world_from_car * point.p_car);
      if (!px) continue;
      Eigen::Matrix<double, 2, 6> rows;
      constexpr double k_small = 1e-6;
      for (int i = 0; i < 6; ++i)
        rows.col(i) =
            (*camera.project(boxplus(world_from_car, k_small * Vector6d::Unit(i)) * point.p_car) - *px) /
            k_small;
      normal += rows.transpose() * rows;
      gradient += rows.transpose() * (*px - point.px);
    }
    world_from_car = boxplus(world_from_car, Vector6d(-normal.ldlt().solve(gradient)));
  }
  return world_from_car;
}

// The true world in the calibrated rig's frame, which is that of camera 0.
Rig in_camera0(Rig rig) {
  const Pose world_from_camera0 = rig.cameras[0].imager_from_world.inverse();
  for (auto* imagers : {&rig.cameras, &rig.projectors}) {
    for (Imager& i : *imagers) i.imager_from_world = i.imager_from_world * world_from_camera0;
  }
  return rig;
}

bool is_seen(const sim::RayScene& scene, const Imager& imager, const Vector3d& p, const Vector3d& n) {
  const auto px = imager.project(p);
  const Vector3d p_imager = imager.imager_from_world.inverse().translation;
  constexpr double k_least_cosine = 0.34;
  return px && imager.contains(*px) && std::abs(n.dot((p_imager - p).normalized())) > k_least_cosine &&
         scene.reached(p_imager, p);
}

// Errors of the light, mm, for each projector, with the place along the car.
struct Errors {
  std::vector<double> mm, x_m;
};

void judge(const Rig& truth,
           const Rig& calibrated,
           const Pose& world_from_car,
           std::mt19937_64* rng,
           Errors* errors) {
  static const scene::Mesh mesh = car_mesh();
  const sim::MeshInstance there{&mesh, world_from_car};
  const sim::RayScene scene({&there, 1});
  constexpr double k_noise_px = 0.02;
  constexpr int k_known = 24, k_targets = 1500;
  std::normal_distribution<double> noise(0, k_noise_px);
  std::vector<KnownPoint> known;
  int targets = 0;
  const auto points = sim::surface_points(mesh, 3 * k_targets, (*rng)());
  for (const sim::SampledPoint& point : points) {
    for (size_t c = 0; c < truth.cameras.size() && known.size() < k_known; ++c) {
      if (known.size() % 2 != c) continue;  // the cameras take turns
      const Vector3d p = world_from_car * point.p;
      if (is_seen(scene, truth.cameras[c], p, world_from_car.rotation * point.n))
        known.push_back({point.p, c, *truth.cameras[c].project(p) + Vector2d(noise(*rng), noise(*rng))});
    }
  }
  const Pose measured = measured_pose(calibrated, known, world_from_car);
  for (const sim::SampledPoint& point : points) {
    if (targets >= k_targets) break;
    const Vector3d p = world_from_car * point.p, n = world_from_car.rotation * point.n;
    for (size_t i = 0; i < truth.projectors.size(); ++i) {
      if (!is_seen(scene, truth.projectors[i], p, n)) continue;
      const auto px = calibrated.projectors[i].project(measured * point.p);
      const auto ray = px ? truth.projectors[i].ray(*px) : std::nullopt;
      if (!ray) continue;
      const Vector3d lands = ray->p_origin + n.dot(p - ray->p_origin) / n.dot(ray->d) * ray->d;
      errors->mm.push_back(1e3 * (lands - p).norm());
      errors->x_m.push_back(point.p.x());
      ++targets;
    }
  }
}

void print_row(const std::string& name, const Rig& calibrated, double stated_mm) {
  const Rig world = true_rig(), truth = in_camera0(world);
  const Pose camera0_from_world = world.cameras[0].imager_from_world;
  std::mt19937_64 rng(17);
  std::vector<double> pooled;
  fmt::print("  {:<28}", name);
  const auto group = [&](const char* text, const std::vector<Pose>& moves) {
    Errors errors;
    for (const Pose& move : moves)
      judge(truth, calibrated, camera0_from_world * k_world_from_car * move, &rng, &errors);
    fmt::print(" {} {:.3f}", text, rms(errors.mm));
    pooled.insert(pooled.end(), errors.mm.begin(), errors.mm.end());
    return errors;
  };
  const auto moved = [](int axis, double m) {
    return Pose(Eigen::Quaterniond::Identity(), m * Vector3d::Unit(axis));
  };
  const auto turned = [](int axis, double degrees) {
    return Pose(exp_rotation(degrees * std::numbers::pi / 180 * Vector3d::Unit(axis)), Vector3d::Zero());
  };
  const Errors in_place = group("in place", {Pose(), Pose(), Pose()});
  group("moved", {moved(0, 0.15), moved(0, -0.15), moved(2, 0.15), moved(2, -0.15)});
  group("turned by 10 deg", {turned(0, 10), turned(0, -10), turned(1, 10), turned(1, -10)});
  if (stated_mm > 0)
    fmt::print(" stated {:.3f} mm holds for {:.1f} %", stated_mm, 100 * share_within(pooled, stated_mm));
  fmt::print("; along the car");
  constexpr int k_parts = 6;
  for (int part = 0; part < k_parts; ++part) {
    std::vector<double> here;
    for (size_t i = 0; i < in_place.mm.size(); ++i) {
      const int at = static_cast<int>((in_place.x_m[i] / k_length_m + 0.5) * k_parts);
      if (std::clamp(at, 0, k_parts - 1) == part) here.push_back(in_place.mm[i]);
    }
    fmt::print(" {:.3f}", rms(here));
  }
  group("; turned by 40 deg", {turned(0, 40), turned(0, -40), turned(1, 40), turned(1, -40)});
  fmt::print("\n");
}

// ---- cost ----

struct Cost {
  double cpu_s = 0, peak_gb = 0;
  bool succeeded = false;
};

// What `work` costs in a process of its own.
Cost cost_of(const std::function<bool()>& work) {
  std::fflush(nullptr);
  const pid_t child = fork();
  if (child == 0) _exit(work() ? 0 : 1);
  int status = 0;
  rusage used{};
  wait4(child, &status, 0, &used);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return {seconds(used.ru_utime) + seconds(used.ru_stime), static_cast<double>(used.ru_maxrss) / 1e6,
          WIFEXITED(status) && WEXITSTATUS(status) == 0};
}

cv::Mat enlarged(const fs::path& path, const cv::Mat& noise) {
  const cv::Mat image = cv::imread(path.string(), cv::IMREAD_GRAYSCALE);
  cv::Mat large;
  cv::resize(image, large, {}, 2, 2, cv::INTER_LINEAR);
  cv::add(large, noise(cv::Rect(0, 0, large.cols, large.rows)), large, cv::noArray(), CV_8U);
  return large;
}

// The series of one pose, projector and camera. Where the camera sees nothing, all images are the same one.
Status enlarge_series(const std::vector<fs::path>& images,
                      const fs::path& from,
                      const fs::path& to,
                      int white,
                      const cv::Mat& noise) {
  constexpr double k_dark = 40;                                       // grey levels
  if (fs::exists(to / fs::relative(images.back(), from))) return {};  // by an earlier run
  const cv::Mat lit = enlarged(images[static_cast<size_t>(white)], noise);
  double most = 0;
  cv::minMaxLoc(lit, nullptr, &most);
  for (size_t i = 0; i < images.size(); ++i) {
    const fs::path path = to / fs::relative(images[i], from);
    fs::create_directories(path.parent_path());
    if (most < k_dark && i > 0)
      fs::create_hard_link(to / fs::relative(images[0], from), path);
    else
      LIMN_TRY_STATUS(calib::store_image_now(path, enlarged(images[i], noise)));
  }
  return {};
}

// The captures with images twice as large, with a sensor's noise added again.
Status enlarge(const fs::path& from, const fs::path& to) {
  fs::create_directories(to);
  fs::copy_file(from / "patterns.json", to / "patterns.json", fs::copy_options::overwrite_existing);
  LIMN_TRY(const std::string text, read_file(from / "capture.json"));
  auto json = nlohmann::ordered_json::parse(text);
  for (auto& camera : json["cameras"])
    camera["size"] = {2 * camera["size"][0].get<int>(), 2 * camera["size"][1].get<int>()};
  LIMN_TRY_STATUS(write_file(to / "capture.json", json.dump(2)));
  cv::Mat noise(3000, 4096, CV_8S);
  cv::RNG(7).fill(noise, cv::RNG::NORMAL, 0, 1.5);
  LIMN_TRY(const calib::CaptureSet set, calib::load_captures(from, {k_scene_pose}));
  for (size_t pose = 0; pose < k_cost_poses; ++pose) {
    for (size_t projector = 0; projector < set.projectors.size(); ++projector) {
      for (const auto& images : set.poses[pose].images[projector])
        LIMN_TRY_STATUS(enlarge_series(images, from, to, set.patterns[projector].white(), noise));
    }
  }
  return {};
}

Status print_cost(const fs::path& captures, const std::vector<std::string>& skip) {
  LIMN_TRY(const calib::CaptureSet set, calib::load_captures(captures, skip));
  double pixels = 0;
  for (const calib::CapturedDevice& c : set.cameras)
    pixels += 1e-6 * c.width * c.height *
              static_cast<double>(set.poses.size() * set.patterns.size() * set.patterns[0].count());
  const Cost reading = cost_of([&] {
    cv::setNumThreads(1);
    double sum = 0;
    for (const calib::CapturedPose& pose : set.poses) {
      for (const auto& by_projector : pose.images) {
        for (const auto& by_camera : by_projector) {
          for (const fs::path& path : by_camera)
            sum += cv::imread(path.string(), cv::IMREAD_GRAYSCALE).at<uchar>(0, 0);
        }
      }
    }
    return sum > 0;
  });
  std::fflush(stdout);
  const Cost solving = cost_of([&] {
    return wizard::solve_captures(
               {.captures = captures, .out = captures / ".." / "rig-cost", .skip_poses = skip})
        .ok();
  });
  if (!solving.succeeded) return error("{}: the solve failed.", captures.string());
  fmt::print(
      "  {} poses, {:.0f} Mpx: reading {:.1f} s CPU; solving {:.1f} s CPU, {:.2f} times reading, {:.1f} "
      "s/Gpx; peak {:.2f} GB\n",
      set.poses.size(), pixels, reading.cpu_s, solving.cpu_s, solving.cpu_s / reading.cpu_s,
      1e3 * solving.cpu_s / pixels, solving.peak_gb);
  return {};
}

}  // namespace

Status bench_car(const fs::path& folder) {
  LIMN_TRY_STATUS(make_captures(folder / "car"));
  fmt::print("car\n");
  for (const bool with_scene : {false, true}) {
    const auto report = wizard::solve_captures(
        {.captures = folder / "car",
         .out = folder / (with_scene ? "rig-car-scene" : "rig-car"),
         .skip_poses = with_scene ? std::vector<std::string>() : std::vector<std::string>{k_scene_pose}});
    if (!report) return report.error();
    print_row(with_scene ? "Limn, the car captured, too" : "Limn, boards only", report->solution.rig,
              report->assessment.worst_predicted_mm());
    fmt::print("    {}\n", report->explanation.verdict);
    for (const calib::Fault& fault : report->assessment.faults)
      fmt::print("    fault {}\n", calib::to_text(fault));
    for (const std::string& advice : report->explanation.advice) fmt::print("    advice {}\n", advice);
  }
  print_row("true rig", in_camera0(true_rig()), 0);
  return {};
}

Status bench_car_cost(const fs::path& folder) {
  LIMN_TRY_STATUS(make_captures(folder / "car"));
  LIMN_TRY_STATUS(enlarge(folder / "car", folder / "car-full"));
  fmt::print("cost\n");
  LIMN_TRY_STATUS(print_cost(folder / "car-full", {}));
  return print_cost(folder / "car", {k_scene_pose});
}

}  // namespace limn::test
