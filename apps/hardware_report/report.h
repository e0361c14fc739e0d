#pragma once

#include <filesystem>
#include <string>

#include "core/result.h"

namespace limn::apps {

struct ReportOptions {
  std::filesystem::path folder;        ///< What was measured before stays in it and is not repeated.
  std::filesystem::path devices = {};  ///< limn.devices/1; empty: chosen by questions, else a virtual rig.
  std::filesystem::path rig = {};      ///< With devices: the calibrated rig; empty: an assumed one.
  std::string board = "charuco:11x8:25mm";  ///< The board that is held into the picture.
  double live_s = 60;                       ///< Length of the recorded live session; seconds.
  bool with_names = false;                  ///< Keeps names, addresses and serial numbers.
};

/// `limn doctor --report FOLDER`: measures a machine with its devices and writes one folder to send:
/// report.json (limn.hardware_report/1), report.html, frames.csv, captures/ (limn solve reads it), recording/
/// (limn replay reads it) and live/. Questions on a terminal have defaults; without a terminal the defaults
/// are taken. A step that fails is written down, and the next one follows. Error: interrupted (the same
/// command goes on), a folder that cannot be written, or a report.json of something else.
Status run_hardware_report(const ReportOptions& options);

}  // namespace limn::apps
