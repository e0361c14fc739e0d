#include "apps/calibrate.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>

#include "calib/capture.h"
#include "core/json_text.h"
#include "core/log.h"
#include "core/print.h"
#include "device/devices_file.h"
#include "nodes/remote_devices.h"
#include "tracker/marker_image.h"
#include "wizard/capture/capture_folder.h"
#include "wizard/capture/capture_plan.h"
#include "wizard/capture/virtual_backend.h"
#include "wizard/capture/virtual_capture.h"
#include "wizard/guided_poses.h"
#include "wizard/measure/solve_captures.h"
#include "wizard/pose_instructions.h"
#include "wizard/sequence.h"
#include "wizard/window/wizard_window.h"

namespace limn::apps {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;
using Say = std::function<void(const std::string&)>;

ordered_json to_json(const wizard::PoseJudged& judged) {
  ordered_json json = {{"pose", judged.pose}, {"captured_before", judged.before}};
  if (!judged.before) json["capture_s"] = judged.capture_s;
  if (!judged.assessment) {
    json["unsolved"] = judged.unsolved;
    return json;
  }
  const calib::Assessment& assessment = *judged.assessment;
  json["verdict"] = calib::to_text(assessment.verdict);
  json["held_out_px"] = assessment.held_out.rms_px;
  json["predicted_mm"] = wizard::predicted_mm(assessment);
  for (const calib::DeviceQuality& device : assessment.devices)
    json["coverage"][device.name] = device.coverage;
  json["faults"] = ordered_json::array();
  for (const calib::Fault& fault : assessment.faults) json["faults"].push_back(calib::to_text(fault.name));
  json["more_helps"] = judged.more_helps;
  return json;
}

std::string to_json(const wizard::Calibrated& done) {
  ordered_json json = {{"verdict", calib::to_text(done.report.assessment.verdict)},
                       {"held_out_px", done.report.assessment.held_out.rms_px},
                       {"predicted_mm", wizard::predicted_mm(done.report.assessment)},
                       {"poses", ordered_json::array()},
                       {"capture_s", ordered_json::object()},
                       {"latency_ms", ordered_json::object()},
                       {"seconds", done.seconds}};
  for (const wizard::PoseJudged& judged : done.poses) json["poses"].push_back(to_json(judged));
  for (const auto& [projector, seconds] : done.capture_s) json["capture_s"][projector] = seconds;
  for (const auto& [projector, seconds] : done.latency_s) json["latency_ms"][projector] = 1e3 * seconds;
  if (const auto& seen = done.prototype) {
    json["prototype"] = {{"points", seen->points},
                         {"scan_stddev_mm", seen->scan_stddev_mm},
                         {"painted_p95_mm", seen->painted_p95_mm},
                         {"painted_good", seen->painted_good},
                         {"warnings", seen->warnings}};
    if (seen->align_rms_mm) json["prototype"]["align_rms_mm"] = *seen->align_rms_mm;
  }
  if (!done.no_prototype.empty()) json["no_prototype"] = done.no_prototype;
  return json_text(json, 2) + "\n";
}

void say_end(const CalibrateOptions& options, const wizard::Calibrated& done, const Say& say) {
  for (const calib::Fault& fault : done.report.assessment.faults) say("fault " + calib::to_text(fault));
  for (const std::string& sentence : done.report.explanation.advice) say("advice: " + sentence);
  std::vector<std::string> times;
  for (const auto& [projector, seconds] : done.capture_s)
    times.push_back(fmt::format("{} {:.1f} s", projector, seconds));
  const auto taken = std::count_if(done.poses.begin(), done.poses.end(),
                                   [](const wizard::PoseJudged& judged) { return !judged.before; });
  say(fmt::format("captured {} of {} poses in this run; capture time on the cameras' clock: {}", taken,
                  done.poses.size(), fmt::join(times, ", ")));
  say(done.report.explanation.verdict);
  if (!done.no_prototype.empty())
    say(fmt::format("the prototype was not scanned: {} The rig is saved; run the same command to try again.",
                    done.no_prototype));
  say(fmt::format("rig and report in {} ({:.0f} s)", options.out.string(), done.seconds));
}

std::string devices_in_words(const calib::CaptureSet& captures, const char* where) {
  const auto counted = [](std::size_t count, const char* what) {
    return fmt::format("{} {}{}", count, what, count == 1 ? "" : "s");
  };
  return fmt::format("{}{}, {}", where, counted(captures.cameras.size(), "camera"),
                     counted(captures.projectors.size(), "projector"));
}

// Nullopt if lines are wanted or there is no display.
std::optional<gui::GuiWindow> window_for(const CalibrateOptions& options,
                                         const Result<device::Desktop>& desktop) {
  constexpr int k_width = 1600, k_height = 1000;
  if (options.terminal || options.json) return std::nullopt;
  auto window = desktop ? gui::GuiWindow::open(*desktop, "Limn calibration", k_width, k_height)
                        : Result<gui::GuiWindow>(desktop.error());
  if (window) return std::move(*window);
  log_info("calibrate: {} The wizard continues in the terminal.", window.message());
  return std::nullopt;
}

// Runs the wizard in a window or in the terminal, and prints the result.
Status play(const CalibrateOptions& options,
            const std::string& plan_json,
            wizard::WizardPlan plan,
            const wizard::WizardBackend& backend,
            std::optional<gui::GuiWindow> window,
            std::atomic<wizard::WizardWish>* wish,
            wizard::MainThreadExecutor* executor) {
  const Say say = [&](const std::string& line) {
    if (options.json) return log_info("{}", line);
    print_out("{}\n", line);
    std::fflush(stdout);
  };
  // The size that was entered when these captures were begun counts, unless another one is given now.
  // Captures of others are refused later, with the reason.
  if (!plan.captures.board_measured) {
    if (const auto stored = calib::stored_board_measured(plan.captures.folder))
      plan.captures.board_measured = *stored;
  }
  LIMN_TRY(plan.captures.board_measured, wizard::measured_board(plan.captures, options.board_measured));
  const wizard::WizardWork work = [&](const wizard::WizardBackend& where,
                                      const wizard::WizardListener& listener) {
    return wizard::calibrate_rig({options.out, options.scene, options.scan, options.all}, plan_json,
                                 plan.captures, plan.places, where, listener);
  };
  LIMN_TRY(const wizard::Calibrated done,
           window ? wizard::calibrate_in_window(&*window, plan, backend, say, wish, executor, work)
                  : work(backend, {.say = say}));
  say_end(options, done, say);
  if (options.json) print_out("{}", to_json(done));
  if (done.report.assessment.verdict == calib::Verdict::reject)
    return error(
        "{}: the calibration is rejected. All files are written. Correct what report.html names, and "
        "calibrate again.",
        options.out.string());
  return {};
}

Status calibrate_virtually(const CalibrateOptions& asked) {
  CalibrateOptions options = asked;
  LIMN_TRY(const wizard::Plan plan, wizard::load_plan(options.plan));
  LIMN_TRY(sim::World world, sim::load_world(plan.world, tracker::marker_image));
  LIMN_TRY(const std::string text, wizard::captured_plan(options.plan, plan.world));
  if (options.scene.empty() && world.scene) options.scene = world.scene->folder;
  sim::VirtualRig rig(std::move(world), {.grab_waits_for_light = false});
  const std::vector<Imager> cameras = rig.world().rig.cameras;
  LIMN_TRY(const calib::CaptureSet captures,
           wizard::plan_virtual_captures(plan, rig, options.out / "captures"));
  LIMN_TRY_STATUS(calib::check_spectra(captures));
  ImageWriter writer;
  rig.remove_prototype();
  std::atomic<wizard::WizardWish> wish = wizard::WizardWish::none;
  wizard::MainThreadExecutor executor;
  return play(options, text,
              {captures, wizard::pose_instructions(cameras[0], plan.board, plan.world_from_board),
               wizard::outlines(plan.board, plan.world_from_board, cameras),
               devices_in_words(captures, "virtual rig: ")},
              wizard::virtual_backend(plan, &rig, &writer), window_for(options, device::Desktop::open()),
              &wish, &executor);
}

// Lets another thread use a display of the main thread.
class MainThreadDisplay : public device::Display {
 public:
  MainThreadDisplay(std::unique_ptr<device::Display> display, wizard::MainThreadExecutor* executor)
      : display_(std::move(display)), executor_(executor) {}
  const std::string& name() const override { return display_->name(); }
  cv::Size size() const override { return display_->size(); }
  Result<Stamp> show(const cv::Mat& image) override {
    std::optional<Result<Stamp>> shown;
    executor_->run([&] { shown = display_->show(image); });
    return *shown;
  }

 private:
  std::unique_ptr<device::Display> display_;
  wizard::MainThreadExecutor* executor_;
};

Status calibrate_devices(const CalibrateOptions& options) {
  if (const auto board = calib::Board::parse(options.board); !board)
    return usage_error("--board: {}", board.message());
  LIMN_TRY(const device::Devices named, device::load_devices(options.devices));
  const Result<device::Desktop> desktop = device::Desktop::open();
  const device::Desktop* const there = desktop ? &*desktop : nullptr;
  std::unique_ptr<nodes::Room> room;
  if (!options.room.room.empty()) {
    LIMN_TRY(room, enter_room_for_orders(options.room));
  }
  nodes::RoomOpener opener(room.get(), there);
  LIMN_TRY(wizard::DeviceBackend::Devices devices, wizard::open_devices(named, &opener));
  return calibrate_on(options, std::move(devices), desktop);
}

}  // namespace

Status calibrate_on(const CalibrateOptions& options,
                    wizard::DeviceBackend::Devices devices,
                    const Result<device::Desktop>& desktop) {
  const auto board = calib::Board::parse(options.board);
  if (!board) return usage_error("--board: {}", board.message());
  const calib::CaptureSet captures = calib::plan_captures(
      options.out / "captures", wizard::captured_devices(devices.cameras, devices.infrared),
      wizard::captured_devices(devices.projectors), *board, options.code);
  LIMN_TRY_STATUS(calib::check_spectra(captures));
  const calib::CapturedDevice& first = captures.cameras.front();
  const Imager assumed = wizard::assumed_camera(first.name, first.width, first.height);
  const std::vector<Pose> poses = wizard::guided_poses(assumed, *board);
  auto targets = wizard::outlines(*board, poses, {assumed});
  for (auto& pose : targets)
    pose.resize(captures.cameras.size());  // the other cameras' poses are not known yet
  const auto targets_by = [&](const Rig& rig) {
    return wizard::outlines(*board, wizard::placed_alike(poses, *board, assumed, rig), rig.cameras);
  };
  std::atomic<wizard::WizardWish> wish = wizard::WizardWish::none;
  wizard::MainThreadExecutor executor;
  std::optional<gui::GuiWindow> window = window_for(options, desktop);
  if (window)
    for (auto& display : devices.projectors)
      display = std::make_unique<MainThreadDisplay>(std::move(display), &executor);
  wizard::DeviceBackend device_backend(std::move(devices), *board, &wish);
  ImageWriter writer;
  return play(options, wizard::captured_plan(options.board, options.code, captures),
              {captures, wizard::pose_instructions(assumed, *board, poses), targets,
               devices_in_words(captures, ""), targets_by},
              device_backend.backend(&writer), std::move(window), &wish, &executor);
}

Status run_calibrate(const CalibrateOptions& options) {
  if (options.plan.empty() == options.devices.empty())
    return usage_error(
        "calibrate: expected either --plan (a virtual rig) or --devices with --board, found {}.",
        options.plan.empty() ? "neither" : "both");
  return options.devices.empty() ? calibrate_virtually(options) : calibrate_devices(options);
}

}  // namespace limn::apps
