#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "core/enum_names.h"
#include "core/foreign_pose.h"
#include "core/result.h"
#include "exchange/poses/pose_osc.h"

namespace limn::exchange {

/// How another tracking system sends its poses.
enum class PoseProtocol { osc, psn, freed, json };
inline constexpr EnumNames<PoseProtocol, 4> k_pose_protocols{{"osc", "psn", "freed", "json"}};

struct PoseDecoderOptions {
  PoseProtocol protocol = PoseProtocol::json;
  PoseOscOptions osc;
  bool is_left_handed = false;    ///< The sender's frame is; PosiStageNet's own always counts as such.
  std::set<std::string> sensors;  ///< Poses of others are left out. A name or, for PosiStageNet, a number.
};

/// Decodes the datagrams of one system. It remembers the names that PosiStageNet sends once a second.
class PoseDecoder {
 public:
  explicit PoseDecoder(PoseDecoderOptions options) : options_(std::move(options)) {}

  /// The poses of the wanted sensors, under the names by which they are wanted. Error: see the codecs.
  Result<std::vector<ForeignPose>> decoded(std::span<const std::uint8_t> datagram);

 private:
  Result<std::vector<ForeignPose>> all_poses(std::span<const std::uint8_t> datagram);

  PoseDecoderOptions options_;
  std::map<std::string, std::string> names_;  // by number
};

}  // namespace limn::exchange
