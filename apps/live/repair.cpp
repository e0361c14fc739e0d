#include "apps/live/repair.h"

#include "apps/recheck.h"
#include "apps/serve/certificate.h"

namespace limn::apps {
namespace {

namespace fs = std::filesystem;

// The rig with what has moved, in words.
std::string words_of(const calib::Recheck& result, const fs::path& folder) {
  if (result.verdict == calib::RecheckVerdict::sound)
    return "repair: nothing has moved; the session goes on with its rig";
  const calib::Move& move = result.candidates.front();
  std::string others;
  for (std::size_t i = 1; i < result.candidates.size(); ++i) others += " or " + result.candidates[i].device;
  return fmt::format(
      "repair: {}{} was turned by {:.2f} degrees and moved by {:.1f} mm; the session goes on with the mended "
      "rig. It is in {} for the next one.",
      move.device, others, move.degrees, move.mm, folder.string());
}

Status mend(
    const Surroundings& around, const fs::path& folder, Stamp at, Watcher* watcher, Session* session) {
  LIMN_TRY(const Rechecked checked, rechecked_in_place(session->setup().rig, around, folder));
  if (checked.result.verdict != calib::RecheckVerdict::sound) {
    LIMN_TRY_STATUS(session->mend(checked.result.rig, at));
    const SessionSetup& setup = session->setup();
    LIMN_TRY(*watcher, Watcher::create(setup.scene, setup.rig, setup.watch));
  }
  session->warn(at, words_of(checked.result, folder));
  return {};
}

}  // namespace

Result<fs::path> repair_folder(const fs::path& out) {
  fs::path base = out;
  if (base.empty()) {
    LIMN_TRY(base, own_folder());
  }
  std::error_code none;
  for (int i = 1;; ++i) {
    const fs::path folder = base / fmt::format("repaired-{}", i);
    if (!fs::exists(folder, none)) return folder;
  }
}

void repair(
    const Surroundings& around, const fs::path& folder, Stamp at, Watcher* watcher, Session* session) {
  const Status mended = mend(around, folder, at, watcher, session);
  if (!mended) session->warn(at, "repair: " + mended.message() + " The session goes on with its rig.");
}

}  // namespace limn::apps
