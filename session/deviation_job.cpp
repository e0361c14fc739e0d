#include "session/deviation_job.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "session/deviation/prototype_comparison.h"
#include "wizard/measure/comparison.h"

namespace limn::session {
namespace {

namespace fs = std::filesystem;

// A prototype at rest, as its tracked pose scatters.
constexpr double k_still_m = 1e-3, k_still_rad = 0.3 * M_PI / 180;
// A part that moved by less has not changed what is scanned.
constexpr double k_part_still_m = 2e-3;
// How long after the capture a tracked pose is waited for, and from when on it is used: the filter has
// settled.
constexpr double k_wait_s = 2, k_settled_s = 0.2;

using Compared = std::shared_ptr<const PrototypeComparison>;

const Track* tracked(std::span<const Track> tracks, const std::string& body) {
  for (const Track& track : tracks)
    if (track.body == body && track.tracking == TrackingState::measured) return &track;
  return nullptr;
}

// Three standard deviations of the difference of two poses; first: 0 rotation, 3 translation.
double scatter_of(const Track& before, const Track& after, int first) {
  return 3 * std::sqrt(before.covariance.diagonal().segment<3>(first).maxCoeff() +
                       after.covariance.diagonal().segment<3>(first).maxCoeff());
}

bool has_shifted(const Track& before, const Track& after, double still_m) {
  return (before.world_from_body.translation - after.world_from_body.translation).norm() >
         still_m + scatter_of(before, after, 3);
}

bool has_moved(const Track& before, const Track& after) {
  return has_shifted(before, after, k_still_m) ||
         angle_between(before.world_from_body.rotation, after.world_from_body.rotation) >
             k_still_rad + scatter_of(before, after, 0);
}

// The bodies whose tracks moved, apart from the prototype.
std::string moved_parts(std::span<const Track> before, std::span<const Track> after) {
  std::string names;
  for (const Track& track : before) {
    if (track.body == "prototype" || track.tracking != TrackingState::measured) continue;
    const Track* later = tracked(after, track.body);
    if (later && has_shifted(track, *later, k_part_still_m))
      names += (names.empty() ? "" : ", ") + track.body;
  }
  return names;
}

ComparisonInput input_of(const Session& session) {
  const scene::Scene& scene = session.setup().scene;
  const scene::DeviationChoice& choice = session.show_state().deviation;
  ComparisonInput input;
  input.cad = std::make_shared<const scene::Mesh>(scene.prototype->mesh);
  input.cad_name = (scene.folder / "scene.json").string();
  input.tolerance_m = choice.tolerance_m;
  input.fit_box = choice.fit_box;
  input.number = choice.layer ? choice.layer->number + 1 : 1;
  if (const Compared& last = session.deviation().result; choice.is_held && last)
    input.held = last->report.registration;
  return input;
}

std::string sentence(const PrototypeComparison& compared, const std::string& moved) {
  std::string text =
      "deviation: " + calib::deviation_text(compared.report.summary, compared.report.deviation.tolerance_m);
  if (!moved.empty())
    text += fmt::format(" Note: {} moved during the scan; what is seen there may be wrong.", moved);
  for (const std::string& warning : compared.report.warnings) text += " Note: " + warning;
  return text;
}

// The images of a scan on the disk, as long as they are needed.
class ImageFolder {
 public:
  ImageFolder() = default;
  explicit ImageFolder(fs::path folder) : folder_(std::move(folder)) {}
  ImageFolder(ImageFolder&& other) noexcept : folder_(std::exchange(other.folder_, {})) {}
  ImageFolder& operator=(ImageFolder&&) = delete;
  ~ImageFolder() {
    std::error_code ignored;
    if (!folder_.empty()) fs::remove_all(folder_, ignored);
  }

 private:
  fs::path folder_;
};

// A comparison that is applied when it is computed.
class ComparisonJob : public CaptureJob {
 public:
  using Task = CaptureTask<Compared>;
  ComparisonJob(int scenes, std::unique_ptr<Task> task, ImageFolder images = {})
      : images_(std::move(images)), scenes_(scenes), task_(std::move(task)) {}

  CapturePort& port() override { return task_->port(); }
  bool is_computed() const override { return task_->is_done(); }
  bool is_ready(const Session&, Stamp) override { return true; }
  void show_progress(const std::string& words, Session* session) const override {
    session->deviation().progress = words;
  }

  void apply(Stamp at, Perception*, Session* session) override {
    const auto compared = task_->take_result();
    if (!compared) return;
    const Status done = applied(*compared, session, at);
    if (!done) session->warn(at, "deviation: " + done.message() + " The former result stays.");
  }

 protected:
  // Whether the result may be used, now that it is known.
  virtual Status check() { return {}; }
  // The parts that moved during the scan.
  virtual std::string moved() { return {}; }

 private:
  Status applied(const Result<Compared>& compared, Session* session, Stamp at) {
    if (!compared) return compared.error();
    if (scenes_ != session->scenes())
      return error("expected the scene and the rig to stay as they were, found others now. Scan again.");
    LIMN_TRY_STATUS(check());
    const std::string what = sentence(**compared, moved());
    session->deviation().result = *compared;
    session->deviation().text = what.substr(what.find(' ') + 1);
    session->show_deviation((*compared)->layer);
    session->warn(at, what);
    return {};
  }

  ImageFolder images_;  // first: it goes when the task, which writes into it, has gone
  int scenes_;
  std::unique_ptr<Task> task_;
};

class ScanJob final : public ComparisonJob {
 public:
  ScanJob(int scenes, std::unique_ptr<Task> task, ImageFolder images, std::vector<Track> before)
      : ComparisonJob(scenes, std::move(task), std::move(images)), before_(std::move(before)) {}

  // Takes the poses soon after the capture: while the result is computed, people may move things again.
  bool is_ready(const Session& session, Stamp now) override {
    if (!ended_at_) ended_at_ = std::max(now, session.percepts().captured_at);
    if (after_.empty() && session.percepts().captured_at > shifted(*ended_at_, k_settled_s) &&
        tracked(session.prediction().at_capture, "prototype"))
      after_ = session.prediction().at_capture;
    return !after_.empty() || seconds_between(*ended_at_, now) > k_wait_s;
  }

 private:
  Status check() override {
    const Track* before = tracked(before_, "prototype");
    const Track* after = tracked(after_, "prototype");
    if (!after)
      return error(
          "expected the prototype to be tracked after the scan, found it lost: it may have moved. Let the "
          "cameras see its markers, and scan again.");
    if (has_moved(*before, *after))
      return error(
          "expected the prototype to stand still while it was scanned, found it moved by {:.1f} mm and "
          "{:.2f} degrees. Scan again.",
          1e3 * (before->world_from_body.translation - after->world_from_body.translation).norm(),
          angle_between(before->world_from_body.rotation, after->world_from_body.rotation) * 180 / M_PI);
    return {};
  }

  std::string moved() override { return moved_parts(before_, after_); }

  std::vector<Track> before_, after_;
  std::optional<Stamp> ended_at_;
};

// Writes files; its result is the folder.
class ReportJob final : public CaptureJob {
 public:
  using Task = CaptureTask<fs::path>;
  explicit ReportJob(std::unique_ptr<Task> task) : task_(std::move(task)) {}

  CapturePort& port() override { return task_->port(); }
  bool is_computed() const override { return task_->is_done(); }
  bool is_ready(const Session&, Stamp) override { return true; }
  void show_progress(const std::string& words, Session* session) const override {
    session->deviation().progress = words.empty() ? "" : "writing the report";
  }
  void apply(Stamp at, Perception*, Session* session) override {
    const auto folder = task_->take_result();
    if (!folder) return;
    if (!*folder) return session->warn(at, "deviation: report: " + folder->message());
    session->deviation().report = **folder;
    session->warn(at, "deviation: the report is " + (**folder / "deviation.html").string());
  }

 private:
  std::unique_ptr<Task> task_;
};

}  // namespace

Result<std::unique_ptr<CaptureJob>> scan_job(
    const Session& session,
    const fs::path& folder,
    const std::function<wizard::WizardBackend(ImageWriter*)>& backend,
    Stamp) {
  ImageFolder images(folder);
  const std::vector<Track>& before = session.prediction().at_capture;
  const Track* prototype = tracked(before, "prototype");
  if (!session.setup().scene.prototype || !prototype)
    return error(
        "deviation: expected the cameras to see the prototype's markers, found it lost. Uncover them, and "
        "scan "
        "again.");
  const Rig& rig = session.setup().rig;
  auto work = [rig, folder, input = input_of(session), start = prototype->world_from_body,
               markers = seen_markers(scene::bodies(session.setup().scene), before)](
                  const wizard::WizardBackend& devices,
                  const ShouldContinue& should_continue) -> Result<Compared> {
    LIMN_TRY(const ScannedPrototype scanned,
             scanned_in_place(rig, *input.cad, start, markers, devices, folder, should_continue));
    LIMN_TRY(PrototypeComparison compared, compared_with_cad(scanned, input, should_continue));
    return std::make_shared<const PrototypeComparison>(std::move(compared));
  };
  auto task = std::make_unique<ComparisonJob::Task>(scan_images(rig), backend, std::move(work));
  return std::unique_ptr<CaptureJob>(
      std::make_unique<ScanJob>(session.scenes(), std::move(task), std::move(images), before));
}

Result<std::unique_ptr<CaptureJob>> comparison_job(const Session& session) {
  const Compared last = session.deviation().result;
  if (!last) return std::unique_ptr<CaptureJob>();
  auto work = [last, input = input_of(session)](const wizard::WizardBackend&,
                                                const ShouldContinue& should_continue) -> Result<Compared> {
    LIMN_TRY(PrototypeComparison compared, compared_with_cad(last->scanned, input, should_continue));
    return std::make_shared<const PrototypeComparison>(std::move(compared));
  };
  auto task = std::make_unique<ComparisonJob::Task>(0, nullptr, std::move(work));
  return std::unique_ptr<CaptureJob>(std::make_unique<ComparisonJob>(session.scenes(), std::move(task)));
}

Result<std::unique_ptr<CaptureJob>> report_job(const Session& session, const fs::path& folder) {
  const Compared last = session.deviation().result;
  if (!last) return std::unique_ptr<CaptureJob>();
  auto work = [last, folder](const wizard::WizardBackend&, const ShouldContinue&) -> Result<fs::path> {
    LIMN_TRY_STATUS(wizard::write_deviation_files(last->report, folder));
    return folder;
  };
  auto task = std::make_unique<ReportJob::Task>(0, nullptr, std::move(work));
  return std::unique_ptr<CaptureJob>(std::make_unique<ReportJob>(std::move(task)));
}

}  // namespace limn::session
