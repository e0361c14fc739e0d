#include <CLI/CLI.hpp>
#include <memory>

#include "apps/align.h"
#include "apps/commands/commands.h"
#include "apps/commands/options.h"
#include "apps/deviation.h"
#include "apps/recheck.h"
#include "apps/scan.h"

namespace limn::apps {

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
  command
      ->add_option("captures", options->captures,
                   "Captures folder that shows the prototype in its pose folders")
      ->type_name("CAPTURES");
  command
      ->add_option("--plan", options->plan,
                   "Instead of captures: capture the prototype of this plan's world on the virtual rig")
      ->type_name("FILE.json");
  command->add_option("--rig", options->rig, "Rig folder")->type_name("RIG")->required();
  command->add_option("--out", options->out, "Folder to write")->type_name("FOLDER")->required();
  command
      ->add_option(
          "--poses", options->poses,
          "Names of poses to use, separated by commas; without it all poses that do not show the board. With "
          "--import: name patterns of the pose folders")
      ->type_name("NAMES")
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
  command->add_option("captures", options->captures, "Captures folder that shows the board or the prototype")
      ->type_name("CAPTURES");
  command
      ->add_option("--devices", options->devices,
                   "Instead of captures: capture with the rig's own cameras and projectors "
                   "(limn.devices/1) for about 15 s, into OUT/captures")
      ->type_name("FILE.json");
  command
      ->add_option("--plan", options->plan,
                   "Instead of captures: capture the first poses of this plan (15 s) on the virtual rig, "
                   "into OUT/captures")
      ->type_name("FILE.json");
  command->add_flag("--prototype", options->prototype,
                    "With --plan: capture the world's prototype instead of the board");
  command->add_option("--rig", options->rig, "Rig folder, rig.json or folder of .cameramodel files")
      ->type_name("RIG")
      ->required();
  command
      ->add_option("--still", options->still,
                   "An earlier recheck.json; the board has not been moved since then")
      ->type_name("FILE.json");
  command->add_option("--out", options->out, "Rig folder to write")->type_name("FOLDER")->required();
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
  command
      ->add_option("--scan", options->scan,
                   "Scan: a PLY file or the folder of limn scan; without it the pose is computed from the "
                   "markers alone")
      ->type_name("SCAN");
  add_choice(command, "--scan-units", &options->scan_units, scene::k_length_units,
             "Unit of the PLY file: m, cm, mm, in or ft");
  command
      ->add_option("--mesh", options->mesh,
                   "CAD mesh: .glb, .obj, .stl, .ply, .3mf, .fbx … (docs/formats.md); without it the scene's "
                   "prototype")
      ->type_name("MESH");
  add_choice(command, "--units", &options->units, scene::k_length_units,
             "Unit of the CAD mesh: m, cm, mm, in or ft");
  command->add_option("--start", options->start, "POSES.json with world_from_prototype, the initial pose")
      ->type_name("FILE.json");
  command
      ->add_option("--points", options->points,
                   "PICKS.json: three or more pairs of corresponding points on CAD and scan")
      ->type_name("FILE.json");
  command
      ->add_option("--scene", options->scene,
                   "Scene whose prototype carries markers; with --rig and --frame they give the initial pose")
      ->type_name("SCENE");
  command
      ->add_option("--body", options->body,
                   "body.json of limn markers --learn-body; writes to markers.json where its markers are on "
                   "the CAD mesh")
      ->type_name("FILE.json")
      ->check(CLI::ExistingFile);
  command->add_option("--rig", options->rig, "Rig folder, needed for --frame")->type_name("RIG");
  command
      ->add_option("--frame", options->frames,
                   "CAMERA=IMAGE, a photograph of the prototype; repeat the option for other cameras")
      ->type_name("CAMERA=IMAGE");
  command
      ->add_option("--least-mm", options->least_mm,
                   "Smallest difference between CAD and scan to report, in mm")
      ->check(CLI::Range(0.001, 1000.0))
      ->capture_default_str();
  command->add_option("--out", options->out, "Folder to write")->type_name("FOLDER")->required();
  command->add_flag("--json", options->json, "Print align.json instead of a line");
  command->callback([options, &run] { run = [options] { return report_result(run_align(*options)); }; });
}

void add_deviation(CLI::App& app, Run& run) {
  auto* command = app.add_subcommand(
      "deviation",
      "Compare the scan of the prototype with its CAD: where is it proud or shy of it, and how sure is that");
  command->footer(
      "Aligns the CAD to the scan as limn align does; large deviations do not pull the alignment. Measures "
      "the "
      "distance\n"
      "along the CAD's normals, positive where the prototype is proud of the CAD, with a standard deviation "
      "for "
      "each\n"
      "point. Writes deviation.html (one file, for people), deviation.ply, deviation.csv, deviation.json and "
      "poses.json.\n"
      "What the scan does not show is not measured; nothing is filled in. It needs no rig.\n"
      "Example: limn deviation --scan scan --cad door.glb --units m --out deviation\n"
      "Example: limn deviation --scan scan/mesh.ply --cad door.stl --units mm --tolerance 0.3 --out "
      "deviation\n"
      "Example: limn deviation --scan scan --cad door.stl --units mm --fit -50,-80,0,120,40,60 --out handle\n"
      "Example: limn deviation --scan scan --cad door.glb --units m --start aligned/align.json --no-align "
      "--out "
      "deviation");
  auto options = std::make_shared<DeviationCommand>();
  wizard::AlignOptions& align = options->files.align;
  command->add_option("--scan", align.scan, "Scan: a PLY file with triangles, or the folder of limn scan")
      ->type_name("SCAN")
      ->required();
  add_choice(command, "--scan-units", &align.scan_units, scene::k_length_units,
             "Unit of the PLY file: m, cm, mm, in or ft");
  command
      ->add_option("--cad", align.mesh,
                   "CAD mesh: .glb, .obj, .stl, .ply, .3mf, .fbx … (docs/formats.md); without it the scene's "
                   "prototype")
      ->type_name("MESH");
  add_choice(command, "--units", &align.units, scene::k_length_units,
             "Unit of the CAD mesh: m, cm, mm, in or ft");
  command
      ->add_option("--tolerance", options->tolerance_mm,
                   "Deviation that is in order, in mm; the colours change at 1, 2 and 4 times it")
      ->check(CLI::Range(0.001, 1000.0))
      ->capture_default_str();
  command
      ->add_option("--reach-mm", options->reach_mm,
                   "Surfaces further from the CAD, in mm, are something else (a hand) and are not measured")
      ->check(CLI::Range(0.01, 1000.0))
      ->capture_default_str();
  command
      ->add_option("--spacing-mm", options->spacing_mm,
                   "Distance of the CAD's points in mm (0 or without it: that of the scan's points)")
      ->check(CLI::Range(0.0, 1000.0));
  command
      ->add_option("--start", align.start,
                   "POSES.json or align.json with world_from_prototype, the initial pose")
      ->type_name("FILE.json");
  command
      ->add_option("--points", align.points,
                   "PICKS.json: three or more pairs of corresponding points on CAD and scan")
      ->type_name("FILE.json");
  command
      ->add_option(
          "--scene", align.scene,
          "Scene whose prototype is the CAD, or carries the markers that give the initial pose (--rig, "
          "--frame)")
      ->type_name("SCENE");
  command->add_option("--rig", align.rig, "Rig folder, needed for --frame")->type_name("RIG");
  command
      ->add_option("--frame", align.frames,
                   "CAMERA=IMAGE, a photograph of the prototype; repeat the option for other cameras")
      ->type_name("CAMERA=IMAGE");
  command->add_flag("--no-align", options->no_align,
                    "Trust the given pose (--start, --points, or markers) and do not align");
  command
      ->add_option(
          "--fit", options->fit_mm,
          "Local best fit: X,Y,Z,X,Y,Z of two opposite corners of a box in the CAD's frame, in mm; the "
          "scan inside it is aligned")
      ->type_name("NUMBERS")
      ->delimiter(',')
      ->expected(6);
  command->add_option("--out", align.out, "Folder to write")->type_name("FOLDER")->required();
  command->add_flag("--json", options->json, "Print deviation.json instead of lines");
  command->callback([options, &run] { run = [options] { return report_result(run_deviation(*options)); }; });
}

}  // namespace limn::apps
