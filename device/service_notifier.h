#pragma once

#include <string>

namespace limn::device {

/// Messages to the service manager that has started the program (sd_notify(3) of systemd): one datagram each,
/// to the socket that NOTIFY_SOCKET names. libsystemd is not used: its own manual shows these lines for
/// programs that need no more, and loading it would lengthen the start of every command.
class ServiceNotifier {
 public:
  /// Reads NOTIFY_SOCKET and WATCHDOG_USEC. Without a service manager nothing is sent.
  static ServiceNotifier from_environment();

  ServiceNotifier(ServiceNotifier&& other) noexcept;
  ServiceNotifier& operator=(ServiceNotifier&&) = delete;
  ~ServiceNotifier();

  /// Whether a service manager listens.
  bool is_open() const { return socket_ >= 0; }
  /// The time after which the manager ends a program that sends no WATCHDOG=1, in seconds; 0: never.
  double watchdog_s() const { return watchdog_s_; }

  /// Sends lines of KEY=VALUE without waiting. False: the message was not sent, for example because the
  /// manager reads more slowly than programs write; it can be tried again. Without a service manager true.
  bool send(const std::string& lines) const;
  /// As send(), and tries again for up to `limit_s` seconds.
  bool send_within(double limit_s, const std::string& lines) const;

 private:
  ServiceNotifier(int socket, std::string address, double watchdog_s)
      : socket_(socket), address_(std::move(address)), watchdog_s_(watchdog_s) {}

  int socket_ = -1;
  std::string address_;  // the socket's name; a zero first for an abstract one
  double watchdog_s_ = 0;
};

}  // namespace limn::device
