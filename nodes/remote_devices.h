#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "device/device_opener.h"
#include "nodes/room.h"
#include "tracker/cameras/detection_source.h"

namespace limn::nodes {

/// A machine of the room by its name, for a device at it. Error: the machine is not there, or has another
/// version of Limn; the message begins with the device's name.
Result<Machine> node_of(const Room& room, const std::string& name, const std::string& device);

/// A projector, or a display for a calibration, that is plugged into a node.
class RemoteDisplay final : public device::Display {
 public:
  /// A display of the node `config.host`. If its size is known, it is opened when it first shows something,
  /// and the node may come later. Otherwise it is opened now. Error: no such machine in the room, another
  /// version of Limn there, or the node's own message.
  static Result<std::unique_ptr<RemoteDisplay>> open(Room* room, const device::DisplayConfig& config);

  const std::string& name() const override { return config_.name; }
  cv::Size size() const override { return size_; }
  /// Sends the image to the node.
  Result<Stamp> show(const cv::Mat& image) override;
  bool is_stereo() const override { return config_.stereo != StereoLayout::off; }
  /// For a session's frames: sends nothing, because the node draws them itself from their descriptions
  /// (RoomHost). Returns when the light of a frame that is described now arrives. Error: the node has gone or
  /// cannot show.
  Result<Stamp> show_eyes(const EyeImages& images) override;

 private:
  RemoteDisplay(Room* room, const device::DisplayConfig& config) : room_(room), config_(config) {}
  Order order(Order::What what) const;

  Room* room_;
  device::DisplayConfig config_;
  cv::Size size_;
};

/// A camera that is plugged into a node. Each image is asked for. In a session the node detects, and a few
/// images a second are asked for on a thread of their own.
class RemoteCamera final : public device::CameraSource, public tracker::DetectionSource {
 public:
  /// A camera of the node `config.host`, opened as a RemoteDisplay is.
  static Result<std::unique_ptr<RemoteCamera>> open(Room* room, const device::CameraConfig& config);
  ~RemoteCamera() override;

  const std::string& name() const override { return config_.name; }
  cv::Size size() const override { return size_; }
  Result<Frame> next() override;
  std::string description() const override { return "at " + config_.host; }
  Result<Output> next_output() override;
  void want_images(Images images) override;

 private:
  RemoteCamera(Room* room, const device::CameraConfig& config) : room_(room), config_(config) {}
  Order order(Order::What what) const;
  Result<Frame> image_by(Order::What what);
  std::optional<tracker::CameraDetections> accepted(Detections received);
  void ask_for_images(const std::stop_token& stop);

  Room* room_;
  device::CameraConfig config_;
  cv::Size size_;
  Stamp captured_at_, detected_at_;
  Stamp worked_at_ = now();  // when the last detections came, or an error was returned
  std::string problem_;      // with the last detections
  std::atomic<Images> wanted_images_ = Images::some;
  std::mutex mutex_;
  std::optional<Frame> image_;  // that was not taken
  std::jthread asking_;
};

/// Opens devices at the machine that their configuration names: a node of the room, or this one. Cameras
/// of ROS 2 (`ros:/TOPIC`), too. A session's `screens`, by their names, get their images from this machine
/// (RemoteScreen).
class RoomOpener final : public device::DeviceOpener {
 public:
  /// Borrows both. `room` may be null: then a device at another machine is an error. `desktop` may be null.
  RoomOpener(Room* room, const device::Desktop* desktop, std::vector<std::string> screens = {})
      : room_(room), local_(desktop), screens_(std::move(screens)) {}
  Result<std::unique_ptr<device::Display>> display(const device::DisplayConfig& config) override;
  Result<std::unique_ptr<device::CameraSource>> camera(const device::CameraConfig& config) override;

 private:
  Room* room_;
  device::LocalOpener local_;
  std::vector<std::string> screens_;
};

}  // namespace limn::nodes
