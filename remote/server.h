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
#include "remote/api/request_handler.h"
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
  std::string at;                 ///< PORT (on the loopback) or ADDRESS:PORT; port 0 takes any free one.
  std::filesystem::path page;     ///< The folder of the page's files; empty: Limn's own.
  std::filesystem::path keys;     ///< The folder of the certificate; empty: Limn's folder of the user.
  bool always_encrypted = false;  ///< TLS on the loopback, too.
  NetworkLimits limits = {};
  std::chrono::milliseconds code_duration{60000};  ///< How long a projector shows the pairing code.
};

/// The remote of a session (docs/remote.md): the network, the API and the projected code. All public
/// functions belong to the session's thread and never wait, but for open() and stop(); everything else
/// happens on threads of the server's own.
class Server : public session::SessionClient, public session::RemoteLink {
 public:
  /// Starts the server. Logs its address and the PINs. Errors name the option. `providers` may be empty.
  static Result<std::unique_ptr<Server>> open(const ServeOptions& options, ImageProviders providers);
  ~Server() override;

  /// Hands the viewpoints of guests' tablets to the session, and then their edits: at most
  /// k_max_edits_at_once, and for at most 5 ms; the others wait for the next call. Guests are told of edits
  /// that cannot be done.
  void apply_edits(session::Session* session, Stamp at);
  /// Publishes the session's state: at once after an edit, otherwise twenty times a second, and once a second
  /// while nobody is paired.
  void publish_state(const session::Session& session,
                     const session::Telemetry& telemetry,
                     const session::DeviceHealth& health,
                     Stamp at);

  /// Both apply edits and publish the state, so that an edit that comes while a frame is made need not wait
  /// for the next one.
  void apply_edits(const session::SessionMoment& moment) override;
  void publish_state(const session::SessionMoment& moment) override { apply_edits(moment); }
  std::vector<projector::Overlay> overlays(session::Session* session) override;

  /// Has a projector show the code that pairs for a role, from its next image on and for
  /// ServeOptions::code_duration. Any other projector stops. Guests of lesser roles see no images of the room
  /// meanwhile, since its cameras see the code.
  void show_code(const std::string& projector, Role role) override;
  /// The projector that shows the code; empty: none.
  const std::string& code_projector() const override { return code_.projector(); }
  /// Closes all connections, destroys the image providers and ends the threads.
  void stop();

  const session::Invitation& invitation() const override { return invitation_; }
  std::vector<std::string> glasses() const override {
    const std::lock_guard lock(mutex_);
    return glasses_;
  }
  int port() const { return network_->port(); }

  static constexpr std::size_t k_max_edits_at_once = 64;

 private:
  using Clock = std::chrono::steady_clock;
  Server() = default;
  RequestHandler::Setup handler_setup(const std::string& host, const std::optional<Certificate>& certificate);
  void invite_guests(const std::string& host, const std::optional<Certificate>& certificate);
  std::optional<EditRequest> next_edit_request();
  void hand_over_update(SessionUpdate update);
  void collect_viewer_tracks(const session::Session& session);

  session::Invitation invitation_;
  WorkerThread worker_;
  std::unique_ptr<RequestHandler> handler_;
  std::unique_ptr<Network> network_;
  std::atomic<bool> has_guests_ = false;  // whether somebody is paired

  mutable std::mutex mutex_;
  std::deque<EditRequest> edit_requests_;                             // from the network to the session
  std::map<std::string, std::optional<Eigen::Vector3d>> viewpoints_;  // likewise, the newest of each guest
  std::vector<std::string> glasses_;                                  // lines for the operator
  std::optional<SessionUpdate> update_;                               // from the session to the network
  bool is_update_posted_ = false;

  // Used by the session's thread alone.
  std::vector<EditResult> edit_results_;
  std::function<void(const session::Session&)> update_providers_;
  std::shared_ptr<const scene::Scene> scene_;
  std::shared_ptr<const Rig> rig_;
  std::vector<Track> viewer_tracks_;  // since the last update, for glasses
  Stamp tracks_at_;                   // the moment of the newest of them
  int scenes_ = 0;
  ProjectedCode code_;
  std::optional<Clock::time_point> published_at_;
  std::optional<Stamp> begun_at_;
  std::size_t published_edits_ = 0;
};

}  // namespace limn::remote
