// A program on the network of a room that has no keys: room_stranger ROOM WHAT SECONDS
//
//   visit    takes part in the room's DDS domain without security: reads all topics of the room and writes
//   offers and
//            moments; prints how many readers and writers it was connected to and how many samples it got
//   flood    sends 10 000 datagrams a second to the ports of the room's domain: what it has received from the
//   room, as it
//            was and with changed bytes, and random bytes; prints how many it has sent and received

#include <arpa/inet.h>
#include <dds/dds.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "core/frame.h"
#include "limn_room.h"
#include "nodes/room_keys.h"

namespace limn {
namespace {

struct Topics {
  const dds_topic_descriptor_t* type;
  const char* name;
};
constexpr std::array<Topics, 4> k_topics = {{{&limn_v1_Offer_desc, "limn_v1_offer"},
                                             {&limn_v1_Moment_desc, "limn_v1_moment"},
                                             {&limn_v1_Setup_desc, "limn_v1_setup"},
                                             {&limn_v1_Health_desc, "limn_v1_health"}}};

int visit(const std::string& room, double seconds) {
  const auto domain = static_cast<dds_domainid_t>(nodes::room_domain(room));
  const std::string config =
      "<CycloneDDS><Domain Id=\"any\"><General><Interfaces><NetworkInterface name=\"lo\" multicast=\"true\"/>"
      "</Interfaces></General><Discovery><Tag>limn " +
      room + "</Tag></Discovery></Domain></CycloneDDS>";
  if (dds_create_domain(domain, config.c_str()) < 0) return 1;
  const dds_entity_t participant = dds_create_participant(domain, nullptr, nullptr);
  std::vector<dds_entity_t> readers, writers;
  for (const auto& [type, name] : k_topics) {
    const dds_entity_t topic = dds_create_topic(participant, type, name, nullptr, nullptr);
    dds_qos_t* qos = dds_create_qos();
    dds_qset_ignorelocal(qos, DDS_IGNORELOCAL_PARTICIPANT);
    readers.push_back(dds_create_reader(participant, topic, qos, nullptr));
    dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_MSECS(10));
    dds_qset_durability(qos, DDS_DURABILITY_TRANSIENT_LOCAL);
    writers.push_back(dds_create_writer(participant, topic, qos, nullptr));
    dds_delete_qos(qos);
  }
  std::string node = "stranger", none;
  limn_v1_Offer offer{};
  offer.node = node.data();
  offer.is_host = true;
  offer.version = offer.renderer = offer.fingerprint = none.data();
  limn_v1_Moment moment{};
  moment.node = node.data();
  moment.viewer.name = moment.viewer.lens.model = none.data();
  int samples = 0, connections = 0;
  for (const Stamp end = shifted(now(), seconds); now() < end;) {
    dds_write(writers[0], &offer);
    dds_write(writers[1], &moment);
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    connections = 0;
    for (std::size_t i = 0; i < k_topics.size(); ++i) {
      std::array<void*, 16> taken{};
      std::array<dds_sample_info_t, 16> infos{};
      const dds_return_t count = dds_take(readers[i], taken.data(), infos.data(), 16, 16);
      samples += std::max(count, 0);
      dds_return_loan(readers[i], taken.data(), count);
      connections += std::max(0, dds_get_matched_publications(readers[i], nullptr, 0));
      connections += std::max(0, dds_get_matched_subscriptions(writers[i], nullptr, 0));
    }
  }
  std::printf("%d connections, %d samples\n", connections, samples);
  return 0;
}

sockaddr_in address_of(const char* host, int port) {
  sockaddr_in out{};
  out.sin_family = AF_INET;
  out.sin_port = htons(static_cast<std::uint16_t>(port));
  ::inet_pton(AF_INET, host, &out.sin_addr);
  return out;
}

// A socket that receives what the room sends to all.
int listening(int port) {
  const int handle = ::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0), yes = 1;
  ::setsockopt(handle, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  const sockaddr_in at = address_of("0.0.0.0", port);
  ::bind(handle, reinterpret_cast<const sockaddr*>(&at), sizeof at);
  ip_mreq group{};
  ::inet_pton(AF_INET, "239.255.0.1", &group.imr_multiaddr);
  ::inet_pton(AF_INET, "127.0.0.1", &group.imr_interface);
  ::setsockopt(handle, IPPROTO_IP, IP_ADD_MEMBERSHIP, &group, sizeof group);
  return handle;
}

int flood(const std::string& room, double seconds) {
  constexpr double k_per_second = 10000;
  std::mt19937_64 random(1);
  const int base = 7400 + 250 * nodes::room_domain(room);
  const std::array<int, 2> inputs = {listening(base), listening(base + 1)};
  const int output = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  const sockaddr_in self = address_of("127.0.0.1", 0);
  ::setsockopt(output, IPPROTO_IP, IP_MULTICAST_IF, &self.sin_addr, sizeof self.sin_addr);
  std::vector<sockaddr_in> targets = {address_of("239.255.0.1", base), address_of("239.255.0.1", base + 1)};
  for (int i = 10; i < 16; ++i) targets.push_back(address_of("127.0.0.1", base + i));
  std::vector<std::string> known;
  std::array<char, 65536> buffer{};
  long sent = 0;
  std::size_t received = 0;
  for (const Stamp begin = now(); seconds_between(begin, now()) < seconds;) {
    for (const int input : inputs)
      for (ssize_t length = 0; (length = ::recv(input, buffer.data(), buffer.size(), 0)) > 0;) {
        ++received;
        if (known.size() < 1000)
          known.emplace_back(buffer.data(), static_cast<std::size_t>(length));
        else
          known[random() % known.size()].assign(buffer.data(), static_cast<std::size_t>(length));
      }
    for (; static_cast<double>(sent) < k_per_second * seconds_between(begin, now()); ++sent) {
      std::string bytes = known.empty() || sent % 3 == 2 ? "RTPS\x02\x05" + std::string(200, '\0')
                                                         : known[random() % known.size()];
      if (sent % 3 == 1) bytes[20 + random() % (bytes.size() - 20)] ^= static_cast<char>(1 + random() % 255);
      if (sent % 3 == 2)
        for (std::size_t i = 6; i < bytes.size(); ++i) bytes[i] = static_cast<char>(random());
      const sockaddr_in& to = targets[random() % targets.size()];
      ::sendto(output, bytes.data(), bytes.size(), 0, reinterpret_cast<const sockaddr*>(&to), sizeof to);
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  std::printf("%ld sent, %zu received\n", sent, received);
  return 0;
}

}  // namespace
}  // namespace limn

int main(int count, char** words) {
  if (count != 4) return 2;
  const std::string what = words[2];
  return what == "visit" ? limn::visit(words[1], std::atof(words[3]))
                         : limn::flood(words[1], std::atof(words[3]));
}
