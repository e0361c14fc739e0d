#include "device/service_notifier.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <chrono>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <thread>
#include <utility>

#include "core/frame.h"

namespace limn::device {
namespace {

constexpr auto k_retry = std::chrono::milliseconds(5);

// WATCHDOG_PID, where it is set, says which process the manager means.
double watchdog_of_environment_s() {
  const char* const period_us = std::getenv("WATCHDOG_USEC");
  const char* const process = std::getenv("WATCHDOG_PID");
  if (!period_us || (process && std::atol(process) != getpid())) return 0;
  const double seconds = 1e-6 * std::atof(period_us);
  return seconds > 0 ? seconds : 0;
}

}  // namespace

ServiceNotifier ServiceNotifier::from_environment() {
  const char* const named = std::getenv("NOTIFY_SOCKET");
  std::string address = named ? named : "";
  constexpr std::size_t k_longest = sizeof(sockaddr_un::sun_path) - 1;
  if (address.size() < 2 || address.size() > k_longest || (address[0] != '/' && address[0] != '@'))
    return {-1, "", 0};
  if (address[0] == '@') address[0] = '\0';
  const int descriptor = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  return {descriptor, std::move(address), watchdog_of_environment_s()};
}

ServiceNotifier::ServiceNotifier(ServiceNotifier&& other) noexcept
    : socket_(std::exchange(other.socket_, -1)),
      address_(std::move(other.address_)),
      watchdog_s_(other.watchdog_s_) {}

ServiceNotifier::~ServiceNotifier() {
  if (socket_ >= 0) close(socket_);
}

bool ServiceNotifier::send(const std::string& lines) const {
  if (socket_ < 0) return true;
  sockaddr_un to{};
  to.sun_family = AF_UNIX;
  std::memcpy(to.sun_path, address_.data(), address_.size());
  const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + address_.size());
  return sendto(socket_, lines.data(), lines.size(), MSG_NOSIGNAL, reinterpret_cast<const sockaddr*>(&to),
                size) >= 0;
}

bool ServiceNotifier::send_within(double limit_s, const std::string& lines) const {
  const Stamp until = shifted(now(), limit_s);
  while (!send(lines)) {
    if (now() >= until) return false;
    std::this_thread::sleep_for(k_retry);
  }
  return true;
}

}  // namespace limn::device
