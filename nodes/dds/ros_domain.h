#pragma once

#include <dds/dds.h>

#include <string>

#include "core/result.h"
#include "nodes/dds/qualities.h"
#include "nodes/ros_port.h"

namespace limn::nodes {

/// This program's place in a domain of ROS 2: one participant, which all objects of the same domain share,
/// because a program can set up a domain only once. The last one leaves the domain.
class RosDomain {
 public:
  /// Error: the room is in this domain, or no network.
  static Result<RosDomain> enter(const RosNetwork& network);
  RosDomain() = default;
  RosDomain(RosDomain&& other) noexcept;
  RosDomain& operator=(RosDomain&& other) noexcept;
  ~RosDomain();

  dds_entity_t participant() const { return participant_; }
  /// A topic by ROS 2's name of it. Error: the middleware's.
  Result<dds_entity_t> topic(const std::string& name, const dds_topic_descriptor_t* type) const;

 private:
  int domain_ = -1;
  dds_entity_t participant_ = 0;
};

/// The qualities that all topics of ROS 2 have here; the newest `depth` samples are kept.
Qos ros_qos(int32_t depth);

/// Error for people of a call of the middleware.
Error ros_failed(const std::string& what, dds_return_t code);

}  // namespace limn::nodes
