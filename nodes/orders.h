#pragma once

#include <condition_variable>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "nodes/detecting_camera.h"
#include "nodes/messages.h"
#include "nodes/node_devices.h"
#include "nodes/room.h"

namespace limn::nodes {

/// Whether an order is for a camera. Such orders may wait for an image.
bool is_for_camera(const Order& order);

/// The image that an order brings; empty: it brings none, or it cannot be decoded.
cv::Mat image_of(const Order& order);

/// Carries out an order on a node's displays or cameras. Stamps of order and answer are on the host's clock,
/// which `clock` translates; nullopt: orders that need it are refused. `image`: image_of() the order.
Answer carried_out(const Order& order,
                   const cv::Mat& image,
                   const std::optional<ClockEstimate>& clock,
                   NodeDisplays* displays);
Answer carried_out(const Order& order, const std::optional<ClockEstimate>& clock, NodeCameras* cameras);
/// Likewise, for a camera in whose images the node detects.
Answer carried_out(const Order& order, const std::optional<ClockEstimate>& clock, DetectingCamera* camera);

/// A camera in whose images a node shall detect.
struct CameraTask {
  device::CameraConfig config;
  Search search;
};

/// Owns the cameras of a node. Carries out the orders for them on a thread of its own, one after the other,
/// and detects in the images of some.
class CameraWorker {
 public:
  explicit CameraWorker(Room* room) : room_(room), thread_([this] { run(); }) {}
  ~CameraWorker();

  /// Queues an order; its answer is sent to the room.
  void carry_out(Order order, const std::string& host);
  /// From now on detects in the images of these cameras, and of no others.
  void detect(std::vector<CameraTask> tasks);
  /// Drops the orders that wait, stops detecting, and closes all cameras, so that other programs can use
  /// them.
  void close_cameras();

 private:
  void run();
  void begin(std::vector<CameraTask> tasks);
  Answer answer_to(const Order& order);

  Room* room_;
  NodeCameras cameras_;
  std::map<std::string, std::unique_ptr<DetectingCamera>> detecting_;  // by configuration
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::pair<Order, std::string>> orders_;
  std::optional<std::vector<CameraTask>> tasks_;
  bool is_stopping_ = false, is_closing_ = false;
  std::thread thread_;
};

}  // namespace limn::nodes
