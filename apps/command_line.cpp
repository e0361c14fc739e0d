#include "apps/command_line.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <functional>
#include <iostream>
#include <memory>

#include "apps/align.h"
#include "apps/bench.h"
#include "apps/calibrate.h"
#include "apps/capture.h"
#include "apps/check.h"
#include "apps/demo.h"
#include "apps/detect.h"
#include "apps/doctor.h"
#include "apps/export.h"
#include "apps/import.h"
#include "apps/learn_body.h"
#include "apps/live.h"
#include "apps/markers.h"
#include "apps/patterns.h"
#include "apps/plan_rig.h"
#include "apps/recheck.h"
#include "apps/render.h"
#include "apps/replay.h"
#include "apps/scan.h"
#include "apps/simulate.h"
#include "apps/solve.h"
#include "core/log.h"
#include "core/version.h"

namespace limn::apps {
namespace {

// What a chosen command does; returns the exit code.
using Run = std::function<int()>;

int finished(const Status& status) {
  if (status) return 0;
  log_warning("limn: {}", status.message());
  return status.error().wrong_usage ? 2 : 1;
}

void add_demo(CLI::App& app, Run& run) {
  auto* command =
      app.add_subcommand("demo", "a whole session on the virtual rig: calibrate, track, project, composite");
  command->footer("Example: limn demo --out out   (then open out/demo.html)");
  auto options = std::make_shared<DemoOptions>();
  command->add_option("--out", options->out, "folder for pictures, demo.html and demo.json")
      ->capture_default_str();
  command->add_flag("--window", options->window, "also show the pictures in a window; Escape closes it");
  command->add_flag("--keep-captures", options->keep_captures, "keep the calibration's pictures (some 1 GB)");
  command->callback([options, &run] { run = [options] { return finished(run_demo(*options)); }; });
}

void add_markers(CLI::App& app, Run& run) {
  auto* command =
      app.add_subcommand("markers", "sheets of markers or a calibration board to print, true size");
  command->footer(
      "Example: limn markers --family aruco_4x4_50 --ids 0-11 --size-mm 40 --out sheet.pdf\n"
      "Example: limn markers --board charuco:11x8:25mm --out board.pdf\n"
      "Example: limn markers --size-mm 40 --mount holder.stl   (a 3D-printable holder, its pose in "
      "holder.json)\n"
      "Example: limn markers --learn-body photos/*.jpg --camera camera0.cameramodel --family aruco_4x4_50 "
      "--size-mm 40 "
      "--out body.json\n"
      "Example: limn markers --train photo.jpg --out logo.patt\n"
      "Example: limn markers --compare logo.patt hiro.patt");
  auto options = std::make_shared<MarkersOptions>();
  auto learning = std::make_shared<LearnBodyOptions>();
  command
      ->add_option("--family", options->family, "such as apriltag_36h11, artoolkit_3x3, artoolkit:hiro.patt")
      ->capture_default_str();
  command->add_option("--ids", options->ids, "such as 0-11,15")->capture_default_str();
  command->add_option("--size-mm", options->size_mm, "side of the black square")->capture_default_str();
  command->add_option("--board", options->board, "a board instead: charuco:11x8:25mm, chessboard:9x7:75mm");
  auto* learn =
      command->add_option("--learn-body", learning->images,
                          "instead: where the markers of a rigid thing stand on it, from pictures of it");
  command->add_option("--camera", learning->camera, "with --learn-body: .cameramodel or another camera file")
      ->needs(learn);
  auto* train =
      command->add_option("--train", options->train, "instead: its one black frame becomes a template");
  auto* compare =
      command->add_option("--compare", options->compare, "instead: how well these templates are told apart");
  command->add_option("--json", options->json, "with --compare: file for the report")->needs(compare);
  compare->excludes(train);
  auto* mount = command->add_option("--mount", options->mount,
                                    "a 3D-printable holder for a marker of --size-mm: .stl (mm), "
                                    "its pose beside it; with --out the sheet, too");
  command->add_option("--paper-mm", options->paper_mm, "with --mount: thickness of paper and glue")
      ->needs(mount)
      ->capture_default_str();
  command->add_option("--out", options->out,
                      "file to write: .pdf, .svg; a board .png; a body .json; a template .patt");
  command->callback([options, learning, &run] {
    run = [options, learning] {
      if (learning->images.empty()) return finished(run_markers(*options));
      learning->family = options->family;
      learning->size_mm = options->size_mm;
      learning->out = options->out;
      return finished(run_learn_body(*learning));
    };
  });
}

void add_detect(CLI::App& app, Run& run) {
  auto* command = app.add_subcommand("detect", "markers and their poses in pictures");
  command->footer(
      "Example: limn detect photo.jpg --family aruco_6x6_250 --camera camera0.cameramodel --size-mm 40 "
      "--draw out");
  auto options = std::make_shared<DetectOptions>();
  command->add_option("images", options->images, "PNG or JPEG pictures")->required();
  command->add_option("--family", options->families, "what to look for, with commas")
      ->delimiter(',')
      ->capture_default_str();
  command->add_option("--camera", options->camera, ".cameramodel, OpenCV YAML or ARToolKit camera_para.dat");
  command->add_option("--size-mm", options->size_mm, "side of the black square; with --camera gives poses");
  command->add_option("--pose", options->pose, "ippe, or triangle (the method of the 2011 paper)")
      ->capture_default_str();
  command
      ->add_option("--encoding", options->encoding,
                   "grey levels: linear in light, or srgb (webcams, photographs)")
      ->capture_default_str();
  command->add_option("--csv", options->csv, "file to write: a row a marker");
  command->add_option("--json", options->json, "file to write: corners, poses, covariances");
  command->add_option("--draw", options->draw, "folder for pictures with the markers drawn in");
  command
      ->add_option("--threads", options->threads,
                   "pictures at a time; of one picture, or with --repeat: shares of it")
      ->check(CLI::Range(1, 1024))
      ->capture_default_str();
  command->add_option("--repeat", options->repeat, "also time: median ms over N detections in memory")
      ->check(CLI::Range(0, 1000000));
  command->callback([options, &run] { run = [options] { return finished(run_detect(*options)); }; });
}

void add_bench(CLI::App& app, Run& run) {
  auto* command = app.add_subcommand("bench", "tables of accuracy and time beside other programs");
  command->footer(
      "tracker: generated frames with exact truth; libapriltag and OpenCV aruco on the same frames.\n"
      "Example: limn bench tracker --frames 4 --detail");
  auto options = std::make_shared<BenchOptions>();
  command
      ->add_option(
          "name", options->name,
          "tracker, id, calib, solve, projector, live, remote or tablet; what follows it goes to the bench")
      ->required();
  command->prefix_command();
  command->callback([command, options, &run] {
    options->arguments = command->remaining();
    run = [options] { return finished(run_bench(*options)); };
  });
}

void add_capture(CLI::App& app, Run& run) {
  auto* command = app.add_subcommand("capture", "show the patterns of a plan and take the pictures");
  command->footer("Example: limn capture --plan config/plans/bench.json --out captures");
  auto options = std::make_shared<CaptureOptions>();
  command->add_option("--plan", options->plan, "plan file (limn.plan/1)")->required();
  command->add_option("--out", options->out, "captures folder to make")->required();
  command->callback([options, &run] { run = [options] { return finished(run_capture(*options)); }; });
}

void add_plan(CLI::App& app, Run& run) {
  auto* command =
      app.add_subcommand("plan", "what a described rig would reach in mm, before anything is bought");
  command->footer("Example: limn plan config/described/bench.json --out plan   (then open plan/plan.html)");
  auto options = std::make_shared<PlanRigOptions>();
  command->add_option("described", options->described, "the rig (limn.described/1)")->required();
  command->add_option("--out", options->out,
                      "folder for plan.html, the rig from above and from the side, and plan.json");
  command->add_flag("--json", options->json, "print JSON instead of a table");
  command->callback([options, &run] { run = [options] { return finished(run_plan_rig(*options)); }; });
}

void add_patterns(CLI::App& app, Run& run) {
  auto* command = app.add_subcommand("patterns", "the pictures that a projector shows for calibration");
  command->footer(
      "Example: limn patterns --projector 1280x800 --out patterns\n"
      "Example: limn patterns --projector 1280x800 --response --out response   (photographs of the prototype "
      "then go to "
      "CAPTURES/response/projector0/camera0/)");
  auto options = std::make_shared<PatternsOptions>();
  command->add_option("--projector", options->projector, "its size, such as 1280x800")->required();
  command->add_option("--code", options->code, "gray, phase (finest), xor (for concave surfaces)")
      ->capture_default_str();
  auto& code = options->code_options;
  command->add_option("--period", code.period_px, "phase: length of a wave, projector pixels")
      ->capture_default_str();
  command->add_option("--steps", code.steps, "phase: pictures of a wave")->capture_default_str();
  command->add_option("--gamma", code.gamma, "phase: of the projector, light = value ^ gamma")
      ->capture_default_str();
  command->add_option("--linearise", options->linearise,
                      "phase: the rig's response.json, instead of --gamma");
  command->add_option("--name", options->name, "the projector's name in it, where it holds several");
  command->add_flag("!--no-inverses", code.inverses, "gray, xor: half the pictures, enough for limn recheck");
  command->add_option("--stripe", code.base_stripe_px, "xor: widest stripe, 2, 4 or 8 projector pixels")
      ->capture_default_str();
  command->add_flag("--response", options->response,
                    "instead: pictures that measure the projector's response and colour");
  command->add_option("--out", options->out, "folder for 000.png ... and patterns.json")->required();
  command->callback([options, &run] { run = [options] { return finished(run_patterns(*options)); }; });
}

void add_solve(CLI::App& app, Run& run) {
  auto* command =
      app.add_subcommand("solve", "captures to a calibrated rig with a report that says how far to trust it");
  command->footer(
      "Example: limn solve captures --out rig\n"
      "Example: limn solve photos --import opencv-gray --projector 1024x768 --board chessboard:9x7:75mm "
      "--poses 'capture_*' --shots 'graycode_*.png' --out rig");
  auto options = std::make_shared<SolveCommandOptions>();
  command->add_option("captures", options->captures, "captures folder")->required();
  command->add_option("--out", options->out, "rig folder to write")->required();
  command->add_option("--skip-poses", options->skip_poses, "poses to leave out, by name, with commas")
      ->delimiter(',');
  command
      ->add_option("--camera-model", options->camera_model,
                   "mrcal lens model of cameras; auto: by held-out error")
      ->capture_default_str();
  command
      ->add_option("--projector-model", options->projector_model,
                   "mrcal lens model of projectors; auto: by held-out error")
      ->capture_default_str();
  command
      ->add_option("--known-length", options->scale_bar_lengths,
                   "a measured length, such as 'apriltag_36h11:3 apriltag_36h11:7 250mm'; again for another")
      ->allow_extra_args(false);
  auto json = std::make_shared<bool>(false);
  command->add_flag("--json", *json, "print report.json instead of a table");
  command->add_option("--import", options->import_format, "read somebody else's captures: opencv-gray");
  command->add_option("--projector", options->projector,
                      "with --import: the projector's size, such as 1024x768");
  command->add_option("--board", options->board,
                      "with --import: such as chessboard:9x7:75mm (inner corners)");
  command->add_option("--poses", options->poses, "with --import: pattern of the pose folders")
      ->capture_default_str();
  command->add_option("--shots", options->shots, "with --import: pattern of the pictures")
      ->capture_default_str();
  command->callback(
      [options, json, &run] { run = [options, json] { return finished(run_solve(*options, *json)); }; });
}

void add_calibrate(CLI::App& app, Run& run) {
  auto* command =
      app.add_subcommand("calibrate", "the wizard: where to hold the board next, captures, solve, report");
  command->footer(
      "In a window where there is a display. OUT/captures keeps every picture: the same command goes on "
      "where it was left. Ends\n"
      "when more poses no longer help and the rig is good, or there are no more. With --devices a pose is "
      "captured when the board\n"
      "is held still. Then the prototype is scanned, laid onto by the scene's CAD, and painted with how far "
      "light may be off.\n"
      "Example: limn calibrate --plan config/plans/bench.json --out rig\n"
      "Example: limn calibrate --devices devices.json --board charuco:11x8:25mm --out rig");
  auto options = std::make_shared<CalibrateOptions>();
  options->scan = true;
  command->add_option("--plan", options->plan, "plan file (limn.plan/1): on its virtual rig");
  auto* devices = command->add_option("--devices", options->devices,
                                      "instead: the cameras and projectors (limn.devices/1)");
  command
      ->add_option("--board", options->board, "with --devices: the board, as limn markers --board prints it")
      ->needs(devices);
  command->add_option("--code", options->code, "with --devices: gray, phase, xor")
      ->needs(devices)
      ->capture_default_str();
  command->add_option("--scene", options->scene, "whose CAD is laid onto the scan; with --plan its world's")
      ->check(CLI::ExistingPath);
  command->add_option("--out", options->out, "rig folder to write, with the captures in it")->required();
  command->add_flag("!--no-scan", options->scan, "end with the rig, without scanning the prototype");
  command->add_flag("--all", options->all, "take every pose of the plan, although fewer are enough");
  command->add_flag("--terminal", options->terminal, "lines in the terminal instead of the window");
  command->add_flag("--json", options->json, "print JSON instead of lines, without a window");
  command->callback([options, &run] { run = [options] { return finished(run_calibrate(*options)); }; });
}

void add_scan(CLI::App& app, Run& run) {
  auto* command =
      app.add_subcommand("scan", "the prototype's surface from scene captures of a calibrated rig");
  command->footer(
      "Writes points.ply and mesh.ply (metres, the rig's world), scan.json and pictures. Poses that show the "
      "board are\n"
      "left out. With --moved the prototype may stand elsewhere in each pose.\n"
      "Example: limn scan captures --rig rig --far 1.8 --out scan\n"
      "Example: limn scan --plan config/plans/bench.json --rig rig --out scan");
  auto options = std::make_shared<ScanCommand>();
  command->add_option("captures", options->captures,
                      "captures folder with the prototype in its pose directories");
  command->add_option("--plan", options->plan, "instead: take them of this plan's world on the virtual rig");
  command->add_option("--rig", options->rig, "rig folder")->required();
  command->add_option("--out", options->out, "folder to write")->required();
  command
      ->add_option("--poses", options->poses,
                   "poses to use, by name, with commas; else all without the board")
      ->delimiter(',');
  command->add_flag("--moved", options->moved,
                    "the prototype was moved between poses: lay them onto the first");
  command
      ->add_option("--pieces", options->pieces,
                   "keep only so many of the largest connected pieces of each view")
      ->check(CLI::Range(0, 1000));
  command->add_option("--near", options->near_m, "leave out what is nearer to the camera, metres");
  command->add_option("--far", options->far_m,
                      "leave out what is further from the camera, metres (the background)");
  command->add_option("--voxel-mm", options->voxel_mm, "edge of the mesh's cells; 0: one and a half points")
      ->check(CLI::Range(0.0, 1000.0));
  command->add_option("--smooth-px", options->smooth_px, "half the window of the averaging, camera pixels")
      ->check(CLI::Range(2, 8))
      ->capture_default_str();
  command->add_flag("--json", options->json, "print scan.json instead of a line");
  command->callback([options, &run] { run = [options] { return finished(run_scan(*options)); }; });
}

void add_recheck(CLI::App& app, Run& run) {
  auto* command = app.add_subcommand(
      "recheck", "has a camera or projector of a calibrated rig been nudged? which, how far");
  command->footer(
      "Captures of the board in one pose are enough, or of the prototype alone where three devices share it. "
      "The device that\n"
      "has moved gets its pose re-solved, its lens is kept; the rig folder is written in any case, with "
      "recheck.json. With one\n"
      "camera and one projector only a board that has not been touched since an earlier recheck tells which "
      "of them it was.\n"
      "Example: limn recheck --devices devices.json --rig rig --out rig-repaired\n"
      "Example: limn recheck captures --rig rig --out rig-repaired\n"
      "Example: limn recheck captures --rig rig --still rig-repaired/recheck.json --out rig-again\n"
      "Example: limn recheck --plan config/plans/studio.json --prototype --rig rig --out rig-repaired");
  auto options = std::make_shared<RecheckCommand>();
  command->add_option("captures", options->captures,
                      "captures folder with the board or the prototype in view");
  command->add_option("--devices", options->devices,
                      "instead: the rig's cameras and projectors (limn.devices/1) capture what is there (15 "
                      "s), into OUT/captures");
  command->add_option("--plan", options->plan,
                      "instead: capture its first poses (15 s) on the virtual rig, into OUT/captures");
  command->add_flag("--prototype", options->prototype,
                    "with --plan: of the world's prototype instead of the board");
  command->add_option("--rig", options->rig, "rig folder, rig.json or folder of .cameramodel files")
      ->required();
  command->add_option("--still", options->still,
                      "an earlier recheck.json: the board stands where it stood then");
  command->add_option("--out", options->out, "rig folder to write")->required();
  command->add_flag("--json", options->json, "print recheck.json instead of a table");
  command->callback([options, &run] { run = [options] { return finished(run_recheck(*options)); }; });
}

void add_align(CLI::App& app, Run& run) {
  auto* command = app.add_subcommand("align", "a CAD mesh onto the scan of the prototype");
  command->footer(
      "The start comes from a pose, from picked points, from the prototype's markers, or from a search of "
      "the whole scan.\n"
      "Writes poses.json (for limn render --poses), align.json, residual.ply and pictures of where CAD and "
      "scan differ.\n"
      "PICKS.json: {\"schema\": \"limn.picks/1\", \"pairs\": [{\"cad\": [x, y, z], \"scan_m\": [x, y, z]}, "
      "...]}, cad in --units\n"
      "Example: limn align --scan scan --mesh door.glb --units m --out aligned\n"
      "Example: limn align --scan scan/mesh.ply --mesh door.stl --units mm --points picks.json --out "
      "aligned\n"
      "Example: limn align --scan scan --mesh door.glb --units m --scene config/scenes/door --rig rig "
      "--frame camera0=picture.png --out aligned\n"
      "Example: limn align --scan scan --mesh door.glb --units m --body body.json --rig rig --frame "
      "camera0=picture.png --out aligned");
  auto options = std::make_shared<AlignCommand>();
  command->add_option("--scan", options->scan,
                      "PLY, or the folder of limn scan; without it the markers' answer is all");
  command->add_option("--scan-units", options->scan_units, "of the PLY: m, cm, mm, in, ft")
      ->capture_default_str();
  command->add_option("--mesh", options->mesh,
                      "the CAD: .glb, .gltf, .obj, .stl, .ply; without it the scene's prototype");
  command->add_option("--units", options->units, "of the CAD: m, cm, mm, in, ft");
  command->add_option("--start", options->start, "POSES.json with a world_from_prototype");
  command->add_option("--points", options->points, "PICKS.json: three and more pairs of the same places");
  command->add_option("--scene", options->scene,
                      "scene whose prototype carries markers; with --rig and --frame they give the start");
  command
      ->add_option(
          "--body", options->body,
          "body.json of limn markers --learn-body: where its markers are on the CAD, as markers.json")
      ->check(CLI::ExistingFile);
  command->add_option("--rig", options->rig, "rig folder, for --frame");
  command->add_option("--frame", options->frames, "CAMERA=PICTURE, again for another camera");
  command->add_option("--least-mm", options->least_mm, "smaller differences are not told")
      ->check(CLI::Range(0.001, 1000.0))
      ->capture_default_str();
  command->add_option("--out", options->out, "folder to write")->required();
  command->add_flag("--json", options->json, "print align.json instead of a line");
  command->callback([options, &run] { run = [options] { return finished(run_align(*options)); }; });
}

void add_render(CLI::App& app, Run& run) {
  auto* command = app.add_subcommand(
      "render", "a scene's pictures: for every projector, over camera pictures, and what light shows");
  command->footer(
      "With --poses alone the composites are drawn over black, one for each camera.\n"
      "Example: limn render --rig rig --scene config/scenes/door --frame camera0=picture.png --out rendered\n"
      "Example: limn render --rig rig --scene config/scenes/door --poses poses.json --viewer pose.json --out "
      "rendered");
  auto options = std::make_shared<RenderOptions>();
  command->add_option("--rig", options->rig, "rig folder, rig.json or folder of .cameramodel files")
      ->required();
  command->add_option("--scene", options->scene, "scene folder or its scene.json")->required();
  command->add_option("--frame", options->frames,
                      "CAMERA=PICTURE, again for another camera; its markers place the scene");
  command->add_option("--poses", options->poses,
                      "POSES.json that places the scene; frames are then only drawn over");
  command->add_option(
      "--viewer", options->viewers,
      "viewer file; again for another viewer: they share one eye, the nearest leads. Without it the scene's "
      "viewers, else camera 0");
  command->add_option("--composite", options->composite, "full parts, or rest: only what light cannot show")
      ->check(CLI::IsMember({"full", "rest"}))
      ->capture_default_str();
  command->add_flag("--undistorted", options->undistorted, "composites without the cameras' lens distortion");
  command
      ->add_option("--contact-shadow", options->contact_shadow,
                   "on: in composites and view.png parts darken the prototype around them; off: pixels "
                   "beside parts keep "
                   "their values")
      ->check(CLI::IsMember({"on", "off"}))
      ->capture_default_str();
  command
      ->add_option("--marker-light", options->marker_light,
                   "what projectors do with markers: keep-out leaves them dark, spotlight lights them white")
      ->check(CLI::IsMember({"as-is", "keep-out", "spotlight"}))
      ->capture_default_str();
  command->add_option("--view", options->view,
                      "viewer file of a virtual camera: writes view.png, prototype and parts");
  command->add_option("--stereo", options->stereo_mm, "two eyes so many mm apart, side by side in view.png");
  command
      ->add_option(
          "--compensation", options->light.compensation,
          "what is divided out of the light: none; geometry: distance, incidence, vignetting and the scene's "
          "albedo; "
          "measured: albedo, colours, ambient and black light as the rig's response pictures saw them")
      ->check(CLI::IsMember({"none", "geometry", "measured"}))
      ->capture_default_str();
  command->add_option(
      "--measured-at", options->light.measured_at,
      "POSES.json with the prototype's place in the response pictures; without it, where it stands now");
  command->add_option(
      "--level", options->light.level,
      "brightness of white with compensation: irradiance, 1 is a projector's white head on at 1 m "
      "(what four fifths of the prototype can reach)");
  command->add_option("--black", options->light.black, "even: overlaps of projectors do not show in the dark")
      ->check(CLI::IsMember({"as-is", "even"}))
      ->capture_default_str();
  command->add_option("--out", options->out, "folder for the pictures and coverage.json")->required();
  command->callback([options, &run] { run = [options] { return finished(run_render(*options)); }; });
}

void add_check(CLI::App& app, Run& run) {
  auto* command =
      app.add_subcommand("check", "is what is drawn right? render checks against the ray-traced truth");
  command->footer(
      "A check names a world, poses and limits (config/README.md); without files all of config/checks run. "
      "OUT/check.html\n"
      "shows what was drawn, what was expected and the difference. Exits 1 when a limit is missed.\n"
      "Example: limn check\n"
      "Example: limn check config/checks/door-moved.json --out checked\n"
      "Example: limn check --against from-the-other-machine");
  auto options = std::make_shared<CheckOptions>();
  command->add_option("checks", options->files, "check files (limn.check/1)");
  command->add_option("--out", options->out, "folder for check.html, check.json and pictures")
      ->capture_default_str();
  command->add_flag("--json", options->json, "print check.json instead of a table");
  command->add_option(
      "--against", options->against,
      "OUT of another run of the same checks, on another machine or driver: at most 0.1 % of a picture's\n"
      "pixels may differ from it by more than two levels");
  command->callback([options, &run] { run = [options] { return finished(run_check(*options)); }; });
}

void add_export(CLI::App& app, Run& run) {
  auto* command = app.add_subcommand("export", "warp and blend of every projector for other programs");
  command->footer(
      "MPCDI 2.0 (VESA), the maps at the projectors' size, points in metres in the frame of the prototype's "
      "mesh, NaN where\n"
      "a pixel lights nothing. sl: points, each projector's pose and pinhole frustum, and its lens as a "
      "distortion map;\n"
      "a3: points alone; 3d: places (x right, y down, 0 to 1) in the picture of one viewer. Alpha: a "
      "projector's share of\n"
      "the linear light, value = share^(1/gamma). Beta (where black light was measured): display values that "
      "make black even.\n"
      "Example: limn export --mpcdi door.mpcdi --rig rig --scene config/scenes/door --poses poses.json\n"
      "Example: limn export --warp warps --format exr --rig rig --scene config/scenes/door --poses "
      "poses.json");
  auto options = std::make_shared<ExportOptions>();
  command->add_option("--mpcdi", options->mpcdi, "archive to write");
  command
      ->add_option("--profile", options->profile,
                   "of MPCDI: sl (shader lamps), a3 (advanced 3D), 3d (one viewer)")
      ->check(CLI::IsMember({"sl", "a3", "3d"}))
      ->capture_default_str();
  command->add_option("--gamma", options->gamma, "of alpha maps (gammaEmbedded); 1: linear")
      ->capture_default_str();
  command->add_option("--bits", options->bits, "of alpha and beta maps, 8 or 16")->capture_default_str();
  command->add_option("--warp", options->warp, "folder for warp-PROJECTOR.pfm or .exr: points as above");
  command->add_option("--format", options->format, "of --warp: pfm, exr (R, G, B are x, y, z)")
      ->check(CLI::IsMember({"pfm", "exr"}))
      ->capture_default_str();
  command->add_option("--looks", options->looks,
                      "folder for look-SLOT-VARIANT.png: each variant as the viewer sees it");
  command->add_option("--rig", options->rig, "rig folder, rig.json or folder of .cameramodel files")
      ->required();
  command->add_option("--scene", options->scene, "scene folder or its scene.json")->required();
  command->add_option("--poses", options->poses, "POSES.json: where the prototype stands")->required();
  command->add_option("--viewer", options->viewer,
                      "viewer file for --profile 3d and --looks; without it the scene's");
  auto json = std::make_shared<bool>(false);
  command->add_flag("--json", *json, "print JSON instead of a line a projector");
  command->callback(
      [options, json, &run] { run = [options, json] { return finished(run_export(*options, *json)); }; });
}

void add_import(CLI::App& app, Run& run) {
  auto* command = app.add_subcommand(
      "import", "what an MPCDI file holds, or what is wrong with it; its projectors as a rig");
  command->footer(
      "Reads archives of MPCDI 1 and 2, and XML alone as Christie's Mystique writes it (poses without "
      "maps).\n"
      "Example: limn import theirs.mpcdi --out rig");
  auto options = std::make_shared<ImportOptions>();
  command->add_option("file", options->file, "archive (.mpcdi) or XML (.mpcdi.xml)")->required();
  command->add_option("--out", options->out, "rig folder to write, in the file's own frame (profile sl)");
  command->add_flag("--json", options->json, "print JSON instead of a line a region");
  command->callback([options, &run] { run = [options] { return finished(run_import(*options)); }; });
}

void add_live(CLI::App& app, Run& run) {
  auto* command =
      app.add_subcommand("live", "the live session: cameras, tracker, prediction, projectors, screen");
  command->footer(
      "Without devices the session runs on a virtual rig, on its own clock: the world's, or a room made for "
      "rig and scene.\n"
      "Keys in the operator's window, also of clickers and pedals: right/left next/previous variant, tab "
      "next slot, b blackout,\n"
      "f freeze, m markers, s save a look, l/k next/previous look, o what the screen shows, r release, a "
      "pair with the marker that glows,\n"
      "v the look before and back, x both beside a line, g grid, escape asks to end.\n"
      "Example: limn live --seconds 5 --out session\n"
      "Example: limn live --devices devices.json --rig rig --scene config/scenes/door --out session "
      "--window\n"
      "Example: limn live --rig rig --scene config/scenes/door --seconds 10 --record recording\n"
      "Example: limn live --osc 9000 --osc-to 127.0.0.1:9001   (docs/osc.md)\n"
      "Example: limn live --window --serve 8080   (docs/remote.md)");
  auto options = std::make_shared<LiveOptions>();
  command->add_option("--rig", options->rig, "rig folder, rig.json or folder of .cameramodel files");
  command->add_option("--scene", options->scene, "scene folder or its scene.json");
  command->add_option("--devices", options->devices,
                      "the cameras and displays (limn.devices/1); without: a virtual rig");
  command->add_option("--world", options->world,
                      "world of the virtual rig (limn.world/1); without rig and scene: the studio");
  command->add_option("--script", options->script, "what happens in the virtual room (limn.script/1)");
  command->add_option("--seconds", options->seconds,
                      "of the session's clock; without: the script's, or until it is ended");
  command->add_option("--resolution", options->resolution, "share of the virtual devices' pixels a side")
      ->capture_default_str();
  command->add_option("--record", options->record, "folder for a recording that limn replay runs again");
  command->add_option("--out", options->out,
                      "folder for poses.csv, telemetry.csv, session.html and the last pictures");
  command->add_flag("--window", options->window,
                    "the operator's window: pictures, devices, parts, looks, telemetry; keys");
  command->add_option("--prediction", options->prediction, "how poses are carried to the moment of light")
      ->check(CLI::IsMember({"hold", "linear", "filtered"}))
      ->capture_default_str();
  command->add_option("--marker-light", options->marker_light, "what projectors do with markers")
      ->check(CLI::IsMember({"as-is", "keep-out", "spotlight"}))
      ->capture_default_str();
  command->add_option("--osc", options->osc,
                      "PORT, or ADDRESS:PORT, where other programs' OSC is heard; a port alone: of this "
                      "machine only");
  command->add_option("--osc-to", options->osc_to, "HOST:PORT that is told by OSC what changes");
  command->add_option("--serve", options->serve,
                      "PORT, or ADDRESS:PORT, of the remote for phones and tablets; a port alone: of "
                      "this machine only; on a network encrypted");
  command->add_option("--serve-show", options->serve_show,
                      "a projector that shows the remote's QR code and PIN (role work) for "
                      "the first 60 s");
  command->add_flag("!--no-refill", options->refill, "leave light that is lost to somebody's shadow lost");
  command
      ->add_option("--extrapolate", options->extrapolate_s, "seconds for which unseen markers are carried on")
      ->capture_default_str();
  command->add_flag("--json", options->json, "print JSON instead of lines");
  command->callback([options, &run] { run = [options] { return finished(run_live(*options)); }; });
}

void add_replay(CLI::App& app, Run& run) {
  auto* command = app.add_subcommand(
      "replay", "a recorded session again: the same poses, on this machine the same pictures");
  command->footer(
      "Example: limn replay recording --out replayed\nExample: limn replay recording --window --speed 1");
  auto options = std::make_shared<ReplayOptions>();
  command->add_option("session", options->session, "folder that limn live --record wrote")->required();
  command->add_option("--out", options->out,
                      "folder for poses.csv, telemetry.csv, session.html and the last pictures");
  command->add_option("--speed", options->speed, "times the session's own; 0: as fast as possible")
      ->capture_default_str();
  command->add_flag("--step", options->step, "wait for enter before each picture");
  command->add_flag("--window", options->window, "show the screen's picture in a window");
  command->add_flag("--json", options->json, "print JSON instead of lines");
  command->callback([options, &run] { run = [options] { return finished(run_replay(*options)); }; });
}

void add_simulate(CLI::App& app, Run& run) {
  auto* command = app.add_subcommand("simulate", "pictures of the virtual rig, and the truth behind them");
  command->footer("Example: limn simulate config/worlds/studio.json --out simulated --variants mirror=sport");
  auto options = std::make_shared<SimulateOptions>();
  command->add_option("world", options->world, "world file (limn.world/1)")->required();
  command->add_option("--out", options->out, "folder for pictures, truth.json and the true rig")->required();
  command->add_option("--show", options->show, "PROJECTOR=PICTURE to shine; again for another projector");
  command->add_option("--variants", options->variants, "SLOT=VARIANT,… of the still life");
  command->add_flag("--srgb", options->srgb, "bright for the eye, instead of as the world's cameras encode");
  command->callback([options, &run] { run = [options] { return finished(run_simulate(*options)); }; });
}

void add_doctor(CLI::App& app, Run& run) {
  auto* command =
      app.add_subcommand("doctor", "displays, cameras, OpenGL, clock, packages: what works, what to do");
  command->footer(
      "Exits 1 when something does not work that is there or that the devices file or --show asks for.\n"
      "Example: limn doctor --show 10\n"
      "Example: limn doctor --devices config/devices/studio.json --rig rig");
  auto options = std::make_shared<DoctorOptions>();
  auto* devices = command->add_option("--devices", options->devices, "devices file (limn.devices/1) to test");
  command->add_option("--rig", options->rig, "rig folder whose names and sizes they must have")
      ->needs(devices);
  command
      ->add_option("--show", options->show_s, "seconds for which each output shows its own number and colour")
      ->check(CLI::Range(0.0, 3600.0));
  command->add_flag("--json", options->json, "print JSON instead of lines");
  command->callback([options, &run] { run = [options] { return finished(run_doctor(*options)); }; });
}

}  // namespace

int run_command_line(int argc, char** argv) {
  CLI::App app{"Limn paints virtual parts onto a physical prototype with light."};
  app.name("limn");
  app.set_version_flag("--version", fmt::format("limn {}", version()), "Print the version and exit");
  app.require_subcommand(1);
  Run run;
  // In the order of a session: add_NAME(app, run).
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
  add_replay(app, run);
  add_simulate(app, run);
  add_doctor(app, run);

  if (argc == 1) {
    std::cout << app.help() << std::flush;
    return 2;
  }
  const auto commands = app.get_subcommands({});
  const auto is_named = [&](const CLI::App* command) { return argc > 1 && command->get_name() == argv[1]; };
  if (argc > 1 && argv[1][0] != '-' && std::none_of(commands.begin(), commands.end(), is_named)) {
    std::string known;
    for (const CLI::App* command : commands) known += " " + command->get_name();
    return finished(usage_error("unknown command '{}'; expected one of:{}.", argv[1], known));
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& problem) {
    return app.exit(problem) == 0 ? 0 : 2;
  }
  try {
    return run();
  } catch (const std::filesystem::filesystem_error& problem) {
    return finished(
        error("{}: expected a file or folder that can be looked at, found: {}. Check its name and rights.",
              problem.path1().string(), problem.code().message()));
  } catch (const std::bad_alloc&) {
    return finished(error("expected enough memory for this work, found none left. Take smaller pictures."));
  } catch (const std::exception& bug) {
    return finished(error("this is a bug in Limn, please report it: {}", bug.what()));
  }
}

}  // namespace limn::apps
