#pragma once

#include <filesystem>
#include <functional>
#include <opencv2/core/mat.hpp>

#include "calib/captures.h"
#include "core/result.h"

namespace limn::calib {

/// Shows a picture (8-bit grey or BGR, the projector's size) on one projector while every other one is black;
/// returns when it is visible to the next grab.
using Show = std::function<Status(int projector, const cv::Mat& picture)>;
/// A picture (8-bit grey or BGR) of one camera, taken after the last show.
using Grab = std::function<Result<cv::Mat>(int camera)>;
/// Keeps a picture on disk. A caller with threads may queue it; then it reports late failures itself.
using Store = std::function<Status(const std::filesystem::path& path, const cv::Mat& picture)>;
/// Told after every grab: pictures done, of how many.
using Tell = std::function<void(int done, int total)>;

/// Writes at once, atomically, as lightly compressed PNG: the Store of callers without threads.
Status store_now(const std::filesystem::path& path, const cv::Mat& picture);

/// Everything that capturing needs from outside: two functions, never a device.
struct Stage {
  Show show;
  Grab grab;
  Store store = store_now;
  Tell tell = nullptr;
};

/// Makes the captures folder: capture.json and patterns.json (one for each size of projector). A folder that
/// holds a capture.json already is an error: captures are never mixed. `plan` comes from plan_captures
/// (calib/captures.h).
Status begin_captures(const Captures& plan);

/// Captures pose number `pose` (0, 1, …): every projector shows its patterns in turn, every camera
/// photographs each of them. A picture of another size than the camera's is an error. Pictures already taken
/// stay on disk.
Status capture_pose(const Captures& plan, int pose, const Stage& stage);

}  // namespace limn::calib
