#include "validate/hardware_report/report.h"

#include <fmt/ranges.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstdio>
#include <functional>
#include <iostream>
#include <memory>
#include <optional>
#include <thread>

#include "calib/temporary_folder.h"
#include "core/data_folder.h"
#include "core/file.h"
#include "core/image_io.h"
#include "core/json_text.h"
#include "core/log.h"
#include "core/print.h"
#include "core/time_now.h"
#include "core/version.h"
#include "device/v4l2_camera.h"
#include "device/v4l2_listing.h"
#include "nodes/remote_devices.h"
#include "sim/virtual_rig.h"
#include "tracker/marker_image.h"
#include "validate/hardware_report/frame_times.h"
#include "validate/hardware_report/page.h"
#include "validate/hardware_report/private_words.h"
#include "wizard/capture/capture_plan.h"
#include "wizard/capture/device_backend.h"
#include "wizard/capture/virtual_backend.h"
#include "wizard/capture/virtual_capture.h"
#include "wizard/device_checks.h"
#include "wizard/guided_poses.h"

namespace limn::validate {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr const char* k_schema = "limn.hardware_report/1";
constexpr int k_frames = 150;  // five seconds of a usual camera

std::atomic<bool> g_is_interrupted = false;
void interrupt(int) { g_is_interrupted = true; }

// The answer of a person; without a terminal, or to an empty line, the default.
std::string answer_to(const std::string& question, const std::string& present) {
  print_out("{} [{}] ", question, present);
  std::fflush(stdout);
  std::string line;
  if (isatty(STDIN_FILENO) && std::getline(std::cin, line) && !line.empty()) return line;
  if (!isatty(STDIN_FILENO)) print_out("\n");
  return present;
}

// The devices of the report, on this machine or on the virtual rig, open while they are measured.
struct OpenDevices {
  calib::CaptureSet captures;
  wizard::WizardBackend backend;
  ordered_json settings;  // what the cameras report, by their names
  // What the backend refers to.
  wizard::Plan plan = {};
  std::optional<device::Desktop> desktop = {};
  std::unique_ptr<device::DeviceOpener> opener = {};
  std::unique_ptr<wizard::DeviceBackend> real = {};
  std::unique_ptr<sim::VirtualRig> rig = {};
  std::unique_ptr<ImageWriter> writer = {};
};

ordered_json settings_of(const device::CameraSource& camera) {
  ordered_json json = {{"width", camera.size().width},
                       {"height", camera.size().height},
                       {"description", camera.description()}};
  for (const device::CameraSetting& setting : camera.settings()) {
    ordered_json& one = json[to_text(setting.name)];
    one = {{"requested", setting.asked}};
    if (setting.found) one["found"] = *setting.found;
    if (!setting.problem.empty()) one["problem"] = setting.problem;
  }
  return json;
}

// What a camera of the kernel offers; null for others.
ordered_json offers_of(const std::string& source) {
  const std::string kind = "v4l2:";
  if (!source.starts_with(kind)) return {};
  const auto listing = device::v4l2_listing(source.substr(kind.size()));
  if (!listing) return listing.message();
  ordered_json json = {{"modes", ordered_json::array()}, {"controls", ordered_json::object()}};
  for (const device::V4l2Mode& mode : listing->modes)
    json["modes"].push_back(fmt::format("{} {}x{} at {:g} frames per second", mode.format, mode.width,
                                        mode.height, fmt::join(mode.rates, ", ")));
  for (const device::V4l2Control& control : listing->controls)
    json["controls"][control.name] = fmt::format("{} ({} to {}, default {})", control.value, control.minimum,
                                                 control.maximum, control.default_value);
  return json;
}

// Ends a capture that a person has interrupted.
void make_interruptible(calib::CaptureBackend* capture) {
  capture->grab = [grab = capture->grab](int camera) -> Result<cv::Mat> {
    if (g_is_interrupted) return error("it was interrupted.");
    return grab(camera);
  };
}

Result<std::unique_ptr<OpenDevices>> open_real(const device::Devices& named,
                                               const ReportOptions& options,
                                               const fs::path& captures) {
  LIMN_TRY(const calib::Board board, calib::Board::parse(options.board));
  auto open = std::make_unique<OpenDevices>();
  if (auto desktop = device::Desktop::open()) open->desktop = *desktop;
  open->opener = std::make_unique<nodes::RoomOpener>(nullptr, open->desktop ? &*open->desktop : nullptr);
  LIMN_TRY(wizard::DeviceBackend::Devices devices, wizard::open_devices(named, open->opener.get()));
  for (const auto& camera : devices.cameras) open->settings[camera->name()] = settings_of(*camera);
  for (const device::CameraConfig& camera : named.cameras)
    if (ordered_json offers = offers_of(camera.source); !offers.is_null())
      open->settings[camera.name]["offers"] = std::move(offers);
  open->captures = calib::plan_captures(captures, wizard::captured_devices(devices.cameras, devices.infrared),
                                        wizard::captured_devices(devices.projectors), board);
  open->writer = std::make_unique<ImageWriter>();
  open->real = std::make_unique<wizard::DeviceBackend>(std::move(devices), board, nullptr);
  open->backend = open->real->backend(open->writer.get());
  make_interruptible(&open->backend.capture);
  return open;
}

Result<std::unique_ptr<OpenDevices>> open_virtual(const fs::path& captures) {
  LIMN_TRY(const fs::path file, data_file("config/plans/bench.json"));
  auto open = std::make_unique<OpenDevices>();
  LIMN_TRY(open->plan, wizard::load_plan(file));
  const wizard::Plan& plan = open->plan;
  LIMN_TRY(sim::World world, sim::load_world(plan.world, tracker::marker_image));
  open->rig = std::make_unique<sim::VirtualRig>(std::move(world),
                                                sim::VirtualRigOptions{.grab_waits_for_light = false});
  LIMN_TRY(open->captures, wizard::plan_virtual_captures(plan, *open->rig, captures));
  open->rig->remove_prototype();
  open->writer = std::make_unique<ImageWriter>();
  open->backend = wizard::virtual_backend(plan, open->rig.get(), open->writer.get());
  make_interruptible(&open->backend.capture);
  return open;
}

// What one step found.
struct Measured {
  ordered_json values = ordered_json::object();
  std::vector<std::string> odd = {};
  std::vector<std::string> images = {};  // files, relative to the report's folder
  ordered_json distances_ms = {};        // from each frame to the next
};

class Report {
 public:
  Report(const ReportOptions& options, const ReportCommands& commands)
      : options_(options), commands_(commands), words_(PrivateWords::of_this_machine()) {}

  Status run() {
    LIMN_TRY_STATUS(go_on());
    LIMN_TRY_STATUS(choose_devices());
    print_out(
        "The images of the captures and of the recording show what the camera sees: look at them before "
        "you send the folder.\n");
    LIMN_TRY_STATUS(step("machine", [this] { return machine(); }));
    LIMN_TRY_STATUS(step("frames", [this] { return frames(); }));
    LIMN_TRY_STATUS(step("light", [this] { return light(); }));
    LIMN_TRY_STATUS(step("capture", [this] { return capture(); }));
    open_.reset();  // the session opens the devices again
    LIMN_TRY_STATUS(step("live", [this] { return live(); }));
    print_out("{}: send this folder. {} shows it.\n", options_.folder.string(),
              (options_.folder / "report.html").string());
    return {};
  }

 private:
  // Reads what an interrupted report has measured.
  Status go_on() {
    LIMN_TRY_STATUS(make_folder(options_.folder));
    report_ = {
        {"schema", k_schema}, {"limn", version()}, {"begun", time_now()}, {"steps", ordered_json::object()}};
    if (!fs::exists(file())) {
      if (fs::is_empty(options_.folder)) return {};
      return error(
          "{}: expected a new or empty folder, or a report that was interrupted, found other files, which a "
          "report could overwrite. Use another folder.",
          options_.folder.string());
    }
    LIMN_TRY(const std::string text, read_file(file()));
    const ordered_json old = ordered_json::parse(text, nullptr, false);
    if (!old.is_object() || old.value("schema", "") != k_schema || !old.contains("steps") ||
        !std::ranges::all_of(old["steps"], [](const auto& step) { return step.is_object(); }))
      return error("{}: expected a report of limn doctor ({}), found something else. Use another folder.",
                   file().string(), k_schema);
    report_["begun"] = old.value("begun", "");
    report_["steps"] = old["steps"];
    return {};
  }

  Status choose_devices() {
    if (!options_.devices.empty()) {
      LIMN_TRY(named_, device::load_devices(options_.devices));
    } else {
      choose_plugged_in();
    }
    report_["devices"] = is_virtual() ? "virtual rig" : "devices of this machine";
    if (is_virtual())
      print_out(
          "Nothing is measured on devices: no camera and projector were found. The virtual rig is used.\n");
    return {};
  }

  // One camera and one monitor: the last one, because the first mostly is the operator's.
  void choose_plugged_in() {
    std::vector<std::string> cameras, monitors;
    for (const device::V4l2Device& found : device::v4l2_cameras())
      if (found.problem.empty()) cameras.push_back("v4l2:" + found.path);
    if (const auto desktop = device::Desktop::open())
      for (const device::Monitor& monitor : desktop->monitors()) monitors.push_back(monitor.name);
    if (cameras.empty() || monitors.empty()) return;
    named_.cameras = {{.name = "camera0", .source = answer_to("Which camera?", cameras.front())}};
    named_.displays = {
        {.name = "projector0", .monitor = answer_to("Which monitor is the projector?", monitors.back())}};
    options_.board = answer_to("Which board do you hold?", options_.board);
  }

  bool is_virtual() const { return named_.cameras.empty() || named_.displays.empty(); }
  fs::path file() const { return options_.folder / "report.json"; }

  // Runs a step that is not done yet, and writes the report. A failure is written down, too.
  Status step(const std::string& name, const std::function<Result<Measured>()>& measure) {
    ordered_json& steps = report_["steps"];
    if (steps.contains(name) && steps[name].value("state", "") == "done") return {};
    print_out("{} …\n", name);
    std::fflush(stdout);
    const Result<Measured> measured = measure();
    ordered_json json = {{"state", measured ? "done" : "failed"}};
    if (!measured) json["why"] = measured.message();
    if (measured) {
      json["measured"] = measured->values;
      json["odd"] = measured->odd;
      json["images"] = measured->images;
      if (!measured->distances_ms.empty()) json["distances_ms"] = measured->distances_ms;
    }
    if (g_is_interrupted) json = {{"state", "interrupted"}};
    const ordered_json images = json.contains("images") ? json["images"] : ordered_json();
    steps[name] = options_.with_names ? json : words_.json_without(json);
    if (!images.is_null()) steps[name]["images"] = images;  // names of files stay
    LIMN_TRY_STATUS(write_file(file(), json_text(report_, 2) + "\n"));
    LIMN_TRY_STATUS(write_report_page(report_, options_.folder));
    if (g_is_interrupted)
      return error(
          "{}: interrupted in the step {}. What was measured is kept; the same command goes on there.",
          options_.folder.string(), name);
    if (!measured) log_warning("doctor: {}: {}", name, measured.message());
    return {};
  }

  Result<OpenDevices*> devices() {
    if (open_) return open_.get();
    const fs::path captures = options_.folder / "captures";
    LIMN_TRY(open_, is_virtual() ? open_virtual(captures) : open_real(named_, options_, captures));
    return open_.get();
  }

  Result<Measured> machine() {
    Measured out;
    utsname system{};
    uname(&system);
    out.values["system"] = fmt::format("{} {} {}", system.sysname, system.release, system.machine);
    if (const auto release = read_file("/etc/os-release")) {
      const std::string key = "PRETTY_NAME=\"";
      if (const std::size_t at = release->find(key); at != std::string::npos)
        out.values["release"] =
            release->substr(at + key.size(), release->find('"', at + key.size()) - at - key.size());
    }
    if (const auto processor = read_file("/proc/cpuinfo")) {
      const std::size_t at = processor->find("model name");
      const std::size_t colon = at == std::string::npos ? at : processor->find(": ", at);
      if (colon != std::string::npos)
        out.values["processor"] = processor->substr(colon + 2, processor->find('\n', colon) - colon - 2);
    }
    out.values["threads"] = std::thread::hardware_concurrency();
    const double bytes =
        static_cast<double>(sysconf(_SC_PHYS_PAGES)) * static_cast<double>(sysconf(_SC_PAGESIZE));
    out.values["memory"] = fmt::format("{:.1f} GiB", bytes / (1 << 30));
    out.values["tests"] = ordered_json::array();
    for (const Finding& finding : commands_.examine(options_.devices)) {
      const char* const state = finding.state == Finding::State::works   ? "works"
                                : finding.state == Finding::State::fails ? "fails"
                                                                         : "note";
      out.values["tests"].push_back({{"area", finding.area},
                                     {"name", finding.name},
                                     {"state", state},
                                     {"text", finding.text},
                                     {"advice", finding.advice}});
      if (finding.state == Finding::State::fails || (finding.area == "gl" && !finding.advice.empty()))
        out.odd.push_back(fmt::format("{} {}: {}{}{}", finding.area, finding.name, finding.text,
                                      finding.advice.empty() ? "" : ". ", finding.advice));
    }
    return out;
  }

  Result<Measured> frames() {
    LIMN_TRY(OpenDevices * open, devices());
    const wizard::FlashDevices camera = open->backend.flashes(0, 0);
    std::vector<FrameTime> times;
    while (times.size() < k_frames && !g_is_interrupted) {
      LIMN_TRY(const Frame frame, camera.next());
      times.push_back({frame.captured_at, open->backend.now()});
    }
    LIMN_TRY_STATUS(write_file(options_.folder / "frames.csv", frame_times_csv(times)));
    const FrameRhythm rhythm = frame_rhythm(times);
    Measured out;
    out.values = {{"frames", rhythm.frames},
                  {"period_ms", 1e3 * rhythm.period_s},
                  {"jitter_ms", 1e3 * rhythm.jitter_s},
                  {"longest_ms", 1e3 * rhythm.longest_s},
                  {"missing", rhythm.missing},
                  {"delay_ms", 1e3 * rhythm.delay_s}};
    if (!open->settings.is_null()) out.values["settings"] = open->settings;
    out.odd = odd_in(rhythm);
    for (std::size_t i = 1; i < times.size(); ++i)
      out.distances_ms.push_back(1e3 * seconds_between(times[i - 1].captured_at, times[i].captured_at));
    return out;
  }

  // Exposure and focus, and the display's latency by flashes.
  Result<Measured> light() {
    LIMN_TRY(OpenDevices * open, devices());
    Measured out;
    const auto listen = [&out](const std::string& line) {
      if (line.starts_with("advice: ")) out.odd.push_back(line.substr(8));
      print_out("  {}\n", line);
    };
    LIMN_TRY(const wizard::CheckedDevices checked,
             wizard::check_devices(open->captures, open->backend, {.say = listen}));
    for (const wizard::ExposureReading& seen : checked.light)
      out.values["exposure"][seen.camera + " " + seen.projector] = {{"lit_share", seen.lit},
                                                                    {"grey_level", seen.bright},
                                                                    {"saturated_share", seen.saturated},
                                                                    {"blur_px", seen.blur_px}};
    for (std::size_t i = 0; i < checked.latency.size(); ++i) {
      ordered_json& one = out.values["latency"][open->captures.projectors[i].name];
      one = "not measured";
      if (const auto& latency = checked.latency[i])
        one = {{"ms", 1e3 * latency->seconds},
               {"within_ms", 1e3 * latency->within_s},
               {"flashes", latency->flashes}};
    }
    return out;
  }

  // One placement of the board, as limn calibrate captures it. Images of an interrupted one are replaced.
  Result<Measured> capture() {
    LIMN_TRY(OpenDevices * open, devices());
    if (!is_virtual())
      answer_to(fmt::format("Hold the board ({}) into the light, still, until it ends; then press enter",
                            options_.board),
                "now");
    std::error_code none;
    fs::remove_all(open->captures.folder, none);
    if (is_virtual()) {
      LIMN_TRY_STATUS(open->backend.wait_for_board(0, [](int, const cv::Mat&, const auto&) {}));
    }
    LIMN_TRY_STATUS(calib::begin_captures(open->captures));
    LIMN_TRY_STATUS(calib::capture_pose(open->captures, 0, open->backend.capture));
    LIMN_TRY_STATUS(open->backend.wait_for_files());
    Measured out;
    for (int camera = 0; camera < static_cast<int>(open->captures.cameras.size()); ++camera) {
      const fs::path white = calib::image_path(open->captures, 0, 0, camera, 0);
      LIMN_TRY(const cv::Mat image, read_grey_image(white));
      const std::size_t corners = calib::find_board(open->captures.board, image).size();
      out.values["board corners"][open->captures.cameras[static_cast<std::size_t>(camera)].name] = corners;
      if (corners == 0)
        out.odd.push_back(
            "Capture: no corner of the board was found. Hold it flat into the light, near the "
            "middle of the image, and check that it is the board that was named.");
      out.images.push_back(fs::relative(white, options_.folder).string());
    }
    out.values["projectors"] = open->captures.projectors.size();
    out.values["cameras"] = open->captures.cameras.size();
    return out;
  }

  // The devices' files as a session needs them, kept out of the report because they may hold addresses.
  Result<ReportSession> session_on_devices(const fs::path& work) const {
    ReportSession options;
    options.rig = options_.rig;
    options.devices = work / "devices.json";
    LIMN_TRY_STATUS(write_file(options.devices, device::devices_text(named_.cameras, named_.displays)));
    LIMN_TRY(options.scene, data_file("config/scenes/door"));
    if (!options.rig.empty()) return options;
    LIMN_TRY(const calib::CaptureSet captures, calib::load_captures(options_.folder / "captures"));
    Rig rig;
    for (const calib::CapturedDevice& camera : captures.cameras)
      rig.cameras.push_back(wizard::assumed_camera(camera.name, camera.width, camera.height));
    for (const calib::CapturedDevice& projector : captures.projectors)
      rig.projectors.push_back(wizard::assumed_camera(projector.name, projector.width, projector.height));
    options.rig = work / "rig";
    LIMN_TRY_STATUS(save_rig(rig, options.rig));
    return options;
  }

  Result<Measured> live() {
    std::error_code none;
    for (const char* const part : {"recording", "live"}) fs::remove_all(options_.folder / part, none);
    LIMN_TRY(const calib::TemporaryFolder work, calib::TemporaryFolder::create());
    ReportSession options;
    if (!is_virtual()) {
      LIMN_TRY(options, session_on_devices(work.path()));
    }
    options.seconds = options_.live_s;
    options.record = options_.folder / "recording";
    options.out = options_.folder / "live";
    bool was_interrupted = false;
    const Status played = commands_.play(options, &was_interrupted);
    g_is_interrupted = g_is_interrupted || was_interrupted;
    std::signal(SIGINT, interrupt);
    LIMN_TRY_STATUS(played);
    LIMN_TRY(const std::string text, read_file(options.out / "session.json"));
    Measured out;
    out.values = ordered_json::parse(text, nullptr, false);
    if (!out.values.is_object()) return error("{}: expected JSON.", (options.out / "session.json").string());
    out.values.erase("schema");
    const double shown = out.values.value("pictures", 0.0), missed = out.values.value("missed_frames", 0.0);
    if (shown == 0) out.odd.push_back("Live: no frame was shown.");
    if (missed > 0.05 * (shown + missed))
      out.odd.push_back(
          fmt::format("Live: {:.0f} camera frames were not processed, {:.0f} images were shown: "
                      "the machine is too slow for this camera.",
                      missed, shown));
    for (const auto& entry : fs::directory_iterator(options.out, none))
      if (entry.path().extension() == ".png")
        out.images.push_back("live/" + entry.path().filename().string());
    return out;
  }

  ReportOptions options_;
  ReportCommands commands_;
  PrivateWords words_;
  device::Devices named_;
  ordered_json report_;
  std::unique_ptr<OpenDevices> open_;
};

}  // namespace

Status run_hardware_report(const ReportOptions& options, const ReportCommands& commands) {
  g_is_interrupted = false;
  const auto before = std::signal(SIGINT, interrupt);
  const Status done = Report(options, commands).run();
  std::signal(SIGINT, before);
  return done;
}

}  // namespace limn::validate
