#pragma once

#include <filesystem>
#include <functional>
#include <opencv2/core/mat.hpp>

#include "calib/capture_set.h"
#include "core/result.h"

namespace limn::calib {

/// Shows an image (8-bit grey or BGR, the projector's size) on one projector while every other one is black;
/// returns when it is visible to the next grab.
using ShowImage = std::function<Status(int projector, const cv::Mat& image)>;
/// An image (8-bit grey or BGR) of one camera, taken after the last show.
using GrabImage = std::function<Result<cv::Mat>(int camera)>;
/// Keeps an image on disk. A caller with threads may queue it; then it reports late failures itself.
using StoreImage = std::function<Status(const std::filesystem::path& path, const cv::Mat& image)>;
/// Told after every grab: images done, of how many.
using ReportProgress = std::function<void(int done, int total)>;

/// Writes at once, atomically, as lightly compressed PNG: the Store of callers without threads.
Status store_image_now(const std::filesystem::path& path, const cv::Mat& image);

/// Everything that capturing needs from outside: two functions, never a device.
struct CaptureBackend {
  ShowImage show;
  GrabImage grab;
  StoreImage store = store_image_now;
  ReportProgress report_progress = nullptr;
};

/// Makes the captures folder: capture.json and patterns.json (one for each size of projector). A folder that
/// holds a capture.json already is an error: captures are never mixed. `plan` comes from plan_captures
/// (calib/capture_set.h).
Status begin_captures(const CaptureSet& plan);

/// Captures pose number `pose` (0, 1, …): every projector shows its patterns in turn, every camera
/// photographs each of them. An image of another size than the camera's is an error. Images already taken
/// stay on disk.
Status capture_pose(const CaptureSet& plan, int pose, const CaptureBackend& backend);

}  // namespace limn::calib
