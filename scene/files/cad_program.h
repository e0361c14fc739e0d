#pragma once

#include <filesystem>
#include <stop_token>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn::scene {

/// What the program limn-cad may take until it is ended.
struct CadLimits {
  double seconds = 600;         ///< In total.
  double silent_seconds = 120;  ///< Without a line of progress.
  double memory_mb = 2048;      ///< Address space.
};

/// The program limn-cad: the one that the environment variable LIMN_CAD names, else the one beside this
/// program, else the one on PATH. Error: it is not installed; the message begins with `file`, which needs it.
Result<std::filesystem::path> limn_cad_for(const std::filesystem::path& file);

/// How a run of limn-cad ended.
struct CadRun {
  Result<std::string> report;
  bool fails_again = false;  ///< A failure is the file's own: it comes again until file or limits change.
};

/// Runs limn-cad (exchange/cad/main.cpp) on a CAD file with these further arguments, as a process of low
/// priority that ends with this one, and returns its report (limn.cad/1). It shows the progress of long work.
/// Errors: it is not installed or does not start; its own message; it crashed; it exceeded a limit; `stop`
/// was requested.
CadRun try_limn_cad(const std::filesystem::path& file,
                    const std::vector<std::string>& arguments,
                    const CadLimits& limits = {},
                    const std::stop_token& stop = {});

/// The report alone.
Result<std::string> run_limn_cad(const std::filesystem::path& file,
                                 const std::vector<std::string>& arguments,
                                 const CadLimits& limits = {},
                                 const std::stop_token& stop = {});

}  // namespace limn::scene
