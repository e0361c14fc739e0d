#pragma once

#include <array>
#include <opencv2/core/mat.hpp>
#include <string>

#include "scene/actions.h"
#include "session/device_health.h"
#include "session/session.h"
#include "session/telemetry.h"

namespace limn::apps {

/// What people need who want to use the remote.
struct Invitation {
  std::string url;                    ///< "https://192.168.7.2:8443/"
  std::string fingerprint;            ///< of the certificate, SHA-256; empty without TLS
  std::string authority_fingerprint;  ///< of /limn.crt, likewise
  std::array<std::string, 3> pins;    ///< by Role

  /// The page that pairs by itself: the text of the QR code.
  std::string url_for(scene::Role role) const {
    return url + "#pin=" + pins[static_cast<std::size_t>(role)];
  }
};

/// What a session's loop and its operator's window use of the remote. remote/server.h implements it; the
/// session knows no network. All calls belong to the session's thread and never wait.
class RemoteLink {
 public:
  virtual ~RemoteLink() = default;

  /// Sets the viewpoints of guests' tablets and does what guests ask for: some edits a call, the others wait
  /// for the next one. A guest whose edit cannot be done gets the error as answer.
  virtual void apply_requests(Session* session, Stamp at) = 0;
  /// Sends the session's state to guests, as often as they need it.
  virtual void publish_state(const Session& session,
                             const Telemetry& telemetry,
                             const DeviceHealth& health,
                             Stamp at) = 0;
  /// The image that a projector of the session's rig shows: what was composed, and the pairing code where one
  /// is asked for.
  virtual cv::Mat projector_image(Session* session, std::size_t projector) = 0;
  /// Shows the code that pairs for a role on a projector, from its next image on.
  virtual void show_code(const std::string& projector, scene::Role role) = 0;
  /// The projector that shows the code; empty: none.
  virtual const std::string& code_projector() const = 0;
  virtual const Invitation& invitation() const = 0;
};

}  // namespace limn::apps
