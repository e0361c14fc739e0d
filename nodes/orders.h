#pragma once

#include <condition_variable>
#include <deque>
#include <mutex>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <thread>
#include <utility>

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

/// Carries out the orders for cameras on a thread of its own, one after the other.
class CameraWorker {
 public:
  explicit CameraWorker(Room* room) : room_(room), thread_([this] { run(); }) {}
  ~CameraWorker();

  /// Queues an order; its answer is sent to the room.
  void carry_out(Order order, const std::string& host);
  /// Drops the orders that wait, and closes all cameras, so that other programs can use them.
  void close_cameras();

 private:
  void run();

  Room* room_;
  NodeCameras cameras_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::pair<Order, std::string>> orders_;
  bool is_stopping_ = false, is_closing_ = false;
  std::thread thread_;
};

}  // namespace limn::nodes
