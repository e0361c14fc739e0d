#include "session/capture_stage.h"

#include <utility>

#include "session/deviation_job.h"
#include "session/frame_loop.h"
#include "session/live_recalibration.h"

namespace limn::session {
namespace {

// Wait for a device call of a job.
constexpr auto k_task_wait = std::chrono::milliseconds(10);

class RecalibrationJob final : public CaptureJob {
 public:
  RecalibrationJob(const Rig& rig,
                   std::filesystem::path folder,
                   const std::function<wizard::WizardBackend(ImageWriter*)>& backend)
      : recalibration_(rig, std::move(folder), backend) {}

  CapturePort& port() override { return recalibration_.port(); }
  bool is_computed() const override { return recalibration_.is_done(); }
  bool is_ready(const Session&, Stamp) override { return true; }
  void apply(Stamp at, Perception* perception, Session* session) override {
    if (const auto checked = recalibration_.take_result())
      apply_recalibration(*checked, recalibration_.folder(), at, perception, session);
  }
  void show_progress(const std::string& words, Session* session) const override {
    session->recalibration().progress = words;
  }

 private:
  LiveRecalibration recalibration_;
};

}  // namespace

CaptureStage::CaptureStage(Perception* perception,
                           Session* session,
                           SessionOutput* output,
                           CaptureDevices* devices)
    : perception_(perception), session_(session), output_(output), devices_(devices) {}

void CaptureStage::step(const FrameClock& clock) {
  if (!devices_) return;
  if (!job_) return begin_requested(clock.now());
  if (holds_light()) job_->port().serve(k_task_wait);
  job_->show_progress(job_->port().words(), session_);
  const bool is_ready = !job_->port().is_capturing() && job_->is_ready(*session_, clock.now());
  if (is_ready && job_->is_computed()) {
    pause();
    job_->show_progress({}, session_);
    job_->apply(clock.now(), perception_, session_);
    job_.reset();
  }
  if (!holds_light()) resume();
}

void CaptureStage::begin_requested(Stamp now) {
  auto job = new_job(now);
  if (!job) session_->warn(now, job.message());
  if (job) job_ = std::move(*job);
  if (!holds_light()) resume();
}

// Null when nothing was requested.
Result<std::unique_ptr<CaptureJob>> CaptureStage::new_job(Stamp now) {
  using Job = std::unique_ptr<CaptureJob>;
  const auto backend = [this](ImageWriter* writer) { return devices_->backend(writer); };
  if (std::exchange(session_->recalibration().is_requested, false)) {
    LIMN_TRY(const std::filesystem::path folder, numbered_folder(output_->out(), "repaired"));
    pause();
    return Job(std::make_unique<RecalibrationJob>(session_->setup().rig, folder, backend));
  }
  DeviationStatus& deviation = session_->deviation();
  if (std::exchange(deviation.is_scan_requested, false)) {
    deviation.is_comparison_requested = false;
    LIMN_TRY(const std::filesystem::path folder, numbered_folder(output_->out(), "scanning"));
    pause();
    return scan_job(*session_, folder, backend, now);
  }
  if (std::exchange(deviation.is_comparison_requested, false)) return comparison_job(*session_);
  if (std::exchange(deviation.is_report_requested, false)) {
    LIMN_TRY(const std::filesystem::path folder, numbered_folder(output_->out(), "deviation"));
    return report_job(*session_, folder);
  }
  return Job();
}

void CaptureStage::pause() {
  if (!std::exchange(is_paused_, true)) devices_->pause_perception(session_);
}

void CaptureStage::resume() {
  if (std::exchange(is_paused_, false)) devices_->resume_perception();
}

}  // namespace limn::session
