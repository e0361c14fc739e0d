#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "core/result.h"
#include "device/udp_socket.h"
#include "exchange/poses/pose_decoder.h"
#include "exchange/poses/ros_port.h"
#include "scene/scene.h"
#include "session/perception.h"
#include "tracker/feeds/foreign_tracker.h"

namespace limn::session {

/// One entry of a file limn.trackers/1: another tracking system that sends poses (docs/trackers.md).
struct FeedConfig {
  tracker::FeedSetup setup;
  exchange::PoseDecoderOptions decoder;
  device::NetPlace receive;
  std::string from;  ///< the only address whose datagrams are accepted; empty: all
};

/// Reads a file limn.trackers/1. The scene's bodies are "prototype", its slots, and "viewer" (or "viewer N",
/// counted from 0) for those with a marker or `tracked`. Error: names the key.
Result<std::vector<FeedConfig>> load_feeds(const std::filesystem::path& path, const scene::Scene& scene);

/// Receives the poses of other tracking systems. It never waits; what was not read yet is in the sockets'
/// buffers, which do not grow. Used by the thread of perception only.
class PoseFeeds {
 public:
  /// Opens a socket or a subscription for each. `ros`, which must outlive this, is needed for ROS 2 only.
  /// Error: names the tracker.
  static Result<std::unique_ptr<PoseFeeds>> open(const std::vector<FeedConfig>& configs,
                                                 exchange::RosPort* ros = nullptr);

  /// The poses that have arrived since the last call, one list for each tracker, and what people should know:
  /// refusals, at most one a second for each tracker. At most k_most_at_once messages of each tracker and 5
  /// ms in all; what a flood brings beyond that is thrown away, so that it does not fill the buffer. `at`:
  /// the session's present time. `is_real_time`: its clock runs as fast as that of the wall, and the moment
  /// of arrival is the one at which the system received the datagram.
  FeedInput received(Stamp at, bool is_real_time);
  /// The UDP port on which a tracker's poses are received.
  int port(std::size_t feed) const { return feeds_[feed].socket->port(); }

  static constexpr int k_most_at_once = 64;

 private:
  struct Feed {
    std::string name, from;
    exchange::PoseDecoder decoder;
    std::optional<device::UdpSocket> socket = {};
    exchange::RosPort* ros = nullptr;  // instead of the socket
    std::size_t subscription = 0;
    std::optional<Stamp> read_at = {};  // when received() was last called
    std::optional<Stamp> refused_at = {};
    std::size_t unreported = 0;
  };
  struct Arrival {
    Result<std::vector<ForeignPose>> poses;
    double age_s = 0;
  };
  static std::optional<Arrival> next_arrival(Feed* feed);
  static void receive(Stamp at, bool is_real_time, Stamp until, Feed* feed, FeedInput* out);
  static void refuse(const std::string& why, Stamp at, Feed* feed, FeedInput* out);

  std::vector<Feed> feeds_;
};

}  // namespace limn::session
