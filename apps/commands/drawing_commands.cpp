#include <CLI/CLI.hpp>
#include <memory>

#include "apps/check.h"
#include "apps/commands/commands.h"
#include "apps/commands/options.h"
#include "apps/export.h"
#include "apps/import.h"
#include "apps/import_rig.h"
#include "apps/render.h"
#include "exchange/cad_import.h"
#include "exchange/line_export.h"
#include "exchange/line_import.h"

namespace limn::apps {
namespace {

constexpr EnumNames<bool, 2> k_off_on{{"off", "on"}};

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
      ->type_name("FILE")
      ->required()
      ->expected(1, 2);
  command->add_option("--out", options->out, "Rig folder to write")->type_name("FOLDER")->required();
  add_choice(command, "--units", &options->units, scene::k_length_units,
             "Unit of the file's lengths, where it does not say: that of the board's squares");
  command
      ->add_option("--camera-size", options->camera_size,
                   "Size of the camera's images in pixels, such as 1280x960, where the file does not say")
      ->type_name("WIDTHxHEIGHT");
  command
      ->add_option("--projector", options->projector_size,
                   "Likewise of the projector. OpenCV's stereo calibration: the second device is a projector "
                   "of this size, not a camera")
      ->type_name("WIDTHxHEIGHT");
  command->add_flag("--json", options->json, "Print JSON instead of a line for each device");
  command->callback([options, &run] { run = [options] { return report_result(run_import_rig(*options)); }; });
  return command;
}

CLI::App* add_import_cad(CLI::App* import, Run& run) {
  auto* command = import->add_subcommand("cad", "Write the solids of a STEP or IGES file as meshes");
  command->footer(
      "Names, colours, places and the unit come from the file; all meshes are in metres and in its frame. A "
      "scene, a slot's\n"
      "folder and limn align also take the file itself, as one part with a chord error of 0.1 mm.\n"
      "part: everything in one mesh, OUT.glb. parts: a mesh for each solid at each place, for slots of their "
      "own.\n"
      "variants: a mesh for each solid, for the variants of one slot.\n"
      "Needs the program limn-cad (apt install limn-cad).\n"
      "Example: limn import cad mirror.step --as part --out scene/mirror.glb\n"
      "Example: limn import cad mirrors.step --as variants --out scene/slots/mirror\n"
      "Example: limn import cad car.step --as parts --chord-mm 0.5 --out scene/car");
  auto options = std::make_shared<exchange::CadImportOptions>();
  command->add_option("file", options->file, "CAD file: .step, .stp, .iges or .igs")
      ->type_name("FILE")
      ->required();
  add_choice(command, "--as", &options->as, exchange::k_cad_taken_as,
             "What the solids become: part, parts or variants (without it: part)");
  command->add_option("--out", options->out, "File NAME.glb to write; a folder for parts and variants")
      ->type_name("OUT")
      ->required();
  command
      ->add_option("--chord-mm", options->chord_mm, "Largest distance between surfaces and triangles, in mm")
      ->check(CLI::Range(0.0001, 1000.0))
      ->capture_default_str();
  command
      ->add_option("--angle-deg", options->angle_deg,
                   "Largest angle between the normals at the ends of a triangle's side, in degrees")
      ->check(CLI::Range(1.0, 90.0))
      ->capture_default_str();
  command->add_option("--minutes", options->minutes, "Time that limn-cad may take, in minutes")
      ->check(CLI::Range(0.01, 10000.0))
      ->capture_default_str();
  command->add_option("--memory-gb", options->memory_gb, "Memory that limn-cad may take, in GB")
      ->check(CLI::Range(0.1, 1000.0))
      ->capture_default_str();
  command->add_flag("--json", options->json, "Print limn.cad/1 instead of a line for each solid");
  command->callback(
      [options, &run] { run = [options] { return report_result(exchange::import_cad(*options)); }; });
  return command;
}

CLI::App* add_import_lines(CLI::App* import, Run& run) {
  auto* command = import->add_subcommand("lines", "Add the curves of a file to a scene as lines of light");
  command->footer(
      "The file is in the prototype's frame: CSV and DXF in millimetres (DXF in the unit that it states), "
      "STEP "
      "and IGES\n"
      "(with limn-cad) the curves that bound no surface. Curves must lie within 20 mm of the prototype. "
      "Their "
      "points become\n"
      "SCENE/lines/NAME.csv, and scene.json names them under \"lines\"; all else in it stays, also comments. "
      "A "
      "session that\n"
      "shows the scene shows them at once.\n"
      "Example: limn import lines sill.step --scene scene\n"
      "Example: limn import lines door.step --scene scene --edges --name edges\n"
      "Example: limn import lines lines.csv --scene scene --name trim --colour 1,0.4,0 --width-mm 1\n"
      "Example: limn import lines sill.dxf --scene scene --replace");
  auto options = std::make_shared<exchange::LineImportOptions>();
  command->add_option("file", options->file, "File of curves: .csv, .dxf, .step, .stp, .iges or .igs")
      ->type_name("FILE")
      ->required();
  command->add_option("--scene", options->scene, "Scene folder or its scene.json, which is changed")
      ->type_name("SCENE")
      ->required();
  command
      ->add_option("--name", options->name,
                   "All curves become one line of this name (without it: a line for each name of the file)")
      ->type_name("NAME");
  command->add_flag("--edges", options->edges, "Of STEP and IGES also the edges of surfaces");
  command->add_flag("--replace", options->replace,
                    "Lines that the scene has get the file's curves, and keep their colour and width");
  auto colour = std::make_shared<std::vector<double>>();
  command
      ->add_option("--colour", *colour,
                   "Colour of new lines: linear red, green and blue from 0 to 1 (without it: white)")
      ->type_name("R,G,B")
      ->delimiter(',')
      ->expected(3)
      ->check(CLI::Range(0.0, 1.0));
  command->add_option("--width-mm", options->width_mm, "Width of new lines in mm (without it: 0.7)")
      ->check(CLI::Range(0.05, 20.0));
  command->add_flag("--json", options->json, "Print limn.lines/1 instead of a sentence for each line");
  command->callback([options, colour, &run] {
    if (colour->size() == 3) options->colour = Eigen::Vector3d(colour->data());
    run = [options] { return report_result(exchange::import_lines(*options)); };
  });
  return command;
}

// The subcommand of `export`.
CLI::App* add_export_lines(CLI::App* parent, Run& run) {
  auto* command = parent->add_subcommand(
      "lines", "Write the curves of a scene's lines of light, in the prototype's frame");
  command->footer(
      "Curves, texts and dimensions of the scene, and the lines that were drawn in sessions and kept in "
      "looks, "
      "as they lie\n"
      "on the surface, in millimetres. Section lines, patterns and outlines of parts are no curves and are "
      "left "
      "out.\n"
      "STEP needs the program limn-cad (apt install limn-cad).\n"
      "Example: limn export lines --scene scene --out lines.step\n"
      "Example: limn export lines --scene scene --look evening --line sill --out sill.dxf");
  auto options = std::make_shared<exchange::LineExportOptions>();
  command->add_option("--scene", options->scene, "Scene folder or its scene.json")
      ->type_name("SCENE")
      ->required();
  command
      ->add_option(
          "--look", options->look,
          "Only the lines that this look shows (without it: those of the scene, and the drawn ones of "
          "all looks)")
      ->type_name("LOOK");
  command->add_option("--line", options->lines, "Only this line; repeat the option for several")
      ->type_name("NAME");
  command->add_option("--out", options->out, "File to write: .csv, .dxf, .step or .stp")
      ->type_name("FILE")
      ->required();
  auto is_spline = std::make_shared<bool>(false);
  command->add_flag(
      "--spline", *is_spline,
      "STEP gets a smooth curve through each line's points, which CAD programs can edit (without "
      "it: straight pieces)");
  command->add_flag("--json", options->json, "Print limn.lines/1 instead of a sentence for each line");
  command->callback([options, is_spline, &run] {
    if (*is_spline) options->form = exchange::CurveForm::spline;
    run = [options] { return report_result(exchange::export_lines(*options)); };
  });
  return command;
}

}  // namespace

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
      ->type_name("RIG")
      ->required();
  command->add_option("--scene", options->scene, "Scene folder or its scene.json")
      ->type_name("SCENE")
      ->required();
  command
      ->add_option(
          "--frame", options->frames,
          "CAMERA=IMAGE, a photograph whose markers place the scene; repeat the option for other cameras")
      ->type_name("CAMERA=IMAGE");
  command
      ->add_option("--poses", options->poses,
                   "POSES.json that places the scene; the images of --frame are then only drawn over")
      ->type_name("FILE.json");
  command
      ->add_option("--viewer", options->viewers,
                   "Viewer file; repeat the option for several viewers, who share one viewpoint in which "
                   "the nearest counts most. Without it: the scene's viewers, or else camera 0")
      ->type_name("FILE.json");
  add_choice(command, "--composite", &options->composite, k_composites,
             "What composites draw: full (whole parts) or rest (only what light cannot show)");
  command->add_flag("--undistorted", options->undistorted,
                    "Remove the lens distortion of the cameras from the composites");
  add_choice(command, "--contact-shadow", &options->contact_shadow, k_off_on,
             "on: parts darken the prototype around them in composites and view.png; off: pixels beside "
             "parts keep their values");
  add_choice(command, "--marker-light", &options->marker_light, tracker::k_marker_lights,
             "Light on markers: as-is (like the rest), keep-out (dark) or spotlight (white)");
  command
      ->add_option(
          "--view", options->view,
          "Viewer file of a virtual camera; writes view.png with prototype and parts as it sees them")
      ->type_name("FILE.json");
  command
      ->add_option(
          "--stereo", options->stereo_mm,
          "With --view: distance between two virtual cameras in mm; view.png shows their images side by side")
      ->type_name("PROJECTOR");
  add_choice(command, "--compensation", &options->light.compensation, k_compensations,
             "What the projected light compensates for: none; geometry (distance, incidence, vignetting and "
             "the scene's albedo); measured (albedo, colours, ambient and black light as measured by the "
             "rig's response images)");
  command
      ->add_option("--measured-at", options->light.measured_at,
                   "POSES.json with the prototype's pose in the response images; without it, the pose where "
                   "it is drawn")
      ->type_name("FILE.json");
  command->add_option(
      "--level", options->light.level,
      "With compensation: brightness of white as an irradiance, where 1 is a projector's white at 1 m "
      "distance and normal incidence; without it, the level that four fifths of the prototype can reach");
  add_choice(
      command, "--black", &options->light.even_black, k_blacks,
      "Black light of the projectors: as-is, or even (overlaps of projectors do not show in the dark)");
  command->add_option("--out", options->out, "Folder for the images and coverage.json")
      ->type_name("FOLDER")
      ->required();
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
  command
      ->add_option("checks", options->files, "Check files (limn.check/1); without them all of config/checks")
      ->type_name("FILE.json");
  command->add_option("--out", options->out, "Folder for check.html, check.json and the images")
      ->type_name("FOLDER")
      ->capture_default_str();
  command->add_flag("--json", options->json, "Print check.json instead of a table");
  command
      ->add_option("--against", options->against,
                   "OUT folder of another run of the same checks, for instance on another machine or "
                   "driver; at most 0.1 % of an image's pixels may differ by more than two levels")
      ->type_name("FOLDER");
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
      "Example: limn export --opencv cameras --kalibr camchain.yaml --rig rig\n"
      "Lines of light: limn export lines --help");
  auto options = std::make_shared<exchange::ExportOptions>();
  command->add_option("--mpcdi", options->mpcdi, "MPCDI archive to write")->type_name("FILE.mpcdi");
  add_choice(command, "--profile", &options->profile, exchange::k_written_mpcdi_profiles,
             "MPCDI profile: sl (shader lamps), a3 (advanced 3D) or 3d (one viewer)");
  command->add_option("--gamma", options->gamma, "Gamma of the alpha maps (gammaEmbedded); 1 is linear")
      ->capture_default_str();
  command->add_option("--bits", options->bits, "Bits of the alpha and beta maps, 8 or 16")
      ->capture_default_str();
  command
      ->add_option("--warp", options->warp,
                   "Folder for warp-PROJECTOR.pfm or .exr, the points that the pixels light")
      ->type_name("FOLDER");
  add_choice(command, "--format", &options->format, exchange::k_warp_formats,
             "File format of --warp: pfm or exr (R, G, B are x, y, z)");
  command
      ->add_option("--looks", options->looks,
                   "Folder for look-SLOT-VARIANT.png, each variant as the viewer sees it")
      ->type_name("FOLDER");
  command->add_option("--opencv", options->opencv, "Folder for NAME.yml, OpenCV's camera files")
      ->type_name("FOLDER");
  command->add_option("--ros", options->ros, "Folder for NAME.yaml, ROS's camera_info files")
      ->type_name("FOLDER");
  command
      ->add_option("--kalibr", options->kalibr,
                   "Kalibr's camchain to write: cameras, then projectors, each relative to the one before")
      ->type_name("FILE.yaml");
  command
      ->add_option("--rig", options->rig,
                   "Rig folder, rig.json or folder of .cameramodel files, which all of these need")
      ->type_name("RIG");
  command
      ->add_option("--scene", options->scene,
                   "Scene folder or its scene.json, for --mpcdi, --warp and --looks")
      ->type_name("SCENE");
  command->add_option("--poses", options->poses, "POSES.json with the pose of the prototype, likewise")
      ->type_name("FILE.json");
  command
      ->add_option("--viewer", options->viewer,
                   "Viewer file for --profile 3d and --looks; without it the scene's viewer")
      ->type_name("FILE.json");
  auto json = std::make_shared<bool>(false);
  command->add_flag("--json", *json, "Print JSON instead of a line for each projector");
  const CLI::App* lines = add_export_lines(command, run);
  command->callback([options, json, lines, &run] {
    if (lines->parsed()) return;  // its own callback has set `run`
    if (options->rig.empty()) throw CLI::RequiredError("--rig");
    run = [options, json] { return report_result(run_export(*options, *json)); };
  });
}

void add_import(CLI::App& app, Run& run) {
  auto* command = app.add_subcommand(
      "import", "Show what an MPCDI file holds or what is wrong with it, and write its projectors as a rig");
  command->footer(
      "Reads archives of MPCDI 1 and 2, and XML without an archive as Christie's Mystique writes it (poses "
      "without maps).\n"
      "Example: limn import theirs.mpcdi --out rig\n"
      "Rigs of other programs: limn import rig --help\n"
      "STEP and IGES files: limn import cad --help\n"
      "Lines of light: limn import lines --help");
  auto options = std::make_shared<ImportOptions>();
  command->add_option("file", options->file, "Archive (.mpcdi) or XML (.mpcdi.xml)")->type_name("FILE");
  command
      ->add_option("--out", options->out,
                   "Rig folder to write, in the file's own coordinate frame (profile sl)")
      ->type_name("FOLDER");
  command->add_flag("--json", options->json, "Print JSON instead of a line for each region");
  const CLI::App *rig = add_import_rig(command, run), *cad = add_import_cad(command, run),
                 *lines = add_import_lines(command, run);
  command->callback([options, rig, cad, lines, &run] {
    if (rig->parsed() || cad->parsed() || lines->parsed()) return;  // its own callback has set `run`
    if (options->file.empty()) throw CLI::RequiredError("file");
    run = [options] { return report_result(run_import(*options)); };
  });
}

}  // namespace limn::apps
