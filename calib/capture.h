#pragma once

#include <filesystem>
#include <functional>
#include <opencv2/core/mat.hpp>
#include <optional>

#include "calib/capture_set.h"
#include "core/result.h"

namespace limn::calib {

/// Shows an image (8-bit grey or BGR, the projector's size) on one projector while all others are black.
/// Returns when the image is visible to the next grab.
using ShowImage = std::function<Status(int projector, const cv::Mat& image)>;
/// Takes an image (8-bit grey or BGR) with one camera, after the last image was shown.
using GrabImage = std::function<Result<cv::Mat>(int camera)>;
/// Stores an image on disk. A caller with threads may queue it; it then reports late failures itself.
using StoreImage = std::function<Status(const std::filesystem::path& path, const cv::Mat& image)>;
/// Reports progress after every grab: the number of images done, and of all images.
using ReportProgress = std::function<void(int done, int total)>;

/// Writes the image at once, atomically, as lightly compressed PNG: the StoreImage of callers without
/// threads.
Status store_image_now(const std::filesystem::path& path, const cv::Mat& image);

/// The functions that a capture needs from its caller. They hide the devices.
struct CaptureBackend {
  ShowImage show;
  GrabImage grab;
  StoreImage store = store_image_now;
  ReportProgress report_progress = nullptr;
};

/// Makes the captures folder: capture.json and patterns.json (one for each size of projector). A folder that
/// already holds a capture.json is an error, because captures are never mixed. `plan` comes from
/// plan_captures (calib/capture_set.h).
Status begin_captures(const CaptureSet& plan);

/// The board's measured size in the captures' capture.json; none where there is no such file, or no size.
Result<std::optional<BoardMeasured>> stored_board_measured(const std::filesystem::path& captures);
/// Adds the board's measured size to the captures' capture.json.
Status store_board_measured(const std::filesystem::path& captures, const BoardMeasured& measured);

/// Captures pose number `pose` (0, 1, …): every projector shows its patterns in turn, and every camera
/// photographs each of them. An image whose size differs from its camera's is an error. Images that were
/// already taken stay on disk.
Status capture_pose(const CaptureSet& plan, int pose, const CaptureBackend& backend);

}  // namespace limn::calib
