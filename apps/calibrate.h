#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "apps/wizard/display_latency.h"
#include "apps/wizard/light_check.h"
#include "calib/board/board_finder.h"
#include "calib/capture.h"
#include "calib/captures.h"
#include "calib/report/report.h"
#include "core/frame.h"
#include "core/result.h"
#include "core/rig.h"

namespace limn::apps {

struct CalibrateOptions {
  std::filesystem::path plan = {};     ///< of a virtual rig
  std::filesystem::path devices = {};  ///< limn.devices/1, instead of a plan
  std::string board = {};              ///< with devices: `charuco:11x8:25mm`
  std::string code = "gray";           ///< with devices
  std::filesystem::path out;           ///< the rig folder; its captures/ keeps every picture
  std::filesystem::path scene = {};    ///< of the prototype; with a plan its world's
  bool scan = false;                   ///< scan the prototype at the end, and paint it
  bool all = false;                    ///< take every pose of the plan, although fewer are enough
  bool terminal = false;               ///< lines instead of a window
  bool json = false;  ///< print one JSON at the end; the lines go to stderr, there is no window
};

/// What the wizard needs from outside: functions, so that a virtual rig and devices in a room are alike.
struct Surroundings {
  /// Told of the board in a camera's picture while it is waited for; may be empty.
  using Seen = std::function<void(int camera, const cv::Mat&, const std::vector<calib::BoardCorner>&)>;
  /// Returns when the board is where this pose wants it, and still.
  std::function<Status(int pose, const Seen& seen)> hold;
  calib::Stage stage;
  std::function<Status()> written;  ///< returns when every picture that was stored is on the disk
  std::function<Stamp()> now;       ///< of the cameras' clock
  /// Returns when the board is gone and the prototype stands still; false: a person skipped it. Empty: there
  /// is no prototype.
  std::function<Result<bool>(const Seen& seen)> stand = nullptr;
  /// All projectors show a picture each, which is visible to the next grab.
  std::function<Status(const std::vector<cv::Mat>&)> paint = nullptr;
  /// One projector and one camera, the others dark.
  std::function<FlashStage(int projector, int camera)> flashes;
  /// From now on a picture is on the surface so long after it was shown; before, the longest that is
  /// measured.
  std::function<void(int projector, double seconds)> use_latency;
};

/// What the captures up to one pose are worth.
struct PoseJudged {
  std::string pose;      ///< its name
  bool before = false;   ///< it was captured by an earlier run
  double capture_s = 0;  ///< of the cameras' clock, all projectors
  /// None: no solution comes of these poses yet, and `unsolved` says why.
  std::optional<calib::Assessment> assessment;
  std::string unsolved;
  std::optional<Rig> rig = {};  ///< of these poses, before models are chosen; world: camera 0
  std::string more_helps;       ///< why more poses help; empty: they are enough
};

/// The wizard's steps, in their order.
enum class WizardStep { devices, outputs, exposure, latency, board, solve, result, scan, align, paint };
constexpr std::size_t k_wizard_steps = 10;
std::string to_text(WizardStep step);
enum class WizardState { waits, runs, done, fails };

/// What a person asks of a running wizard.
enum class WizardWish {
  none,
  check,   ///< look at outputs, exposure and latency again, then take the pictures of this pose again
  repeat,  ///< take the pictures of this pose again
  finish,  ///< take no more poses: solve
  scan,    ///< the prototype stands there: scan it
  skip,    ///< leave out what is waited for
  leave    ///< stop; what was captured stays, the next run goes on from there
};

/// Who watches the wizard; functions may be empty, but for `say`.
struct WizardAudience {
  std::function<void(const std::string& line)> say;
  std::function<void(WizardStep step, WizardState state, const std::string& words)> step = nullptr;
  std::function<void(const std::vector<LightSeen>&)> lit = nullptr;
  std::function<void(int pose)> aims = nullptr;                ///< a pose's pictures are taken from now on
  std::function<void(const calib::Report&)> solved = nullptr;  ///< the rig is saved; the prototype may follow
  std::function<void(int pose)> judges = nullptr;              ///< it is decoded and judged from now on
  /// Observations are of all poses so far.
  std::function<void(const PoseJudged&, const calib::Observations&, const std::vector<calib::Fault>&)>
      judged = nullptr;
  std::atomic<WizardWish>* wish = nullptr;  ///< none again once it is followed
};

/// What came of the prototype.
struct PrototypeSeen {
  std::size_t points = 0;              ///< of the scan
  double scan_stddev_mm = 0;           ///< median
  std::optional<double> align_rms_mm;  ///< of the scan from the CAD; none: not aligned
  double painted_p95_mm = 0;           ///< predicted error of light on it
  double painted_good = 0;             ///< share of it with at most calib::k_good_mm
  std::vector<std::string> warnings;
};

/// What a run of the wizard gave.
struct Calibrated {
  std::vector<PoseJudged> poses;
  calib::Report report;  ///< as limn solve writes it
  /// Of the captures taken by this run, on the cameras' clock: by name of the projector.
  std::vector<std::pair<std::string, double>> capture_s;
  /// Measured, from show to light, by name of the projector; those of an earlier run where this one captured
  /// nothing.
  std::vector<std::pair<std::string, double>> latency_s;
  std::optional<PrototypeSeen> prototype;  ///< none: not asked for, skipped, or `no_prototype` says why
  std::string no_prototype;
  double seconds = 0;  ///< the run, by the wall
};

/// The largest of its projectors' predicted errors.
double predicted_mm(const calib::Assessment& assessment);

/// Why more poses help after the last of `poses`, in a few words; empty when they are enough: the rig is good
/// without a fault that only more poses cure, and the predicted error is a quarter of a millimetre at most
/// or, with as many poses as the report asks for, fell by less than a twentieth over the last two.
std::string more_helps(const std::vector<PoseJudged>& poses);

/// The sequence: pose after pose of `captures` (planned, its folder is options.out / "captures"; begun or
/// not) is captured unless it is there already, decoded, solved and judged, with a line each to `audience`;
/// before the first one that is captured the devices are checked (wizard/device_checks.h). Then the rig is
/// solved as limn solve does it. `places`: where each pose's board is to be held, in words. Captures that
/// another plan made are an error that says what differs; `plan_json` describes this one. Whatever fails,
/// pictures on the disk stay there, and the next run goes on from them; leaving is an error, too.
Result<Calibrated> calibrated(const CalibrateOptions& options,
                              const std::string& plan_json,
                              const calib::Captures& captures,
                              const std::vector<std::string>& places,
                              const Surroundings& surroundings,
                              const WizardAudience& audience);

/// `limn calibrate`: on the virtual rig of the plan's world, or on devices; in a window where a display is
/// there and neither `terminal` nor `json` is asked for.
Status run_calibrate(const CalibrateOptions& options);

}  // namespace limn::apps
