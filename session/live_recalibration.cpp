#include "session/live_recalibration.h"

#include "core/user_folder.h"

namespace limn::session {
namespace {

namespace fs = std::filesystem;

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

Result<fs::path> numbered_folder(const fs::path& out, const std::string& name) {
  fs::path base = out;
  if (base.empty()) {
    LIMN_TRY(base, user_folder());
  }
  std::error_code none;
  for (int i = 1;; ++i) {
    const fs::path folder = base / fmt::format("{}-{}", name, i);
    if (!fs::exists(folder, none)) return folder;
  }
}

LiveRecalibration::LiveRecalibration(const Rig& rig,
                                     fs::path folder,
                                     const std::function<wizard::WizardBackend(ImageWriter*)>& backend)
    : folder_(std::move(folder)),
      task_(wizard::recheck_images(rig),
            backend,
            [rig, into = folder_](const wizard::WizardBackend& devices,
                                  const std::function<bool()>& should_continue) {
              return wizard::recheck_in_place(rig, devices, into, should_continue);
            }) {}

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
