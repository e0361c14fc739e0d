#include "nodes/dds/ros_domain.h"

#include <fmt/format.h>

#include <cstdlib>
#include <map>
#include <mutex>
#include <utility>

namespace limn::nodes {
namespace {

struct Entered {
  dds_entity_t domain = 0, participant = 0;
  int users = 0;
};

// The domains of the program, which Cyclone DDS does not count. They stay for threads that outlive main().
struct AllEntered {
  std::mutex mutex;
  std::map<int, Entered> by_number;
};
AllEntered& all_entered() {
  static auto* const all = new AllEntered;
  return *all;
}

// The kernel limits it to net.core.rmem_max. An image of 6 MB comes at once.
constexpr const char* k_receive_buffer =
    "<CycloneDDS><Domain><Internal><SocketReceiveBufferSize "
    "max=\"32MiB\"/></Internal></Domain></CycloneDDS>,";
constexpr const char* k_local =
    "<CycloneDDS><Domain><General><Interfaces><NetworkInterface "
    "address=\"127.0.0.1\"/></Interfaces></General>"
    "</Domain></CycloneDDS>,";

Result<Entered> entered(const RosNetwork& network) {
  const char* own = std::getenv("CYCLONEDDS_URI");
  const std::string config =
      std::string(k_receive_buffer) + (network.is_local_only ? k_local : "") + (own ? own : "");
  const auto domain = static_cast<dds_domainid_t>(network.domain);
  Entered out;
  out.domain = dds_create_domain(domain, config.c_str());
  if (out.domain == DDS_RETCODE_PRECONDITION_NOT_MET)
    return error(
        "ROS 2: expected domain {} to be free in this program, found the room in it. Use another "
        "ROS_DOMAIN_ID, or a room of another name.",
        network.domain);
  if (out.domain < 0) return ros_failed(fmt::format("domain {}", network.domain), out.domain);
  out.participant = dds_create_participant(domain, nullptr, nullptr);
  if (out.participant >= 0) return out;
  dds_delete(out.domain);
  return ros_failed(fmt::format("domain {}", network.domain), out.participant);
}

}  // namespace

Result<RosDomain> RosDomain::enter(const RosNetwork& network) {
  AllEntered& all = all_entered();
  const std::lock_guard lock(all.mutex);
  auto known = all.by_number.find(network.domain);
  if (known == all.by_number.end()) {
    LIMN_TRY(const Entered made, entered(network));
    known = all.by_number.emplace(network.domain, made).first;
  }
  ++known->second.users;
  RosDomain out;
  out.domain_ = network.domain;
  out.participant_ = known->second.participant;
  return out;
}

RosDomain::RosDomain(RosDomain&& other) noexcept
    : domain_(std::exchange(other.domain_, -1)), participant_(other.participant_) {}

RosDomain& RosDomain::operator=(RosDomain&& other) noexcept {
  std::swap(domain_, other.domain_);
  std::swap(participant_, other.participant_);
  return *this;
}

RosDomain::~RosDomain() {
  if (domain_ < 0) return;
  AllEntered& all = all_entered();
  const std::lock_guard lock(all.mutex);
  const auto known = all.by_number.find(domain_);
  if (--known->second.users > 0) return;
  dds_delete(known->second.domain);
  all.by_number.erase(known);
}

Result<dds_entity_t> RosDomain::topic(const std::string& name, const dds_topic_descriptor_t* type) const {
  const dds_entity_t made = dds_create_topic(participant_, type, ("rt" + name).c_str(), nullptr, nullptr);
  if (made < 0) return ros_failed("topic " + name, made);
  return made;
}

Qos ros_qos(int32_t depth) {
  Qos qos(dds_create_qos());
  dds_qset_durability(qos.get(), DDS_DURABILITY_VOLATILE);
  dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, depth);
  const dds_data_representation_id_t xcdr1 = DDS_DATA_REPRESENTATION_XCDR1;
  dds_qset_data_representation(qos.get(), 1, &xcdr1);
  dds_qset_ignorelocal(qos.get(), DDS_IGNORELOCAL_PARTICIPANT);
  return qos;
}

Error ros_failed(const std::string& what, dds_return_t code) {
  return error("ROS 2: {}: expected success, found: {}. Check the network, ROS_DOMAIN_ID and CYCLONEDDS_URI.",
               what, dds_strretcode(code));
}

}  // namespace limn::nodes
