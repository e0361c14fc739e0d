// A program on the network of a room that has no keys: room_stranger ROOM WHAT SECONDS
//
//   visit    takes part in the room's DDS domain without security: reads all topics of the room and writes
//   offers and
//            moments; prints how many readers and writers it was connected to and how many samples it got
//   flood    sends 10 000 datagrams a second to the ports of the room's domain: what it has received from the
//   room, as it
//            was and with changed bytes, and random bytes; prints how many it has sent and received
//   crowd    as flood, but each datagram announces another participant that claims to have keys

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
  if (::bind(handle, reinterpret_cast<const sockaddr*>(&at), sizeof at) != 0) std::abort();
  ip_mreq group{};
  ::inet_pton(AF_INET, "239.255.0.1", &group.imr_multiaddr);
  ::inet_pton(AF_INET, "127.0.0.1", &group.imr_interface);
  ::setsockopt(handle, IPPROTO_IP, IP_ADD_MEMBERSHIP, &group, sizeof group);
  return handle;
}

// Sends datagrams to all ports of a room.
class Disturbance {
 public:
  Disturbance(const std::string& room, bool is_crowd)
      : is_crowd_(is_crowd),
        base_(7400 + 250 * nodes::room_domain(room)),
        inputs_{listening(base_), listening(base_ + 1)} {
    const sockaddr_in self = address_of("127.0.0.1", 0);
    ::setsockopt(output_, IPPROTO_IP, IP_MULTICAST_IF, &self.sin_addr, sizeof self.sin_addr);
    targets_ = {address_of("239.255.0.1", base_), address_of("239.255.0.1", base_ + 1)};
    for (int i = 10; i < 16; ++i) targets_.push_back(address_of("127.0.0.1", base_ + i));
  }

  void run(double seconds) {
    constexpr double k_per_second = 10000;
    for (const Stamp begin = now(); seconds_between(begin, now()) < seconds;) {
      for (const int input : inputs_) receive_from(input);
      while (static_cast<double>(sent_) < k_per_second * seconds_between(begin, now())) send_one();
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    std::printf("%ld sent, %zu received\n", sent_, received_);
  }

 private:
  void receive_from(int input) {
    constexpr std::size_t k_most = 1000;
    static std::array<char, 65536> buffer;
    for (ssize_t length = 0; (length = ::recv(input, buffer.data(), buffer.size(), 0)) > 0;) {
      ++received_;
      const std::string bytes(buffer.data(), static_cast<std::size_t>(length));
      if (is_crowd_ && !is_announcement(bytes)) continue;
      if (known_.size() < k_most)
        known_.push_back(bytes);
      else
        known_[random_() % k_most] = bytes;
    }
  }

  // Whether a datagram announces a participant: the only one that is not encrypted and names its room.
  static bool is_announcement(const std::string& bytes) {
    return bytes.size() > 40 && bytes.starts_with("RTPS") && bytes.find("limn ") != std::string::npos;
  }

  void send_one() {
    std::string bytes = is_crowd_ ? of_another_participant() : disturbing();
    const sockaddr_in& to = targets_[random_() % (is_crowd_ ? 1 : targets_.size())];
    ::sendto(output_, bytes.data(), bytes.size(), 0, reinterpret_cast<const sockaddr*>(&to), sizeof to);
    ++sent_;
  }

  std::string disturbing() {
    if (known_.empty() || sent_ % 3 == 2) {
      std::string bytes = "RTPS\x02\x05" + std::string(200, '\0');
      for (std::size_t i = 6; i < bytes.size(); ++i) bytes[i] = static_cast<char>(random_());
      return bytes;
    }
    std::string bytes = known_[random_() % known_.size()];
    if (sent_ % 3 == 1) bytes[20 + random_() % (bytes.size() - 20)] = static_cast<char>(random_());
    return bytes;
  }

  std::string of_another_participant() {
    constexpr std::size_t k_prefix = 12, k_at = 8;  // of a GUID; where the header has it
    if (known_.empty()) return "RTPS";
    std::string bytes = known_[random_() % known_.size()];
    const std::string before = bytes.substr(k_at, k_prefix);
    std::string after = before;
    for (char& byte : after) byte = static_cast<char>(random_());
    for (std::size_t at = 0; (at = bytes.find(before, at)) != std::string::npos; at += k_prefix)
      bytes.replace(at, k_prefix, after);
    return bytes;
  }

  const bool is_crowd_;
  const int base_;
  std::mt19937_64 random_{1};
  std::array<int, 2> inputs_;
  int output_ = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  std::vector<sockaddr_in> targets_;
  std::vector<std::string> known_;
  long sent_ = 0;
  std::size_t received_ = 0;
};

}  // namespace
}  // namespace limn

int main(int count, char** words) {
  if (count != 4) return 2;
  const std::string what = words[2];
  const double seconds = std::atof(words[3]);
  if (what == "visit") return limn::visit(words[1], seconds);
  limn::Disturbance(words[1], what == "crowd").run(seconds);
  return 0;
}
