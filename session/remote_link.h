#pragma once

#include <array>
#include <string>

#include "scene/actions.h"

namespace limn::session {

/// What people need to connect to the remote.
struct Invitation {
  std::string url;                    ///< "https://192.168.7.2:8443/"
  std::string fingerprint;            ///< SHA-256 fingerprint of the certificate; empty without TLS
  std::string authority_fingerprint;  ///< SHA-256 fingerprint of /limn.crt; empty without TLS
  std::array<std::string, 3> pins;    ///< by Role

  /// The address of the page that pairs without typing: the text of the QR code.
  std::string url_for(scene::Role role) const { return url + "#pin=" + pins[static_cast<std::size_t>(role)]; }
};

/// The functions of the remote that the operator's window uses. remote/server.h implements them, so that the
/// session does not depend on network code. All calls are made on the session's thread and never wait.
class RemoteLink {
 public:
  virtual ~RemoteLink() = default;

  /// Shows the pairing code of a role on a projector, from its next image on.
  virtual void show_code(const std::string& projector, scene::Role role) = 0;
  /// The projector that shows the code; empty: none.
  virtual const std::string& code_projector() const = 0;
  virtual const Invitation& invitation() const = 0;
  virtual std::vector<std::string> glasses() const { return {}; }  ///< lines about guests' glasses
};

}  // namespace limn::session
