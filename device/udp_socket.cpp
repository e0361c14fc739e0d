#include "device/udp_socket.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <ctime>
#include <memory>
#include <string_view>
#include <utility>

namespace limn::device {
namespace {

constexpr std::string_view k_ipv4_as_ipv6 = "::ffff:";

struct FreeAddresses {
  void operator()(addrinfo* all) const { freeaddrinfo(all); }
};
using Addresses = std::unique_ptr<addrinfo, FreeAddresses>;

Result<Addresses> addresses_of(const NetPlace& place, int flags) {
  addrinfo wanted = {};
  wanted.ai_family = AF_UNSPEC;
  wanted.ai_socktype = SOCK_DGRAM;
  wanted.ai_flags = flags | AI_NUMERICSERV;
  addrinfo* found = nullptr;
  if (const int problem = getaddrinfo(place.host.c_str(), place.port.c_str(), &wanted, &found); problem != 0)
    return error("{}: expected {}, found: {}.", place.host,
                 flags & AI_NUMERICHOST ? "a numeric address" : "a host with an address",
                 gai_strerror(problem));
  return Addresses(found);
}

int open_for(const addrinfo& address) {
  const int handle = socket(address.ai_family, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  const int yes = 1;
  if (handle < 0) return handle;
  setsockopt(handle, SOL_SOCKET, SO_BROADCAST, &yes, sizeof yes);
  setsockopt(handle, SOL_SOCKET, SO_TIMESTAMPNS, &yes, sizeof yes);
  return handle;
}

bool is_multicast(const addrinfo& address) {
  return address.ai_family == AF_INET &&
         IN_MULTICAST(ntohl(reinterpret_cast<const sockaddr_in*>(address.ai_addr)->sin_addr.s_addr));
}

// Joins the group on the interface that the system chooses, and lets other programs use its port.
bool join(int handle, const addrinfo& address) {
  const int yes = 1;
  ip_mreq group = {};
  group.imr_multiaddr = reinterpret_cast<const sockaddr_in*>(address.ai_addr)->sin_addr;
  return setsockopt(handle, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes) == 0 &&
         setsockopt(handle, IPPROTO_IP, IP_ADD_MEMBERSHIP, &group, sizeof group) == 0;
}

// Seconds since the system received the datagram; 0 where it does not say so.
double age_of(const msghdr& message) {
  for (const cmsghdr* part = CMSG_FIRSTHDR(&message); part;
       part = CMSG_NXTHDR(const_cast<msghdr*>(&message), const_cast<cmsghdr*>(part))) {
    if (part->cmsg_level != SOL_SOCKET || part->cmsg_type != SCM_TIMESTAMPNS) continue;
    timespec received = {}, now = {};
    std::memcpy(&received, CMSG_DATA(part), sizeof received);
    clock_gettime(CLOCK_REALTIME, &now);
    return std::max(0.0, static_cast<double>(now.tv_sec - received.tv_sec) +
                             1e-9 * static_cast<double>(now.tv_nsec - received.tv_nsec));
  }
  return 0;
}

}  // namespace

Result<NetPlace> net_place(const std::string& text, const std::string& default_host, bool or_any) {
  NetPlace place{default_host, text};
  if (const auto colon = text.rfind(':'); colon != std::string::npos) {
    place = {text.substr(0, colon), text.substr(colon + 1)};
    if (place.host.size() > 2 && place.host.front() == '[' && place.host.back() == ']')
      place.host = place.host.substr(1, place.host.size() - 2);
  }
  int port = -1;
  const char* end = place.port.data() + place.port.size();
  const auto [at, problem] = std::from_chars(place.port.data(), end, port);
  if (problem != std::errc() || at != end || port < (or_any ? 0 : 1) || port > 65535)
    return usage_error("expected a port from 1 to 65535, found '{}' in '{}'.", place.port, text);
  if (place.host.empty())
    return usage_error("expected an address before the port, found none in '{}'.", text);
  return place;
}

std::optional<std::string> numeric_address(const std::string& text) {
  for (const int family : {AF_INET, AF_INET6}) {
    in6_addr address{};
    char usual[INET6_ADDRSTRLEN] = "";
    if (inet_pton(family, text.c_str(), &address) == 1 && inet_ntop(family, &address, usual, sizeof usual))
      return usual;
  }
  return std::nullopt;
}

bool is_loopback(const std::string& address) {
  in_addr four{};
  in6_addr six{};
  if (inet_pton(AF_INET, address.c_str(), &four) == 1) return ntohl(four.s_addr) >> 24 == 127;
  return inet_pton(AF_INET6, address.c_str(), &six) == 1 && IN6_IS_ADDR_LOOPBACK(&six);
}

Result<UdpSocket> UdpSocket::receiving(const NetPlace& place) {
  LIMN_TRY(const Addresses addresses, addresses_of(place, AI_NUMERICHOST | AI_PASSIVE));
  UdpSocket out(open_for(*addresses));
  if (out.handle_ >= 0 && is_multicast(*addresses) && !join(out.handle_, *addresses))
    return error(
        "{}:{}: expected a multicast group that this machine can join, found: {}. Check its network.",
        place.host, place.port, std::strerror(errno));
  if (out.handle_ < 0 || bind(out.handle_, addresses->ai_addr, addresses->ai_addrlen) != 0)
    return error("{}:{}: expected a free port at an address of this machine, found: {}. Take another port.",
                 place.host, place.port, std::strerror(errno));
  return out;
}

Result<UdpSocket> UdpSocket::sending(const NetPlace& place) {
  LIMN_TRY(const Addresses addresses, addresses_of(place, 0));
  UdpSocket out(open_for(*addresses));
  if (out.handle_ < 0 || connect(out.handle_, addresses->ai_addr, addresses->ai_addrlen) != 0)
    return error("{}:{}: expected a host that can be reached, found: {}.", place.host, place.port,
                 std::strerror(errno));
  return out;
}

UdpSocket::UdpSocket(UdpSocket&& other) noexcept : handle_(std::exchange(other.handle_, -1)) {}
UdpSocket& UdpSocket::operator=(UdpSocket&& other) noexcept {
  std::swap(handle_, other.handle_);
  return *this;
}
UdpSocket::~UdpSocket() {
  if (handle_ >= 0) close(handle_);
}

std::optional<Datagram> UdpSocket::next(std::span<std::uint8_t> bytes) {
  sockaddr_storage sender = {};
  alignas(cmsghdr) char control[CMSG_SPACE(sizeof(timespec))] = {};
  iovec buffer = {bytes.data(), bytes.size()};
  msghdr message = {};
  message.msg_name = &sender;
  message.msg_namelen = sizeof sender;
  message.msg_iov = &buffer;
  message.msg_iovlen = 1;
  message.msg_control = control;
  message.msg_controllen = sizeof control;
  const ssize_t length = recvmsg(handle_, &message, MSG_TRUNC);
  if (length < 0) return std::nullopt;
  const auto* const address = reinterpret_cast<const sockaddr*>(&sender);
  char host[NI_MAXHOST] = "";
  static_cast<void>(getnameinfo(address, message.msg_namelen, host, sizeof host, nullptr, 0, NI_NUMERICHOST));
  const std::string_view from = host;
  return Datagram{static_cast<std::size_t>(length),
                  std::string(from.starts_with(k_ipv4_as_ipv6) ? from.substr(k_ipv4_as_ipv6.size()) : from),
                  age_of(message)};
}

void UdpSocket::send(std::span<const std::uint8_t> bytes) {
  // An error here belongs to the previous datagram (nobody received it): this one is sent again.
  if (::send(handle_, bytes.data(), bytes.size(), MSG_NOSIGNAL) < 0 && errno == ECONNREFUSED)
    static_cast<void>(::send(handle_, bytes.data(), bytes.size(), MSG_NOSIGNAL));
}

int UdpSocket::port() const {
  sockaddr_storage address = {};
  socklen_t length = sizeof address;
  if (getsockname(handle_, reinterpret_cast<sockaddr*>(&address), &length) != 0) return 0;
  return ntohs(address.ss_family == AF_INET6 ? reinterpret_cast<const sockaddr_in6&>(address).sin6_port
                                             : reinterpret_cast<const sockaddr_in&>(address).sin_port);
}

}  // namespace limn::device
