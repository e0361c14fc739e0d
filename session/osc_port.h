#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/result.h"
#include "session/osc.h"
#include "session/session.h"
#include "session/session_client.h"
#include "session/telemetry.h"
#include "session/udp_socket.h"

namespace limn::apps {

/// A session's ear and mouth for other programs (docs/osc.md), over UDP. Belongs to the session's thread and
/// never waits. What it has not heard yet lies in the system's buffer for this socket, which does not grow:
/// when that is full, datagrams are lost.
class OscPort : public SessionClient {
 public:
  /// `hear`: PORT on the loopback, or ADDRESS:PORT; `tell`: HOST:PORT; empty: not. Port 0 to hear: any free
  /// one. Errors name the option.
  static Result<OscPort> open(const std::string& hear, const std::string& tell);

  /// Edits of the messages that wait, at most k_most_at_once of them and for at most 5 ms; the others wait
  /// for the next call. What cannot be done is told, at most once a second, with how many more there were.
  /// `at`: this moment on the session's clock.
  void hear(Session* session, Telemetry* telemetry, Stamp at);
  /// What has changed since it was told last; once a second everything, for datagrams get lost.
  void tell(const Session& session, Stamp at);

  void hear(const SessionMoment& moment) override { hear(&moment.session, &moment.telemetry, moment.at); }
  void tell(const SessionMoment& moment) override { tell(moment.session, moment.at); }

  /// The port that it hears on, 0: none.
  int port() const { return ear_ ? ear_->port() : 0; }

  static constexpr int k_most_at_once = 64;

 private:
  void refuse(const std::string& why, Telemetry* telemetry, Stamp at);
  void put(const std::string& key, const std::string& path, std::vector<OscValue> arguments);

  std::optional<UdpSocket> ear_, mouth_;
  std::optional<Stamp> refused_at_;
  std::size_t untold_ = 0;  // refusals
  std::map<std::string, std::vector<OscValue>> told_;
  std::optional<Stamp> told_all_at_;
};

}  // namespace limn::apps
