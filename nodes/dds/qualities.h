#pragma once

#include <dds/dds.h>

#include <memory>
#include <string>

#include "core/result.h"
#include "nodes/engine.h"

namespace limn::nodes {

struct DeleteQos {
  void operator()(dds_qos_t* qos) const { dds_delete_qos(qos); }
};
using Qos = std::unique_ptr<dds_qos_t, DeleteQos>;

/// A topic's name on the network and its type.
struct TopicDescription {
  const char* name;
  const dds_topic_descriptor_t* type;
};
TopicDescription description_of(Topic topic);

/// The qualities of service of a topic's writers.
Qos writer_qos(Topic topic, double liveliness_s);
/// Those of its readers, which accept writers of any liveliness.
Qos reader_qos(Topic topic);
/// Those of a publisher or subscriber that exchanges with one program only.
Qos partition_qos(const Sender& receiver);

/// A participant's qualities with the keys and plugins of DDS Security. Error: the plugins are not installed.
Result<Qos> secure_qos(const RoomKeys& keys);

}  // namespace limn::nodes
