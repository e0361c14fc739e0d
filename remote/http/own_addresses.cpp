#include "remote/http/own_addresses.h"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <netinet/in.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <memory>

#include "device/udp_socket.h"

namespace limn::remote {
namespace {

struct FreeInterfaces {
  void operator()(ifaddrs* all) const { freeifaddrs(all); }
};

std::string text_of(const sockaddr& address) {
  std::array<char, INET6_ADDRSTRLEN> text{};
  const void* bytes =
      address.sa_family == AF_INET
          ? static_cast<const void*>(&reinterpret_cast<const sockaddr_in&>(address).sin_addr)
          : static_cast<const void*>(&reinterpret_cast<const sockaddr_in6&>(address).sin6_addr);
  return inet_ntop(address.sa_family, bytes, text.data(), text.size()) ? text.data() : "";
}

bool is_link_local(const std::string& address) {
  return address.rfind("169.254.", 0) == 0 || address.rfind("fe80:", 0) == 0;
}

}  // namespace

bool is_unspecified(const std::string& address) {
  in_addr four{};
  in6_addr six{};
  if (inet_pton(AF_INET, address.c_str(), &four) == 1) return four.s_addr == INADDR_ANY;
  return inet_pton(AF_INET6, address.c_str(), &six) == 1 && IN6_IS_ADDR_UNSPECIFIED(&six);
}

std::vector<std::string> own_addresses_with_link_local() {
  ifaddrs* found = nullptr;
  if (getifaddrs(&found) != 0) return {};
  const std::unique_ptr<ifaddrs, FreeInterfaces> all(found);
  std::vector<std::string> out;
  for (const ifaddrs* at = all.get(); at; at = at->ifa_next) {
    if (!at->ifa_addr || (at->ifa_addr->sa_family != AF_INET && at->ifa_addr->sa_family != AF_INET6))
      continue;
    const std::string address = text_of(*at->ifa_addr);
    if (address.empty() || device::is_loopback(address)) continue;
    if (std::find(out.begin(), out.end(), address) == out.end()) out.push_back(address);
  }
  std::stable_partition(out.begin(), out.end(),
                        [](const std::string& address) { return address.find(':') == std::string::npos; });
  std::stable_partition(out.begin(), out.end(),
                        [](const std::string& address) { return !is_link_local(address); });
  return out;
}

std::vector<std::string> own_addresses() {
  std::vector<std::string> out = own_addresses_with_link_local();
  std::erase_if(out, is_link_local);
  return out;
}

std::string own_host_name() {
  std::array<char, 256> name{};
  return gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "";
}

}  // namespace limn::remote
