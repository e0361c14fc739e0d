#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "core/foreign_pose.h"
#include "core/result.h"

namespace limn::exchange {

/// A packet of PosiStageNet 2 (VYV and MA Lighting, "PosiStageNet protocol description", 2.03). Its frame is
/// left-handed (x right, y up, z away, metres); here and in what is encoded poses are in a right-handed one
/// whose z axis points the other way (mirrored() in pose_limits.h).
struct PsnPacket {
  double sent_at_s = 0;                        ///< on the server's clock
  int frame = 0, packets_of_frame = 1;         ///< 8 bits each
  std::vector<ForeignPose> poses;              ///< in a data packet; a sensor's name is the tracker's number
  std::map<std::uint16_t, std::string> names;  ///< in an info packet, by number
};

/// Decodes a data or an info packet. A tracker without a position is left out; one without an orientation has
/// no rotation; one whose validity is 0 is lost. Unknown chunks are skipped. Error: a packet of another
/// protocol or version, chunks that do not fit into each other, numbers that are not finite, too many
/// trackers.
Result<PsnPacket> psn_packet(std::span<const std::uint8_t> datagram);

/// A tracker to be sent.
struct PsnTracker {
  std::uint16_t number = 0;
  std::string name;
  Pose room_from_sensor;
  bool is_lost = false;
};

/// The data packets of one frame, each of at most 1500 bytes.
std::vector<std::vector<std::uint8_t>> psn_data(std::span<const PsnTracker> trackers,
                                                double at_s,
                                                std::uint8_t frame);
/// The info packets with the names of the trackers.
std::vector<std::vector<std::uint8_t>> psn_info(std::span<const PsnTracker> trackers,
                                                double at_s,
                                                std::uint8_t frame);

}  // namespace limn::exchange
