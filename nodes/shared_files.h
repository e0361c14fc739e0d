#pragma once

#include <filesystem>

#include "core/result.h"
#include "nodes/file_offer.h"

namespace limn::nodes {

/// How a node gets the files of a setup: those that it does not have in `cache_folder` from the host's
/// FileServer. `cache_folder` may be used by several nodes; empty: files/ in user_cache_folder().
///
/// The result empties the folder that it is given and fills it with copies. If it fails, the folder is gone,
/// and files that have come stay in the cache for the next attempt. Errors: check_listing() refuses the
/// setup's files; those of FileClient; those of FileCache (a full disk is one). It may take minutes, at a
/// slow network; it ends when nothing comes for 5 s.
FetchFiles fetch_from_host(const std::filesystem::path& cache_folder = {});

}  // namespace limn::nodes
