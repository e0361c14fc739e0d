#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "device/device_opener.h"
#include "nodes/room.h"

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

/// A camera that is plugged into a node. Each image is asked for.
class RemoteCamera final : public device::CameraSource {
 public:
  /// A camera of the node `config.host`, opened as a RemoteDisplay is.
  static Result<std::unique_ptr<RemoteCamera>> open(Room* room, const device::CameraConfig& config);

  const std::string& name() const override { return config_.name; }
  cv::Size size() const override { return size_; }
  Result<Frame> next() override;
  std::string description() const override { return "at " + config_.host; }

 private:
  RemoteCamera(Room* room, const device::CameraConfig& config) : room_(room), config_(config) {}
  Order order(Order::What what) const;

  Room* room_;
  device::CameraConfig config_;
  cv::Size size_;
  Stamp captured_at_;
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
