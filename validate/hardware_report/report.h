#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/result.h"
#include "validate/hardware_report/finding.h"
#include "validate/hardware_report/open_devices.h"
#include "validate/hardware_report/plugged_in.h"
#include "validate/hardware_report/private_facts.h"

namespace limn::validate {

struct ReportOptions {
  std::filesystem::path folder;        ///< What was measured before stays in it and is not repeated.
  std::filesystem::path devices = {};  ///< limn.devices/1; empty: chosen by questions, else a virtual rig.
  std::filesystem::path rig = {};      ///< With devices: the calibrated rig; empty: an assumed one.
  std::string board = "charuco:11x8:25mm";  ///< The board that is held into the picture.
  int placements = 5;                       ///< How often the board is captured; limn solve needs 3.
  double live_s = 60;                       ///< Length of the recorded live session; seconds.
  bool with_names = false;                  ///< Keeps names, addresses and serial numbers.
};

/// A session that is recorded for the report.
struct ReportSession {
  std::filesystem::path rig, scene, devices;  ///< empty: the virtual rig
  double seconds = 0;
  std::filesystem::path record, out;  ///< folders of the recording and of what the session writes
};

/// What the report does with other commands.
struct ReportCommands {
  /// The tests of `limn doctor` with this devices file, which may be empty.
  std::function<std::vector<Finding>(const std::filesystem::path& devices)> examine;
  /// Plays a session as `limn live` does, and says whether a signal has ended it. It may leave signal
  /// handlers of its own.
  std::function<Status(const ReportSession& session, bool* was_interrupted)> play;
  std::function<PluggedIn()> plugged_in = find_plugged_in;
  /// Opens the devices; `desktop` may be null.
  OpenerFor opener = opener_here;
  /// A file descriptor with a line for each answer; without it the terminal, if there is one.
  std::optional<int> answers = {};
  /// Adds what is private on this machine.
  std::function<void(PrivateWords*)> add_private_words = [](PrivateWords* words) { add_machine(words); };
};

/// `limn doctor --report FOLDER`: measures a machine with its devices and writes one folder to send:
/// report.json (limn.hardware_report/1), report.html, frames.csv, captures/ (limn solve reads it), recording/
/// (limn replay reads it) and live/. Questions on a terminal have defaults; without a terminal the defaults
/// are taken. A step that fails is written down, and the next one follows. Names, addresses and serial
/// numbers are taken out of all files unless options.with_names. Error: interrupted (the same command goes
/// on), a folder that cannot be written, a report.json of something else or of other devices, or a devices
/// file without a camera or without a projector.
Status run_hardware_report(const ReportOptions& options, const ReportCommands& commands);

}  // namespace limn::validate
