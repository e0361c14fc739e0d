#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/result.h"
#include "device/udp_socket.h"
#include "session/requests/osc.h"
#include "session/session.h"
#include "session/session_client.h"
#include "session/telemetry.h"

namespace limn::session {

/// Receives edits from other programs and sends them the session's state, by OSC over UDP (docs/osc.md).
/// Belongs to the session's thread and never waits. Datagrams that were not read yet are in the system's
/// buffer for the socket, which does not grow: when it is full, datagrams are lost.
class OscPort : public SessionClient {
 public:
  /// `receive_at`: PORT on the loopback interface, or ADDRESS:PORT; port 0: any free one. `send_to`:
  /// HOST:PORT. An empty text: receives or sends nothing. `from`: the only address whose messages are
  /// accepted; empty: all are, and a warning says so if other machines can reach the port. Errors name the
  /// option.
  static Result<OscPort> open(const std::string& receive_at,
                              const std::string& send_to,
                              const std::string& from = "");

  /// Applies the edits of the messages that wait, at most k_most_at_once of them and for at most 5 ms; the
  /// others wait for the next call. Refused messages are reported at most once a second, with the number of
  /// further ones. `at`: the session's present time.
  void apply_edits(Session* session, Telemetry* telemetry, Stamp at);
  /// Sends what has changed since it was last sent; once a second it sends everything, because datagrams get
  /// lost.
  void publish_state(const Session& session, Stamp at);

  void apply_edits(const SessionMoment& moment) override {
    apply_edits(&moment.session, &moment.telemetry, moment.at);
  }
  void publish_state(const SessionMoment& moment) override { publish_state(moment.session, moment.at); }

  /// The port on which it receives; 0: none.
  int port() const { return input_ ? input_->port() : 0; }

  static constexpr int k_most_at_once = 64;

 private:
  void refuse(const std::string& why, Telemetry* telemetry, Stamp at);
  void put(const std::string& key, const std::string& path, std::vector<OscValue> arguments);

  std::optional<device::UdpSocket> input_, output_;
  std::string from_;  // the only accepted sender; empty: all
  std::optional<Stamp> refused_at_;
  std::size_t unreported_ = 0;  // refusals that were not reported yet
  std::map<std::string, std::vector<OscValue>> sent_;
  std::optional<Stamp> sent_all_at_;
};

}  // namespace limn::session
