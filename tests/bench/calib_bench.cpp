// Calibration against the truth in millimetres. Ray-traced captures of bowed and flat boards are solved by
// Limn and by OpenCV's joint solve. Both are judged on prototypes whose place the same camera measures,
// together with the floor (the true rig with the same measurement): mm RMS in place, moved by 150 mm, turned
// by 40 degrees. Boards of the cases "paper" are printed 0.15 % too wide with smooth errors of 0.1 mm, bowed
// and twisted; they are solved as limn solve does it, with lengths measured to 0.03 and to 0.1 mm and without
// lengths. Captures are kept for the next run. Usage: limn bench calib [NAME…]     (names of the rigs
// below; all when none is given; car: a rig as large as a car; car-cost: its memory and time at full size)
#include <fmt/core.h>

#include <chrono>
#include <filesystem>
#include <map>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <set>

#include "calib/board_print.h"
#include "calib/capture.h"
#include "calib/judge/assess.h"
#include "calib/solve.h"
#include "core/opencv_aruco.h"
#include "core/predefined_family.h"
#include "sim/sensor_model.h"
#include "sim/trace.h"
#include "tests/bench/car_bench.h"
#include "tests/calib/bad_print.h"
#include "tests/calib/true_rig.h"
#include "wizard/capture/capture_plan.h"
#include "wizard/capture/virtual_capture.h"
#include "wizard/measure/solve_captures.h"

namespace limn::test {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector2d;
using Eigen::Vector3d;

struct Case {
  std::string name;
  RigOptions options;
  std::optional<BadPrint> print = {};  ///< none: the print is exact
  double twist_m = 0;
  double shake_px = 0, flicker = 0;
  /// sRGB camera with JPEG images, vignetting of both devices, more noise, twice the defocus, black light.
  bool is_rough = false;
  calib::PatternCode code = calib::PatternCode::gray;
};

std::vector<Case> all_cases() {
  std::vector<Case> cases;
  for (const double bow : {0.0, 0.4e-3}) {
    const std::string suffix = bow > 0 ? "-bowed" : "";
    cases.push_back({"plain" + suffix, {.k1 = 0, .shift = 0, .bow_m = bow, .seed = 1}});
    cases.push_back({"shifted" + suffix, {.k1 = -0.05, .shift = 0.5, .bow_m = bow, .seed = 2}});
    cases.push_back({"wide" + suffix, {.k1 = -0.15, .shift = 1.1, .bow_m = bow, .seed = 3}});
  }
  for (unsigned seed = 1; seed <= 3; ++seed) {
    for (const bool turned : {false, true}) {
      cases.push_back({fmt::format("paper{}-{}", turned ? "-turned" : "", seed),
                       {.k1 = -0.05,
                        .shift = 0.5,
                        .bow_m = 0.4e-3,
                        .square_pixels = true,
                        .quarter_turns = turned,
                        .seed = seed + 4},
                       BadPrint{.phase = 0.9 * seed},
                       0.4e-3});
    }
  }
  for (unsigned draw = 1; draw <= 5; ++draw)
    cases.push_back({draw == 1 ? "ill-posed" : fmt::format("ill-posed-{}", draw),
                     {.k1 = -0.05, .shift = 0.5, .tilt = 0.05, .spread = 0.15, .seed = 4 + 20 * (draw - 1)}});
  for (unsigned seed = 1; seed <= 3; ++seed) {
    cases.push_back({.name = fmt::format("all-effects-{}", seed),
                     .options = {.k1 = -0.05,
                                 .shift = 0.5,
                                 .bow_m = 0.4e-3,
                                 .square_pixels = true,
                                 .quarter_turns = true,
                                 .seed = seed + 7},
                     .print = BadPrint{.phase = 0.9 * seed + 0.4},
                     .twist_m = 0.4e-3,
                     .shake_px = 0.2,
                     .flicker = 0.015,
                     .is_rough = true});
  }
  cases.push_back({.name = "shaken",
                   .options = {.k1 = -0.05, .shift = 0.5, .seed = 2},
                   .shake_px = 0.2,
                   .flicker = 0.015});
  cases.push_back(cases.back());
  cases.back().name = "shaken-phase";
  cases.back().code = calib::PatternCode::phase;
  return cases;
}

// ---- captures ----

// Where a point of the board's drawing is printed.
Vector2d printed(const TrueRig& truth, const std::optional<BadPrint>& print, const Vector2d& p_board) {
  return print ? print->at(truth.board, p_board) : p_board;
}

// The board as a bent sheet, made of strips across its width.
sim::Object bowed_board(const TrueRig& truth,
                        const std::optional<BadPrint>& print,
                        const Pose& world_from_board) {
  sim::Object object = wizard::board_object(truth.board, world_from_board);
  const scene::Mesh flat = *object.mesh;
  const calib::BoardShape shape{truth.board.width_m(), truth.board.height_m(), truth.twist_m};
  const Pose board_from_sheet = world_from_board.inverse() * object.world_from_object;
  scene::Mesh bent;
  bent.materials = flat.materials;
  const Eigen::Vector2d half(flat.positions[2].x(), flat.positions[2].y());
  constexpr int k_columns = 96, k_rows = 64;
  for (int i = 0; i < (k_columns + 1) * (k_rows + 1); ++i) {
    const double s = static_cast<double>(i % (k_columns + 1)) / k_columns,
                 t = static_cast<double>(i / (k_columns + 1)) / k_rows;
    Vector3d p((2 * s - 1) * half.x(), (2 * t - 1) * half.y(), 0);
    const Vector2d p_board = printed(truth, print, (board_from_sheet * p).head<2>());
    p = board_from_sheet.inverse() *
        Vector3d(p_board.x(), p_board.y(), shape.z(truth.bow_m, p_board.x(), p_board.y()));
    bent.positions.push_back(p.cast<float>());
    bent.normals.push_back({0, 0, -1});
    bent.uvs.emplace_back(static_cast<float>(s), static_cast<float>(1 - t));
  }
  for (std::uint32_t row = 0; row < k_rows; ++row) {
    for (std::uint32_t column = 0; column < k_columns; ++column) {
      const std::uint32_t a = row * (k_columns + 1) + column, c = a + k_columns + 2;
      bent.triangles.push_back({a, c, a + 1});
      bent.triangles.push_back({a, c - 1, c});
    }
  }
  bent.triangle_materials.assign(bent.triangles.size(), 0);
  object.mesh = std::make_shared<const scene::Mesh>(std::move(bent));
  return object;
}

sim::World world_of(const Case& test_case, const TrueRig& truth) {
  sim::World world;
  world.rig = truth.rig;
  world.camera_effects = {{.exposure = 0.9,
                           .psf_px = 0.6,
                           .read_noise = 2,
                           .black_level = 4,
                           .shake_px = test_case.shake_px,
                           .flicker = test_case.flicker}};
  world.projector_effects = {
      {.illuminance_at_1m = 1.7, .gamma = 2.2, .black_level = 0.002, .focus_m = 1.3, .aperture_m = 0.01}};
  world.room.ambient = 0.05;
  if (!test_case.is_rough) return world;
  sim::CameraEffects& camera = world.camera_effects[0];
  camera.srgb = true;
  camera.vignetting = 0.3;
  camera.full_well_e = 10000;
  camera.psf_px = 0.9;
  sim::ProjectorEffects& projector = world.projector_effects[0];
  projector.vignetting = 0.3;
  projector.black_level = 0.01;
  projector.aperture_m = 0.02;
  return world;
}

cv::Mat through_jpeg(const cv::Mat& image) {
  std::vector<uchar> bytes;
  cv::imencode(".jpg", image, bytes, {cv::IMWRITE_JPEG_QUALITY, 90});
  return cv::imdecode(bytes, cv::IMREAD_UNCHANGED);
}

Result<calib::CaptureSet> captured(const Case& test_case, const TrueRig& truth, const fs::path& folder) {
  if (fs::exists(folder / "complete")) return calib::load_captures(folder);
  fs::remove_all(folder);
  sim::World world = world_of(test_case, truth);
  const Imager &camera = truth.rig.cameras[0], &projector = truth.rig.projectors[0];
  const calib::CaptureSet plan = calib::plan_captures(folder, {{camera.name, camera.width, camera.height}},
                                                      {{projector.name, projector.width, projector.height}},
                                                      truth.board, test_case.code);
  LIMN_TRY_STATUS(calib::begin_captures(plan));
  std::uint64_t seed = 1;
  for (size_t pose = 0; pose < truth.world_from_board.size(); ++pose) {
    world.objects = {bowed_board(truth, test_case.print, truth.world_from_board[pose])};
    const sim::Samples samples = sim::trace(world, 0);
    cv::Mat shown;
    const calib::CaptureBackend backend{
        .show = [&](int, const cv::Mat& image) -> Status {
          shown = image.clone();
          return {};
        },
        .grab = [&](int) -> Result<cv::Mat> {
          const cv::Mat image = sim::photograph(world, samples, {&shown, 1}, seed++);
          return test_case.is_rough ? through_jpeg(image) : image;
        }};
    LIMN_TRY_STATUS(calib::capture_pose(plan, static_cast<int>(pose), backend));
  }
  cv::imwrite((folder / "complete.png").string(), cv::Mat::zeros(1, 1, CV_8U));
  fs::rename(folder / "complete.png", folder / "complete");
  return calib::load_captures(folder);
}

// ---- OpenCV's method ----

struct View {
  std::vector<cv::Point3f> points;
  std::vector<cv::Point2f> camera, projector;
};

// ChArUco corners as OpenCV finds them, then refined in the image, because its interpolation is half a pixel
// off.
std::map<int, cv::Point2f> opencv_corners(const calib::Board& board, const cv::Mat& white) {
  const auto dictionary = aruco_dictionary(find_predefined_family(board.dictionary)->opencv_dictionary);
  const auto charuco =
      opencv_charuco_board({board.columns, board.rows}, static_cast<float>(board.square_m),
                           static_cast<float>(board.square_m * board.marker_share), dictionary);
  const auto [markers, ids] = find_aruco_markers(white, dictionary);
  std::vector<int> corner_ids;
  std::vector<cv::Point2f> corners;
  if (!ids.empty()) cv::aruco::interpolateCornersCharuco(markers, ids, white, charuco, corners, corner_ids);
  if (corners.empty()) return {};
  cv::cornerSubPix(white, corners, {4, 4}, {-1, -1},
                   {cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 100, 1e-4});
  std::map<int, cv::Point2f> found;
  for (size_t i = 0; i < corners.size(); ++i) found[corner_ids[i]] = corners[i];
  return found;
}

// Whole-pixel labels as cv::structured_light::GrayCodePattern decodes them. A bit is the sign of image minus
// inverse. A pixel is dropped when one of its bits differs by 5 levels or less, or when it gets no light.
cv::Mat opencv_labels(const calib::Patterns& patterns, const std::vector<fs::path>& images) {
  const auto read = [&](int i) {
    return cv::imread(images[static_cast<size_t>(i)].string(), cv::IMREAD_GRAYSCALE);
  };
  cv::Mat direct, sure, labels[2];
  cv::subtract(read(patterns.white()), read(patterns.black()), direct);
  sure = direct > 20;
  int at = 0;
  for (int axis = 0; axis < 2; ++axis) {
    cv::Mat label = cv::Mat::zeros(direct.size(), CV_32S), gray = cv::Mat::zeros(direct.size(), CV_8U);
    for (int bit = axis == 0 ? patterns.column_bits() : patterns.row_bits(); bit > 0; --bit, at += 2) {
      const cv::Mat image = read(at), inverse = read(at + 1);
      cv::Mat difference;
      cv::absdiff(image, inverse, difference);
      sure &= difference > 5;
      gray ^= (image > inverse) / 255;  // Gray to binary: each bit is the XOR of those above
      cv::Mat wide;
      gray.convertTo(wide, CV_32S);
      label = label * 2 + wide;
    }
    label.convertTo(labels[axis], CV_32F);
  }
  cv::Mat both;
  cv::merge(labels, 2, both);
  both.setTo(cv::Scalar::all(std::nan("")), ~sure);
  return both;
}

// The projector's pixel at a corner: a robust homography over the whole-pixel labels around it.
std::optional<cv::Point2f> local_corner(const cv::Mat& labels, const cv::Point2f& corner) {
  constexpr int k_window = 20;  // camera pixels to each side: a little more than half a square
  std::vector<cv::Point2f> from, to;
  for (int y = cvRound(corner.y) - k_window; y <= cvRound(corner.y) + k_window; ++y) {
    for (int x = cvRound(corner.x) - k_window; x <= cvRound(corner.x) + k_window; ++x) {
      if (x < 0 || y < 0 || x >= labels.cols || y >= labels.rows) continue;
      const auto& label = labels.at<cv::Vec2f>(y, x);
      if (std::isnan(label[0])) continue;
      from.emplace_back(static_cast<float>(x) - corner.x, static_cast<float>(y) - corner.y);
      to.emplace_back(label[0], label[1]);
    }
  }
  if (from.size() < 100) return std::nullopt;
  const cv::Mat h = cv::findHomography(from, to, cv::RANSAC, 1.5);
  if (h.empty()) return std::nullopt;
  return cv::Point2f(static_cast<float>(h.at<double>(0, 2) / h.at<double>(2, 2)),
                     static_cast<float>(h.at<double>(1, 2) / h.at<double>(2, 2)));
}

std::vector<View> opencv_views(const calib::CaptureSet& captures) {
  std::vector<View> views;
  for (const calib::CapturedPose& pose : captures.poses) {
    const auto& images = pose.images[0][0];
    const cv::Mat labels = opencv_labels(captures.patterns[0], images);
    const cv::Mat white =
        cv::imread(images[static_cast<size_t>(captures.patterns[0].white())].string(), cv::IMREAD_GRAYSCALE);
    View view;
    for (const auto& [id, px] : opencv_corners(captures.board, white)) {
      const auto lit = local_corner(labels, px);
      if (!lit) continue;
      const Vector3d p = captures.board.p_corner(id);
      view.points.emplace_back(static_cast<float>(p.x()), static_cast<float>(p.y()), 0.0F);
      view.camera.push_back(px);
      view.projector.push_back(*lit);
    }
    if (view.points.size() >= 8) views.push_back(std::move(view));
  }
  return views;
}

Imager imager_of(const std::string& name, const cv::Size& size, const cv::Mat& k, const cv::Mat& d) {
  std::vector<double> values = {k.at<double>(0, 0), k.at<double>(1, 1), k.at<double>(0, 2),
                                k.at<double>(1, 2)};
  for (int i = 0; i < 4; ++i) values.push_back(d.at<double>(i));
  return {name, size.width, size.height, Lens::create("LENSMODEL_OPENCV4", values).value(), Pose()};
}

// Calibrates each device alone, then runs cv::stereoCalibrate over all views with all values free (k1 k2 p1
// p2).
Rig opencv_rig(const calib::CaptureSet& captures, const std::vector<View>& views) {
  std::vector<std::vector<cv::Point3f>> points;
  std::vector<std::vector<cv::Point2f>> camera, projector;
  for (const View& view : views) {
    points.push_back(view.points);
    camera.push_back(view.camera);
    projector.push_back(view.projector);
  }
  const cv::Size camera_size(captures.cameras[0].width, captures.cameras[0].height);
  const cv::Size projector_size(captures.projectors[0].width, captures.projectors[0].height);
  const int flags = cv::CALIB_FIX_K3;
  const cv::TermCriteria until(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 300, 1e-10);
  cv::Mat k1, d1, k2, d2, r, t, e, f;
  std::vector<cv::Mat> rvecs, tvecs;
  cv::calibrateCamera(points, camera, camera_size, k1, d1, rvecs, tvecs, flags, until);
  cv::calibrateCamera(points, projector, projector_size, k2, d2, rvecs, tvecs, flags, until);
  const double rms_px = cv::stereoCalibrate(points, camera, projector, k1, d1, k2, d2, camera_size, r, t, e,
                                            f, flags | cv::CALIB_USE_INTRINSIC_GUESS, until);
  fmt::print("  OpenCV: {} views, stereo RMS {:.3f} px, projector fx {:.1f} cy {:.1f}\n", views.size(),
             rms_px, k2.at<double>(0, 0), k2.at<double>(1, 2));
  Rig rig;
  rig.cameras.push_back(imager_of("camera0", camera_size, k1, d1));
  rig.projectors.push_back(imager_of("projector0", projector_size, k2, d2));
  Eigen::Matrix3d rotation;
  Vector3d translation;
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) rotation(i, k) = r.at<double>(i, k);
    translation[i] = t.at<double>(i);
  }
  rig.projectors[0].imager_from_world = Pose(rotation, translation);
  return rig;
}

// ---- measurements against the truth ----

calib::ImagerView view_of(const Imager& imager) {
  return {imager.lens.model, imager.lens.values, imager.imager_from_world};
}

// Mean (bias) and RMS of differences, px.
struct Offsets {
  Vector2d sum = Vector2d::Zero();
  double squared = 0;
  int count = 0;
  void take(const Vector2d& d) {
    sum += d;
    squared += d.squaredNorm();
    ++count;
  }
  std::string text() const {
    const double n = std::max(1, count);
    return fmt::format("{} off by {:.4f} px RMS (mean {:+.4f} {:+.4f})", count, std::sqrt(squared / n),
                       sum.x() / n, sum.y() / n);
  }
};

void print_limn_offsets(const TrueRig& truth, const calib::Observations& observations) {
  const calib::BoardShape shape{truth.board.width_m(), truth.board.height_m()};
  const Imager &camera = truth.rig.cameras[0], &projector = truth.rig.projectors[0];
  Offsets corners, matches;
  Vector2d px;
  for (const calib::CornerObservation& seen : observations.corners) {
    if (calib::predict_corner(view_of(camera), truth.world_from_board[static_cast<size_t>(seen.pose)], shape,
                              truth.bow_m, truth.board.p_corner(seen.corner).head<2>(), &px))
      corners.take(seen.px - px);
  }
  for (const calib::Match& match : observations.matches) {
    if (calib::predict_match(view_of(camera), view_of(projector),
                             truth.world_from_board[static_cast<size_t>(match.pose)], shape, truth.bow_m,
                             match.px_camera, &px))
      matches.take(match.px_projector - px);
  }
  fmt::print("  Limn: corners {}; matches {}\n", corners.text(), matches.text());
}

void print_opencv_offsets(const TrueRig& truth, const std::vector<View>& views) {
  const calib::BoardShape shape{truth.board.width_m(), truth.board.height_m()};
  Offsets camera, projector;
  for (size_t pose = 0; pose < views.size(); ++pose) {
    for (size_t i = 0; i < views[pose].points.size(); ++i) {
      const Vector2d xy(views[pose].points[i].x, views[pose].points[i].y);
      Vector2d px;
      const auto off = [&](const Imager& imager, const cv::Point2f& found, Offsets* offsets) {
        if (calib::predict_corner(view_of(imager), truth.world_from_board[pose], shape, truth.bow_m, xy, &px))
          offsets->take(Vector2d(found.x, found.y) - px);
      };
      off(truth.rig.cameras[0], views[pose].camera[i], &camera);
      off(truth.rig.projectors[0], views[pose].projector[i], &projector);
    }
  }
  fmt::print("  OpenCV: corners {}; in the projector {}\n", camera.text(), projector.text());
}

// ---- the table ----

constexpr double k_pnp_px = 0.02;  // noise of the prototype's known points, as in the stated error
constexpr int k_points = 2000;

std::string row(const Landed& errors) {
  return fmt::format("{:.3f} {:.3f} {:.3f}", rms(errors.in_place_mm), rms(errors.moved_mm),
                     rms(errors.turned_mm));
}

// The rig on all prototypes; `stated_mm` 0: not stated.
void print_rows(const std::string& name, const TrueRig& truth, const Rig& rig, double stated_mm) {
  std::vector<double> pooled;
  fmt::print("  {:<52}", name);
  for (const Prototype prototype : {Prototype::panel, Prototype::cluster, Prototype::concave}) {
    std::mt19937_64 rng(17);
    const Landed errors = landed(truth, rig, prototype_mesh(prototype), k_pnp_px, k_points, &rng);
    fmt::print(" {} {} |", to_text(prototype), row(errors));
    for (const double e : errors.pooled_mm()) pooled.push_back(e);
  }
  fmt::print(" p95 {:.3f}", p95(pooled));
  if (stated_mm > 0)
    fmt::print(", stated {:.3f} mm, holds for {:.1f} %", stated_mm, 100 * share_within(pooled, stated_mm));
  fmt::print("\n");
}

// The true rig, larger by as much as lengths that are wrong by `wrong_m` make a print of known shape.
Rig scaled_by_lengths(const TrueRig& truth, const Vector2d& wrong_m) {
  const Vector2d lengths = calib::nominal_lengths(truth.board);
  const double growth = wrong_m.dot(lengths) / lengths.squaredNorm();
  Rig rig = truth.rig;
  for (Imager& projector : rig.projectors) projector.imager_from_world.translation *= 1 + growth;
  return rig;
}

// A bad print, solved from its folder as limn solve does it.
Status run_paper(const Case& test_case, const fs::path& folder) {
  TrueRig truth = make_true_rig(test_case.options);
  truth.twist_m = test_case.twist_m;
  LIMN_TRY(const calib::CaptureSet captures, captured(test_case, truth, folder / test_case.name));
  fmt::print("{}\n", test_case.name);
  std::mt19937_64 rng(test_case.options.seed);
  const Vector2d lengths = 1e3 * test_case.print->lengths(truth.board);
  for (const double stddev_mm : {0.03, 0.1, 0.0}) {
    std::normal_distribution<double> error(0, stddev_mm > 0 ? stddev_mm : 1);
    const Vector2d wrong(error(rng), error(rng)), read = lengths + wrong;
    const auto report = wizard::solve_captures(
        {.captures = folder / test_case.name,
         .out = folder / "rig",
         .board_measured =
             stddev_mm > 0 ? fmt::format("{:.3f}x{:.3f}mm:{}", read.x(), read.y(), stddev_mm) : ""});
    if (!report) return report.error();
    print_rows(stddev_mm > 0 ? fmt::format("Limn, lengths to {} mm (drawn: {:+.1f} {:+.1f} of it)", stddev_mm,
                                           wrong.x() / stddev_mm, wrong.y() / stddev_mm)
                             : "Limn, no lengths",
               truth, report->solution.rig, report->assessment.worst_predicted_mm());
    for (const calib::Fault& fault : report->assessment.faults)
      fmt::print("    {}: {}\n", calib::to_text(fault.name), fault.evidence);
    if (stddev_mm > 0)
      print_rows("true rig, scaled by these lengths", truth, scaled_by_lengths(truth, 1e-3 * wrong), 0);
  }
  print_rows("OpenCV", truth, opencv_rig(captures, opencv_views(captures)), 0);
  print_rows("true rig", truth, truth.rig, 0);
  return {};
}

Status run_case(const Case& test_case, const fs::path& folder) {
  if (test_case.print) return run_paper(test_case, folder);
  const TrueRig truth = make_true_rig(test_case.options);
  const auto begun = std::chrono::steady_clock::now();
  const auto seconds = [&] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
  };
  LIMN_TRY(const calib::CaptureSet captures, captured(test_case, truth, folder / test_case.name));
  fmt::print("{}: captured {:.0f} s\n", test_case.name, seconds());
  const double begun_solving = seconds();
  LIMN_TRY(const calib::Observed observed, calib::observe(captures));
  const calib::SolveOptions options;
  LIMN_TRY(const calib::Solution solution, calib::solve(observed.observations, options));
  LIMN_TRY(const calib::Assessment assessment, calib::assess(observed, options, solution));
  fmt::print(
      "  Limn: {} corners {:.3f} px, {} matches {:.3f} px; bend {:.3f} {:.3f} mm; held-out {:.3f} px; {}\n",
      observed.observations.corners.size(), solution.noise.corner.common_px,
      observed.observations.matches.size(), solution.noise.match.common_px, 1e3 * solution.bend_m.x(),
      1e3 * solution.bend_m.y(), assessment.held_out.rms_px, calib::to_text(assessment.verdict));
  for (const calib::Fault& fault : assessment.faults)
    fmt::print("  {}: {}\n", calib::to_text(fault.name), fault.evidence);
  const double limn_seconds = seconds() - begun_solving;
  print_limn_offsets(truth, observed.observations);
  std::optional<Rig> by_opencv;  // none: it does not read this code
  if (test_case.code == calib::PatternCode::gray) {
    const std::vector<View> views = opencv_views(captures);
    if (views.size() == truth.world_from_board.size()) print_opencv_offsets(truth, views);
    by_opencv = opencv_rig(captures, views);
  }
  const double opencv_seconds = seconds() - begun_solving - limn_seconds;
  for (const Prototype prototype : {Prototype::panel, Prototype::cluster, Prototype::concave}) {
    const scene::Mesh mesh = prototype_mesh(prototype);
    // The same points with the same measurement noise for each rig.
    const auto judged = [&](const Rig& rig) {
      std::mt19937_64 rng(17);
      return landed(truth, rig, mesh, k_pnp_px, k_points, &rng);
    };
    const Landed limn = judged(solution.rig), floor = judged(truth.rig);
    const std::string opencv = by_opencv ? row(judged(*by_opencv)) : "reads no such code";
    const double stated = assessment.predicted_error_mm[0];
    fmt::print(
        "  {:<14} {:<8} Limn {}  OpenCV {}  floor {}  stated {:.3f} (held-out {:.3f}, propagated {:.3f}) p95 "
        "{:.3f} holds {:.1f} %\n",
        test_case.name, to_text(prototype), row(limn), opencv, row(floor), stated,
        assessment.held_out_error_mm[0], assessment.propagated_error_mm[0], p95(limn.pooled_mm()),
        100 * share_within(limn.pooled_mm(), stated));
  }
  fmt::print("  Limn {:.1f} s, OpenCV {:.1f} s, from images to rig\n", limn_seconds, opencv_seconds);
  return {};
}

}  // namespace
}  // namespace limn::test

int main(int argc, char** argv) {
  const std::set<std::string> wanted(argv + 1, argv + argc);
  const std::filesystem::path folder = "out/bench-calib";
  int done = 0;
  using Bench = limn::Status (*)(const std::filesystem::path&);
  const std::map<std::string, Bench> large = {{"car", limn::test::bench_car},
                                              {"car-cost", limn::test::bench_car_cost}};
  for (const auto& [name, bench] : large) {
    if (!wanted.contains(name)) continue;
    const limn::Status status = bench(folder);
    if (!status.ok()) fmt::print(stderr, "{}: {}\n", name, status.message());
    if (!status.ok()) return 1;
    ++done;
  }
  for (const auto& test_case : limn::test::all_cases()) {
    if (!wanted.empty() && !wanted.contains(test_case.name)) continue;
    const limn::Status status = limn::test::run_case(test_case, folder);
    std::fflush(stdout);
    ++done;
    if (status.ok()) continue;
    fmt::print(stderr, "{}: {}\n", test_case.name, status.message());
    return 1;
  }
  if (done > 0) return 0;
  fmt::print(stderr, "bench calib: expected some of");
  for (const auto& test_case : limn::test::all_cases()) fmt::print(stderr, " {}", test_case.name);
  fmt::print(stderr, ", found '{}'.\n", *wanted.begin());
  return 2;
}
