#pragma once

#include <ctime>
#include <string>

namespace limn::nodes {

/// The subjects of a room's two certificates, as RFC 2253 writes them.
struct RoomSubjects {
  std::string host, node;
};

/// The governance document of a room (DDS Security 1.1, 9.4.1.2): nobody without keys, everything encrypted.
std::string governance_document();

/// The permissions document of a room (DDS Security 1.1, 9.4.1.3): both roles may receive everything; a host
/// may send everything, a node everything but Setup, Moment, ScreenImage and Order.
std::string permissions_document(const RoomSubjects& subjects, std::time_t not_before, std::time_t not_after);

}  // namespace limn::nodes
