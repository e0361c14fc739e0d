#include "apps/recheck.h"

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <system_error>

#include "calib/capture_set.h"
#include "core/file.h"
#include "core/image_writer.h"
#include "core/print.h"
#include "core/rig.h"
#include "device/desktop.h"
#include "device/devices_file.h"
#include "nodes/remote_devices.h"
#include "tracker/marker_image.h"
#include "wizard/capture/capture_plan.h"
#include "wizard/capture/device_backend.h"
#include "wizard/capture/virtual_capture.h"

namespace limn::apps {
namespace {

namespace fs = std::filesystem;

constexpr double k_images_a_second = 10;  // shown, settled and photographed by an ordinary camera
constexpr double k_most_seconds = 15;

// As many poses as fit into the time that a recheck may take, at least one.
size_t affordable_poses(const wizard::Plan& plan, const Rig& rig) {
  int images = 0;
  for (const Imager& projector : rig.projectors) {
    if (const auto patterns =
            calib::Patterns::create(plan.code, projector.width, projector.height, plan.code_options))
      images += patterns->count();
  }
  return static_cast<size_t>(std::max(1.0, k_most_seconds * k_images_a_second / std::max(1, images)));
}

Status capture_in_virtual_room(const RecheckCommand& command, const fs::path& folder) {
  LIMN_TRY(wizard::Plan plan, wizard::load_plan(command.plan));
  plan.code_options.inverses =
      false;  // the rig is almost known, so half the images are enough, and more devices fit into the time
  LIMN_TRY(sim::World world, sim::load_world(plan.world, tracker::marker_image));
  if (command.prototype && !world.scene)
    return error("{}: scene: expected a prototype for --prototype, found none.", plan.world.string());
  plan.world_from_board.resize(std::min(plan.world_from_board.size(), affordable_poses(plan, world.rig)));
  sim::VirtualRig rig(std::move(world));
  if (!command.prototype) return wizard::capture_virtually(plan, &rig, folder);
  return wizard::capture_prototype(plan, {rig.world().world_from_prototype}, &rig, folder);
}

Status capture_with_devices(const RecheckCommand& command, const fs::path& folder) {
  LIMN_TRY(const Rig rig, load_rig(command.rig));
  LIMN_TRY(const device::Devices all, device::load_devices(command.devices));
  LIMN_TRY(const device::Devices named, device::matched(all, rig));
  const Result<device::Desktop> desktop = device::Desktop::open();
  nodes::RoomOpener opener(nullptr, desktop ? &*desktop : nullptr);
  LIMN_TRY(wizard::DeviceBackend::Devices devices, wizard::open_devices(named, &opener));
  LIMN_TRY(const calib::Board board, wizard::calibration_board(rig));
  const calib::CaptureSet captures = calib::plan_captures(
      folder, wizard::captured_devices(devices.cameras, devices.infrared),
      wizard::captured_devices(devices.projectors), board, calib::PatternCode::gray, {.inverses = false});
  wizard::DeviceBackend device_backend(std::move(devices), board, nullptr);
  ImageWriter writer;
  return wizard::capture_once(captures, rig, device_backend.backend(&writer));
}

// The captures folder that the command names, or that it captures now.
Result<fs::path> prepare_captures(const RecheckCommand& command) {
  const int ways = !command.plan.empty() + !command.captures.empty() + !command.devices.empty();
  if (ways != 1)
    return usage_error("expected one of a captures folder, --plan and --devices, found {}.",
                       ways == 0 ? "none" : "several");
  if (command.prototype && command.plan.empty())
    return usage_error(
        "--prototype: expected --plan with it, found none. Leave --prototype out: captures and --devices do "
        "not need it.");
  if (!command.captures.empty()) return command.captures;
  const fs::path folder = command.out / "captures";
  LIMN_TRY_STATUS(command.plan.empty() ? capture_with_devices(command, folder)
                                       : capture_in_virtual_room(command, folder));
  return folder;
}

Status write_rig(const calib::RigCheck& result, const RecheckCommand& command) {
  LIMN_TRY_STATUS(save_rig(result.rig, command.out));
  const fs::path folder = fs::is_directory(command.rig) ? command.rig : command.rig.parent_path();
  const fs::path response = folder / "response.json";
  std::error_code ignored;
  if (!fs::exists(response, ignored) || fs::equivalent(folder, command.out, ignored)) return {};
  LIMN_TRY(const std::string content, read_file(response));
  return write_file(command.out / "response.json", content);
}

void print_table(const wizard::Rechecked& checked) {
  const calib::RigCheck& result = checked.result;
  print_out("{:<14} {:>12} {:>10} {:>10}\n", "device", "observations", "before px", "after px");
  for (const calib::CheckedDevice& device : result.devices) {
    if (device.observations == 0)
      print_out("{:<14} {:>12}\n", device.name, "not seen");
    else
      print_out("{:<14} {:>12} {:>10.3f} {:>10.3f}\n", device.name, device.observations, device.before_px,
                device.after_px);
  }
  for (const calib::Move& move : result.candidates)
    print_out("{}: turned {:.3f} ± {:.3f}°, moved {:.2f} ± {:.2f} mm: {:.2f} px, {:.2f} mm on the board\n",
              move.device, move.degrees, move.degrees_stddev, move.mm, move.mm_stddev, move.px,
              move.mm_on_board);
  if (result.board_moved) print_out("the board has been moved: --still is not used\n");
  print_out("{} ({} images, {:.1f} s at {:.0f} per second)\n", wizard::recheck_sentence(result),
            checked.images, checked.images / k_images_a_second, k_images_a_second);
}

Result<wizard::CheckedRig> check(const RecheckCommand& command) {
  LIMN_TRY(const Rig rig, load_rig(command.rig));
  LIMN_TRY(const fs::path folder, prepare_captures(command));
  LIMN_TRY(wizard::CheckedRig checked, wizard::recheck_rig(rig, folder, command.still, command.out));
  if (checked.rechecked.result.verdict != calib::RigVerdict::unexplained)
    LIMN_TRY_STATUS(write_rig(checked.rechecked.result, command));
  return checked;
}

}  // namespace

Result<wizard::Rechecked> recheck(const RecheckCommand& command) {
  LIMN_TRY(wizard::CheckedRig checked, check(command));
  LIMN_TRY_STATUS(wizard::check_explained(checked.rechecked.result));
  return checked.rechecked;
}

Status run_recheck(const RecheckCommand& command) {
  LIMN_TRY(const wizard::CheckedRig checked, check(command));
  if (command.json)
    print_out("{}", checked.json);
  else
    print_table(checked.rechecked);
  LIMN_TRY_STATUS(wizard::check_explained(checked.rechecked.result));
  if (!command.json) print_out("rig in {}\n", command.out.string());
  return {};
}

}  // namespace limn::apps
