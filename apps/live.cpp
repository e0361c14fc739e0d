#include "apps/live.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <csignal>
#include <functional>
#include <limits>
#include <optional>
#include <span>

#include "apps/live_service.h"
#include "core/data_folder.h"
#include "core/log.h"
#include "core/names.h"
#include "core/scale_resolution.h"
#include "core/screen_encoding.h"
#include "core/user_folder.h"
#include "device/desktop.h"
#include "device/device_locks.h"
#include "device/device_opener.h"
#include "device/devices_file.h"
#include "device/gl_context.h"
#include "nodes/remote_devices.h"
#include "nodes/ros_port.h"
#include "nodes/ros_sender.h"
#include "remote/server.h"
#include "remote/tablet/tablet_view.h"
#include "session/device_session.h"
#include "session/operator_console.h"
#include "session/osc_port.h"
#include "session/perception.h"
#include "session/pose_feeds.h"
#include "session/pose_sender.h"
#include "session/requests/script.h"
#include "session/session.h"
#include "session/session_output.h"
#include "session/virtual_room.h"
#include "session/virtual_session.h"
#include "sim/virtual_rig.h"
#include "tracker/marker_image.h"

namespace limn::apps {
namespace {

namespace fs = std::filesystem;

constexpr double k_camera_limit_s = 0.5;  // short, so that the session ends in under a second

// Set by the signals that end a session.
std::atomic<bool> g_is_ended = false;
void end_session(int) { g_is_ended = true; }

void end_session_on_signals() {
  g_is_ended = false;
  std::signal(SIGINT, end_session);
  std::signal(SIGTERM, end_session);
  // The terminal was closed. With nohup this signal is ignored, and stays so.
  if (std::signal(SIGHUP, end_session) == SIG_IGN) std::signal(SIGHUP, SIG_IGN);
}

// Whether the session is on devices; else it is on the virtual rig.
bool has_devices(const LiveOptions& options) {
  return !options.devices.empty() || !options.room.room.empty();
}

Status check_options(const LiveOptions& options) {
  if (!options.stereo.empty() && has_devices(options))
    return usage_error(
        "--stereo: expected it without --devices and --room. For devices, set stereo at the display in the "
        "devices file.");
  if (!(options.seconds >= 0) || options.seconds > 1e6)
    return usage_error("--seconds: expected a number of seconds, or 0 for no end, found {}.",
                       options.seconds);
  if (!(options.extrapolate_s > 0 && options.extrapolate_s <= 5))
    return usage_error("--extrapolate: expected seconds over 0 and at most 5, found {}.",
                       options.extrapolate_s);
  if (options.triple_pose == tracker::TriplePose::triangle &&
      options.prediction == tracker::Prediction::filtered)
    return usage_error(
        "--triple-pose triangle: expected --prediction hold or linear with it, found filtered, which uses "
        "the balls' centres themselves and no pose of one image.");
  const char* with_devices = !options.devices.empty() ? "--devices" : "--room";
  if (has_devices(options) && options.rig.empty())
    return usage_error("{}: expected --rig and --scene with it, found neither.", with_devices);
  if (has_devices(options) && (!options.world.empty() || !options.script.empty()))
    return usage_error(
        "{}: expected no --world and no --script with it, because they are for the virtual rig.",
        with_devices);
  if (!options.serve_show.empty() && options.serve.empty())
    return usage_error("--serve-show: expected --serve with it, found none.");
  if (options.rig.empty() != options.scene.empty())
    return usage_error(
        "expected --rig and --scene together, found one of them. Without both the world is virtual.");
  return {};
}

// The virtual room's true content, and what the session knows about it.
struct VirtualSetup {
  sim::World world;
  session::SessionSetup setup;
  std::vector<scene::SkippedVariant> skipped_variants;
};

Result<VirtualSetup> load_virtual_setup(const LiveOptions& options) {
  VirtualSetup loaded;
  if (!options.rig.empty()) {
    LIMN_TRY(loaded.setup.rig, load_rig(options.rig));
    LIMN_TRY(loaded.setup.scene, scene::load_scene(options.scene, &loaded.skipped_variants));
  }
  if (options.rig.empty() || !options.world.empty()) {
    fs::path world = options.world;
    if (world.empty()) {
      LIMN_TRY(world, data_file("config/worlds/studio.json"));
    }
    LIMN_TRY(loaded.world, sim::load_world(world, tracker::marker_image, &loaded.skipped_variants));
    if (!loaded.world.scene)
      return error("{}: scene: expected a scene for a session, found none.", world.string());
  } else {
    LIMN_TRY(loaded.world, session::room_for(loaded.setup.rig, loaded.setup.scene));
  }
  for (Imager& camera : loaded.setup.rig.cameras)
    if (const Imager* there = find_named(loaded.world.rig.cameras, camera.name)) camera.sees = there->sees;
  if (options.rig.empty()) {
    loaded.setup.rig = loaded.world.rig;
    loaded.setup.scene = *loaded.world.scene;
  }
  return loaded;
}

// Makes the rig of world and session as coarse as `share` says.
Status make_coarser(double share, VirtualSetup* loaded) {
  LIMN_TRY_STATUS(scale_resolution(share, &loaded->world.rig));
  return scale_resolution(share, &loaded->setup.rig);
}

// The effort to begin with: the largest one at which this machine computes all frames in time, as far as one
// can say from the time of a frame at the smallest resolution. It is taken to grow with the number of pixels.
Result<std::size_t> choose_effort(const VirtualSetup& loaded, const session::RealTime& real_time) {
  const double smallest = real_time.efforts.back().resolution;
  VirtualSetup coarser = loaded;
  LIMN_TRY_STATUS(make_coarser(smallest, &coarser));
  LIMN_TRY(const double frame_s, session::measure_frame_s(coarser.world, coarser.setup));
  const auto is_fast = [&](const session::Effort& effort) {
    return frame_s * std::pow(effort.resolution / smallest, 2) <= real_time.frame_period_s;
  };
  const auto& efforts = real_time.efforts;
  return static_cast<std::size_t>(std::find_if(efforts.begin(), efforts.end() - 1, is_fast) -
                                  efforts.begin());
}

// A rig is valid only for the devices that it was measured on.
Status check_fits(const Rig& rig, const Rig& devices) {
  for (const auto& [wanted, there] :
       {std::pair{&rig.cameras, &devices.cameras}, {&rig.projectors, &devices.projectors}}) {
    for (const Imager& imager : *wanted) {
      const Imager* found = find_named(*there, imager.name);
      if (!found)
        return error(
            "rig: {}: expected one of the devices ({}), found none of that name. This rig belongs to other "
            "devices; name the right one, or run limn calibrate.",
            imager.name, joined_names(*there));
      if (found->width != imager.width || found->height != imager.height)
        return error(
            "rig: {}: expected the device's size {}x{}, found {}x{}. This rig belongs to another device or "
            "mode; set the mode, or run limn calibrate.",
            imager.name, found->width, found->height, imager.width, imager.height);
    }
  }
  return {};
}

// Copies the options into the setup, except those for devices and virtual rig.
Status set_up(const LiveOptions& options, session::SessionSetup* setup) {
  setup->paint.prediction = options.prediction;
  setup->paint.marker_light = options.marker_light;
  setup->paint.refill = options.refill;
  setup->paint.prepares_lines = !options.serve.empty() || setup->scene.pen;
  for (const std::string& name : options.stereo) {
    if (!find_named(setup->rig.projectors, name))
      return usage_error("--stereo: expected a projector of the rig ({}), found '{}'.",
                         joined_names(setup->rig.projectors), name);
    setup->paint.stereo_projectors.push_back(name);
  }
  setup->watch.triple_pose = options.triple_pose;
  setup->watch.motion.extrapolation_limit_s = options.extrapolate_s;
  setup->paint.motion = setup->watch.motion;
  return {};
}

// Opens the remote; null if it is not asked for.
Result<std::unique_ptr<remote::Server>> serve(const LiveOptions& options,
                                              const session::SessionSetup& setup) {
  if (options.serve.empty()) return std::unique_ptr<remote::Server>();
  if (!options.serve_show.empty() && !find_named(setup.rig.projectors, options.serve_show))
    return usage_error("--serve-show: expected a projector of the rig ({}), found '{}'.",
                       joined_names(setup.rig.projectors), options.serve_show);
  remote::ServeOptions serve;
  serve.at = options.serve;
  LIMN_TRY(const fs::path own, user_folder());
  auto tablet_view = remote::TabletView::create(setup, own / "lenses");
  if (!tablet_view) log_warning("live: the remote shows no live images: {}", tablet_view.message());
  auto locator = remote::CameraLocator::create(setup);
  if (!locator) log_warning("live: the cameras of glasses are not used: {}", locator.message());
  LIMN_TRY(std::unique_ptr<remote::Server> server,
           remote::Server::open(serve, tablet_view
                                           ? remote::image_providers(std::move(*tablet_view),
                                                                     locator ? std::move(*locator) : nullptr)
                                           : remote::ImageProviders{}));
  if (!options.serve_show.empty()) server->show_code(options.serve_show, scene::Role::work);
  return server;
}

session::Session::Drawing drawing_in(std::optional<device::GlContext>* context) {
  return {[context] { return !*context || (*context)->is_lost(); },
          [context]() -> Status {
            context->reset();
            LIMN_TRY(*context, device::GlContext::create());
            return {};
          }};
}

// The way to ROS 2; null if nothing is received from it or sent to it.
Result<std::unique_ptr<exchange::RosPort>> ros_port_for(const std::vector<session::FeedConfig>& trackers,
                                                        const std::vector<std::string>& poses_out) {
  const auto is_ros = [](const session::FeedConfig& tracker) {
    return tracker.decoder.protocol == exchange::PoseProtocol::ros;
  };
  if (std::ranges::any_of(trackers, is_ros) || std::ranges::find(poses_out, "ros") != poses_out.end())
    return nodes::open_ros_port();
  return std::unique_ptr<exchange::RosPort>();
}

// Opens everything that sessions on devices and on the virtual rig have in common, calls `play`, and closes
// it. `setup` becomes what a replay will read. `room` may be null.
Status run_session(const LiveOptions& options,
                   session::SessionSetup setup,
                   std::span<const scene::SkippedVariant> skipped_variants,
                   const device::Desktop* desktop,
                   session::SessionClient* room,
                   const std::function<Status(const session::SessionParts&, session::Keys*)>& play) {
  std::optional<device::GlContext> context;
  LIMN_TRY(context, device::GlContext::create());
  log_info("live: {}", context->description());
  LIMN_TRY(session::OscPort osc, session::OscPort::open(options.osc, options.osc_to, options.osc_from));
  LIMN_TRY(const std::unique_ptr<remote::Server> server, serve(options, setup));
  std::vector<session::FeedConfig> trackers;
  if (!options.trackers.empty()) {
    LIMN_TRY(trackers, session::load_feeds(options.trackers, setup.scene));
  }
  std::vector<std::string> poses_out = options.poses_out;
  LIMN_TRY(const std::unique_ptr<exchange::RosPort> ros, ros_port_for(trackers, poses_out));
  const bool is_sent_to_ros = std::erase(poses_out, "ros") > 0;
  std::unique_ptr<session::PoseFeeds> feeds;
  if (!trackers.empty()) {
    LIMN_TRY(feeds, session::PoseFeeds::open(trackers, ros.get()));
  }
  for (const session::FeedConfig& tracker : trackers) setup.watch.feeds.push_back(tracker.setup);
  LIMN_TRY(session::SessionOutput output, session::SessionOutput::open(options.out, options.record, &setup));
  LIMN_TRY(session::Perception perception, session::Perception::create(setup.scene, setup.rig, setup.watch));
  LIMN_TRY(session::Session session, session::Session::create(setup, &output.telemetry(), output.recorder()));
  session.report_skipped(skipped_variants, {});
  session.survive_losses(drawing_in(&context));
  std::optional<session::OperatorConsole> console;
  if (options.window) {
    LIMN_TRY(console, session::OperatorConsole::open(*desktop, setup.scene));
    if (server) console->invite(server.get());
  }
  LIMN_TRY(session::PoseSender sender, session::PoseSender::open(poses_out));
  nodes::RosSender ros_sender(ros.get());
  session::SessionParts parts{perception, session, output, {&osc, &sender}, feeds.get()};
  if (is_sent_to_ros) parts.clients.push_back(&ros_sender);
  if (server) parts.clients.push_back(server.get());
  if (console) parts.clients.push_back(&*console);
  if (room) parts.clients.push_back(room);
  LiveService service;
  parts.clients.push_back(&service);
  LIMN_TRY_STATUS(play(parts, console ? &console->keys() : nullptr));
  service.stop();
  console.reset();
  if (server) server->stop();
  return output.close(&session, options.json);
}

Status play_in_virtual_room(const LiveOptions& options) {
  LIMN_TRY(session::Script script, options.script.empty() ? Result<session::Script>(session::Script{})
                                                          : session::load_script(options.script));
  LIMN_TRY(VirtualSetup loaded, load_virtual_setup(options));
  session::SessionSetup& setup = loaded.setup;
  LIMN_TRY_STATUS(check_fits(setup.rig, loaded.world.rig));
  LIMN_TRY_STATUS(set_up(options, &setup));
  setup.paint.is_linear_camera =
      !loaded.world.camera_effects.at(loaded.world.rig.first_visible_camera()).srgb;
  if (const Status coarser = make_coarser(options.resolution.value_or(1), &loaded); !coarser)
    return usage_error("--resolution: {}", coarser.message());
  session::RealTime real_time{loaded.world.rig, options.frame_period_s,
                              session::efforts_for(loaded.world.rig, !options.resolution)};
  if (options.is_real_time && !options.resolution) {
    LIMN_TRY(real_time.first, choose_effort(loaded, real_time));
    LIMN_TRY_STATUS(make_coarser(real_time.efforts[real_time.first].resolution, &loaded));
  }
  log_info("live: no devices are given; the session runs on a virtual rig with its own clock");
  const double end_s = options.seconds > 0  ? options.seconds
                       : script.seconds > 0 ? script.seconds
                                            : std::numeric_limits<double>::infinity();
  sim::VirtualRig rig(std::move(loaded.world), session::virtual_rig_options(options.frame_period_s));
  LIMN_TRY(session::ScriptedRoom room, session::ScriptedRoom::create(std::move(script), &rig));
  std::optional<device::Desktop> desktop;
  if (options.window) {
    LIMN_TRY(desktop, device::Desktop::open());
  }
  return run_session(options, setup, loaded.skipped_variants, desktop ? &*desktop : nullptr, nullptr,
                     [&](const session::SessionParts& parts, session::Keys*) {
                       return session::play_virtually(end_s, options.is_real_time ? &real_time : nullptr,
                                                      g_is_ended, &rig, &room, parts);
                     });
}

bool is_projector(const Rig& rig, const std::string& display) {
  return find_named(rig.projectors, display) != nullptr;
}

// Opens the devices. Those that cannot be opened are reported and left out.
session::SessionDevices opened(const device::Devices& devices, const Rig& rig, device::DeviceOpener* opener) {
  session::SessionDevices out;
  const auto miss = [&out](const std::string& name, const char* kind, const std::string& why) {
    log_warning("live: {}: {} The session continues without it.", name, why);
    out.missing.push_back({.name = name, .kind = kind, .works = false, .why = why});
  };
  for (device::CameraConfig wanted : devices.cameras) {
    wanted.limit_s = k_camera_limit_s;
    auto camera = opener->camera(wanted);
    if (!camera) miss(wanted.name, "camera", camera.message());
    out.cameras.push_back(camera ? std::move(*camera) : nullptr);
  }
  out.projectors.resize(rig.projectors.size());
  out.latency_s.resize(rig.projectors.size());
  for (const device::DisplayConfig& wanted : devices.displays) {
    auto display = opener->display(wanted);
    const Imager* projector = find_named(rig.projectors, wanted.name);
    if (!display) miss(wanted.name, projector ? "projector" : "screen", display.message());
    auto opened = display ? std::move(*display) : nullptr;
    if (projector) {
      const auto index = static_cast<std::size_t>(projector - rig.projectors.data());
      out.projectors[index] = std::move(opened);
      out.latency_s[index] = wanted.latency_s;
    } else {
      out.screens.push_back(std::move(opened));
    }
    if (wanted.wall) out.walls[wanted.name] = *wanted.wall;
  }
  for (const device::KeysConfig& wanted : devices.keys) {
    auto keys = device::KeySource::open(wanted);
    keys ? out.keys.push_back(std::move(*keys)) : miss(wanted.name, "keys", keys.message());
  }
  return out;
}

Status play_with_devices(const LiveOptions& options) {
  session::SessionSetup setup;
  LIMN_TRY(setup.rig, load_rig(options.rig));
  LIMN_TRY(const device::Devices named, options.devices.empty() ? devices_in_room(options.room, setup.rig)
                                                                : device::load_devices(options.devices));
  LIMN_TRY(const std::vector<device::FileLock> locks, device::lock_devices(named));
  std::vector<scene::SkippedVariant> skipped_variants;
  LIMN_TRY(setup.scene, scene::load_scene(options.scene, &skipped_variants));
  LIMN_TRY(const device::Devices devices, device::matched(named, setup.rig));
  for (const device::CameraConfig& camera : devices.cameras)
    if (camera.sees != Spectrum::visible) find_named(setup.rig.cameras, camera.name)->sees = camera.sees;
  for (const device::DisplayConfig& display : devices.displays)
    if (!is_projector(setup.rig, display.name))
      setup.screens.push_back(display.name);
    else if (display.stereo != StereoLayout::off)
      setup.paint.stereo_projectors.push_back(display.name);
  LIMN_TRY_STATUS(set_up(options, &setup));
  setup.paint.is_linear_camera =
      !setup.rig.cameras.empty() &&
      is_measured_linear(setup.rig, setup.rig.cameras[setup.rig.first_visible_camera()]);
  std::optional<device::Desktop> desktop;
  if (options.window ||
      std::any_of(devices.displays.begin(), devices.displays.end(), device::needs_desktop)) {
    LIMN_TRY(desktop, device::Desktop::open());
  }
  std::unique_ptr<HostedRoom> room;
  if (!options.room.room.empty()) {
    LIMN_TRY(room, HostedRoom::open(options.room, devices, options.out, &setup));
  }
  nodes::RoomOpener opener(room ? room->room() : nullptr, desktop ? &*desktop : nullptr, setup.screens);
  session::SessionDevices open = opened(devices, setup.rig, &opener);
  return run_session(
      options, setup, skipped_variants, desktop ? &*desktop : nullptr, room ? room->client() : nullptr,
      [&](const session::SessionParts& parts, session::Keys* keys) {
        open.chosen = keys;
        const Status played = session::play_on_devices(&open, options.seconds, g_is_ended, parts);
        darken(open);
        return played;
      });
}

}  // namespace

bool live_was_ended_by_signal() { return g_is_ended; }

Status run_live(const LiveOptions& options) {
  LIMN_TRY_STATUS(check_options(options));
  end_session_on_signals();
  return has_devices(options) ? play_with_devices(options) : play_in_virtual_room(options);
}

}  // namespace limn::apps
