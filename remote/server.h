#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <deque>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "core/result.h"
#include "core/worker_thread.h"
#include "remote/api/reception.h"
#include "remote/http/network.h"
#include "remote/projected_code.h"
#include "remote/tablet/image_providers.h"
#include "session/device_health.h"
#include "session/remote_link.h"
#include "session/session.h"
#include "session/session_client.h"
#include "session/telemetry.h"

namespace limn::remote {

struct ServeOptions {
  std::string at;                 ///< PORT (of this machine alone) or ADDRESS:PORT; port 0: any free one
  std::filesystem::path page;     ///< the page's files; empty: Limn's own
  std::filesystem::path keys;     ///< of the certificate; empty: Limn's own folder
  bool always_encrypted = false;  ///< TLS on the loopback, too
  NetworkLimits limits = {};
  std::chrono::milliseconds code_duration{60000};  ///< in a projector's light
};

/// The remote of a session (docs/remote.md): guests on its network. What SessionClient and RemoteLink have
/// belongs to the session's thread and never waits; everything else happens on threads of the server's own.
class Server : public apps::SessionClient, public apps::RemoteLink {
 public:
  /// Tells on stderr where it is and the PINs. Errors name the option. `eyes` may be
  /// empty.
  static Result<std::unique_ptr<Server>> open(const ServeOptions& options, ImageProviders providers);
  ~Server() override;

  /// Tells the session where guests' tablets look from. Does what guests want, at most k_max_edits_at_once
  /// edits and for at most 5 ms; the others wait for the next call. What cannot be done is answered to who
  /// wanted it.
  void apply_edits(apps::Session* session, Stamp at);
  /// Lets guests know: at once after an edit, else twenty times a second, and once a second while there are
  /// none.
  void publish_state(const apps::Session& session,
                     const apps::Telemetry& telemetry,
                     const apps::DeviceHealth& health,
                     Stamp at);

  /// Both hear and tell: what came while a frame was made need not wait for the next one.
  void hear(const apps::SessionMoment& moment) override;
  void tell(const apps::SessionMoment& moment) override { hear(moment); }
  std::vector<apps::Overlay> overlays(apps::Session* session) override;

  /// From its next image on a projector shows the code that pairs for a role, for
  /// ServeOptions::code_duration; no other one does then. Guests of lesser roles see no images of the room
  /// meanwhile, since its cameras see the code.
  void show_code(const std::string& projector, Role role) override;
  /// Who shows it; empty: nobody.
  const std::string& code_projector() const override { return code_.projector(); }
  /// Says goodbye to all, lets go of the eyes and ends the threads.
  void stop();

  const apps::Invitation& invitation() const override { return invitation_; }
  int port() const { return network_->port(); }

  static constexpr std::size_t k_max_edits_at_once = 64;

 private:
  using Clock = std::chrono::steady_clock;
  Server() = default;
  std::optional<Wish> next_edit_request();

  apps::Invitation invitation_;
  WorkerThread worker_;
  std::unique_ptr<Reception> reception_;
  std::unique_ptr<Network> network_;
  std::atomic<bool> has_guests_ = false;  // somebody is paired

  std::mutex mutex_;
  std::deque<Wish> edit_requests_;                                    // for the session
  std::map<std::string, std::optional<Eigen::Vector3d>> viewpoints_;  // likewise: the newest of each guest
  std::optional<SessionNews> news_;                                   // for the network
  bool is_news_posted_ = false;

  std::vector<Outcome> edit_results_;  // the session's alone, as the rest
  std::function<void(const apps::Session&)> update_providers_;
  std::shared_ptr<const scene::Scene> scene_;
  int scenes_ = 0;
  ProjectedCode code_;
  std::optional<Clock::time_point> published_at_;
  std::optional<Stamp> begun_at_;
  std::size_t published_edits_ = 0;
};

}  // namespace limn::remote
