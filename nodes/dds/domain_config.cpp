#include "nodes/dds/domain_config.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netdb.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <map>
#include <memory>
#include <vector>

namespace limn::nodes {
namespace {

// A whole datagram with its encryption fits into an Ethernet packet of 1500 bytes, so that no datagram is
// divided: a divided one is lost with any of its parts, and strangers can disturb its assembly.
constexpr int k_datagram_bytes = 1400, k_fragment_bytes = 1152;
constexpr const char* k_receive_buffer = "8MiB";  // asked for; the kernel limits it to net.core.rmem_max
// How much a writer keeps that its receivers have not confirmed, before it waits. It does not shrink, because
// a setup must not wait for a machine that was switched off.
constexpr const char* k_unconfirmed = "8MiB";
constexpr std::size_t k_most_interfaces = 4;  // MAX_XMIT_CONNS of Cyclone DDS
constexpr int k_last_participant = 60;        // programs on one machine; the domain has ports for 119
constexpr int k_peer_participants = 4;        // among them, those that machines without multicast find
// Ports of a participant (DDSI-RTPS 2.5, 9.6.2).
constexpr int k_port_base = 7400, k_domain_gain = 250, k_participant_gain = 2, k_unicast_offset = 10;

enum class Family { v4 = AF_INET, v6 = AF_INET6 };

struct Interface {
  bool is_up = false, is_loopback = false, has_v4 = false, has_v6 = false;
  bool has(Family family) const { return family == Family::v4 ? has_v4 : has_v6; }
};
using Interfaces = std::map<std::string, Interface>;

Interfaces own_interfaces() {
  Interfaces out;
  ifaddrs* found = nullptr;
  if (::getifaddrs(&found) != 0) return out;
  const std::unique_ptr<ifaddrs, decltype(&::freeifaddrs)> owner(found, &::freeifaddrs);
  for (const ifaddrs* at = found; at; at = at->ifa_next) {
    if (!at->ifa_addr) continue;
    Interface& entry = out[at->ifa_name];
    entry.is_up = (at->ifa_flags & IFF_UP) != 0 && (at->ifa_flags & IFF_RUNNING) != 0;
    entry.is_loopback = (at->ifa_flags & IFF_LOOPBACK) != 0;
    entry.has_v4 |= at->ifa_addr->sa_family == AF_INET;
    entry.has_v6 |= at->ifa_addr->sa_family == AF_INET6;
  }
  return out;
}

struct PeerAddresses {
  std::string v4, v6;  // numeric; empty: none
};

Result<PeerAddresses> peer_addresses(const std::string& peer) {
  addrinfo hints{};
  hints.ai_socktype = SOCK_DGRAM;
  addrinfo* found = nullptr;
  if (const int code = ::getaddrinfo(peer.c_str(), nullptr, &hints, &found); code != 0)
    return error(
        "peer '{}': expected a machine's name or address, found: {}. Check its spelling and the network.",
        peer, ::gai_strerror(code));
  const std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> owner(found, &::freeaddrinfo);
  PeerAddresses out;
  for (const addrinfo* at = found; at; at = at->ai_next) {
    std::array<char, NI_MAXHOST> text{};
    if (::getnameinfo(at->ai_addr, at->ai_addrlen, text.data(), text.size(), nullptr, 0, NI_NUMERICHOST) != 0)
      continue;
    std::string& address = at->ai_family == AF_INET ? out.v4 : out.v6;
    if (address.empty()) address = text.data();
  }
  return out;
}

// The interfaces that people name, else all that are up, without the loopback.
Result<std::vector<std::string>> used_interfaces(const EngineOptions& options, const Interfaces& own) {
  std::string names;
  for (const auto& entry : own) names += (names.empty() ? "" : ", ") + entry.first;
  for (const std::string& name : options.interfaces)
    if (!own.contains(name))
      return error(
          "interface '{}': expected one of this machine's ({}), found none of this name. Choose one of them.",
          name, names);
  std::vector<std::string> used = options.interfaces;
  if (used.empty())
    for (const auto& entry : own)
      if (entry.second.is_up && !entry.second.is_loopback && (entry.second.has_v4 || entry.second.has_v6))
        used.push_back(entry.first);
  if (used.empty())
    return error(
        "room: expected a network interface that is up, found none ({}). Plug in the cable, or name "
        "interface lo for "
        "programs on this machine alone.",
        names);
  used.resize(std::min(used.size(), k_most_interfaces));
  return used;
}

Result<Family> used_family(const std::vector<PeerAddresses>& peers,
                           const std::vector<std::string>& interfaces,
                           const Interfaces& own) {
  const auto all_have = [&](Family family) {
    return std::all_of(peers.begin(), peers.end(), [family](const PeerAddresses& peer) {
      return !(family == Family::v4 ? peer.v4 : peer.v6).empty();
    });
  };
  const auto any_has = [&](Family family) {
    return std::any_of(interfaces.begin(), interfaces.end(),
                       [&](const std::string& name) { return own.at(name).has(family); });
  };
  for (const Family family : {Family::v4, Family::v6})
    if (all_have(family) && any_has(family)) return family;
  return error(
      "room: expected IPv4 addresses of all peers and of an interface, or IPv6 addresses, found neither. "
      "Give the "
      "peers addresses of one kind, which this machine has, too.");
}

std::string interface_lines(const std::vector<std::string>& used, Family family, const Interfaces& own) {
  std::string lines;
  for (const std::string& name : used)
    if (own.at(name).has(family))
      lines += fmt::format("<NetworkInterface name=\"{}\"{}/>", name,
                           own.at(name).is_loopback ? " multicast=\"true\"" : "");
  return lines;
}

std::string peer_lines(const std::vector<PeerAddresses>& peers, Family family, int domain) {
  std::string lines;
  for (const PeerAddresses& peer : peers)
    for (int i = 0; i < k_peer_participants; ++i) {
      const int port = k_port_base + k_domain_gain * domain + k_unicast_offset + k_participant_gain * i;
      lines += family == Family::v4 ? fmt::format("<Peer Address=\"{}:{}\"/>", peer.v4, port)
                                    : fmt::format("<Peer Address=\"[{}]:{}\"/>", peer.v6, port);
    }
  return lines.empty() ? "" : "<Peers>" + lines + "</Peers>";
}

}  // namespace

Result<std::string> domain_config(const EngineOptions& options) {
  constexpr double k_announcement_s = 0.5;  // a machine that comes is found within this time
  const Interfaces own = own_interfaces();
  LIMN_TRY(const std::vector<std::string> used, used_interfaces(options, own));
  std::vector<PeerAddresses> peers;
  for (const std::string& peer : options.peers) {
    LIMN_TRY(PeerAddresses addresses, peer_addresses(peer));
    peers.push_back(std::move(addresses));
  }
  LIMN_TRY(const Family family, used_family(peers, used, own));
  return fmt::format(
      "<CycloneDDS><Domain Id=\"any\"><General><Transport>{}</Transport><AllowMulticast>{}</AllowMulticast>"
      "<MaxMessageSize>{}B</MaxMessageSize><MaxRexmitMessageSize>{}B</MaxRexmitMessageSize>"
      "<FragmentSize>{}B</FragmentSize><Interfaces>{}</Interfaces></General>"
      "<Discovery><Tag>limn "
      "{}</Tag><SPDPInterval>{:.0f}ms</SPDPInterval><LeaseDuration>{:.0f}ms</LeaseDuration>"
      "<ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>{}</MaxAutoParticipantIndex>{}</"
      "Discovery>"
      "<Internal><SocketReceiveBufferSize max=\"{}\"/>"
      "<SynchronousDeliveryPriorityThreshold>1</SynchronousDeliveryPriorityThreshold>"
      "<Watermarks><WhcHigh>{}</WhcHigh><WhcHighInit>{}</WhcHighInit><WhcAdaptive>false</WhcAdaptive></"
      "Watermarks>"
      "</Internal>"
      "</Domain></CycloneDDS>",
      family == Family::v4 ? "udp" : "udp6", peers.empty() ? "default" : "false", k_datagram_bytes,
      k_datagram_bytes, k_fragment_bytes, interface_lines(used, family, own), options.keys.name,
      k_announcement_s * 1000, k_memory_s * 1000, k_last_participant,
      peer_lines(peers, family, options.domain), k_receive_buffer, k_unconfirmed, k_unconfirmed);
}

}  // namespace limn::nodes
