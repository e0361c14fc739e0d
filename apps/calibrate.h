#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "calib/capture.h"
#include "calib/captures.h"
#include "calib/report/report.h"
#include "core/frame.h"
#include "core/result.h"

namespace limn::apps {

struct CalibrateOptions {
  std::filesystem::path plan;
  std::filesystem::path out;  ///< the rig folder; its captures/ keeps every picture
  bool all = false;           ///< take every pose of the plan, although fewer are enough
  bool json = false;          ///< print one JSON at the end; the lines go to stderr
};

/// What the wizard needs from outside: functions, so that a virtual rig and devices in a room are alike.
struct Surroundings {
  std::function<Status(int pose)> hold;  ///< returns when the board is where this pose wants it, and still
  calib::Stage stage;
  std::function<Status()> written;  ///< returns when every picture that was stored is on the disk
  std::function<Stamp()> now;       ///< of the cameras' clock
};

/// What the captures up to one pose are worth.
struct PoseJudged {
  std::string pose;      ///< its name
  bool before = false;   ///< it was captured by an earlier run
  double capture_s = 0;  ///< of the cameras' clock, all projectors
  /// None: no solution comes of these poses yet, and `unsolved` says why.
  std::optional<calib::Assessment> assessment;
  std::string unsolved;
  std::string more_helps;  ///< why more poses help; empty: they are enough
};

/// What a run of the wizard gave.
struct Calibrated {
  std::vector<PoseJudged> poses;
  calib::Report report;  ///< as limn solve writes it
  /// Of the captures taken by this run, on the cameras' clock: by name of the projector.
  std::vector<std::pair<std::string, double>> capture_s;
  double seconds = 0;  ///< the run, by the wall
};

/// Why more poses help after the last of `poses`, in a few words; empty when they are enough: the rig is good
/// without a fault that only more poses cure, and the predicted error is a quarter of a millimetre at most or
/// fell by less than a twentieth over the last two poses.
std::string more_helps(const std::vector<PoseJudged>& poses);

/// The sequence: pose after pose of `captures` (planned, its folder is options.out / "captures"; begun or
/// not) is captured unless it is there already, decoded, solved and judged, with a line each through `say`;
/// then the rig is solved as limn solve does it. `places`: where each pose's board is to be held, in words.
/// Captures that another plan made are an error that says what differs; `plan_json` describes this one.
/// Whatever fails, pictures on the disk stay there, and the next run goes on from them.
Result<Calibrated> calibrated(const CalibrateOptions& options,
                              const std::string& plan_json,
                              const calib::Captures& captures,
                              const std::vector<std::string>& places,
                              const Surroundings& surroundings,
                              const std::function<void(const std::string&)>& say);

/// `limn calibrate`: on the virtual rig of the plan's world.
Status run_calibrate(const CalibrateOptions& options);

}  // namespace limn::apps
