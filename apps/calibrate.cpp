#include "apps/calibrate.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "apps/board_place.h"
#include "apps/capture.h"
#include "apps/devices.h"
#include "apps/plan.h"
#include "apps/solve.h"
#include "apps/wizard/device_checks.h"
#include "apps/wizard/device_stage.h"
#include "apps/wizard/guided_poses.h"
#include "apps/wizard/prototype_steps.h"
#include "apps/wizard/virtual_stage.h"
#include "apps/wizard/wizard_window.h"
#include "apps/world_markers.h"
#include "calib/held_out.h"
#include "calib/judge/board_check.h"
#include "calib/judge/capture_faults.h"
#include "calib/judge/picture_check.h"
#include "calib/observations.h"
#include "calib/solve.h"
#include "core/config.h"
#include "core/file.h"
#include "core/log.h"
#include "device/desktop.h"

namespace limn::apps {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;
using Say = std::function<void(const std::string&)>;

constexpr double k_settled = 0.05;  // of the predicted error, over two poses
constexpr const char *k_taken_by = "plan.json", *k_latency = "latency.json";  // beside capture.json

// Every leaf of two plans that differs, the first alone: "plan.board: captured with …, this plan says …".
std::string difference(const nlohmann::json& then, const nlohmann::json& now) {
  const auto leaves_then = then.flatten(), leaves_now = now.flatten();
  std::set<std::string> keys;
  for (const auto* leaves : {&leaves_then, &leaves_now})
    for (const auto& leaf : leaves->items()) keys.insert(leaf.key());
  const auto told = [](const nlohmann::json& leaves, const std::string& key) {
    return leaves.contains(key) ? leaves[key].dump() : std::string("nothing");
  };
  for (const std::string& key : keys) {
    if (told(leaves_then, key) == told(leaves_now, key)) continue;
    std::string name = key.substr(1);
    std::replace(name.begin(), name.end(), '/', '.');
    return fmt::format("{}: captured with {}, this plan says {}", name, told(leaves_then, key),
                       told(leaves_now, key));
  }
  return "";
}

// A plan may have grown at its end: what was captured is still its beginning.
nlohmann::json beginning(nlohmann::json now, const nlohmann::json& then) {
  const nlohmann::json::json_pointer poses("/plan/world_from_board");
  if (!now.contains(poses) || !then.contains(poses)) return now;
  auto& list = now[poses];
  const std::size_t count = then[poses].size();
  if (list.size() > count) list.erase(list.begin() + static_cast<std::ptrdiff_t>(count), list.end());
  return now;
}

// Makes the captures folder, or finds that this plan made it.
Status opened(const calib::Captures& captures, const std::string& plan_json) {
  const fs::path taken_by = captures.folder / k_taken_by, begun = captures.folder / "capture.json";
  if (fs::exists(begun)) {
    if (!fs::exists(taken_by))
      return error("{}: expected captures of limn calibrate, found others (no {}). Choose another --out.",
                   captures.folder.string(), k_taken_by);
    LIMN_TRY(const Config config, Config::load(taken_by, "limn.captured_plan/1"));
    const nlohmann::json then = config.root().json();
    const std::string differs = difference(then, beginning(nlohmann::json::parse(plan_json), then));
    if (!differs.empty())
      return error(
          "{}: expected captures of this plan, found those of another: {}. Choose another --out, or "
          "calibrate with the plan that began them.",
          captures.folder.string(), differs);
  }
  LIMN_TRY_STATUS(make_folder(captures.folder));
  LIMN_TRY_STATUS(write_file(taken_by, plan_json));
  return fs::exists(begun) ? Status() : calib::begin_captures(captures);
}

// One pose of the captures, with the files that it has or will have.
calib::CapturedPose files_of(const calib::Captures& captures, int pose) {
  calib::CapturedPose files{fmt::format("pose{:02d}", pose), {}};
  for (std::size_t projector = 0; projector < captures.projectors.size(); ++projector) {
    auto& of_projector = files.pictures.emplace_back(captures.cameras.size());
    for (std::size_t camera = 0; camera < captures.cameras.size(); ++camera) {
      for (int i = 0; i < captures.patterns[projector].count(); ++i)
        of_projector[camera].push_back(
            calib::picture_path(captures, pose, static_cast<int>(projector), static_cast<int>(camera), i));
    }
  }
  return files;
}

std::vector<fs::path> all_of(const calib::CapturedPose& pose) {
  std::vector<fs::path> files;
  for (const auto& of_projector : pose.pictures)
    for (const auto& of_camera : of_projector) files.insert(files.end(), of_camera.begin(), of_camera.end());
  return files;
}

// Files are written whole or not at all; an empty one is what a power cut leaves.
bool is_complete(const calib::CapturedPose& pose) {
  const auto files = all_of(pose);
  return std::all_of(files.begin(), files.end(), [](const fs::path& file) {
    std::error_code absent;
    const auto size = fs::file_size(file, absent);
    return !absent && size > 0;
  });
}

// What is left of an interrupted pose: the board may stand elsewhere, so nothing of it can be used.
void remove_pictures(const calib::CapturedPose& pose) {
  for (const fs::path& file : all_of(pose)) {
    std::error_code absent;
    fs::remove(file, absent);
  }
}

// How long each projector was waited for, on the cameras' clock.
class CaptureClock {
 public:
  CaptureClock(std::size_t projectors, std::function<Stamp()> now)
      : seconds_(projectors), now_(std::move(now)), since_(now_()) {}
  void showing(int projector) {
    stop();
    showing_ = projector;
  }
  void stop() {
    const Stamp now = now_();
    if (showing_ >= 0) seconds_[static_cast<std::size_t>(showing_)] += seconds_between(since_, now);
    since_ = now;
    showing_ = -1;
  }
  const std::vector<double>& seconds() const { return seconds_; }
  double total() const {
    double sum = 0;
    for (const double s : seconds_) sum += s;
    return sum;
  }

 private:
  std::vector<double> seconds_;
  std::function<Stamp()> now_;
  Stamp since_;
  int showing_ = -1;
};

// Ends early, with an error, when a person wishes to repeat or to leave.
Status capture(const calib::Captures& captures,
               int pose,
               const Surroundings& around,
               const std::atomic<WizardWish>* wish,
               CaptureClock* clock) {
  calib::Stage stage = around.stage;
  stage.show = [&](int projector, const cv::Mat& picture) -> Status {
    const WizardWish now = wish ? wish->load() : WizardWish::none;
    if (now == WizardWish::check || now == WizardWish::repeat || now == WizardWish::leave)
      return error("calibrate: stopped in pose {}.", pose);
    clock->showing(projector);
    return around.stage.show(projector, picture);
  };
  clock->stop();
  Status done = calib::capture_pose(captures, pose, stage);
  clock->stop();
  const Status written = around.written();
  return done ? written : done;
}

// The solve after each pose: one lens model for all, for models are chosen when all poses are there.
Status judge(const calib::Observed& observed, PoseJudged* judged) {
  const calib::SolveOptions options;
  LIMN_TRY(calib::Solution solution, calib::solve(observed.observations, options));
  LIMN_TRY(judged->assessment, calib::assess(observed, options, solution));
  judged->rig = std::move(solution.rig);
  return {};
}

std::string line_of(const PoseJudged& judged) {
  const std::string name = judged.pose + (judged.before ? " (captured before): " : ": ");
  if (!judged.assessment) return name + "no rig yet: " + judged.unsolved;
  std::vector<std::string> seen;
  for (const calib::DeviceQuality& device : judged.assessment->devices)
    seen.push_back(fmt::format("{} {:.0f} %", device.name, 100 * device.coverage));
  return fmt::format("{}held-out {:.3f} px, predicted {:.2f} mm (95 %), boards over {}; {}", name,
                     judged.assessment->held_out.rms_px, predicted_mm(*judged.assessment),
                     fmt::join(seen, ", "),
                     judged.more_helps.empty() ? "enough" : "more poses help: " + judged.more_helps);
}

// Says faults when they come and when they go, not at each pose.
class FaultTeller {
 public:
  explicit FaultTeller(const Say& say) : say_(say) {}
  void tell(const std::vector<calib::Fault>& faults) {
    std::set<std::string> names;
    for (const calib::Fault& fault : faults) {
      const bool is_new = names.insert(fault.name).second && !told_.contains(fault.name);
      if (is_new) say_(fmt::format("fault {}: {}; {}.", fault.name, fault.evidence, fault.advice));
    }
    for (const std::string& name : told_)
      if (!names.contains(name)) say_(fmt::format("fault {} is gone", name));
    told_ = std::move(names);
  }

 private:
  const Say& say_;
  std::set<std::string> told_;
};

// Faults that another pose may cure; the others are cured by hands.
bool wants_poses(const calib::Fault& fault) {
  return fault.name == "few_poses" || fault.name == "little_tilt" || fault.name == "low_coverage";
}

// A run of the wizard, from pose to pose.
class Run {
 public:
  Run(const calib::Captures& captures, const Surroundings& around, const WizardAudience& audience)
      : captures_(captures),
        around_(around),
        audience_(audience),
        faults_(audience.say),
        clock_(captures.projectors.size(), around.now) {}

  Status pose(int number, const std::string& place) {
    const calib::CapturedPose files = files_of(captures_, number);
    PoseJudged judged;
    judged.pose = files.name;
    judged.before = is_complete(files);
    if (!judged.before) {
      const double before_s = clock_.total();
      LIMN_TRY_STATUS(take(number, place, files));
      judged.capture_s = clock_.total() - before_s;
    }
    if (audience_.judges) audience_.judges(number);
    LIMN_TRY_STATUS(observe(files));
    judge(&judged);
    audience_.say(line_of(judged));
    const auto faults = judged.assessment ? judged.assessment->faults : calib::unsolved_faults(*observed_);
    faults_.tell(faults);
    if (audience_.judged) audience_.judged(judged, observed_->observations, faults);
    return {};
  }

  bool is_enough() const { return !poses_.empty() && poses_.back().more_helps.empty(); }
  // Whether no more poses are wanted; the wish is followed then.
  bool is_to_finish() { return followed(WizardWish::finish); }
  std::vector<PoseJudged> poses() const { return poses_; }
  std::vector<std::pair<std::string, double>> capture_s() const {
    std::vector<std::pair<std::string, double>> named;
    for (std::size_t i = 0; i < captures_.projectors.size(); ++i)
      named.emplace_back(captures_.projectors[i].name, clock_.seconds()[i]);
    return named;
  }

 private:
  bool followed(WizardWish wish) {
    const WizardWish wanted = wish;
    if (!audience_.wish || !audience_.wish->compare_exchange_strong(wish, WizardWish::none)) return false;
    are_checked_ &= wanted != WizardWish::check;
    return true;
  }

  bool is_left() const { return audience_.wish && *audience_.wish == WizardWish::leave; }
  static Status left_in(const calib::CapturedPose& files) {
    return error("calibrate: left in {}. What was captured is kept; the same command goes on from there.",
                 files.name);
  }

  void step(WizardStep which, WizardState state, const std::string& words) {
    if (audience_.step) audience_.step(which, state, words);
  }

  // Devices, once in a run; their latencies are kept beside the captures.
  Status check() {
    LIMN_TRY(const CheckedDevices checked, checked_devices(captures_, around_, audience_));
    are_checked_ = true;
    ordered_json json = {{"schema", "limn.latency/1"}, {"projectors", ordered_json::array()}};
    for (std::size_t i = 0; i < checked.latency.size(); ++i)
      if (checked.latency[i])
        json["projectors"].push_back({{"name", captures_.projectors[i].name},
                                      {"latency_ms", 1e3 * checked.latency[i]->seconds},
                                      {"within_ms", 1e3 * checked.latency[i]->within_s}});
    return write_file(captures_.folder / k_latency, json.dump(2) + "\n");
  }

  // The pictures of a pose, from the beginning as often as that is wished for.
  Status take(int number, const std::string& place, const calib::CapturedPose& files) {
    for (bool is_again = true; is_again;) {
      audience_.say(fmt::format("{}: hold the board {}", files.name, place));
      if (audience_.aims) audience_.aims(number);
      step(WizardStep::board, WizardState::runs, files.name);
      remove_pictures(files);
      if (const Status held = around_.hold(number, nullptr); !held) {
        if (followed(WizardWish::check) || followed(WizardWish::repeat)) continue;
        return is_left() ? left_in(files) : held;
      }
      if (!are_checked_) LIMN_TRY_STATUS(check());
      const Status done = capture(captures_, number, around_, audience_.wish, &clock_);
      if (is_left()) return left_in(files);
      is_again = followed(WizardWish::check) || followed(WizardWish::repeat);
      if (!is_again) LIMN_TRY_STATUS(done);
    }
    return {};
  }

  Status observe(const calib::CapturedPose& files) {
    calib::Captures alone = captures_;
    alone.poses = {files};
    LIMN_TRY_STATUS(calib::check_pictures(alone));
    LIMN_TRY(calib::Observed seen, calib::observe(alone));
    LIMN_TRY_STATUS(calib::check_board(alone, seen.observations));
    observed_ = observed_ ? calib::joined(std::move(*observed_), std::move(seen)) : std::move(seen);
    return {};
  }

  void judge(PoseJudged* judged) {
    if (const Status done = apps::judge(*observed_, judged); !done) judged->unsolved = done.message();
    poses_.push_back(*judged);
    judged->more_helps = poses_.back().more_helps = apps::more_helps(poses_);
  }

  const calib::Captures& captures_;
  const Surroundings& around_;
  const WizardAudience& audience_;
  FaultTeller faults_;
  bool are_checked_ = false;  // the devices
  CaptureClock clock_;
  std::optional<calib::Observed> observed_;
  std::vector<PoseJudged> poses_;
};

// The rig as limn solve makes it of the complete poses.
Result<calib::Report> solve_all(const CalibrateOptions& options, const calib::Captures& captures, int poses) {
  SolveOptions solving{.captures = captures.folder, .out = options.out};
  for (int pose = 0; pose < poses; ++pose) {
    const calib::CapturedPose files = files_of(captures, pose);
    if (!is_complete(files) && fs::is_directory(captures.folder / files.name))
      solving.skip_poses.push_back(files.name);
  }
  return solved(solving);
}

// What decides what is captured: the plan and its world, without the path between them.
Result<std::string> plan_text(const fs::path& plan_path, const fs::path& world_path) {
  ordered_json all = {{"schema", "limn.captured_plan/1"}};
  for (const auto& [name, path] : {std::pair("plan", plan_path), std::pair("world", world_path)}) {
    LIMN_TRY(const std::string text, read_file(path));
    all[name] = ordered_json::parse(text, nullptr, true, true);
  }
  all["plan"].erase("world");
  return all.dump(2) + "\n";
}

ordered_json to_json(const PoseJudged& judged) {
  ordered_json json = {{"pose", judged.pose}, {"captured_before", judged.before}};
  if (!judged.before) json["capture_s"] = judged.capture_s;
  if (!judged.assessment) {
    json["unsolved"] = judged.unsolved;
    return json;
  }
  const calib::Assessment& assessment = *judged.assessment;
  json["verdict"] = calib::to_text(assessment.verdict);
  json["held_out_px"] = assessment.held_out.rms_px;
  json["predicted_mm"] = predicted_mm(assessment);
  for (const calib::DeviceQuality& device : assessment.devices)
    json["coverage"][device.name] = device.coverage;
  json["faults"] = ordered_json::array();
  for (const calib::Fault& fault : assessment.faults) json["faults"].push_back(fault.name);
  json["more_helps"] = judged.more_helps;
  return json;
}

std::string to_json(const Calibrated& done) {
  ordered_json json = {{"verdict", calib::to_text(done.report.assessment.verdict)},
                       {"held_out_px", done.report.assessment.held_out.rms_px},
                       {"predicted_mm", predicted_mm(done.report.assessment)},
                       {"poses", ordered_json::array()},
                       {"capture_s", ordered_json::object()},
                       {"latency_ms", ordered_json::object()},
                       {"seconds", done.seconds}};
  for (const PoseJudged& judged : done.poses) json["poses"].push_back(to_json(judged));
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
  return json.dump(2) + "\n";
}

void say_end(const CalibrateOptions& options, const Calibrated& done, const Say& say) {
  for (const calib::Fault& fault : done.report.assessment.faults)
    say(fmt::format("fault {}: {}; {}.", fault.name, fault.evidence, fault.advice));
  for (const std::string& sentence : done.report.words.advice) say("advice: " + sentence);
  std::vector<std::string> times;
  for (const auto& [projector, seconds] : done.capture_s)
    times.push_back(fmt::format("{} {:.1f} s", projector, seconds));
  const auto taken = std::count_if(done.poses.begin(), done.poses.end(),
                                   [](const PoseJudged& judged) { return !judged.before; });
  say(fmt::format("captured {} of {} poses in this run, at the cameras' pace: {}", taken, done.poses.size(),
                  fmt::join(times, ", ")));
  say(done.report.words.verdict);
  if (!done.no_prototype.empty())
    say(fmt::format("the prototype was not scanned: {} The rig is saved; the same command tries again.",
                    done.no_prototype));
  say(fmt::format("rig and report in {} ({:.0f} s)", options.out.string(), done.seconds));
}

// What an earlier run, or this one, has measured; empty where none has.
Result<std::vector<std::pair<std::string, double>>> kept_latencies(const fs::path& path) {
  std::vector<std::pair<std::string, double>> latency_s;
  if (!fs::exists(path)) return latency_s;
  LIMN_TRY(const Config config, Config::load(path, "limn.latency/1"));
  for (const ConfigNode& node : config.root().at("projectors").items())
    latency_s.emplace_back(node.at("name").text(), 1e-3 * node.at("latency_ms").number());
  LIMN_TRY_STATUS(config.status());
  return latency_s;
}

// Into the rig's provenance.
Status add_to_rig(const std::vector<std::pair<std::string, double>>& latency_s, const fs::path& folder) {
  if (latency_s.empty()) return {};
  LIMN_TRY(Rig rig, load_rig(folder));
  ordered_json provenance =
      rig.provenance_json.empty() ? ordered_json::object() : ordered_json::parse(rig.provenance_json);
  for (const auto& [projector, seconds] : latency_s)
    provenance["display_latency_ms"][projector] = 1e3 * seconds;
  rig.provenance_json = provenance.dump();
  return save_rig(rig, folder);
}

std::string devices_in_words(const calib::Captures& captures, const char* where) {
  const auto counted = [](std::size_t count, const char* what) {
    return fmt::format("{} {}{}", count, what, count == 1 ? "" : "s");
  };
  return fmt::format("{}{}, {}", where, counted(captures.cameras.size(), "camera"),
                     counted(captures.projectors.size(), "projector"));
}

// None where lines are wanted, or where there is no display.
std::optional<GuiWindow> window_for(const CalibrateOptions& options, const Result<device::Desktop>& desktop) {
  constexpr int k_width = 1600, k_height = 1000;
  if (options.terminal || options.json) return std::nullopt;
  auto window = desktop ? GuiWindow::open(*desktop, "Limn calibration", k_width, k_height)
                        : Result<GuiWindow>(desktop.error());
  if (window) return std::move(*window);
  log_info("calibrate: {} The wizard goes on in the terminal.", window.message());
  return std::nullopt;
}

// The wizard with its surroundings, in a window or in the terminal; prints the end.
Status played(const CalibrateOptions& options,
              const std::string& plan_json,
              const WizardPlan& plan,
              const Surroundings& around,
              std::optional<GuiWindow> window,
              std::atomic<WizardWish>* wish,
              MainErrands* errands) {
  const Say say = [&](const std::string& line) {
    if (options.json) return log_info("{}", line);
    fmt::print("{}\n", line);
    std::fflush(stdout);
  };
  const WizardWork work = [&](const Surroundings& where, const WizardAudience& audience) {
    return calibrated(options, plan_json, plan.captures, plan.places, where, audience);
  };
  LIMN_TRY(const Calibrated done, window
                                      ? calibrated_in_window(&*window, plan, around, say, wish, errands, work)
                                      : work(around, {.say = say}));
  say_end(options, done, say);
  if (options.json) fmt::print("{}", to_json(done));
  return {};
}

Status calibrate_virtually(const CalibrateOptions& asked) {
  CalibrateOptions options = asked;
  LIMN_TRY(const Plan plan, load_plan(options.plan));
  LIMN_TRY(sim::World world, sim::load_world(plan.world, marker_picture));
  LIMN_TRY(const std::string text, plan_text(options.plan, plan.world));
  if (options.scene.empty() && world.scene) options.scene = world.scene->folder;
  sim::VirtualRig rig(std::move(world), {.grab_waits_for_light = false});
  const std::vector<Imager> cameras = rig.world().rig.cameras;
  LIMN_TRY(const calib::Captures captures, planned(plan, rig, options.out / "captures"));
  PictureWriter writer;
  rig.clear_stage();
  std::atomic<WizardWish> wish = WizardWish::none;
  MainErrands errands;
  return played(
      options, text,
      {captures, places_in_words(cameras[0], plan.board, plan.world_from_board),
       outlines(plan.board, plan.world_from_board, cameras), devices_in_words(captures, "virtual rig: ")},
      virtual_surroundings(plan, &rig, &writer), window_for(options, device::Desktop::open()), &wish,
      &errands);
}

// A display of the main thread, for another one.
class ErrandDisplay : public device::Display {
 public:
  ErrandDisplay(std::unique_ptr<device::Display> display, MainErrands* errands)
      : display_(std::move(display)), errands_(errands) {}
  const std::string& name() const override { return display_->name(); }
  cv::Size size() const override { return display_->size(); }
  Result<Stamp> show(const cv::Mat& picture) override {
    std::optional<Result<Stamp>> shown;
    errands_->run([&] { shown = display_->show(picture); });
    return *shown;
  }

 private:
  std::unique_ptr<device::Display> display_;
  MainErrands* errands_;
};

// What decides what devices capture.
std::string devices_text(const CalibrateOptions& options, const calib::Captures& captures) {
  ordered_json all = {{"schema", "limn.captured_plan/1"},
                      {"plan", {{"board", options.board}, {"code", options.code}}}};
  for (const auto* devices : {&captures.cameras, &captures.projectors})
    for (const calib::CapturedDevice& device : *devices)
      all["devices"][device.name] = {device.width, device.height};
  return all.dump(2) + "\n";
}

Status calibrate_devices(const CalibrateOptions& options) {
  if (const auto board = calib::Board::parse(options.board); !board)
    return usage_error("--board: {}", board.message());
  LIMN_TRY(const Devices named, load_devices(options.devices));
  const Result<device::Desktop> desktop = device::Desktop::open();
  LIMN_TRY(DeviceStage::Devices devices, opened_devices(named, desktop));
  return calibrate_on(options, std::move(devices), desktop);
}

}  // namespace

Status calibrate_on(const CalibrateOptions& options,
                    DeviceStage::Devices devices,
                    const Result<device::Desktop>& desktop) {
  const auto board = calib::Board::parse(options.board);
  if (!board) return usage_error("--board: {}", board.message());
  const calib::Captures captures =
      calib::plan_captures(options.out / "captures", captured_devices(devices.cameras),
                           captured_devices(devices.projectors), *board, options.code);
  const calib::CapturedDevice& first = captures.cameras.front();
  const Imager assumed = assumed_camera(first.name, first.width, first.height);
  const std::vector<Pose> poses = guided_poses(assumed, *board);
  auto targets = outlines(*board, poses, {assumed});
  for (auto& pose : targets) pose.resize(captures.cameras.size());  // nothing is known yet of the others
  const auto targets_by = [&](const Rig& rig) {
    return outlines(*board, placed_alike(poses, *board, assumed, rig), rig.cameras);
  };
  std::atomic<WizardWish> wish = WizardWish::none;
  MainErrands errands;
  std::optional<GuiWindow> window = window_for(options, desktop);
  if (window)
    for (auto& display : devices.projectors)
      display = std::make_unique<ErrandDisplay>(std::move(display), &errands);
  DeviceStage stage(std::move(devices), *board, &wish);
  PictureWriter writer;
  return played(options, devices_text(options, captures),
                {captures, places_in_words(assumed, *board, poses), targets, devices_in_words(captures, ""),
                 targets_by},
                stage.surroundings(&writer), std::move(window), &wish, &errands);
}

std::string to_text(WizardStep step) {
  static const std::array<const char*, k_wizard_steps> names = {
      "devices", "outputs", "exposure and focus", "display latency", "board", "solve", "result", "scan",
      "align",   "paint"};
  return names.at(static_cast<std::size_t>(step));
}

double predicted_mm(const calib::Assessment& assessment) {
  return *std::max_element(assessment.predicted_error_mm.begin(), assessment.predicted_error_mm.end());
}

std::string more_helps(const std::vector<PoseJudged>& poses) {
  if (poses.empty() || !poses.back().assessment) return "too few for a rig";
  const calib::Assessment& last = *poses.back().assessment;
  for (const calib::Fault& fault : last.faults)
    if (wants_poses(fault)) return fault.name;
  if (last.verdict != calib::Verdict::good) return "the rig is " + calib::to_text(last.verdict);
  const double mm = predicted_mm(last);
  if (mm <= calib::k_fine_mm) return "";
  if (!calib::rests_on_enough_poses(last, static_cast<int>(poses.size())))
    return "few leave little to judge by";
  const auto earlier = poses.size() < 3 ? nullptr : &poses[poses.size() - 3].assessment;
  if (earlier == nullptr || !*earlier) return "the predicted error may still fall";
  const bool has_settled = mm > (1 - k_settled) * predicted_mm(**earlier);
  return has_settled ? "" : "the predicted error still falls";
}

Result<Calibrated> calibrated(const CalibrateOptions& options,
                              const std::string& plan_json,
                              const calib::Captures& captures,
                              const std::vector<std::string>& places,
                              const Surroundings& surroundings,
                              const WizardAudience& audience) {
  const auto begun = std::chrono::steady_clock::now();
  const int count = static_cast<int>(places.size());
  LIMN_TRY_STATUS(opened(captures, plan_json));
  Run run(captures, surroundings, audience);
  const auto solved_all = [&] {
    if (audience.step) audience.step(WizardStep::solve, WizardState::runs, "");
    return solve_all(options, captures, count);
  };
  std::optional<calib::Report> report;
  for (int pose = 0; pose < count; ++pose) {
    const Status done = run.pose(pose, places[static_cast<std::size_t>(pose)]);
    if (run.is_to_finish()) break;
    LIMN_TRY_STATUS(done);
    const bool is_next_there = pose + 1 < count && is_complete(files_of(captures, pose + 1));
    if (options.all || is_next_there || pose + 1 == count || !run.is_enough()) continue;
    LIMN_TRY(report, solved_all());
    if (report->assessment.verdict == calib::Verdict::good) break;
    report.reset();
  }
  if (!report) {
    LIMN_TRY(report, solved_all());
  }
  LIMN_TRY(const auto latency_s, kept_latencies(captures.folder / k_latency));
  LIMN_TRY_STATUS(add_to_rig(latency_s, options.out));
  Calibrated done{run.poses(), std::move(*report), run.capture_s(), latency_s, std::nullopt, ""};
  if (audience.solved) audience.solved(done.report);
  if (options.scan && surroundings.stand) {
    auto seen = prototype_seen({options.out, options.scene, captures, done.report.assessment.error_maps},
                               surroundings, audience);
    if (seen)
      done.prototype = std::move(*seen);
    else
      done.no_prototype = seen.message();  // the rig stays what it is
  }
  done.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
  return done;
}

Status run_calibrate(const CalibrateOptions& options) {
  if (options.plan.empty() == options.devices.empty())
    return usage_error(
        "calibrate: expected either --plan (a virtual rig) or --devices with --board, found {}.",
        options.plan.empty() ? "neither" : "both");
  const std::vector<std::string>& codes = calib::pattern_codes();
  if (std::find(codes.begin(), codes.end(), options.code) == codes.end())
    return usage_error("--code: expected {}, found '{}'.", fmt::join(codes, ", "), options.code);
  return options.devices.empty() ? calibrate_virtually(options) : calibrate_devices(options);
}

}  // namespace limn::apps
