#include "wizard/sequence.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <functional>
#include <nlohmann/json.hpp>
#include <set>

#include "calib/cross_validation.h"
#include "calib/judge/board_check.h"
#include "calib/judge/capture_faults.h"
#include "calib/judge/image_check.h"
#include "calib/observations.h"
#include "calib/solve.h"
#include "core/config.h"
#include "core/file.h"
#include "core/json_text.h"
#include "wizard/capture/capture_folder.h"
#include "wizard/device_checks.h"
#include "wizard/measure/solve_captures.h"

namespace limn::wizard {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;
using Say = std::function<void(const std::string&)>;

constexpr const char* k_latency = "latency.json";  // beside capture.json

// Measures how long the capture takes with each projector, on the cameras' clock.
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

// Stops with an error when a person asks to check again, to repeat or to leave.
Status capture(const calib::CaptureSet& captures,
               int pose,
               const WizardBackend& backend,
               const std::atomic<WizardWish>* wish,
               CaptureClock* clock) {
  calib::CaptureBackend capture = backend.capture;
  capture.show = [&](int projector, const cv::Mat& image) -> Status {
    const WizardWish now = wish ? wish->load() : WizardWish::none;
    if (now == WizardWish::check || now == WizardWish::repeat || now == WizardWish::leave)
      return error("calibrate: stopped in pose {}.", pose);
    clock->showing(projector);
    return backend.capture.show(projector, image);
  };
  clock->stop();
  Status done = calib::capture_pose(captures, pose, capture);
  clock->stop();
  const Status written = backend.wait_for_files();
  return done ? written : done;
}

// Solves after each pose with one lens model for all devices; models are selected at the end.
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
  return fmt::format(
      "{}held-out error {:.3f} px, predicted error {:.2f} mm (95 %), coverage {}; {}", name,
      judged.assessment->held_out.rms_px, predicted_mm(*judged.assessment), fmt::join(seen, ", "),
      judged.more_helps.empty() ? "these poses are enough" : "more poses help: " + judged.more_helps);
}

// Reports faults when they appear and when they are gone, not after each pose.
class FaultTeller {
 public:
  explicit FaultTeller(const Say& say) : say_(say) {}
  void report_progress(const std::vector<calib::Fault>& faults) {
    std::set<calib::FaultName> names;
    for (const calib::Fault& fault : faults) {
      const bool is_new = names.insert(fault.name).second && !reported_.contains(fault.name);
      if (is_new) say_("fault " + calib::to_text(fault));
    }
    for (const calib::FaultName name : reported_)
      if (!names.contains(name)) say_(fmt::format("fault {} is gone", calib::to_text(name)));
    reported_ = std::move(names);
  }

 private:
  const Say& say_;
  std::set<calib::FaultName> reported_;
};

// One run of the wizard, pose by pose.
class Run {
 public:
  Run(const calib::CaptureSet& captures, const WizardBackend& backend, const WizardListener& listener)
      : captures_(captures),
        backend_(backend),
        listener_(listener),
        faults_(listener.say),
        clock_(captures.projectors.size(), backend.now) {}

  Status pose(int number, const std::string& place) {
    const calib::CapturedPose files = files_of(captures_, number);
    PoseJudged judged;
    judged.pose = files.name;
    judged.before = is_complete(files);
    if (!judged.before) {
      const double before_s = clock_.total();
      LIMN_TRY_STATUS(capture_pose(number, place, files));
      judged.capture_s = clock_.total() - before_s;
    }
    if (listener_.judging_begins) listener_.judging_begins(number);
    LIMN_TRY_STATUS(observe(files));
    judge(&judged);
    listener_.say(line_of(judged));
    const auto faults = judged.assessment ? judged.assessment->faults : calib::unsolved_faults(*observed_);
    faults_.report_progress(faults);
    if (listener_.judged) listener_.judged(judged, observed_->observations, faults);
    return {};
  }

  bool is_enough() const { return !poses_.empty() && poses_.back().more_helps.empty(); }
  // Whether a person asked to finish; this clears the request.
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
    if (!listener_.wish || !listener_.wish->compare_exchange_strong(wish, WizardWish::none)) return false;
    are_checked_ &= wanted != WizardWish::check;
    return true;
  }

  bool is_left() const { return listener_.wish && *listener_.wish == WizardWish::leave; }
  static Status left_in(const calib::CapturedPose& files) {
    return error(
        "calibrate: left in {}. The captured images are kept; the same command continues from there.",
        files.name);
  }

  void step(WizardStep which, WizardState state, const std::string& words) {
    if (listener_.step) listener_.step(which, state, words);
  }

  // Checks the devices, once in a run; their latencies are stored beside the captures.
  Status check() {
    LIMN_TRY(const CheckedDevices checked, check_devices(captures_, backend_, listener_));
    are_checked_ = true;
    ordered_json json = {{"schema", "limn.latency/1"}, {"projectors", ordered_json::array()}};
    for (std::size_t i = 0; i < checked.latency.size(); ++i)
      if (checked.latency[i])
        json["projectors"].push_back({{"name", captures_.projectors[i].name},
                                      {"latency_ms", 1e3 * checked.latency[i]->seconds},
                                      {"within_ms", 1e3 * checked.latency[i]->within_s}});
    return write_file(captures_.folder / k_latency, json_text(json, 2) + "\n");
  }

  // Captures a pose, again from its first image each time that a person asks for it.
  Status capture_pose(int number, const std::string& place, const calib::CapturedPose& files) {
    for (bool is_again = true; is_again;) {
      listener_.say(
          fmt::format("{}: hold the board as follows in the first camera's image: {}", files.name, place));
      if (listener_.pose_begins) listener_.pose_begins(number);
      step(WizardStep::board, WizardState::runs, files.name);
      remove_images(files);
      if (const Status held = backend_.wait_for_board(number, nullptr); !held) {
        if (followed(WizardWish::check) || followed(WizardWish::repeat)) continue;
        return is_left() ? left_in(files) : held;
      }
      if (!are_checked_) LIMN_TRY_STATUS(check());
      const Status done = capture(captures_, number, backend_, listener_.wish, &clock_);
      if (is_left()) return left_in(files);
      is_again = followed(WizardWish::check) || followed(WizardWish::repeat);
      if (!is_again) LIMN_TRY_STATUS(done);
    }
    return {};
  }

  Status observe(const calib::CapturedPose& files) {
    calib::CaptureSet alone = captures_;
    alone.poses = {files};
    LIMN_TRY_STATUS(calib::check_images(alone));
    LIMN_TRY(calib::Observed seen, calib::observe(alone));
    LIMN_TRY_STATUS(calib::check_board(alone, seen.observations));
    observed_ = observed_ ? calib::joined(std::move(*observed_), std::move(seen)) : std::move(seen);
    return {};
  }

  void judge(PoseJudged* judged) {
    if (const Status done = wizard::judge(*observed_, judged); !done) judged->unsolved = done.message();
    poses_.push_back(*judged);
    judged->more_helps = poses_.back().more_helps = more_helps(poses_);
  }

  const calib::CaptureSet& captures_;
  const WizardBackend& backend_;
  const WizardListener& listener_;
  FaultTeller faults_;
  bool are_checked_ = false;  // whether the devices are
  CaptureClock clock_;
  std::optional<calib::Observed> observed_;
  std::vector<PoseJudged> poses_;
};

// Stores the board's measured size with the captures.
Status store_board_size(const calib::CaptureSet& captures, const WizardListener& listener) {
  const std::string entered = listener.board_measured ? listener.board_measured() : "";
  LIMN_TRY(const auto measured, measured_board(captures, entered));
  return measured ? calib::store_board_measured(captures.folder, *measured) : Status();
}

// Solves the complete poses as limn solve does.
Result<calib::Report> solve_all(const WizardOptions& options, const calib::CaptureSet& captures, int poses) {
  SolveCommandOptions solving{.captures = captures.folder, .out = options.out};
  for (int pose = 0; pose < poses; ++pose) {
    const calib::CapturedPose files = files_of(captures, pose);
    if (!is_complete(files) && fs::is_directory(captures.folder / files.name))
      solving.skip_poses.push_back(files.name);
  }
  return solve_captures(solving);
}

// The latencies that this run or an earlier one measured; empty if none did.
Result<std::vector<std::pair<std::string, double>>> kept_latencies(const fs::path& path) {
  std::vector<std::pair<std::string, double>> latency_s;
  if (!fs::exists(path)) return latency_s;
  LIMN_TRY(const Config config, Config::load(path, "limn.latency/1"));
  for (const ConfigNode& node : config.root().at("projectors").items())
    latency_s.emplace_back(node.at("name").text(), 1e-3 * node.at("latency_ms").number());
  LIMN_TRY_STATUS(config.status());
  return latency_s;
}

// Stores the latencies in the rig's provenance.
Status add_to_rig(const std::vector<std::pair<std::string, double>>& latency_s, const fs::path& folder) {
  if (latency_s.empty()) return {};
  LIMN_TRY(Rig rig, load_rig(folder));
  ordered_json provenance =
      rig.provenance_json.empty() ? ordered_json::object() : ordered_json::parse(rig.provenance_json);
  for (const auto& [projector, seconds] : latency_s)
    provenance["display_latency_ms"][projector] = 1e3 * seconds;
  rig.provenance_json = json_text(provenance);
  return save_rig(rig, folder);
}

}  // namespace

Result<Calibrated> calibrate_rig(const WizardOptions& options,
                                 const std::string& plan_json,
                                 const calib::CaptureSet& captures,
                                 const std::vector<std::string>& places,
                                 const WizardBackend& backend,
                                 const WizardListener& listener) {
  const auto begun = std::chrono::steady_clock::now();
  const int count = static_cast<int>(places.size());
  LIMN_TRY_STATUS(open_captures(captures, plan_json));
  Run run(captures, backend, listener);
  const auto solved_all = [&]() -> Result<calib::Report> {
    if (listener.step) listener.step(WizardStep::solve, WizardState::runs, "");
    LIMN_TRY_STATUS(store_board_size(captures, listener));
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
  if (listener.solved) listener.solved(done.report);
  if (options.scan && backend.wait_for_prototype) {
    auto seen = prototype_seen({options.out, options.scene, captures, done.report.assessment.error_maps},
                               backend, listener);
    if (seen)
      done.prototype = std::move(*seen);
    else
      done.no_prototype = seen.message();  // the rig is complete without it
    if (done.prototype && calib::note_cad_size(done.prototype->size, &done.report)) {
      LIMN_TRY_STATUS(calib::write_report(done.report, options.out));
      listener.say(done.report.explanation.verdict);
    }
  }
  done.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
  return done;
}

}  // namespace limn::wizard
