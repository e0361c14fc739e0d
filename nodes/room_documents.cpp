#include "nodes/room_documents.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

namespace limn::nodes {
namespace {

constexpr const char* k_domains =
    "<domains><id_range><min>1</min><max>99</max></id_range></domains>";  // room_domain()

std::string grant(const std::string& role,
                  const std::string& subject,
                  const std::string& sent_topics,
                  std::time_t not_before,
                  std::time_t not_after) {
  constexpr const char* k_any_partition = "<partitions><partition>*</partition></partitions>";
  return fmt::format(
      R"(    <grant name="{}">
      <subject_name>{}</subject_name>
      <validity>
        <not_before>{:%Y-%m-%dT%H:%M:%S}</not_before>
        <not_after>{:%Y-%m-%dT%H:%M:%S}</not_after>
      </validity>
      <allow_rule>
        {}
        <publish><topics>{}</topics>{}</publish>
        <subscribe><topics><topic>*</topic></topics>{}</subscribe>
      </allow_rule>
      <default>DENY</default>
    </grant>
)",
      role, subject, fmt::gmtime(not_before), fmt::gmtime(not_after), k_domains, sent_topics, k_any_partition,
      k_any_partition);
}

}  // namespace

std::string governance_document() {
  return fmt::format(
      R"(<?xml version="1.0" encoding="utf-8"?>
<dds xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xsi:noNamespaceSchemaLocation="https://www.omg.org/spec/DDS-SECURITY/20170901/omg_shared_ca_governance.xsd">
  <domain_access_rules>
    <domain_rule>
      {}
      <allow_unauthenticated_participants>false</allow_unauthenticated_participants>
      <enable_join_access_control>true</enable_join_access_control>
      <discovery_protection_kind>ENCRYPT</discovery_protection_kind>
      <liveliness_protection_kind>ENCRYPT</liveliness_protection_kind>
      <rtps_protection_kind>ENCRYPT</rtps_protection_kind>
      <topic_access_rules>
        <topic_rule>
          <topic_expression>*</topic_expression>
          <enable_discovery_protection>true</enable_discovery_protection>
          <enable_liveliness_protection>true</enable_liveliness_protection>
          <enable_read_access_control>true</enable_read_access_control>
          <enable_write_access_control>true</enable_write_access_control>
          <metadata_protection_kind>NONE</metadata_protection_kind>
          <data_protection_kind>ENCRYPT</data_protection_kind>
        </topic_rule>
      </topic_access_rules>
    </domain_rule>
  </domain_access_rules>
</dds>
)",
      k_domains);
}

std::string permissions_document(const RoomSubjects& subjects,
                                 std::time_t not_before,
                                 std::time_t not_after) {
  std::string of_nodes;
  for (const char* topic : {"offer", "clock_request", "clock_answer", "answer", "health", "detections"})
    of_nodes += fmt::format("<topic>limn_v1_{}</topic>", topic);
  return fmt::format(
      R"(<?xml version="1.0" encoding="utf-8"?>
<dds xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xsi:noNamespaceSchemaLocation="https://www.omg.org/spec/DDS-SECURITY/20170901/omg_shared_ca_permissions.xsd">
  <permissions>
{}{}  </permissions>
</dds>
)",
      grant("host", subjects.host, "<topic>*</topic>", not_before, not_after),
      grant("node", subjects.node, of_nodes, not_before, not_after));
}

}  // namespace limn::nodes
