#pragma once

#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "device/open_display.h"
#include "nodes/room.h"

namespace limn::nodes {

/// A screen of a session that is plugged into a node. The host draws its images; they are encoded and sent on
/// a thread of this object, at most 15 times and about 4 MB in a second, so that no frame waits for them and
/// the network stays free. What comes faster is left out.
class RemoteScreen final : public device::Display {
 public:
  /// A screen of the node `config.host`. If its size is known, the node may come later. Otherwise the node is
  /// asked for it now. Error: no such machine in the room, another version of Limn there, or the node's own
  /// message.
  static Result<std::unique_ptr<RemoteScreen>> open(Room* room, const device::DisplayConfig& config);
  ~RemoteScreen() override;

  const std::string& name() const override { return config_.name; }
  cv::Size size() const override { return size_; }
  bool is_stereo() const override { return config_.stereo != StereoLayout::off; }
  Result<Stamp> show(const cv::Mat& image) override { return show_eyes({image}); }
  /// Returns at once. Error: an image of another size, the node has gone, or it cannot show this screen's
  /// images.
  Result<Stamp> show_eyes(const EyeImages& images) override;

 private:
  RemoteScreen(Room* room, const device::DisplayConfig& config);
  void hand_over(const EyeImages& images);
  void run();
  Status send(const EyeImages& images, double* seconds);

  Room* room_;
  device::DisplayConfig config_;
  cv::Size size_;
  std::uint64_t sent_ = 0;  // used by the thread alone
  std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<EyeImages> waiting_;
  bool is_sending_ = false, is_stopping_ = false;
  Stamp due_at_;         // the next image is not taken earlier
  std::string problem_;  // why the last one could not be sent
  std::thread thread_;
};

/// The configuration by which a screen at a node is opened there: it does not wait for the monitor's refresh,
/// because the projectors of the node would wait, too.
device::DisplayConfig screen_at_node(device::DisplayConfig config);

}  // namespace limn::nodes
