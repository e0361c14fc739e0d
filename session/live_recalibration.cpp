#include "session/live_recalibration.h"

#include "core/user_folder.h"
#include "core/worker_thread.h"

namespace limn::session {
namespace {

namespace fs = std::filesystem;

constexpr int k_niceness = 10;  // niceness of the computation, so that drawing has priority
constexpr auto k_look_again = std::chrono::milliseconds(5);
constexpr const char* k_ended = "the session was ended.";

// A sentence about what has moved.
std::string words_of(const calib::RigCheck& result, const fs::path& folder) {
  if (result.verdict == calib::RigVerdict::sound)
    return "repair: no device has moved; the session continues with the same rig";
  const calib::Move& move = result.candidates.front();
  std::string others;
  for (std::size_t i = 1; i < result.candidates.size(); ++i) others += " or " + result.candidates[i].device;
  return fmt::format(
      "repair: {}{} was turned by {:.2f} degrees and moved by {:.1f} mm; the session continues with a "
      "corrected rig. It is saved in {} for the next session.",
      move.device, others, move.degrees, move.mm, folder.string());
}

Status mend(const Result<wizard::Rechecked>& checked,
            const fs::path& folder,
            Stamp at,
            Perception* perception,
            Session* session) {
  if (!checked) return checked.error();
  if (checked->result.verdict != calib::RigVerdict::sound) {
    LIMN_TRY_STATUS(session->replace_rig(checked->result.rig, at));
    const SessionSetup& setup = session->setup();
    LIMN_TRY(*perception, perception->successor(setup.scene, setup.rig));
  }
  session->warn(at, words_of(checked->result, folder));
  return {};
}

}  // namespace

Result<fs::path> recalibration_folder(const fs::path& out) {
  fs::path base = out;
  if (base.empty()) {
    LIMN_TRY(base, user_folder());
  }
  std::error_code none;
  for (int i = 1;; ++i) {
    const fs::path folder = base / fmt::format("repaired-{}", i);
    if (!fs::exists(folder, none)) return folder;
  }
}

LiveRecalibration::LiveRecalibration(const Rig& rig,
                                     fs::path folder,
                                     const std::function<wizard::WizardBackend(ImageWriter*)>& backend)
    : folder_(std::move(folder)), images_(wizard::recheck_images(rig)) {
  result_ = std::async(
      std::launch::async,
      [this, rig, backend = run_on_session_thread(backend(&writer_))]() -> Result<wizard::Rechecked> {
        try {
          return wizard::recheck_in_place(rig, backend, folder_, [this] { return !is_over_; });
        } catch (const std::exception& bug) {
          return error("this is a bug in Limn, please report it: {}", bug.what());
        }
      });
}

LiveRecalibration::~LiveRecalibration() {
  is_over_ = true;
  while (result_.valid() && result_.wait_for(k_look_again) != std::future_status::ready) executor_.serve();
}

// The same functions, executed by serve(). After cancellation they return errors.
wizard::WizardBackend LiveRecalibration::run_on_session_thread(wizard::WizardBackend backend) {
  wizard::WizardBackend out;
  out.capture.show = [this, show = backend.capture.show](int projector, const cv::Mat& image) {
    Status status = error("{}", k_ended);
    executor_.run([&] {
      if (is_over_) return;
      status = show(projector, image);
      ++shown_;
    });
    return status;
  };
  out.capture.grab = [this, grab = backend.capture.grab](int camera) {
    Result<cv::Mat> image = error("{}", k_ended);
    executor_.run([&] {
      if (!is_over_) image = grab(camera);
    });
    return image;
  };
  out.capture.store = backend.capture.store;
  out.use_latency = [this, use = backend.use_latency](int projector, double seconds) {
    executor_.run([&] { use(projector, seconds); });
  };
  out.wait_for_files = [this, written = backend.wait_for_files] {
    Status status = written();
    step_back(k_niceness);
    is_capturing_ = false;
    return status;
  };
  return out;
}

std::string LiveRecalibration::words() const {
  return is_capturing_ ? fmt::format("{} of {} patterns", shown_.load(), images_) : "computing";
}

std::optional<Result<wizard::Rechecked>> LiveRecalibration::take_result() {
  if (!result_.valid() || result_.wait_for(std::chrono::seconds(0)) != std::future_status::ready)
    return std::nullopt;
  is_capturing_ = false;
  return result_.get();
}

void apply_recalibration(const Result<wizard::Rechecked>& checked,
                         const fs::path& folder,
                         Stamp at,
                         Perception* perception,
                         Session* session) {
  session->recalibration() = {};  // a request that was made during this recalibration is served by it
  const Status mended = mend(checked, folder, at, perception, session);
  if (!mended) session->warn(at, "repair: " + mended.message() + " The session continues with the same rig.");
}

}  // namespace limn::session
