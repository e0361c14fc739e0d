#pragma once

#include <atomic>
#include <filesystem>

#include "core/result.h"
#include "device/desktop.h"
#include "nodes/room.h"
#include "nodes/setup_loader.h"

namespace limn::nodes {

struct NodeOptions {
  FetchFiles fetch;            ///< how the files of a setup come to this machine
  std::filesystem::path work;  ///< a folder for them
  std::filesystem::path out =
      {};                      ///< folder for shown.csv, which lists the images that were shown; empty: none
  bool offers_cameras = true;  ///< whether cameras are searched for at the start, which takes a second
};

/// Runs this machine as a node of a room until `is_ended` is set: offers its monitors and cameras, carries
/// out the host's orders, and draws the session's frames for its projectors. When the host goes, the light
/// fades out within a second; when it is back, the node goes on. An OpenGL context is created. `desktop` may
/// be null. Error: no OpenGL, or `out` cannot be written.
Status run_node(const NodeOptions& options,
                Room* room,
                const device::Desktop* desktop,
                const std::atomic<bool>& is_ended);

}  // namespace limn::nodes
