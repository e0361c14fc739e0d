#pragma once

#include <array>
#include <string>

#include "scene/actions.h"

namespace limn::apps {

/// What people need who want to use the remote.
struct Invitation {
  std::string url;                    ///< "https://192.168.7.2:8443/"
  std::string fingerprint;            ///< of the certificate, SHA-256; empty without TLS
  std::string authority_fingerprint;  ///< of /limn.crt, likewise
  std::array<std::string, 3> pins;    ///< by Role

  /// The page that pairs by itself: the text of the QR code.
  std::string url_for(scene::Role role) const { return url + "#pin=" + pins[static_cast<std::size_t>(role)]; }
};

/// What the operator's window uses of the remote. remote/server.h implements it; the session knows no
/// network. All calls belong to the session's thread and never wait.
class RemoteLink {
 public:
  virtual ~RemoteLink() = default;

  /// Shows the code that pairs for a role on a projector, from its next image on.
  virtual void show_code(const std::string& projector, scene::Role role) = 0;
  /// The projector that shows the code; empty: none.
  virtual const std::string& code_projector() const = 0;
  virtual const Invitation& invitation() const = 0;
};

}  // namespace limn::apps
