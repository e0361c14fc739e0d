#include "device/socket.h"

#include <fcntl.h>
#include <netdb.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <memory>
#include <utility>

#include "device/wall_clock.h"

namespace limn::device {
namespace {

constexpr double k_oldest_stamp_s = 10;

int milliseconds_until(Stamp deadline) {
  const double seconds = seconds_between(std::chrono::steady_clock::now(), deadline);
  return std::clamp(static_cast<int>(seconds * 1000) + 1, 0, 600'000);
}

bool wait_for(int fd, short events, Stamp deadline) {
  pollfd wanted{fd, events, 0};
  for (;;) {
    const int ready =
        poll(&wanted, 1, std::chrono::steady_clock::now() < deadline ? milliseconds_until(deadline) : 0);
    if (ready >= 0 || errno != EINTR) return ready > 0;
  }
}

// The kernel's arrival time, converted from the wall clock to the monotonic clock.
Stamp arrival(msghdr* message) {
  for (cmsghdr* item = CMSG_FIRSTHDR(message); item; item = CMSG_NXTHDR(message, item)) {
    if (item->cmsg_level != SOL_SOCKET || item->cmsg_type != SCM_TIMESTAMPNS) continue;
    timespec stamp{};
    std::memcpy(&stamp, CMSG_DATA(item), sizeof(stamp));
    return from_wall_clock(std::chrono::seconds(stamp.tv_sec) + std::chrono::nanoseconds(stamp.tv_nsec),
                           k_oldest_stamp_s);
  }
  return now();
}

// Waits for the result of a connect() that was begun; returns 0 or the errno.
int finished_connecting(int fd, Stamp deadline) {
  if (!wait_for(fd, POLLOUT, deadline)) return ETIMEDOUT;
  int problem = 0;
  socklen_t size = sizeof(problem);
  getsockopt(fd, SOL_SOCKET, SO_ERROR, &problem, &size);
  return problem;
}

}  // namespace

Result<Socket> Socket::connect(const std::string& host, const std::string& port, Stamp deadline) {
  addrinfo wanted{};
  wanted.ai_socktype = SOCK_STREAM;
  addrinfo* list = nullptr;
  if (const int problem = getaddrinfo(host.c_str(), port.c_str(), &wanted, &list); problem != 0)
    return limn::error("the host {} is unknown ({}). Check its name and the network.", host,
                       gai_strerror(problem));
  const std::unique_ptr<addrinfo, void (*)(addrinfo*)> addresses(list, freeaddrinfo);
  int problem = EADDRNOTAVAIL;
  for (const addrinfo* address = list; address; address = address->ai_next) {
    Socket candidate(socket(address->ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    if (candidate.fd_ < 0) continue;
    problem = ::connect(candidate.fd_, address->ai_addr, address->ai_addrlen) == 0 ? 0 : errno;
    if (problem == EINPROGRESS) problem = finished_connecting(candidate.fd_, deadline);
    if (problem != 0) continue;
    const int on = 1;
    setsockopt(candidate.fd_, SOL_SOCKET, SO_TIMESTAMPNS, &on,
               sizeof(on));  // if it fails, arrival times are those of reading
    return candidate;
  }
  return limn::error("{}:{} does not answer ({}). Check that it is switched on and on this network.", host,
                     port, std::strerror(problem));
}

Socket::Socket(Socket&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
Socket& Socket::operator=(Socket&& other) noexcept {
  std::swap(fd_, other.fd_);
  return *this;
}
Socket::~Socket() {
  if (fd_ >= 0) close(fd_);
}

Status Socket::send(std::string_view text) {
  // A request is far smaller than a new connection's buffer: it is sent at once, or the other side has
  // closed.
  if (::send(fd_, text.data(), text.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(text.size())) return {};
  return limn::error("the request could not be sent ({}).", std::strerror(errno));
}

Result<Socket::Received> Socket::receive() {
  iovec space{buffer_.data(), buffer_.size()};
  alignas(cmsghdr) std::array<char, 256> control{};
  msghdr message{};
  message.msg_iov = &space;
  message.msg_iovlen = 1;
  message.msg_control = control.data();
  message.msg_controllen = control.size();
  const ssize_t count = recvmsg(fd_, &message, 0);
  if (count > 0) return Received{{buffer_.data(), static_cast<std::size_t>(count)}, arrival(&message)};
  if (count == 0) return limn::error("the server closed the connection.");
  if (errno == EAGAIN || errno == EINTR) return Received{};
  return limn::error("the connection broke ({}).", std::strerror(errno));
}

bool Socket::wait(Stamp deadline) const { return wait_for(fd_, POLLIN, deadline); }

}  // namespace limn::device
