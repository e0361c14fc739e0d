#include "apps/command_line.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <filesystem>
#include <functional>
#include <memory>
#include <new>
#include <opencv2/core.hpp>
#include <optional>
#include <system_error>

#include "apps/align.h"
#include "apps/bench.h"
#include "apps/calibrate.h"
#include "apps/capture.h"
#include "apps/check.h"
#include "apps/demo.h"
#include "apps/detect.h"
#include "apps/detect_balls.h"
#include "apps/doctor.h"
#include "apps/export.h"
#include "apps/import.h"
#include "apps/import_rig.h"
#include "apps/learn_body.h"
#include "apps/learn_constellation.h"
#include "apps/live.h"
#include "apps/markers.h"
#include "apps/output_files.h"
#include "apps/patterns.h"
#include "apps/plan_rig.h"
#include "apps/recheck.h"
#include "apps/render.h"
#include "apps/replay.h"
#include "apps/room.h"
#include "apps/scan.h"
#include "apps/simulate.h"
#include "apps/solve.h"
#include "core/enum_names.h"
#include "core/log.h"
#include "core/names.h"
#include "core/print.h"
#include "core/version.h"

namespace limn::apps {
namespace {

// Runs the chosen command and returns the exit code.
using Run = std::function<int()>;

int report_result(const Status& status) {
  if (status) return 0;
  log_warning("limn: {}", status.message());
  return status.error().wrong_usage ? 2 : 1;
}

constexpr EnumNames<bool, 2> k_off_on{{"off", "on"}};

// Accepts one of these names.
CLI::Validator one_of(const std::vector<std::string>& names) {
  const auto problem = [names](const std::string& text) {
    const bool is_one = std::find(names.begin(), names.end(), text) != names.end();
    return is_one ? std::string() : fmt::format("expected one of {}, found '{}'.", joined_names(names), text);
  };
  return {problem, fmt::format("{{{}}}", fmt::join(names, ","))};
}

// An option whose value is one of an enum's names.
template <class Enum, std::size_t Count>
CLI::Option* add_choice(CLI::App* command,
                        const std::string& name,
                        std::optional<Enum>* value,
                        const EnumNames<Enum, Count>& names,
                        const std::string& help) {
  const auto keep = [value, &names](const std::string& text) { *value = names.find(text); };
  return command->add_option_function<std::string>(name, keep, help)->check(one_of(names.all()));
}

// The same; the help shows the present value as the default.
template <class Enum, std::size_t Count>
CLI::Option* add_choice(CLI::App* command,
                        const std::string& name,
                        Enum* value,
                        const EnumNames<Enum, Count>& names,
                        const std::string& help) {
  const auto keep = [value, &names](const std::string& text) { *value = names.find(text).value(); };
  return command->add_option_function<std::string>(name, keep, help)
      ->check(one_of(names.all()))
      ->default_str(names.text(*value));
}

void add_demo(CLI::App& app, Run& run) {
  auto* command = app.add_subcommand(
      "demo", "Play a whole session on the virtual rig: calibrate, track, project, composite");
  command->footer("Example: limn demo --out out   (then open out/demo.html)");
  auto options = std::make_shared<DemoOptions>();
  command->add_option("--out", options->out, "Folder for the images, demo.html and demo.json")
      ->capture_default_str();
  command->add_flag("--window", options->window, "Also show the images in a window; Escape closes it");
  command->add_flag("--keep-captures", options->keep_captures,
                    "Keep the images of the calibration (about 1 GB)");
  command->callback([options, &run] { run = [options] { return report_result(run_demo(*options)); }; });
}

void add_markers(CLI::App& app, Run& run) {
  auto* command = app.add_subcommand(
      "markers", "Make sheets of markers, a calibration board or a marker holder to print in true size");
  command->footer(
      "Example: limn markers --family aruco_4x4_50 --ids 0-11 --size-mm 40 --out sheet.pdf\n"
      "Example: limn markers --board charuco:11x8:25mm --out board.pdf\n"
      "Example: limn markers --size-mm 40 --mount holder.stl   (a 3D-printable holder, its pose in "
      "holder.json)\n"
      "Example: limn markers --learn-body photos/*.jpg --camera camera0.cameramodel --family aruco_4x4_50 "
      "--size-mm 40 --out body.json\n"
      "Example: limn markers --learn-constellation photos/*.jpg --camera camera0.cameramodel --ball-mm 40 "
      "--out wand.json\n"
      "Example: limn markers --train photo.jpg --out logo.patt\n"
      "Example: limn markers --compare logo.patt hiro.patt");
  auto options = std::make_shared<MarkersOptions>();
  auto learning = std::make_shared<LearnBodyOptions>();
  command
      ->add_option(
          "--family", options->family,
          "Marker family, such as apriltag_36h11, apriltag_41h12, artoolkit_3x3 or artoolkit:hiro.patt; "
          "white on black with _inverted: aruco_4x4_50_inverted")
      ->capture_default_str();
  command->add_option("--ids", options->ids, "Numbers of the markers, such as 0-11,15")
      ->capture_default_str();
  command->add_option("--size-mm", options->size_mm, "Side of the marker's square in mm")
      ->capture_default_str();
  command->add_option("--board", options->board,
                      "Make a calibration board instead of markers, such as charuco:11x8:25mm, "
                      "chessboard:9x7:75mm or aprilgrid:6x6:88mm:0.3");
  auto* learn = command->add_option(
      "--learn-body", learning->images,
      "Instead of a sheet: measure from these photographs where the markers of a rigid body are on it");
  command->add_option(
      "--camera", learning->camera,
      "With --learn-body and --learn-constellation: camera file (.cameramodel or another format)");
  auto balls = std::make_shared<LearnConstellationOptions>();
  auto* learn_balls =
      command
          ->add_option("--learn-constellation", balls->images,
                       "Instead of a sheet: measure from these photographs where the balls of a "
                       "rigid body are on it")
          ->excludes(learn);
  command->add_option("--ball-mm", balls->ball_mm, "With --learn-constellation: diameter of the balls in mm")
      ->needs(learn_balls)
      ->capture_default_str();
  add_choice(command, "--shade", &balls->shade, tracker::k_ball_shades,
             "With --learn-constellation: whether the balls are brighter or darker than what is around them")
      ->needs(learn_balls);
  add_choice(command, "--encoding", &balls->encoding, tracker::k_encodings,
             "With --learn-constellation: encoding of grey levels: linear (proportional to light) or srgb "
             "(webcams, photographs)")
      ->needs(learn_balls);
  command
      ->add_option("--others", balls->others,
                   "With --learn-constellation: constellation files that the new one must differ from")
      ->needs(learn_balls);
  auto* train =
      command->add_option("--train", options->train,
                          "Instead of a sheet: make a template from the one black frame in this image");
  command
      ->add_option("--pattern-ratio", options->pattern_ratio,
                   "With --train: width of the frame's inside as share of the frame's (AR.js: patternRatio)")
      ->needs(train)
      ->capture_default_str();
  auto* compare =
      command->add_option("--compare", options->compare,
                          "Instead of a sheet: measure how well these templates can be distinguished");
  command->add_option("--json", options->json, "With --compare: file for the report")->needs(compare);
  compare->excludes(train);
  auto* mount = command->add_option("--mount", options->mount,
                                    "Make a 3D-printable holder (.stl, in mm) for a marker of --size-mm and "
                                    "write its pose beside it; with --out also make the sheet");
  command->add_option("--paper-mm", options->paper_mm, "With --mount: thickness of paper and glue in mm")
      ->needs(mount)
      ->capture_default_str();
  command->add_option(
      "--out", options->out,
      "File to write: .pdf or .svg, for a board also .png, for a body .json, for a template .patt");
  command->callback([options, learning, balls, &run] {
    run = [options, learning, balls] {
      if (!balls->images.empty()) {
        balls->camera = learning->camera;
        balls->out = options->out;
        return report_result(run_learn_constellation(*balls));
      }
      if (learning->images.empty() && !learning->camera.empty())
        return report_result(
            usage_error("--camera: expected --learn-body or --learn-constellation with it."));
      if (learning->images.empty()) return report_result(run_markers(*options));
      learning->family = options->family;
      learning->size_mm = options->size_mm;
      learning->out = options->out;
      return report_result(run_learn_body(*learning));
    };
  });
}

void add_detect(CLI::App& app, Run& run) {
  auto* command =
      app.add_subcommand("detect", "Find markers, or constellations of balls, and their poses in images");
  command->footer(
      "Example: limn detect photo.jpg --family aruco_6x6_250 --camera camera0.cameramodel --size-mm 40 "
      "--draw out\n"
      "Example: limn detect photo.jpg --constellation wand.json --camera camera0.cameramodel");
  auto options = std::make_shared<DetectOptions>();
  command
      ->add_option(
          "images", options->images,
          "Images: PNG, JPEG, PGM, PPM, BMP, TIFF, WebP or TGA, rows as stored (an EXIF orientation is "
          "ignored)")
      ->required();
  command
      ->add_option(
          "--family", options->families,
          "Marker families to look for, separated by commas; white markers on black with _inverted, such as "
          "aruco_4x4_50_inverted; templates with another pattern ratio than 0.5 as "
          "artoolkit:logo.patt@0.8")
      ->delimiter(',')
      ->capture_default_str();
  command->add_option("--camera", options->camera,
                      "Camera file of mrcal, OpenCV, ROS, Kalibr, PhotonVision, ORB-SLAM or ARToolKit; "
                      "FILE:NAME for one of several");
  command->add_option("--size-mm", options->size_mm,
                      "Side of the black square in mm; with --camera it gives poses");
  add_choice(command, "--pose", &options->pose, k_pose_methods,
             "How poses are computed: ippe, or triangle (the method of the 2011 paper)");
  add_choice(command, "--encoding", &options->encoding, tracker::k_encodings,
             "Encoding of grey levels: linear (proportional to light) or srgb (webcams, photographs)");
  command->add_option("--csv", options->csv, "CSV file to write, one row for each marker");
  command->add_option("--json", options->json, "JSON file to write: corners, poses, covariances");
  command->add_option("--draw", options->draw, "Folder for copies of the images with the markers drawn in");
  command
      ->add_option("--threads", options->threads,
                   "Number of images to process at the same time; with one image or --repeat, number of "
                   "threads for an image")
      ->check(CLI::Range(1, 1024))
      ->capture_default_str();
  command
      ->add_option("--repeat", options->repeat,
                   "Also measure the median time in ms of N detections in memory (0: do not)")
      ->check(CLI::Range(0, 1000000));
  auto balls = std::make_shared<DetectBallsOptions>();
  auto* constellation =
      command
          ->add_option("--constellation", balls->constellations,
                       "Find these constellations of balls instead of markers (files of limn markers "
                       "--learn-constellation), separated by commas")
          ->delimiter(',');
  for (const char* other : {"--family", "--size-mm", "--pose", "--csv", "--draw", "--threads", "--repeat"})
    constellation->excludes(command->get_option(other));
  add_choice(command, "--shade", &balls->shade, tracker::k_ball_shades,
             "With --constellation: whether the balls are brighter or darker than what is around them")
      ->needs(constellation);
  command->callback([options, balls, &run] {
    run = [options, balls] {
      if (balls->constellations.empty()) return report_result(run_detect(*options));
      balls->images = options->images;
      balls->camera = options->camera;
      balls->encoding = options->encoding;
      balls->json = options->json;
      return report_result(run_detect_balls(*balls));
    };
  });
}

void add_bench(CLI::App& app, Run& run) {
  auto* command = app.add_subcommand("bench", "Measure accuracy and time beside other programs");
  command->footer(
      "tracker uses generated frames with exact truth, and compares with libapriltag and OpenCV aruco on the "
      "same frames.\n"
      "Example: limn bench tracker --frames 4 --detail");
  auto options = std::make_shared<BenchOptions>();
  command
      ->add_option(
          "name", options->name,
          "Benchmark to run: tracker, id, calib, solve, projector, live, prediction, remote, tablet or room; "
          "arguments after it are passed on to it")
      ->required();
  command->prefix_command();
  command->callback([command, options, &run] {
    options->arguments = command->remaining();
    run = [options] { return report_result(run_bench(*options)); };
  });
}

void add_capture(CLI::App& app, Run& run) {
  auto* command = app.add_subcommand("capture", "Show the patterns of a plan and take the photographs");
  command->footer("Example: limn capture --plan config/plans/bench.json --out captures");
  auto options = std::make_shared<CaptureOptions>();
  command->add_option("--plan", options->plan, "Plan file (limn.plan/1)")->required();
  command->add_option("--out", options->out, "Captures folder to create")->required();
  command->callback([options, &run] { run = [options] { return report_result(run_capture(*options)); }; });
}

void add_plan(CLI::App& app, Run& run) {
  auto* command =
      app.add_subcommand("plan", "Predict the accuracy in mm of a described rig before it is bought");
  command->footer("Example: limn plan config/described/bench.json --out plan   (then open plan/plan.html)");
  auto options = std::make_shared<PlanRigOptions>();
  command->add_option("described", options->described, "File that describes the rig (limn.described/1)")
      ->required();
  command->add_option("--out", options->out,
                      "Folder for plan.html (with the rig from above and from the side) and plan.json; "
                      "without it no files are written");
  command->add_flag("--json", options->json, "Print JSON instead of a table");
  command->callback([options, &run] { run = [options] { return report_result(run_plan_rig(*options)); }; });
}

void add_patterns(CLI::App& app, Run& run) {
  auto* command = app.add_subcommand("patterns", "Make the images that a projector shows for calibration");
  command->footer(
      "Example: limn patterns --projector 1280x800 --out patterns\n"
      "Example: limn patterns --projector 1280x800 --response --out response   (photographs of the prototype "
      "then go to CAPTURES/response/projector0/camera0/)");
  auto options = std::make_shared<PatternsOptions>();
  command->add_option("--projector", options->projector, "Size of the projector in pixels, such as 1280x800")
      ->required();
  add_choice(command, "--code", &options->code, calib::k_pattern_codes,
             "Code: gray, phase (most accurate) or xor (for concave surfaces)");
  auto& code = options->code_options;
  command->add_option("--period", code.period_px, "With phase: length of a wave in projector pixels")
      ->capture_default_str();
  command->add_option("--steps", code.steps, "With phase: number of images of a wave")->capture_default_str();
  command->add_option("--gamma", code.gamma, "With phase: gamma of the projector, light = value ^ gamma")
      ->capture_default_str();
  command->add_option("--linearise", options->linearise,
                      "With phase: response.json of the rig, used instead of --gamma");
  command->add_option("--name", options->name,
                      "Name of the projector in response.json, needed when the file describes several");
  command->add_flag("!--no-inverses", code.inverses,
                    "With gray or xor: leave out the inverted images, which is enough for limn recheck");
  command
      ->add_option("--stripe", code.base_stripe_px,
                   "With xor: width of the widest stripe, 2, 4 or 8 projector pixels")
      ->capture_default_str();
  command->add_flag("--response", options->response,
                    "Instead of a code: make the images that measure the projector's response and colour");
  command->add_option("--out", options->out, "Folder for 000.png ... and patterns.json")->required();
  command->callback([options, &run] { run = [options] { return report_result(run_patterns(*options)); }; });
}

// The options of captures that another program took; --poses is the caller's. They live in `options`.
void add_foreign_options(CLI::App* command, wizard::ForeignOptions* options) {
  add_choice(
      command, "--import", &options->import_format, wizard::k_import_formats,
      "Read captures of another program: opencv-gray, Gray code in any order; phase, phase-shifted waves as "
      "--steps, --periods, --cue, --wave and --order describe");
  command->add_option("--projector", options->projector,
                      "With --import: size of the projector in pixels, such as 1024x768");
  command->add_option(
      "--board", options->board,
      "With --import or --cameras-only: board, such as chessboard:9x7:75mm (counted in inner corners), "
      "charuco:11x8:25mm, circles:11x7:20mm or acircles:4x11:20mm");
  command
      ->add_option_function<std::vector<std::string>>(
          "--shots",
          [options](const std::vector<std::string>& patterns) {
            options->shots = fmt::format("{}", fmt::join(patterns, ","));
          },
          "With --import: name pattern of the images; for several cameras one for each, separated by commas, "
          "such as 'left_*.png,right_*.png' or camera0='left_*',camera1='right_*'")
      ->delimiter(',')
      ->default_str(options->shots);
  command->add_option(
      "--order", options->order,
      "With --import: what is known of the images' order, words separated by commas: white-first, "
      "black-first, "
      "white-last, no-white; inverse-second, inverse-first, inverses-behind, inverses-before, no-inverses; "
      "columns-first, rows-first, columns-only; widest-first, finest-first. The rest is found in the images");
  command
      ->add_option(
          "--step", options->step_px,
          "With --import: width of the narrowest stripes in projector pixels (without it: by the number "
          "of images)")
      ->check(CLI::Range(1, 16));
  command->add_option("--steps", options->steps, "With --import phase: images of one wave")
      ->capture_default_str();
  command
      ->add_option("--periods", options->periods,
                   "With --import phase: lengths of the waves in projector pixels, longest first, such as "
                   "1024,128,16; the first covers the projector unless there is a cue")
      ->delimiter(',');
  command
      ->add_option("--row-periods", options->row_periods,
                   "With --import phase: lengths of the waves along the rows (without it: as the columns')")
      ->delimiter(',');
  command->add_flag(
      "--cue", options->is_cued,
      "With --import phase: before each axis's waves, images of a Gray code number the waves of the "
      "first period; with --order inverse-second each is followed by its inverse");
  add_choice(command, "--wave", &options->wave, calib::k_wave_forms,
             "With --import phase: form of the waves, value = wave(2 pi (x / period - step / steps)): cos, "
             "sin, -cos "
             "or -sin (--wave=-sin)");
  command->add_flag("--backward", options->is_backward,
                    "With --import phase: the steps run the other way, + step / steps");
}

void add_board_measured(CLI::App* command, std::string* text) {
  command->add_option(
      "--board-measured", *text,
      "Measured size of the printed board, from its first to its last inner corner, across and down, with "
      "the "
      "uncertainty in mm: 225.2x149.9mm:0.05 (0.1 when absent). The print's errors are then solved, too");
}

void add_solve(CLI::App& app, Run& run) {
  auto* command = app.add_subcommand(
      "solve", "Calibrate a rig from captures, with a report that says how accurate it is");
  command->footer(
      "Example: limn solve captures --out rig\n"
      "Example: limn solve photos --import opencv-gray --projector 1024x768 --board chessboard:9x7:75mm "
      "--poses 'capture_*' --shots 'graycode_*.png' --out rig\n"
      "Example: limn solve photos --import phase --projector 1280x800 --steps 4 --periods 1280,160,20 "
      "--order "
      "white-first --board chessboard:9x7:75mm --out rig\n"
      "Example: limn solve photos --cameras-only --board chessboard:9x6:25mm --shots 'left*.jpg,right*.jpg' "
      "--out "
      "rig");
  auto options = std::make_shared<wizard::SolveCommandOptions>();
  command->add_option("captures", options->captures, "Captures folder")->required();
  command->add_option("--out", options->out, "Rig folder to write")->required();
  command
      ->add_option("--skip-poses", options->skip_poses,
                   "Names of board poses to leave out, separated by commas")
      ->delimiter(',');
  command
      ->add_option("--camera-model", options->camera_model,
                   "mrcal lens model of the cameras; auto chooses each camera's by held-out error")
      ->capture_default_str();
  command
      ->add_option("--projector-model", options->projector_model,
                   "mrcal lens model of the projectors; auto chooses each projector's by held-out error")
      ->capture_default_str();
  command
      ->add_option(
          "--known-length", options->scale_bar_lengths,
          "A length that was measured: two markers and their distance, such as 'apriltag_36h11:3 "
          "apriltag_36h11:7 250mm:0.05' (standard deviation in mm); a marker and its side, such as "
          "'apriltag_36h11:3 40mm'; or a second board, such as 'charuco:6x5:30mm:aruco_5x5_50'; repeat the "
          "option for more")
      ->allow_extra_args(false);
  command
      ->add_option(
          "--family", options->families,
          "Families of the markers on the prototype, separated by commas: with several cameras their "
          "corners join the cameras (tie points). No size is needed")
      ->delimiter(',')
      ->capture_default_str();
  add_board_measured(command, &options->board_measured);
  command->add_flag(
      "--pixels-not-square", options->pixels_not_square,
      "The cameras' pixels may be not square: take an uneven print for uneven pixels, and do not "
      "assume squares to 0.0001 with --board-measured");
  command->add_flag(
      "--cameras-only", options->cameras_only,
      "Solve the cameras alone, from photographs of the board (one for each pose: in one folder, or in "
      "a folder for each camera) or from captures");
  auto json = std::make_shared<bool>(false);
  command->add_flag("--json", *json, "Print report.json instead of a table");
  add_foreign_options(command, &options->foreign);
  command
      ->add_option(
          "--poses", options->foreign.poses,
          "With --import: name pattern of the pose folders. Where none matches, the folder holds the "
          "images of all poses")
      ->capture_default_str();
  command->callback(
      [options, json, &run] { run = [options, json] { return report_result(run_solve(*options, *json)); }; });
}

// How a command enters a room, beside the room's name.
void add_room_options(CLI::App* command, RoomOptions* options) {
  command->add_option("--name", options->name,
                      "This machine's name in the room; without it the machine's own");
  command->add_option(
      "--peer", options->peers,
      "Address of another machine of the room, for networks without multicast; may be repeated");
  command->add_option("--interface", options->interfaces,
                      "Network interface to use; may be repeated; without it all that work");
}

void add_room_of_devices(CLI::App* command, RoomOptions* options) {
  command->add_option(
      "--room", options->room,
      "Name or folder of a room: devices with host in the devices file are at its other machines");
  add_room_options(command, options);
}

void add_calibrate(CLI::App& app, Run& run) {
  auto* command = app.add_subcommand(
      "calibrate",
      "Calibrate with a wizard that says where to hold the board next, captures, solves and reports");
  command->footer(
      "Opens a window where there is a display. OUT/captures keeps every image, and the same command "
      "continues where\n"
      "it stopped. The wizard ends when the rig is good and more poses do not improve it, or when there are "
      "no more\n"
      "poses. With --devices a pose is captured when the board is held still. Then the prototype is scanned, "
      "the CAD\n"
      "mesh of the scene is aligned to the scan, and projected colours show how far light may be off.\n"
      "Example: limn calibrate --plan config/plans/bench.json --out rig\n"
      "Example: limn calibrate --devices devices.json --board charuco:11x8:25mm --out rig");
  auto options = std::make_shared<CalibrateOptions>();
  options->scan = true;
  command->add_option("--plan", options->plan, "Plan file (limn.plan/1); calibrates the plan's virtual rig");
  auto* devices =
      command->add_option("--devices", options->devices,
                          "Instead of --plan: file that names the cameras and projectors (limn.devices/1)");
  command
      ->add_option("--board", options->board,
                   "With --devices: the board, written as for limn markers --board")
      ->needs(devices);
  add_choice(command, "--code", &options->code, calib::k_pattern_codes,
             "With --devices: code of the patterns, gray, phase or xor")
      ->needs(devices);
  command
      ->add_option(
          "--scene", options->scene,
          "Scene whose CAD mesh is aligned to the scan; with --plan the default is the scene of its world")
      ->check(CLI::ExistingPath);
  add_room_of_devices(command, &options->room);
  add_board_measured(command, &options->board_measured);
  command->add_option("--out", options->out, "Rig folder to write; it also keeps the captures")->required();
  command->add_flag("!--no-scan", options->scan, "Stop after the rig and do not scan the prototype");
  command->add_flag("--all", options->all, "Capture every pose of the plan, even if fewer are enough");
  command->add_flag("--terminal", options->terminal,
                    "Print lines in the terminal instead of opening a window");
  command->add_flag("--json", options->json, "Print JSON instead of lines and open no window");
  command->callback([options, &run] { run = [options] { return report_result(run_calibrate(*options)); }; });
}

void add_scan(CLI::App& app, Run& run) {
  auto* command =
      app.add_subcommand("scan", "Measure the prototype's surface from captures of it with a calibrated rig");
  command->footer(
      "Writes points.ply and mesh.ply (metres, in the rig's world frame), scan.json and images. Poses that "
      "show the\n"
      "board are left out. With --moved the prototype may be in another place in each pose.\n"
      "Example: limn scan captures --rig rig --far 1.8 --out scan\n"
      "Example: limn scan photos --import opencv-gray --projector 1024x768 --poses 'scene_*' --rig rig --out "
      "scan\n"
      "Example: limn scan --plan config/plans/bench.json --rig rig --out scan");
  auto options = std::make_shared<ScanCommand>();
  command->add_option("captures", options->captures,
                      "Captures folder that shows the prototype in its pose folders");
  command->add_option("--plan", options->plan,
                      "Instead of captures: capture the prototype of this plan's world on the virtual rig");
  command->add_option("--rig", options->rig, "Rig folder")->required();
  command->add_option("--out", options->out, "Folder to write")->required();
  command
      ->add_option(
          "--poses", options->poses,
          "Names of poses to use, separated by commas; without it all poses that do not show the board. With "
          "--import: name patterns of the pose folders")
      ->delimiter(',');
  add_foreign_options(command, &options->foreign);
  command->add_flag("--moved", options->moved,
                    "The prototype was moved between poses; register each pose to the first one");
  command
      ->add_option("--pieces", options->pieces,
                   "Number of the largest connected pieces to keep of each view (without it: all)")
      ->check(CLI::Range(0, 1000));
  command->add_option("--near", options->near_m,
                      "Leave out what is nearer to the camera, in metres (without it: no limit)");
  command->add_option(
      "--far", options->far_m,
      "Leave out what is farther from the camera, such as the background, in metres (without it: no limit)");
  command
      ->add_option("--voxel-mm", options->voxel_mm,
                   "Edge of the mesh's voxels in mm (0 or without it: 1.5 times the distance between points)")
      ->check(CLI::Range(0.0, 1000.0));
  command
      ->add_option("--smooth-px", options->smooth_px,
                   "Half the side of the smoothing window, in camera pixels")
      ->check(CLI::Range(2, 8))
      ->capture_default_str();
  command->add_flag("--json", options->json, "Print scan.json instead of a line");
  command->callback([options, &run] { run = [options] { return report_result(run_scan(*options)); }; });
}

void add_recheck(CLI::App& app, Run& run) {
  auto* command = app.add_subcommand(
      "recheck",
      "Find out whether a camera or projector of a calibrated rig has moved, which one and how far");
  command->footer(
      "Needs captures of the board in one pose, or of the prototype alone if it is covered by at least three "
      "devices\n"
      "(cameras and projectors). The pose of the device that has moved is solved again; its lens is kept. "
      "The rig folder\n"
      "is also written if nothing has moved. If no single move explains the captures, only recheck.json is "
      "written. With\n"
      "one camera and one projector, only a board that has not been touched since an earlier recheck shows "
      "which of them\n"
      "has moved.\n"
      "Example: limn recheck --devices devices.json --rig rig --out rig-repaired\n"
      "Example: limn recheck captures --rig rig --out rig-repaired\n"
      "Example: limn recheck captures --rig rig --still rig-repaired/recheck.json --out rig-again\n"
      "Example: limn recheck --plan config/plans/studio.json --prototype --rig rig --out rig-repaired");
  auto options = std::make_shared<RecheckCommand>();
  command->add_option("captures", options->captures, "Captures folder that shows the board or the prototype");
  command->add_option("--devices", options->devices,
                      "Instead of captures: capture with the rig's own cameras and projectors "
                      "(limn.devices/1) for about 15 s, into OUT/captures");
  command->add_option("--plan", options->plan,
                      "Instead of captures: capture the first poses of this plan (15 s) on the virtual rig, "
                      "into OUT/captures");
  command->add_flag("--prototype", options->prototype,
                    "With --plan: capture the world's prototype instead of the board");
  command->add_option("--rig", options->rig, "Rig folder, rig.json or folder of .cameramodel files")
      ->required();
  command->add_option("--still", options->still,
                      "An earlier recheck.json; the board has not been moved since then");
  command->add_option("--out", options->out, "Rig folder to write")->required();
  command->add_flag("--json", options->json, "Print recheck.json instead of a table");
  command->callback([options, &run] { run = [options] { return report_result(run_recheck(*options)); }; });
}

void add_align(CLI::App& app, Run& run) {
  auto* command = app.add_subcommand("align", "Align a CAD mesh to the scan of the prototype");
  command->footer(
      "The initial pose comes from a file, from picked points, from the prototype's markers, or from a "
      "search of the\n"
      "whole scan. Writes poses.json (for limn render --poses), align.json, residual.ply and images of where "
      "CAD and\n"
      "scan differ.\n"
      "PICKS.json: {\"schema\": \"limn.picks/1\", \"pairs\": [{\"cad\": [x, y, z], \"scan_m\": [x, y, z]}, "
      "...]}, cad in --units\n"
      "Example: limn align --scan scan --mesh door.glb --units m --out aligned\n"
      "Example: limn align --scan scan/mesh.ply --mesh door.stl --units mm --points picks.json --out "
      "aligned\n"
      "Example: limn align --scan scan --mesh door.glb --units m --scene config/scenes/door --rig rig "
      "--frame camera0=photo.png --out aligned\n"
      "Example: limn align --scan scan --mesh door.glb --units m --body body.json --rig rig --frame "
      "camera0=photo.png --out aligned");
  auto options = std::make_shared<AlignCommand>();
  command->add_option(
      "--scan", options->scan,
      "Scan: a PLY file or the folder of limn scan; without it the pose is computed from the markers alone");
  add_choice(command, "--scan-units", &options->scan_units, scene::k_length_units,
             "Unit of the PLY file: m, cm, mm, in or ft");
  command->add_option(
      "--mesh", options->mesh,
      "CAD mesh: .glb, .obj, .stl, .ply, .3mf, .fbx … (docs/formats.md); without it the scene's prototype");
  add_choice(command, "--units", &options->units, scene::k_length_units,
             "Unit of the CAD mesh: m, cm, mm, in or ft");
  command->add_option("--start", options->start, "POSES.json with world_from_prototype, the initial pose");
  command->add_option("--points", options->points,
                      "PICKS.json: three or more pairs of corresponding points on CAD and scan");
  command->add_option(
      "--scene", options->scene,
      "Scene whose prototype carries markers; with --rig and --frame they give the initial pose");
  command
      ->add_option("--body", options->body,
                   "body.json of limn markers --learn-body; writes to markers.json where its markers are on "
                   "the CAD mesh")
      ->check(CLI::ExistingFile);
  command->add_option("--rig", options->rig, "Rig folder, needed for --frame");
  command->add_option("--frame", options->frames,
                      "CAMERA=IMAGE, a photograph of the prototype; repeat the option for other cameras");
  command
      ->add_option("--least-mm", options->least_mm,
                   "Smallest difference between CAD and scan to report, in mm")
      ->check(CLI::Range(0.001, 1000.0))
      ->capture_default_str();
  command->add_option("--out", options->out, "Folder to write")->required();
  command->add_flag("--json", options->json, "Print align.json instead of a line");
  command->callback([options, &run] { run = [options] { return report_result(run_align(*options)); }; });
}

void add_render(CLI::App& app, Run& run) {
  auto* command = app.add_subcommand(
      "render", "Draw a scene: images for every projector, composites over camera images, and coverage");
  command->footer(
      "With --poses and no --frame the composites are drawn over black, one for each camera.\n"
      "Example: limn render --rig rig --scene config/scenes/door --frame camera0=photo.png --out rendered\n"
      "Example: limn render --rig rig --scene config/scenes/door --poses poses.json --viewer pose.json --out "
      "rendered");
  auto options = std::make_shared<RenderOptions>();
  command->add_option("--rig", options->rig, "Rig folder, rig.json or folder of .cameramodel files")
      ->required();
  command->add_option("--scene", options->scene, "Scene folder or its scene.json")->required();
  command->add_option(
      "--frame", options->frames,
      "CAMERA=IMAGE, a photograph whose markers place the scene; repeat the option for other cameras");
  command->add_option("--poses", options->poses,
                      "POSES.json that places the scene; the images of --frame are then only drawn over");
  command->add_option("--viewer", options->viewers,
                      "Viewer file; repeat the option for several viewers, who share one viewpoint in which "
                      "the nearest counts most. Without it: the scene's viewers, or else camera 0");
  add_choice(command, "--composite", &options->composite, k_composites,
             "What composites draw: full (whole parts) or rest (only what light cannot show)");
  command->add_flag("--undistorted", options->undistorted,
                    "Remove the lens distortion of the cameras from the composites");
  add_choice(command, "--contact-shadow", &options->contact_shadow, k_off_on,
             "on: parts darken the prototype around them in composites and view.png; off: pixels beside "
             "parts keep their values");
  add_choice(command, "--marker-light", &options->marker_light, tracker::k_marker_lights,
             "Light on markers: as-is (like the rest), keep-out (dark) or spotlight (white)");
  command->add_option(
      "--view", options->view,
      "Viewer file of a virtual camera; writes view.png with prototype and parts as it sees them");
  command->add_option(
      "--stereo", options->stereo_mm,
      "With --view: distance between two virtual cameras in mm; view.png shows their images side by side");
  add_choice(command, "--compensation", &options->light.compensation, k_compensations,
             "What the projected light compensates for: none; geometry (distance, incidence, vignetting and "
             "the scene's albedo); measured (albedo, colours, ambient and black light as measured by the "
             "rig's response images)");
  command->add_option(
      "--measured-at", options->light.measured_at,
      "POSES.json with the prototype's pose in the response images; without it, the pose where it is drawn");
  command->add_option(
      "--level", options->light.level,
      "With compensation: brightness of white as an irradiance, where 1 is a projector's white at 1 m "
      "distance and normal incidence; without it, the level that four fifths of the prototype can reach");
  add_choice(
      command, "--black", &options->light.even_black, k_blacks,
      "Black light of the projectors: as-is, or even (overlaps of projectors do not show in the dark)");
  command->add_option("--out", options->out, "Folder for the images and coverage.json")->required();
  command->callback([options, &run] { run = [options] { return report_result(run_render(*options)); }; });
}

void add_check(CLI::App& app, Run& run) {
  auto* command = app.add_subcommand(
      "check", "Compare what the renderer draws with the ray tracer, and fail where a limit is missed");
  command->footer(
      "A check file names a world, poses and limits (config/README.md); without files all of config/checks "
      "are run.\n"
      "OUT/check.html shows what was drawn, what was expected and the difference. Exits with 1 when a limit "
      "is missed.\n"
      "Example: limn check\n"
      "Example: limn check config/checks/door-moved.json --out checked\n"
      "Example: limn check --against from-the-other-machine");
  auto options = std::make_shared<CheckOptions>();
  command->add_option("checks", options->files,
                      "Check files (limn.check/1); without them all of config/checks");
  command->add_option("--out", options->out, "Folder for check.html, check.json and the images")
      ->capture_default_str();
  command->add_flag("--json", options->json, "Print check.json instead of a table");
  command->add_option("--against", options->against,
                      "OUT folder of another run of the same checks, for instance on another machine or "
                      "driver; at most 0.1 % of an image's pixels may differ by more than two levels");
  command->callback([options, &run] { run = [options] { return report_result(run_check(*options)); }; });
}

void add_export(CLI::App& app, Run& run) {
  auto* command =
      app.add_subcommand("export", "Export maps of every projector, or the rig's lenses, for other programs");
  command->footer(
      "Writes MPCDI 2.0 (VESA). The maps have the projectors' size. Points are in metres in the frame of "
      "the\n"
      "prototype's mesh, and NaN where a pixel does not reach it. Profile sl: points, each projector's pose "
      "and pinhole\n"
      "frustum, and its lens as a distortion map. Profile a3: points alone. Profile 3d: positions (x right, "
      "y down,\n"
      "0 to 1) in the image of one viewer. Alpha map: the projector's share of the linear light, value =\n"
      "share^(1/gamma). Beta map (where black light was measured): display values that make black even.\n"
      "--opencv, --ros and --kalibr write the rig's cameras and projectors as camera files; they need --rig "
      "alone.\n"
      "Example: limn export --mpcdi door.mpcdi --rig rig --scene config/scenes/door --poses poses.json\n"
      "Example: limn export --warp warps --format exr --rig rig --scene config/scenes/door --poses "
      "poses.json\n"
      "Example: limn export --opencv cameras --kalibr camchain.yaml --rig rig");
  auto options = std::make_shared<exchange::ExportOptions>();
  command->add_option("--mpcdi", options->mpcdi, "MPCDI archive to write");
  add_choice(command, "--profile", &options->profile, exchange::k_written_mpcdi_profiles,
             "MPCDI profile: sl (shader lamps), a3 (advanced 3D) or 3d (one viewer)");
  command->add_option("--gamma", options->gamma, "Gamma of the alpha maps (gammaEmbedded); 1 is linear")
      ->capture_default_str();
  command->add_option("--bits", options->bits, "Bits of the alpha and beta maps, 8 or 16")
      ->capture_default_str();
  command->add_option("--warp", options->warp,
                      "Folder for warp-PROJECTOR.pfm or .exr, the points that the pixels light");
  add_choice(command, "--format", &options->format, exchange::k_warp_formats,
             "File format of --warp: pfm or exr (R, G, B are x, y, z)");
  command->add_option("--looks", options->looks,
                      "Folder for look-SLOT-VARIANT.png, each variant as the viewer sees it");
  command->add_option("--opencv", options->opencv, "Folder for NAME.yml, OpenCV's camera files");
  command->add_option("--ros", options->ros, "Folder for NAME.yaml, ROS's camera_info files");
  command->add_option(
      "--kalibr", options->kalibr,
      "Kalibr's camchain to write: cameras, then projectors, each relative to the one before");
  command->add_option("--rig", options->rig, "Rig folder, rig.json or folder of .cameramodel files")
      ->required();
  command->add_option("--scene", options->scene,
                      "Scene folder or its scene.json, for --mpcdi, --warp and --looks");
  command->add_option("--poses", options->poses, "POSES.json with the pose of the prototype, likewise");
  command->add_option("--viewer", options->viewer,
                      "Viewer file for --profile 3d and --looks; without it the scene's viewer");
  auto json = std::make_shared<bool>(false);
  command->add_flag("--json", *json, "Print JSON instead of a line for each projector");
  command->callback([options, json, &run] {
    run = [options, json] { return report_result(run_export(*options, *json)); };
  });
}

// The subcommand of `import`.
CLI::App* add_import_rig(CLI::App* import, Run& run) {
  auto* command = import->add_subcommand("rig", "Make a rig from the calibration of another program");
  command->footer(
      "Reads procam-calibration (calibration_result.xml), SLStudio (calibration.xml), procamcalib "
      "(calibration.yml), RoomAlive\n"
      "Toolkit (XML), OpenCV's stereo calibration (one file, or intrinsics and extrinsics) and MPCDI.\n"
      "Example: limn import rig calibration_result.xml --units mm --projector 1024x768 --out rig\n"
      "Example: limn import rig intrinsics.yml extrinsics.yml --units m --camera-size 640x480 --out rig");
  auto options = std::make_shared<ImportRigOptions>();
  command->add_option("files", options->files, "File of the other program, or two that belong together")
      ->required()
      ->expected(1, 2);
  command->add_option("--out", options->out, "Rig folder to write")->required();
  add_choice(command, "--units", &options->units, scene::k_length_units,
             "Unit of the file's lengths, where it does not say: that of the board's squares");
  command->add_option("--camera-size", options->camera_size,
                      "Size of the camera's images in pixels, such as 1280x960, where the file does not say");
  command->add_option(
      "--projector", options->projector_size,
      "Likewise of the projector. OpenCV's stereo calibration: the second device is a projector "
      "of this size, not a camera");
  command->add_flag("--json", options->json, "Print JSON instead of a line for each device");
  command->callback([options, &run] { run = [options] { return report_result(run_import_rig(*options)); }; });
  return command;
}

void add_import(CLI::App& app, Run& run) {
  auto* command = app.add_subcommand(
      "import", "Show what an MPCDI file holds or what is wrong with it, and write its projectors as a rig");
  command->footer(
      "Reads archives of MPCDI 1 and 2, and XML without an archive as Christie's Mystique writes it (poses "
      "without maps).\n"
      "Example: limn import theirs.mpcdi --out rig\n"
      "Rigs of other programs: limn import rig --help");
  auto options = std::make_shared<ImportOptions>();
  command->add_option("file", options->file, "Archive (.mpcdi) or XML (.mpcdi.xml)");
  command->add_option("--out", options->out,
                      "Rig folder to write, in the file's own coordinate frame (profile sl)");
  command->add_flag("--json", options->json, "Print JSON instead of a line for each region");
  const CLI::App* rig = add_import_rig(command, run);
  command->callback([options, rig, &run] {
    if (rig->parsed()) return;  // its own callback has set `run`
    if (options->file.empty()) throw CLI::RequiredError("file");
    run = [options] { return report_result(run_import(*options)); };
  });
}

void add_live(CLI::App& app, Run& run) {
  auto* command =
      app.add_subcommand("live", "Run a live session: cameras, tracker, prediction, projectors and screen");
  command->footer(
      "Without --devices the session runs on a virtual rig with its own clock: on the given world, or in a "
      "room made for\n"
      "the given rig and scene. Keys in the operator's window, also from clickers and pedals: right/left "
      "next/previous\n"
      "variant, tab next slot, b blackout, f freeze, m markers, s save a look, l/k next/previous look, o "
      "what the screen\n"
      "shows, r release, a pair with the marker that glows, v switch between this look and the one before, x "
      "show both\n"
      "looks side by side, g grid, escape asks to end.\n"
      "Example: limn live --seconds 5 --out session\n"
      "Example: limn live --devices devices.json --rig rig --scene config/scenes/door --out session "
      "--window\n"
      "Example: limn live --rig rig --scene config/scenes/door --seconds 10 --record recording\n"
      "Example: limn live --osc 9000 --osc-to 127.0.0.1:9001   (docs/osc.md)\n"
      "Example: limn live --trackers trackers.json --window   (docs/trackers.md)\n"
      "Example: limn live --window --serve 8080   (docs/remote.md)");
  auto options = std::make_shared<LiveOptions>();
  command->add_option(
      "--rig", options->rig,
      "Rig folder, rig.json or folder of .cameramodel files; without it the virtual world's own rig");
  command->add_option("--scene", options->scene,
                      "Scene folder or its scene.json; without it the virtual world's own scene");
  command->add_option("--devices", options->devices,
                      "File that names the cameras and displays (limn.devices/1); without it a virtual rig");
  command->add_option(
      "--world", options->world,
      "World of the virtual rig (limn.world/1); without it, and without rig and scene, the world studio");
  command->add_option("--script", options->script,
                      "File that says what happens in the virtual room (limn.script/1)");
  command->add_option("--seconds", options->seconds,
                      "Length in seconds of the session's clock; without it the script's length, or until "
                      "somebody ends the session");
  command->add_option(
      "--resolution", options->resolution,
      "Scale of the virtual devices' image sides, over 0 and at most 1. Without it 1, or with "
      "--window, --serve, --osc or --trackers what this machine computes in real time");
  command->add_option("--record", options->record, "Folder for a recording that limn replay can play");
  command->add_option("--out", options->out,
                      "Folder for poses.csv, telemetry.csv, session.html and the last images");
  command->add_flag("--window", options->window,
                    "Open the operator's window: images, devices, parts, looks, telemetry, keys");
  add_choice(command, "--prediction", &options->prediction, tracker::k_predictions,
             "How poses are predicted for the moment when the light is shown: hold, linear or filtered");
  add_choice(command, "--triple-pose", &options->triple_pose, tracker::k_triple_poses,
             "Pose of three balls in one image: refined, or triangle (the method of the 2011 paper; with "
             "--prediction hold or linear)");
  add_choice(command, "--marker-light", &options->marker_light, tracker::k_marker_lights,
             "Light on markers: as-is (like the rest), keep-out (dark) or spotlight (white)");
  command->add_option("--stereo", options->stereo,
                      "Projector of the virtual rig that shows an image to each eye of the viewer; repeat it "
                      "for several. For devices, stereo is set in the devices file");
  command->add_option("--osc", options->osc,
                      "PORT or ADDRESS:PORT at which OSC messages of other programs are received; a port "
                      "alone accepts this machine only");
  command->add_option("--osc-from", options->osc_from,
                      "Numeric address of the only machine whose OSC messages are accepted");
  command->add_option("--osc-to", options->osc_to, "HOST:PORT to which changes are sent by OSC");
  command->add_option("--trackers", options->trackers,
                      "File that names other tracking systems whose poses are used (limn.trackers/1)");
  command->add_option(
      "--poses-out", options->poses_out,
      "PROTOCOL:HOST:PORT to which the poses of bodies and viewer are sent at each frame; psn, "
      "freed or json; or ros for ROS 2; may be repeated");
  add_room_of_devices(command, &options->room);
  command->add_option("--serve", options->serve,
                      "PORT or ADDRESS:PORT of the remote for phones and tablets; a port alone accepts this "
                      "machine only, a network address is encrypted");
  command->add_option(
      "--serve-show", options->serve_show,
      "Name of a projector that shows the remote's QR code and PIN (role work) for the first 60 s");
  command->add_flag("!--no-refill", options->refill,
                    "Do not fill shadows of people with the light of other projectors");
  command
      ->add_option("--extrapolate", options->extrapolate_s,
                   "How long unseen markers are extrapolated, in seconds")
      ->capture_default_str();
  command->add_flag("--json", options->json, "Print JSON instead of lines");
  command->callback([options, &run] {
    // People and programs that take part in a session live in real time.
    options->is_real_time =
        options->window || !options->serve.empty() || !options->osc.empty() || !options->trackers.empty();
    run = [options] { return report_result(run_live(*options)); };
  });
}

void add_room(CLI::App& app, Run& run) {
  auto* command = app.add_subcommand("room", "Make the keys of a room of several machines");
  command->footer("Example: limn room create studio   (docs/rooms.md)");
  command->require_subcommand(1);
  auto* create = command->add_subcommand(
      "create",
      "Make a room: keys that machines need to work together. Copy its folder to the other machines");
  auto name = std::make_shared<std::string>();
  auto folder = std::make_shared<std::filesystem::path>();
  create->add_option("name", *name, "The room's name")->required();
  create->add_option("--out", *folder, "Folder for the keys; without it ~/.config/limn/rooms/NAME");
  create->callback(
      [name, folder, &run] { run = [=] { return report_result(create_room(*name, *folder)); }; });
}

void add_node(CLI::App& app, Run& run) {
  auto* command = app.add_subcommand(
      "node", "Lend this machine's monitors and cameras to a room, and light its projectors");
  command->footer(
      "Ctrl+C or a TERM signal ends it; its projectors become black. Without a host it waits for one.\n"
      "Example: limn node --join studio   (docs/rooms.md)");
  auto options = std::make_shared<NodeCommand>();
  command->add_option("--join", options->room.room, "Name or folder of the room (limn room create)")
      ->required();
  add_room_options(command, &options->room);
  command->add_option("--out", options->out,
                      "Folder for shown.csv: when each image was shown, and its fingerprint");
  command->callback([options, &run] { run = [options] { return report_result(run_node(*options)); }; });
}

void add_replay(CLI::App& app, Run& run) {
  auto* command = app.add_subcommand(
      "replay", "Replay a recorded session, with the same poses and, on the same machine, the same images");
  command->footer(
      "Example: limn replay recording --out replayed\n"
      "Example: limn replay recording --window --speed 1");
  auto options = std::make_shared<ReplayOptions>();
  command->add_option("session", options->session, "Recording folder that limn live --record wrote")
      ->required();
  command->add_option("--out", options->out,
                      "Folder for poses.csv, telemetry.csv, session.html and the last images");
  command
      ->add_option("--speed", options->speed,
                   "Speed relative to the recorded session; 0 is as fast as possible")
      ->capture_default_str();
  command->add_flag("--step", options->step, "Wait for the enter key before each image");
  command->add_flag("--window", options->window, "Show the screen's image in a window");
  command->add_flag("--json", options->json, "Print JSON instead of lines");
  command->callback([options, &run] { run = [options] { return report_result(run_replay(*options)); }; });
}

void add_simulate(CLI::App& app, Run& run) {
  auto* command = app.add_subcommand(
      "simulate", "Simulate the images of a virtual rig's cameras, and write the ground truth");
  command->footer("Example: limn simulate config/worlds/studio.json --out simulated --variants mirror=sport");
  auto options = std::make_shared<SimulateOptions>();
  command->add_option("world", options->world, "World file (limn.world/1)")->required();
  command->add_option("--out", options->out, "Folder for the images, truth.json and the true rig")
      ->required();
  command->add_option("--show", options->show,
                      "PROJECTOR=IMAGE that a projector shows; repeat the option for other projectors");
  command->add_option("--variants", options->variants,
                      "SLOT=VARIANT,… for the image that shows the parts as physical objects; without it "
                      "each slot's first variant");
  command->add_flag("--srgb", options->srgb,
                    "Encode images as sRGB for people, instead of as the world's cameras do");
  command->callback([options, &run] { run = [options] { return report_result(run_simulate(*options)); }; });
}

void add_doctor(CLI::App& app, Run& run) {
  auto* command =
      app.add_subcommand("doctor", "Test displays, cameras, OpenGL, clock and packages, and say what to do");
  command->footer(
      "Exits with 1 when a device that is connected, or that the devices file or --show asks for, does not "
      "work.\n"
      "Example: limn doctor --show 10\n"
      "Example: limn doctor --devices config/devices/studio.json --rig rig\n"
      "Example: limn doctor --room studio");
  auto options = std::make_shared<DoctorOptions>();
  command->add_option("--room", options->room.room, "Name or folder of a room whose machines are listed");
  add_room_options(command, &options->room);
  auto* devices = command->add_option("--devices", options->devices, "Devices file (limn.devices/1) to test");
  command->add_option("--rig", options->rig, "Rig folder; the devices must have its names and sizes")
      ->needs(devices);
  command
      ->add_option(
          "--show", options->show_s,
          "How long each output shows its own number and colour, in seconds (without it: not at all)")
      ->check(CLI::Range(0.0, 3600.0));
  command->add_flag("--json", options->json, "Print JSON instead of lines");
  command->callback([options, &run] { run = [options] { return report_result(run_doctor(*options)); }; });
}

}  // namespace

namespace {

Error out_of_memory() {
  return error("expected enough memory for this work, found none left. Use smaller images.");
}

// Wrong usage if a file that the command would write is one that it reads. A value may name its file after
// "CAMERA=" or "FAMILY:".
Status check_files(const CLI::App& command) {
  static constexpr std::array k_outputs = {"--out", "--csv", "--json", "--draw", "--mount"};
  std::vector<NamedFile> outputs, inputs;
  for (const CLI::Option* option : command.get_options()) {
    if (option->get_items_expected_max() == 0) continue;  // a flag
    const std::string name = option->get_name();
    const bool is_output = std::find(k_outputs.begin(), k_outputs.end(), name) != k_outputs.end();
    for (const std::string& value : option->results()) {
      (is_output ? outputs : inputs).push_back({name.starts_with("-") ? name : "", value});
      for (const char separator : {'=', ':'})
        if (const auto at = value.find(separator); at != std::string::npos && !is_output)
          inputs.push_back({name, value.substr(at + 1)});
    }
  }
  return check_outputs(outputs, inputs);
}

Error bug(const std::exception& problem) {
  return error("this is a bug in Limn, please report it: {}", problem.what());
}

int run_arguments(int argc, char** argv) {
  CLI::App app{"Limn paints virtual parts onto a physical prototype with light."};
  app.name("limn");
  app.set_version_flag("--version", fmt::format("limn {}", version()), "Print the version and exit");
  app.require_subcommand(1);
  Run run;
  // The order of a session. Each line is add_NAME(app, run).
  add_markers(app, run);
  add_detect(app, run);
  add_bench(app, run);
  add_demo(app, run);
  add_plan(app, run);
  add_patterns(app, run);
  add_capture(app, run);
  add_solve(app, run);
  add_calibrate(app, run);
  add_scan(app, run);
  add_recheck(app, run);
  add_align(app, run);
  add_render(app, run);
  add_export(app, run);
  add_import(app, run);
  add_check(app, run);
  add_live(app, run);
  add_room(app, run);
  add_node(app, run);
  add_replay(app, run);
  add_simulate(app, run);
  add_doctor(app, run);

  if (argc == 1) {
    print_text(app.help());
    return 2;
  }
  const auto commands = app.get_subcommands({});
  const auto is_named = [&](const CLI::App* command) { return argc > 1 && command->get_name() == argv[1]; };
  if (argc > 1 && argv[1][0] != '-' && std::none_of(commands.begin(), commands.end(), is_named)) {
    std::string known;
    for (const CLI::App* command : commands) known += " " + command->get_name();
    return report_result(usage_error("unknown command '{}'; expected one of:{}.", argv[1], known));
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& problem) {
    return app.exit(problem) == 0 ? 0 : 2;
  }
  try {
    for (const CLI::App* command = &app; !command->get_subcommands().empty();) {
      command = command->get_subcommands().front();
      if (const Status files = check_files(*command); !files) return report_result(files);
    }
    return run();
  } catch (const std::filesystem::filesystem_error& problem) {
    return report_result(
        error("{}: expected a file or folder that can be opened, found: {}. Check its name and permissions.",
              problem.path1().string(), problem.code().message()));
  } catch (const std::bad_alloc&) {
    return report_result(out_of_memory());
  } catch (const cv::Exception& problem) {
    if (problem.code == cv::Error::StsNoMem) return report_result(out_of_memory());
    return report_result(bug(problem));
  } catch (const std::system_error& problem) {
    if (problem.code() == std::errc::resource_unavailable_try_again)
      return report_result(
          error("expected another thread for this work, found none left. End other programs, "
                "or raise the limit (ulimit -u)."));
    return report_result(bug(problem));
  } catch (const std::exception& problem) {
    return report_result(bug(problem));
  }
}

}  // namespace

int run_command_line(int argc, char** argv) {
  const int code = run_arguments(argc, argv);
  const int output = report_result(flush_output());
  return code != 0 ? code : output;
}

}  // namespace limn::apps
