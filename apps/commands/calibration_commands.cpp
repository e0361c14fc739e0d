#include <CLI/CLI.hpp>
#include <memory>

#include "apps/calibrate.h"
#include "apps/capture.h"
#include "apps/commands/commands.h"
#include "apps/commands/options.h"
#include "apps/patterns.h"
#include "apps/plan_rig.h"
#include "apps/solve.h"

namespace limn::apps {

void add_plan(CLI::App& app, Run& run) {
  auto* command =
      app.add_subcommand("plan", "Predict the accuracy in mm of a described rig before it is bought");
  command->footer("Example: limn plan config/described/bench.json --out plan   (then open plan/plan.html)");
  auto options = std::make_shared<PlanRigOptions>();
  command->add_option("described", options->described, "File that describes the rig (limn.described/1)")
      ->type_name("FILE.json")
      ->required();
  command
      ->add_option("--out", options->out,
                   "Folder for plan.html (with the rig from above and from the side) and plan.json; "
                   "without it no files are written")
      ->type_name("FOLDER");
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
      ->type_name("WIDTHxHEIGHT")
      ->required();
  add_choice(command, "--code", &options->code, calib::k_pattern_codes,
             "Code: gray, phase (most accurate) or xor (for concave surfaces)");
  auto& code = options->code_options;
  command->add_option("--period", code.period_px, "With phase: length of a wave in projector pixels")
      ->capture_default_str();
  command->add_option("--steps", code.steps, "With phase: number of images of a wave")->capture_default_str();
  command->add_option("--gamma", code.gamma, "With phase: gamma of the projector, light = value ^ gamma")
      ->capture_default_str();
  command
      ->add_option("--linearise", options->linearise,
                   "With phase: response.json of the rig, used instead of --gamma")
      ->type_name("FILE.json");
  command
      ->add_option("--name", options->name,
                   "Name of the projector in response.json, needed when the file describes several")
      ->type_name("NAME");
  command->add_flag("!--no-inverses", code.inverses,
                    "With gray or xor: leave out the inverted images, which is enough for limn recheck");
  command
      ->add_option("--stripe", code.base_stripe_px,
                   "With xor: width of the widest stripe, 2, 4 or 8 projector pixels")
      ->capture_default_str();
  command->add_flag("--response", options->response,
                    "Instead of a code: make the images that measure the projector's response and colour");
  command->add_option("--out", options->out, "Folder for 000.png ... and patterns.json")
      ->type_name("FOLDER")
      ->required();
  command->callback([options, &run] { run = [options] { return report_result(run_patterns(*options)); }; });
}

void add_capture(CLI::App& app, Run& run) {
  auto* command = app.add_subcommand("capture", "Show the patterns of a plan and take the photographs");
  command->footer("Example: limn capture --plan config/plans/bench.json --out captures");
  auto options = std::make_shared<CaptureOptions>();
  command->add_option("--plan", options->plan, "Plan file (limn.plan/1)")->type_name("FILE.json")->required();
  command->add_option("--out", options->out, "Captures folder to create")->type_name("FOLDER")->required();
  command->callback([options, &run] { run = [options] { return report_result(run_capture(*options)); }; });
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
  command->add_option("captures", options->captures, "Captures folder")->type_name("CAPTURES")->required();
  command->add_option("--out", options->out, "Rig folder to write")->type_name("FOLDER")->required();
  command
      ->add_option("--skip-poses", options->skip_poses,
                   "Names of board poses to leave out, separated by commas")
      ->type_name("NAMES")
      ->delimiter(',');
  command
      ->add_option("--camera-model", options->camera_model,
                   "mrcal lens model of the cameras; auto chooses each camera's by held-out error")
      ->type_name("MODEL")
      ->capture_default_str();
  command
      ->add_option("--projector-model", options->projector_model,
                   "mrcal lens model of the projectors; auto chooses each projector's by held-out error")
      ->type_name("MODEL")
      ->capture_default_str();
  command
      ->add_option(
          "--known-length", options->scale_bar_lengths,
          "A length that was measured: two markers and their distance, such as 'apriltag_36h11:3 "
          "apriltag_36h11:7 250mm:0.05' (standard deviation in mm); a marker and its side, such as "
          "'apriltag_36h11:3 40mm'; or a second board, such as 'charuco:6x5:30mm:aruco_5x5_50'; repeat the "
          "option for more")
      ->type_name("LENGTH")
      ->allow_extra_args(false);
  command
      ->add_option(
          "--family", options->families,
          "Families of the markers on the prototype, separated by commas: with several cameras their "
          "corners join the cameras (tie points). No size is needed")
      ->type_name("FAMILY")
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
      ->type_name("PATTERN")
      ->capture_default_str();
  command->callback(
      [options, json, &run] { run = [options, json] { return report_result(run_solve(*options, *json)); }; });
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
  command->add_option("--plan", options->plan, "Plan file (limn.plan/1); calibrates the plan's virtual rig")
      ->type_name("FILE.json");
  auto* devices =
      command
          ->add_option("--devices", options->devices,
                       "Instead of --plan: file that names the cameras and projectors (limn.devices/1)")
          ->type_name("FILE.json");
  command
      ->add_option("--board", options->board,
                   "With --devices: the board, written as for limn markers --board")
      ->type_name("BOARD")
      ->needs(devices);
  add_choice(command, "--code", &options->code, calib::k_pattern_codes,
             "With --devices: code of the patterns, gray, phase or xor")
      ->needs(devices);
  command
      ->add_option(
          "--scene", options->scene,
          "Scene whose CAD mesh is aligned to the scan; with --plan the default is the scene of its world")
      ->type_name("SCENE")
      ->check(CLI::ExistingPath);
  add_room_of_devices(command, &options->room);
  add_board_measured(command, &options->board_measured);
  command->add_option("--out", options->out, "Rig folder to write; it also keeps the captures")
      ->type_name("FOLDER")
      ->required();
  command->add_flag("!--no-scan", options->scan, "Stop after the rig and do not scan the prototype");
  command->add_flag("--all", options->all, "Capture every pose of the plan, even if fewer are enough");
  command->add_flag("--terminal", options->terminal,
                    "Print lines in the terminal instead of opening a window");
  command->add_flag("--json", options->json, "Print JSON instead of lines and open no window");
  command->callback([options, &run] { run = [options] { return report_result(run_calibrate(*options)); }; });
}

}  // namespace limn::apps
