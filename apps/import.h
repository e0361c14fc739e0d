#pragma once

#include <filesystem>

#include "core/result.h"

namespace limn::apps {

struct ImportOptions {
  std::filesystem::path file;  ///< MPCDI archive, or its XML alone
  std::filesystem::path out;   ///< rig folder to write; empty: none
  bool json = false;
};

/// `limn import`: says what an MPCDI file holds, or what is wrong with it; with `out` its projectors become a
/// rig, whose world is the file's frame.
Status run_import(const ImportOptions& options);

}  // namespace limn::apps
