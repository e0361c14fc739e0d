#pragma once

#include <filesystem>

#include "core/result.h"

namespace limn::apps {

struct ImportOptions {
  std::filesystem::path file;  ///< MPCDI archive, or its XML alone.
  std::filesystem::path out;   ///< Rig folder to write; empty: none.
  bool json = false;
};

/// `limn import`: prints what an MPCDI file holds, or what is wrong with it. With `out` its projectors become
/// a rig whose world frame is the file's coordinate frame.
Status run_import(const ImportOptions& options);

}  // namespace limn::apps
