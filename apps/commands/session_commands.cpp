#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>

#include "apps/bench.h"
#include "apps/commands/commands.h"
#include "apps/commands/options.h"
#include "apps/demo.h"
#include "apps/doctor.h"
#include "apps/live.h"
#include "apps/replay.h"
#include "apps/room.h"
#include "apps/simulate.h"

namespace limn::apps {

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
      ->type_name("BENCH")
      ->required();
  command->prefix_command();
  command->callback([command, options, &run] {
    options->arguments = command->remaining();
    run = [options] { return report_result(run_bench(*options)); };
  });
}

void add_demo(CLI::App& app, Run& run) {
  auto* command = app.add_subcommand(
      "demo", "Play a whole session on the virtual rig: calibrate, track, project, composite");
  command->footer("Example: limn demo --out out   (then open out/demo.html)");
  auto options = std::make_shared<DemoOptions>();
  command->add_option("--out", options->out, "Folder for the images, demo.html and demo.json")
      ->type_name("FOLDER")
      ->capture_default_str();
  command->add_flag("--window", options->window, "Also show the images in a window; Escape closes it");
  command->add_flag("--keep-captures", options->keep_captures,
                    "Keep the images of the calibration (about 1 GB)");
  command->callback([options, &run] { run = [options] { return report_result(run_demo(*options)); }; });
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
      "looks side by side, g grid, d deviation from the CAD, escape asks to end.\n"
      "Example: limn live --seconds 5 --out session\n"
      "Example: limn live --devices devices.json --rig rig --scene config/scenes/door --out session "
      "--window\n"
      "Example: limn live --rig rig --scene config/scenes/door --seconds 10 --record recording\n"
      "Example: limn live --osc 9000 --osc-to 127.0.0.1:9001   (docs/osc.md)\n"
      "Example: limn live --trackers trackers.json --window   (docs/trackers.md)\n"
      "Example: limn live --window --serve 8080   (docs/remote.md)");
  auto options = std::make_shared<LiveOptions>();
  command
      ->add_option(
          "--rig", options->rig,
          "Rig folder, rig.json or folder of .cameramodel files; without it the virtual world's own rig")
      ->type_name("RIG");
  command
      ->add_option("--scene", options->scene,
                   "Scene folder or its scene.json; without it the virtual world's own scene")
      ->type_name("SCENE");
  command
      ->add_option("--devices", options->devices,
                   "File that names the cameras and displays (limn.devices/1); without it and without --room "
                   "a virtual rig")
      ->type_name("FILE.json");
  command
      ->add_option(
          "--world", options->world,
          "World of the virtual rig (limn.world/1); without it, and without rig and scene, the world studio")
      ->type_name("FILE.json");
  command
      ->add_option("--script", options->script,
                   "File that says what happens in the virtual room (limn.script/1)")
      ->type_name("FILE.json");
  command->add_option("--seconds", options->seconds,
                      "Length in seconds of the session's clock; without it the script's length, or until "
                      "somebody ends the session");
  command->add_option(
      "--resolution", options->resolution,
      "Scale of the virtual devices' image sides, over 0 and at most 1. Without it 1, or with "
      "--window, --serve, --osc or --trackers what this machine computes in real time");
  command->add_option("--record", options->record, "Folder for a recording that limn replay can play")
      ->type_name("FOLDER");
  command
      ->add_option("--out", options->out,
                   "Folder for poses.csv, telemetry.csv, session.html and the last images")
      ->type_name("FOLDER");
  command->add_flag("--window", options->window,
                    "Open the operator's window: images, devices, parts, looks, telemetry, keys");
  add_choice(command, "--prediction", &options->prediction, tracker::k_predictions,
             "How poses are predicted for the moment when the light is shown: hold, linear or filtered");
  add_choice(command, "--triple-pose", &options->triple_pose, tracker::k_triple_poses,
             "Pose of three balls in one image: refined, or triangle (the method of the 2011 paper; with "
             "--prediction hold or linear)");
  add_choice(command, "--marker-light", &options->marker_light, tracker::k_marker_lights,
             "Light on markers: as-is (like the rest), keep-out (dark) or spotlight (white)");
  command
      ->add_option("--stereo", options->stereo,
                   "Projector of the virtual rig that shows an image to each eye of the viewer; repeat it "
                   "for several. For devices, stereo is set in the devices file")
      ->type_name("PROJECTOR");
  command
      ->add_option("--osc", options->osc,
                   "PORT or ADDRESS:PORT at which OSC messages of other programs are received; a port "
                   "alone accepts this machine only")
      ->type_name("PORT");
  command
      ->add_option("--osc-from", options->osc_from,
                   "Numeric address of the only machine whose OSC messages are accepted")
      ->type_name("ADDRESS");
  command->add_option("--osc-to", options->osc_to, "HOST:PORT to which changes are sent by OSC")
      ->type_name("ADDRESS");
  command
      ->add_option("--trackers", options->trackers,
                   "File that names other tracking systems whose poses are used (limn.trackers/1)")
      ->type_name("FILE.json");
  command
      ->add_option("--poses-out", options->poses_out,
                   "PROTOCOL:HOST:PORT to which the poses of bodies and viewer are sent at each frame; psn, "
                   "freed or json; or ros for ROS 2; may be repeated")
      ->type_name("TARGET");
  add_room_of_devices(command, &options->room);
  command
      ->add_option("--serve", options->serve,
                   "PORT or ADDRESS:PORT of the remote for phones and tablets; a port alone accepts this "
                   "machine only, a network address is encrypted")
      ->type_name("PORT");
  command
      ->add_option(
          "--serve-show", options->serve_show,
          "Name of a projector that shows the remote's QR code and PIN (role work) for the first 60 s")
      ->type_name("PROJECTOR");
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
  create->add_option("name", *name, "The room's name")->type_name("NAME")->required();
  create->add_option("--out", *folder, "Folder for the keys; without it ~/.config/limn/rooms/NAME")
      ->type_name("FOLDER");
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
      ->type_name("ROOM")
      ->required();
  add_room_options(command, &options->room);
  command
      ->add_option("--out", options->out,
                   "Folder for shown.csv: when each image was shown, and its fingerprint")
      ->type_name("FOLDER");
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
      ->type_name("FOLDER")
      ->required();
  command
      ->add_option("--out", options->out,
                   "Folder for poses.csv, telemetry.csv, session.html and the last images")
      ->type_name("FOLDER");
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
  command->add_option("world", options->world, "World file (limn.world/1)")
      ->type_name("FILE.json")
      ->required();
  command->add_option("--out", options->out, "Folder for the images, truth.json and the true rig")
      ->type_name("FOLDER")
      ->required();
  command
      ->add_option("--show", options->show,
                   "PROJECTOR=IMAGE that a projector shows; repeat the option for other projectors")
      ->type_name("PROJECTOR=IMAGE");
  command
      ->add_option("--variants", options->variants,
                   "SLOT=VARIANT,… for the image that shows the parts as physical objects; without it "
                   "each slot's first variant")
      ->type_name("SLOT=VARIANT");
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
      "Example: limn doctor --room studio\n"
      "Example: limn doctor --report report");
  auto options = std::make_shared<DoctorOptions>();
  auto report = std::make_shared<validate::ReportOptions>();
  command->add_option("--room", options->room.room, "Name or folder of a room whose machines are listed")
      ->type_name("ROOM");
  add_room_options(command, &options->room);
  auto* devices = command->add_option("--devices", options->devices, "Devices file (limn.devices/1) to test")
                      ->type_name("FILE.json");
  command->add_option("--rig", options->rig, "Rig folder; the devices must have its names and sizes")
      ->type_name("RIG")
      ->needs(devices);
  command
      ->add_option(
          "--show", options->show_s,
          "How long each output shows its own number and colour, in seconds (without it: not at all)")
      ->check(CLI::Range(0.0, 3600.0));
  command->add_flag("--json", options->json, "Print JSON instead of lines");
  auto* folder =
      command
          ->add_option(
              "--report", report->folder,
              "Measure camera, projector and a live session for about half an hour, and write all of "
              "it into one folder; the same command goes on after an interruption")
          ->type_name("FOLDER");
  command->add_option("--board", report->board, "With --report: the board that you hold into the light")
      ->type_name("BOARD")
      ->capture_default_str()
      ->needs(folder);
  command
      ->add_option("--placements", report->placements,
                   "With --report: how often the board is captured; limn solve needs it in 3 placements")
      ->check(CLI::Range(1, 9))
      ->capture_default_str()
      ->needs(folder);
  command->add_option("--live-seconds", report->live_s, "With --report: length of the recorded session")
      ->check(CLI::Range(1.0, 3600.0))
      ->capture_default_str()
      ->needs(folder);
  command
      ->add_flag("--with-names", report->with_names,
                 "With --report: keep names, addresses and serial numbers in all its files")
      ->needs(folder);
  command->callback([options, report, &run] {
    run = [options, report] {
      if (report->folder.empty()) return report_result(run_doctor(*options));
      report->devices = options->devices;
      report->rig = options->rig;
      return report_result(validate::run_hardware_report(*report, report_commands()));
    };
  });
}

}  // namespace limn::apps
