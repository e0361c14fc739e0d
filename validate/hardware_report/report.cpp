#include "validate/hardware_report/report.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <cstdio>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "calib/temporary_folder.h"
#include "core/data_folder.h"
#include "core/file.h"
#include "core/image_io.h"
#include "core/json_text.h"
#include "core/log.h"
#include "core/print.h"
#include "core/time_now.h"
#include "core/version.h"
#include "validate/hardware_report/board_captures.h"
#include "validate/hardware_report/chosen_devices.h"
#include "validate/hardware_report/clean_folder.h"
#include "validate/hardware_report/frame_times.h"
#include "validate/hardware_report/machine.h"
#include "validate/hardware_report/open_devices.h"
#include "validate/hardware_report/page.h"
#include "validate/hardware_report/questions.h"
#include "wizard/device_checks.h"
#include "wizard/guided_poses.h"

namespace limn::validate {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr const char* k_schema = "limn.hardware_report/1";
constexpr int k_frames = 150;  // five seconds of a usual camera

// What one step found.
struct Measured {
  ordered_json values = ordered_json::object();
  std::vector<std::string> odd = {};
  std::vector<std::string> images = {};  // files, relative to the report's folder
  ordered_json distances_ms = {};        // from each frame to the next
};

class Report {
 public:
  Report(const ReportOptions& options, const ReportCommands& commands, Interruption* interruption)
      : options_(options), commands_(commands), interruption_(interruption), questions_(commands.answers) {}

  Status run() {
    LIMN_TRY_STATUS(read_begun());
    LIMN_TRY_STATUS(choose());
    print_out(
        "The images of the captures and of the recording show what the camera sees: look at them before "
        "you send the folder.\n");
    LIMN_TRY_STATUS(step("machine", {}, [this] { return machine(); }));
    LIMN_TRY_STATUS(step("frames", {}, [this] { return frames(); }));
    LIMN_TRY_STATUS(step("light", {}, [this] { return light(); }));
    LIMN_TRY_STATUS(step("capture", {"captures"}, [this] { return capture(); }));
    open_.reset();  // the session opens the devices again
    LIMN_TRY_STATUS(step("live", {"recording", "live"}, [this] { return live(); }));
    print_out("{}: send this folder. {} shows it.\n", options_.folder.string(),
              (options_.folder / "report.html").string());
    return {};
  }

 private:
  // Reads what an interrupted report has measured.
  Status read_begun() {
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
    const auto is_text = [&old](const char* key) { return !old.contains(key) || old[key].is_string(); };
    if (!old.is_object() || !is_text("schema") || old.value("schema", "") != k_schema ||
        !old.contains("steps") || !old["steps"].is_object() || !is_text("begun") || !is_text("devices") ||
        !is_text("devices_mark") || (old.contains("with_names") && !old["with_names"].is_boolean()) ||
        !std::ranges::all_of(old["steps"], [](const auto& step) { return step.is_object(); }))
      return error("{}: expected a report of limn doctor ({}), found something else. Use another folder.",
                   file().string(), k_schema);
    if (old.value("with_names", false) != options_.with_names)
      return error(
          "{}: expected this report to be continued {} --with-names, as it was begun, found the other. Use "
          "another folder for a report {} names.",
          options_.folder.string(), options_.with_names ? "without" : "with",
          options_.with_names ? "with" : "without");
    report_["begun"] = old.value("begun", "");
    report_["steps"] = old["steps"];
    begun_on_ = old.value("devices", "");
    begun_mark_ = old.value("devices_mark", "");
    return {};
  }

  Status choose() {
    Result<ChosenDevices> chosen = choose_devices(options_, commands_, &questions_);
    if (!chosen && is_interrupted())
      return error("{}: interrupted at a question. What was measured is kept; the same command goes on.",
                   options_.folder.string());
    LIMN_TRY(chosen_, std::move(chosen));
    commands_.add_private_words(&words_);
    add_devices(&words_, chosen_.named);
    add_folder_of(&words_, options_.folder);
    if (!options_.rig.empty()) add_folder_of(&words_, options_.rig);
    if (!options_.with_names) rename_private(&chosen_, &words_);
    report_["devices"] = chosen_.is_virtual() ? "virtual rig" : "devices of this machine";
    report_["devices_mark"] = devices_mark(chosen_, options_.rig);
    report_["with_names"] = options_.with_names;
    if (begun_mark_.empty() || begun_mark_ == report_["devices_mark"]) return {};
    return error(
        "{}: expected the devices, board and rig that this report was begun with ({}), found others ({}). A "
        "report is about one set of devices: name the same ones again, or use another folder.",
        options_.folder.string(), begun_on_, report_["devices"].get<std::string>());
  }

  fs::path file() const { return options_.folder / "report.json"; }

  // Runs a step that is not done yet, takes private words out of the folders that it wrote, and writes the
  // report. A failure is written down, too.
  Status step(const std::string& name,
              const std::vector<std::string>& folders,
              const std::function<Result<Measured>()>& measure) {
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
      if (!measured->distances_ms.empty()) json["distances_ms"] = measured->distances_ms;
    }
    if (is_interrupted()) json = {{"state", "interrupted"}};
    steps[name] = options_.with_names ? json : words_.json_without(json);
    if (json["state"] == "done") steps[name]["images"] = measured->images;  // names of files stay
    for (const std::string& folder : folders) {
      LIMN_TRY_STATUS(remove_unneeded(options_.folder / folder));
      if (!options_.with_names) LIMN_TRY_STATUS(clean_folder(options_.folder / folder, words_));
    }
    LIMN_TRY_STATUS(write_file(file(), json_text(report_, 2) + "\n"));
    LIMN_TRY_STATUS(write_report_page(report_, options_.folder));
    if (is_interrupted())
      return error(
          "{}: interrupted in the step {}. What was measured is kept; the same command goes on there.",
          options_.folder.string(), name);
    if (!measured) log_warning("doctor: {}: {}", name, measured.message());
    return {};
  }

  Result<const OpenDevices*> devices() {
    if (open_) return open_.get();
    const fs::path captures = options_.folder / "captures";
    LIMN_TRY(open_, chosen_.is_virtual()
                        ? OpenDevices::open_virtual(captures)
                        : OpenDevices::open(chosen_.named, chosen_.board, captures, commands_.opener));
    return open_.get();
  }

  Result<Measured> machine() {
    Measured out;
    const std::vector<Finding> findings = commands_.examine(options_.devices);
    out.values = machine_json();
    out.values["tests"] = findings_json(findings);
    out.odd = odd_in(findings);
    return out;
  }

  Result<Measured> frames() {
    LIMN_TRY(const OpenDevices* open, devices());
    const wizard::FlashDevices camera = open->backend().flashes(0, 0);
    std::vector<FrameTime> times;
    while (times.size() < k_frames && !is_interrupted()) {
      LIMN_TRY(const Frame frame, camera.next());
      times.push_back({frame.captured_at, open->backend().now()});
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
    if (!open->settings().is_null()) out.values["settings"] = open->settings();
    out.odd = odd_in(rhythm);
    for (std::size_t i = 1; i < times.size(); ++i)
      out.distances_ms.push_back(1e3 * seconds_between(times[i - 1].captured_at, times[i].captured_at));
    return out;
  }

  // Exposure and focus, and the display's latency by flashes.
  Result<Measured> light() {
    LIMN_TRY(const OpenDevices* open, devices());
    Measured out;
    const auto listen = [&out](const std::string& line) {
      if (line.starts_with("advice: ")) out.odd.push_back(line.substr(8));
      print_out("  {}\n", line);
    };
    LIMN_TRY(const wizard::CheckedDevices checked,
             wizard::check_devices(open->captures(), open->backend(), {.say = listen}));
    for (const wizard::ExposureReading& seen : checked.light)
      out.values["exposure"][seen.camera + " " + seen.projector] = {{"lit_share", seen.lit},
                                                                    {"grey_level", seen.bright},
                                                                    {"saturated_share", seen.saturated},
                                                                    {"blur_px", seen.blur_px}};
    for (std::size_t i = 0; i < checked.latency.size(); ++i) {
      ordered_json& one = out.values["latency"][open->captures().projectors[i].name];
      one = "not measured";
      if (const auto& latency = checked.latency[i])
        one = {{"ms", 1e3 * latency->seconds},
               {"within_ms", 1e3 * latency->within_s},
               {"flashes", latency->flashes}};
    }
    return out;
  }

  // Placements of the board, as limn calibrate captures them. Complete ones of an interrupted capture are
  // kept.
  Result<Measured> capture() {
    LIMN_TRY(const OpenDevices* open, devices());
    LIMN_TRY_STATUS(capture_board(*open, options_.placements, chosen_.is_virtual() ? nullptr : &questions_));
    LIMN_TRY(const std::vector<BoardInCamera> found,
             find_captured_board(open->captures(), options_.placements));
    Measured out;
    for (const BoardInCamera& camera : found) {
      out.values["board corners"][camera.camera] = fmt::format("{}", fmt::join(camera.corners, ", "));
      for (const std::string& image : camera.images) out.images.push_back("captures/" + image);
    }
    out.values["placements"] = options_.placements;
    out.values["projectors"] = open->captures().projectors.size();
    out.values["cameras"] = open->captures().cameras.size();
    out.odd = odd_in(found);
    return out;
  }

  // The devices' files as a session needs them, kept out of the report because they may hold addresses.
  Result<ReportSession> session_on_devices(const fs::path& work) const {
    ReportSession options;
    options.devices = work / "devices.json";
    LIMN_TRY_STATUS(
        write_file(options.devices, device::devices_text(chosen_.named.cameras, chosen_.named.displays)));
    LIMN_TRY(options.scene, data_file("config/scenes/door"));
    options.rig = work / "rig";
    if (!options_.rig.empty()) {
      LIMN_TRY(Rig rig, load_rig(options_.rig));
      for (std::vector<Imager>* imagers : {&rig.cameras, &rig.projectors})
        for (Imager& imager : *imagers)
          if (const auto name = chosen_.renamed.find(imager.name); name != chosen_.renamed.end())
            imager.name = name->second;
      LIMN_TRY_STATUS(save_rig(rig, options.rig));
      return options;
    }
    LIMN_TRY(const calib::CaptureSet captures, calib::load_captures(options_.folder / "captures"));
    Rig rig;
    for (const calib::CapturedDevice& camera : captures.cameras)
      rig.cameras.push_back(wizard::assumed_camera(camera.name, camera.width, camera.height));
    for (const calib::CapturedDevice& projector : captures.projectors)
      rig.projectors.push_back(wizard::assumed_camera(projector.name, projector.width, projector.height));
    LIMN_TRY_STATUS(save_rig(rig, options.rig));
    return options;
  }

  Result<Measured> live() {
    std::error_code none;
    for (const char* const part : {"recording", "live"}) fs::remove_all(options_.folder / part, none);
    LIMN_TRY(const calib::TemporaryFolder work, calib::TemporaryFolder::create());
    ReportSession options;
    if (!chosen_.is_virtual()) {
      LIMN_TRY(options, session_on_devices(work.path()));
    }
    options.seconds = options_.live_s;
    options.record = options_.folder / "recording";
    options.out = options_.folder / "live";
    bool was_interrupted = false;
    const Status played = commands_.play(options, &was_interrupted);
    interruption_->take_back(was_interrupted);
    if (!played) return played.error();
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
  Interruption* interruption_;
  Questions questions_;
  PrivateWords words_;
  ChosenDevices chosen_;
  ordered_json report_;
  std::string begun_on_, begun_mark_;  // the devices that an interrupted report was begun with
  std::unique_ptr<OpenDevices> open_;
};

}  // namespace

Status run_hardware_report(const ReportOptions& options, const ReportCommands& commands) {
  Interruption interruption;
  return Report(options, commands, &interruption).run();
}

}  // namespace limn::validate
