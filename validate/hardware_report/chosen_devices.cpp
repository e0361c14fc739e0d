#include "validate/hardware_report/chosen_devices.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <cstdint>

#include "core/file.h"
#include "core/print.h"

namespace limn::validate {
namespace {

constexpr int k_no_light_width = 1280, k_no_light_height = 800;  // images that nobody sees

bool is_projector(const device::DisplayConfig& display) { return display.name.starts_with("projector"); }

Result<device::Devices> load_complete(const std::filesystem::path& file) {
  LIMN_TRY(device::Devices named, device::load_devices(file));
  const auto projectors = std::ranges::count_if(named.displays, is_projector);
  if (named.cameras.empty() || projectors == 0)
    return error(
        "{}: expected at least one camera and one display whose name begins with projector, found {} cameras "
        "and {} such displays. Add what is missing; a camera without a projector is measured with "
        "{{\"name\": \"projector0\", \"monitor\": \"offscreen\", \"size\": [1280, 800]}}. Without --devices "
        "the report uses what is plugged in.",
        file.string(), named.cameras.size(), projectors);
  return named;
}

device::DisplayConfig no_projector() {
  return {.name = "projector0",
          .kind = device::DisplayKind::offscreen,
          .size = {k_no_light_width, k_no_light_height}};
}

// The projector's monitor. The only one has the terminal on it, so it is covered only when a person wants it.
Result<device::DisplayConfig> choose_projector(const PluggedIn& found, Questions* questions) {
  if (found.monitors.empty()) {
    print_out(
        "There is no monitor for a projector. {} The camera is measured without one: no light, no latency.\n",
        found.no_monitor);
    return no_projector();
  }
  if (found.monitors.size() > 1) {
    LIMN_TRY(
        const std::string monitor,
        questions->choose(fmt::format("The projector is covered with white, flashes and stripes; keep this "
                                      "terminal on another monitor. Which monitor is the projector ({})?",
                                      fmt::join(found.monitors, ", ")),
                          found.monitors, found.monitors.back()));
    return device::DisplayConfig{.name = "projector0", .monitor = monitor};
  }
  const std::string& only = found.monitors.front();
  LIMN_TRY(
      const std::string answer,
      questions->choose(
          fmt::format("{} is the only monitor. As the projector it is covered with white, flashes and "
                      "stripes for some minutes, and so is this terminal if it is there: you could not read "
                      "the questions. Is it the projector (yes), or is the camera measured without a "
                      "projector (no)?",
                      only),
          {"yes", "no"}, "no"));
  if (answer == "yes") return device::DisplayConfig{.name = "projector0", .monitor = only};
  print_out(
      "The camera is measured without a projector: no light, no latency. For them plug in the projector, and "
      "use another folder.\n");
  return no_projector();
}

// FNV-1a.
std::uint64_t hash(const std::string& text) {
  std::uint64_t value = 14695981039346656037U;
  for (const char c : text) value = (value ^ static_cast<unsigned char>(c)) * 1099511628211U;
  return value;
}

}  // namespace

Result<ChosenDevices> choose_devices(const ReportOptions& options,
                                     const ReportCommands& commands,
                                     Questions* questions) {
  ChosenDevices chosen{.board = options.board};
  if (!options.devices.empty()) {
    LIMN_TRY(chosen.named, load_complete(options.devices));
    return chosen;
  }
  const PluggedIn found = commands.plugged_in();
  if (found.cameras.empty()) {
    print_out(
        "Nothing is measured on devices: no camera was found (monitors: {}). The virtual rig is used. Plug a "
        "camera in, or name a network camera in a devices file (--devices).\n",
        found.monitors.empty() ? "none" : fmt::format("{}", fmt::join(found.monitors, ", ")));
    return chosen;
  }
  LIMN_TRY(const std::string camera,
           questions->ask(fmt::format("Which camera ({})?", fmt::join(found.cameras, ", ")),
                          found.cameras.front()));
  LIMN_TRY(const device::DisplayConfig projector, choose_projector(found, questions));
  LIMN_TRY(chosen.board, questions->ask("Which board do you hold?", options.board));
  chosen.named.cameras = {{.name = "camera0", .source = camera}};
  chosen.named.displays = {projector};
  return chosen;
}

void rename_private(ChosenDevices* devices, PrivateWords* words) {
  const auto rename = [&](std::string* name, const std::string& kind) {
    if (words->without(*name) == *name) return;  // also an address that nobody knows
    const auto is_taken = [&](const std::string& other) {
      return std::ranges::any_of(devices->named.cameras,
                                 [&](const auto& one) { return one.name == other; }) ||
             std::ranges::any_of(devices->named.displays, [&](const auto& one) { return one.name == other; });
    };
    int number = 0;
    while (is_taken(kind + std::to_string(number))) ++number;
    const std::string plain = kind + std::to_string(number);
    devices->renamed[*name] = plain;
    words->add(*name, plain);
    *name = plain;
  };
  for (device::CameraConfig& camera : devices->named.cameras) rename(&camera.name, "camera");
  for (device::DisplayConfig& display : devices->named.displays)
    rename(&display.name, is_projector(display) ? "projector" : "screen");
}

std::string devices_mark(const ChosenDevices& devices, const std::filesystem::path& rig) {
  if (devices.is_virtual()) return "virtual rig";
  const auto key = read_file("/etc/machine-id");
  device::Devices named = devices.named;
  // Without the id an address could be found: then the sources are left out.
  if (!key || key->size() < 32)
    for (device::CameraConfig& camera : named.cameras)
      camera.source = camera.source.substr(0, camera.source.find(':'));
  const auto calibrated = rig.empty() ? Result<std::string>(std::string()) : read_file(rig / "rig.json");
  return fmt::format("{:016x}", hash((key ? *key : "") + device::devices_text(named.cameras, named.displays) +
                                     devices.board + (calibrated ? *calibrated : rig.string())));
}

}  // namespace limn::validate
