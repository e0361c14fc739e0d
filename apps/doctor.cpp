#include "apps/doctor.h"

#include <time.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <optional>
#include <set>
#include <sstream>
#include <thread>

#include "apps/doctor_room.h"
#include "apps/live.h"
#include "core/data_folder.h"
#include "core/file.h"
#include "core/json_text.h"
#include "core/log.h"
#include "core/print.h"
#include "device/address.h"
#include "device/devices_file.h"
#include "device/gige_camera.h"
#include "device/gl_context.h"
#include "device/test_card.h"
#include "device/v4l2_camera.h"
#include "nodes/ros_camera.h"

namespace limn::apps {
namespace {

using Clock = std::chrono::steady_clock;
using State = Finding::State;
using Findings = std::vector<Finding>;

// The message of the error already says what to do.
Finding failed(const std::string& area, const std::string& name, const std::string& message) {
  return {area, name, State::fails, message, ""};
}

// The release that an os-release file names, such as `trixie`; empty when it names none.
std::string release_in(const std::string& text) {
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with("VERSION_CODENAME=")) continue;
    std::erase(line, '"');
    return line.substr(line.find('=') + 1);
  }
  return "";
}

// The package names in a packages.txt. A line `NAME [RELEASE]` counts only on that release.
std::vector<std::string> packages_in(const std::string& text, const std::string& release) {
  std::vector<std::string> names;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line.substr(0, line.find('#')));
    std::string name, only;
    words >> name >> only;
    if (!name.empty() && (only.empty() || only == "[" + release + "]")) names.push_back(name);
  }
  return names;
}

// Names of the packages that are installed according to Debian's status file.
std::set<std::string> installed_in(const std::string& text) {
  std::set<std::string> names;
  std::istringstream lines(text);
  std::string package;
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("Package: ")) package = line.substr(9);
    if (line == "Status: install ok installed" || line == "Status: hold ok installed") names.insert(package);
  }
  return names;
}

// An installed program needs no list of packages: its own package named them. Its data may be missing.
Finding installed_data() {
  const auto data = data_file("config");
  if (!data) return failed("packages", "data", data.message());
  return {"packages", "data", State::works, data->parent_path().string(), ""};
}

Finding packages(const DoctorOptions& options) {
  if (options.packages.empty() && !is_development_build()) return installed_data();
  const auto list =
      options.packages.empty() ? data_file("packages.txt") : Result<std::filesystem::path>(options.packages);
  const auto wanted = list ? read_file(*list) : Result<std::string>(list.error());
  const auto status = read_file(options.installed);
  if (!wanted || !status)
    return {"packages", "Debian", State::note,
            fmt::format("cannot be checked: {}", wanted ? status.message() : wanted.message()), ""};
  const auto release = read_file(options.release);
  const auto names = packages_in(*wanted, release ? release_in(*release) : "");
  const auto there = installed_in(*status);
  std::string missing;
  for (const std::string& name : names)
    if (!there.contains(name)) missing += fmt::format(" {}", name);
  if (missing.empty())
    return {"packages", "Debian", State::works,
            fmt::format("all {} of packages.txt are installed", names.size()), ""};
  return {"packages", "Debian", State::fails, fmt::format("missing:{}", missing),
          fmt::format("apt-get install --no-install-recommends --no-remove{}", missing)};
}

Finding clock_of_session() {
  constexpr double k_coarsest_s = 1e-4;  // prediction needs better than a tenth of a millisecond
  timespec resolution{};
  clock_getres(CLOCK_MONOTONIC, &resolution);
  double step_s = 1;
  bool backwards = false;
  Stamp last = Clock::now();
  for (int i = 0; i < 20000; ++i) {
    const Stamp now = Clock::now();
    backwards = backwards || now < last;
    if (now > last) step_s = std::min(step_s, seconds_between(last, now));
    last = now;
  }
  const bool works = !backwards && step_s < k_coarsest_s;
  const std::string text =
      fmt::format("{}, resolution {} ns, smallest step {:.0f} ns", backwards ? "runs backwards" : "monotonic",
                  resolution.tv_sec * 1'000'000'000 + resolution.tv_nsec, 1e9 * step_s);
  return {"clock", "monotonic", works ? State::works : State::fails, text,
          works ? "" : "Choose another clocksource (/sys/devices/system/clocksource)."};
}

Finding gl() {
  const auto context = device::GlContext::create();
  if (!context) return failed("gl", "OpenGL 4.5", context.message());
  const std::string& text = context->description();
  const bool software = text.find("llvmpipe") != std::string::npos ||
                        text.find("softpipe") != std::string::npos ||
                        text.find("swrast") != std::string::npos;
  return {
      "gl", "OpenGL 4.5", State::works, text + (software ? ": software" : ": hardware"),
      software ? "Images are right but slow: for a live session install the graphics card's driver." : ""};
}

Finding described(const device::Monitor& monitor) {
  const std::string text =
      fmt::format("{}x{} at {} Hz, at {},{} of the desktop", monitor.size.width, monitor.size.height,
                  monitor.refresh_hz, monitor.position.x, monitor.position.y);
  const bool largest = monitor.size == monitor.largest;
  return {"displays", monitor.name, State::works, text,
          largest ? ""
                  : fmt::format("It also has {}x{}: a projector blurs patterns when it is driven in a size "
                                "other than its native one.",
                                monitor.largest.width, monitor.largest.height)};
}

Findings displays(const Result<device::Desktop>& desktop, bool asked_for) {
  if (!desktop)
    return {{"displays", "desktop", asked_for ? State::fails : State::note, desktop.message(), ""}};
  Findings findings;
  for (const device::Monitor& monitor : desktop->monitors()) findings.push_back(described(monitor));
  if (findings.empty())
    findings.push_back({"displays", "desktop", asked_for ? State::fails : State::note,
                        "a desktop without a monitor.", "Plug one in and switch it on."});
  return findings;
}

// The frames of a camera in about one second.
struct Rate {
  int frames = 0;
  double per_second = 0;  // by the stamps; 0: unknown
};

Result<Rate> measure_rate(device::CameraSource& camera) {
  constexpr int k_most = 120;
  const Stamp until = shifted(Clock::now(), 1);
  Rate rate;
  Stamp first, last;
  while (rate.frames < k_most && Clock::now() < until) {
    const auto frame = camera.next();
    if (!frame && (rate.frames == 0 || !camera.is_finite())) return frame.error();
    if (!frame) break;
    last = frame->captured_at;
    if (rate.frames++ == 0) first = last;
  }
  if (rate.frames > 1 && last > first) rate.per_second = (rate.frames - 1) / seconds_between(first, last);
  return rate;
}

std::string setting_text(const device::CameraSetting& setting) {
  if (!setting.found) return fmt::format(", {} requested {:g}", to_text(setting.name), setting.asked);
  return fmt::format(", {} {:g} (requested {:g})", to_text(setting.name), *setting.found, setting.asked);
}

// Opens the camera, grabs frames and compares the requested settings with the reported ones.
Finding tested(const std::string& area, const device::CameraConfig& wanted) {
  auto camera = nodes::open_camera_here(wanted);
  if (!camera) return failed(area, wanted.name, camera.message());
  const auto rate = measure_rate(**camera);
  if (!rate) return failed(area, wanted.name, rate.message());
  const cv::Size size = (*camera)->size();
  std::string text = fmt::format("{}: {}x{}", device::without_login(wanted.source), size.width, size.height);
  if (rate->per_second > 0) text += fmt::format(", {:.1f} frames per second", rate->per_second);
  std::string problems;
  for (const device::CameraSetting& setting : (*camera)->settings()) {
    text += setting_text(setting);
    if (!setting.problem.empty())
      problems += fmt::format("{}{}", problems.empty() ? "" : " ", setting.problem);
  }
  text += fmt::format(" [{}]", (*camera)->description());
  return {area, wanted.name, problems.empty() ? State::works : State::fails, text, problems};
}

// All cameras that are connected or answer, except those of the file, which are tested with the file's
// settings.
Findings cameras(const device::Devices& devices) {
  const auto named = [&](const std::string& source) {
    return std::ranges::find(devices.cameras, source, &device::CameraConfig::source) != devices.cameras.end();
  };
  Findings findings;
  for (const device::V4l2Device& found : device::v4l2_cameras()) {
    const std::string source = fmt::format("v4l2:{}", found.path);
    if (named(source)) continue;
    if (!found.problem.empty()) findings.push_back(failed("cameras", found.path, found.problem));
    if (found.problem.empty()) findings.push_back(tested("cameras", {.name = found.card, .source = source}));
  }
  const auto on_network = device::gige_cameras();
  if (!on_network) findings.push_back(failed("cameras", "gige", on_network.message()));
  for (const std::string& id : on_network ? *on_network : std::vector<std::string>{})
    if (!named(fmt::format("gige:{}", id)))
      findings.push_back({"cameras", id, State::note, fmt::format("answers as gige:{}", id), ""});
  if (findings.empty() && devices.cameras.empty())
    findings.push_back({"cameras", "none", State::note, "no camera is connected or answers",
                        "Connect one, or name a network camera in a devices file (config/README.md)."});
  return findings;
}

// Shows its number and colour on every display until the time is over. Returns the latest result for each.
Findings show_signs(const std::vector<std::unique_ptr<device::Display>>& shown, double seconds) {
  Findings findings(shown.size());
  const Stamp until = shifted(Clock::now(), seconds);
  do {
    for (std::size_t i = 0; i < shown.size(); ++i) {
      device::Display& display = *shown[i];
      const int number = static_cast<int>(i) + 1;
      const auto done = display.show(device::output_sign(display.size(), number, display.name()));
      findings[i] = {"displays", display.name(), State::works,
                     fmt::format("shows the number {} on {}", number, device::sign_colour(number)), ""};
      if (!done) findings[i] = failed("displays", display.name(), done.message());
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  } while (Clock::now() < until);
  return findings;
}

void add(Findings* findings, const Findings& more) {
  findings->insert(findings->end(), more.begin(), more.end());
}

// The displays of the file, or all monitors. Displays that cannot be opened are reported.
Findings signs(const DoctorOptions& options,
               const device::Devices& devices,
               const Result<device::Desktop>& desktop) {
  const device::Desktop* there = desktop ? &*desktop : nullptr;
  std::vector<device::DisplayConfig> wanted = devices.displays;
  if (options.devices.empty() && options.show_s > 0 && there)
    for (const device::Monitor& monitor : there->monitors())
      wanted.push_back({.name = monitor.name, .monitor = monitor.name});
  Findings findings;
  std::vector<std::unique_ptr<device::Display>> shown;
  for (device::DisplayConfig& one : wanted) {
    one.vsync = shown.empty();
    auto display = device::open_display(one, there);
    if (!display) {
      findings.push_back(failed("devices", one.name, display.message()));
      continue;
    }
    if (options.show_s <= 0)
      findings.push_back(
          {"devices", one.name, State::works,
           fmt::format("{}: {}x{}", to_text(one), (*display)->size().width, (*display)->size().height), ""});
    shown.push_back(std::move(*display));
  }
  if (options.show_s > 0) add(&findings, show_signs(shown, options.show_s));
  return findings;
}

Result<device::Devices> wanted_devices(const DoctorOptions& options) {
  if (options.devices.empty()) return device::Devices{};
  LIMN_TRY(const device::Devices devices, device::load_devices(options.devices));
  if (options.rig.empty()) return devices;
  LIMN_TRY(const Rig rig, load_rig(options.rig));
  return device::matched(devices, rig);
}

// Takes the devices of other machines out of the list.
template <class Config>
void note_remote(std::vector<Config>* devices, Findings* findings) {
  for (const Config& device : *devices)
    if (!device.host.empty())
      findings->push_back(
          {"devices", device.name, State::note,
           fmt::format("is plugged into the machine {}; --room lists the machines", device.host), ""});
  std::erase_if(*devices, [](const Config& device) { return !device.host.empty(); });
}

const char* word(State state) {
  return state == State::works ? "works" : state == State::fails ? "does not" : "note";
}

void print_lines(const Findings& findings) {
  for (const Finding& finding : findings) {
    print_out("{:<9}{:<10}{:<14} {}\n", word(finding.state), finding.area, finding.name, finding.text);
    if (!finding.advice.empty()) print_out("{:<34}-> {}\n", "", finding.advice);
  }
}

void print_json(const Findings& findings) {
  nlohmann::ordered_json report = {
      {"schema", "limn.doctor/1"}, {"works", true}, {"findings", nlohmann::json::array()}};
  for (const Finding& finding : findings) {
    if (finding.state == State::fails) report["works"] = false;
    report["findings"].push_back(nlohmann::ordered_json{{"area", finding.area},
                                                        {"name", finding.name},
                                                        {"state", word(finding.state)},
                                                        {"text", finding.text},
                                                        {"advice", finding.advice}});
  }
  print_out("{}\n", json_text(report, 2));
}

}  // namespace

std::vector<Finding> examined(const DoctorOptions& options) {
  Findings findings = {packages(options), clock_of_session(), gl()};
  auto devices = wanted_devices(options);
  if (!devices) findings.push_back(failed("devices", "file", devices.message()));
  device::Devices wanted = devices ? *devices : device::Devices{};
  note_remote(&wanted.cameras, &findings);
  note_remote(&wanted.displays, &findings);
  const bool desktop_asked_for =
      (options.devices.empty() && options.show_s > 0) ||
      std::any_of(wanted.displays.begin(), wanted.displays.end(), device::needs_desktop);
  const auto desktop = device::Desktop::open();
  add(&findings, displays(desktop, desktop_asked_for));
  add(&findings, cameras(wanted));
  for (const device::CameraConfig& camera : wanted.cameras) findings.push_back(tested("devices", camera));
  add(&findings, signs(options, wanted, desktop));
  if (!options.room.room.empty()) add(&findings, examined_room(options.room));
  return findings;
}

Status run_doctor(const DoctorOptions& options) {
  if (!options.rig.empty() && options.devices.empty())
    return usage_error(
        "--rig: expected --devices with it, because its names and sizes are compared with the rig's.");
  const Findings findings = examined(options);
  if (options.json) print_json(findings);
  if (!options.json) print_lines(findings);
  const auto failures = std::count_if(findings.begin(), findings.end(),
                                      [](const Finding& finding) { return finding.state == State::fails; });
  if (failures == 0) return {};
  return error("{} of {} do not work; the lines above say what to do.", failures, findings.size());
}

validate::ReportCommands report_commands() {
  const auto examine = [](const std::filesystem::path& devices) { return examined({.devices = devices}); };
  const auto play = [](const validate::ReportSession& session, bool* was_interrupted) {
    LiveOptions options;
    options.rig = session.rig;
    options.scene = session.scene;
    options.devices = session.devices;
    options.seconds = session.seconds;
    options.is_real_time = true;
    options.record = session.record;
    options.out = session.out;
    const Status played = run_live(options);
    *was_interrupted = live_was_ended_by_signal();
    return played;
  };
  return {.examine = examine, .play = play};
}

}  // namespace limn::apps
