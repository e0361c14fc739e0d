#pragma once

#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "core/frame.h"
#include "core/rig.h"
#include "device/open_camera.h"
#include "nodes/room.h"
#include "session/camera_threads.h"
#include "tracker/cameras/camera_detector.h"

namespace limn::nodes {

/// What is searched for in a camera's images, from the host's setup.
struct Search {
  std::uint64_t setup = 0;  ///< Setup::revision
  tracker::CameraDetectorSetup wanted;
  Imager camera;
  tracker::Encoding encoding = {};
};

/// A camera of a node in whose images the node detects: a thread reads them, another detects in the newest
/// and sends what is found to the host.
class DetectingCamera {
 public:
  /// Begins. `source`: the camera, if it is open already; otherwise it is opened, and tried again until it
  /// can be.
  DetectingCamera(Room* room,
                  device::CameraConfig config,
                  std::unique_ptr<device::CameraSource> source,
                  Search search);
  ~DetectingCamera();

  /// Searches for something else from the next image on.
  void search_for(Search search);
  /// Width and height of the images. Error: the camera is not open within the limit.
  Result<cv::Size> size(double limit_s);
  /// The newest image if it was exposed later than `after`, or else the next one that was. Error: none comes
  /// within the limit.
  Result<Frame> next_frame(Stamp after, double limit_s);

 private:
  struct Work;  // a search and its detector
  void run();
  bool open();
  void detect(const Frame& frame);
  Error none_within(double limit_s) const;

  Room* room_;
  const device::CameraConfig config_;
  std::unique_ptr<device::CameraSource> source_;  // until its thread owns it
  std::shared_ptr<session::DeviceHealth> health_ = std::make_shared<session::DeviceHealth>();
  std::optional<session::CameraThreads> reading_;
  std::unique_ptr<Work> work_;  // used by the thread only

  std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<Search> next_;
  Frame newest_;
  cv::Size size_;
  std::string problem_;  // why it is not open
  bool is_stopping_ = false;
  std::thread thread_;
};

}  // namespace limn::nodes
