#pragma once

#include <chrono>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/result.h"
#include "remote/api/messages.h"
#include "remote/api/session_update.h"
#include "remote/api/tablet_windows.h"
#include "remote/api/ws_client.h"

namespace limn::remote {

/// The guests' glasses (docs/remote.md): takes the poses of their odometry, pairs them with the tracks of the
/// scene's viewers, and sends each page its place in the room and where the parts are. While they are
/// registered, their eye is the guest's viewpoint, as a tablet's. Belongs to the network's thread.
class GlassesClients {
 public:
  using Clock = std::chrono::steady_clock;

  /// `clients` and `providers` must outlive this object. Answers of `providers` come back through `post`.
  GlassesClients(const WsClients* clients,
                 SetViewpoint set_viewpoint,
                 const ImageProviders* providers = nullptr,
                 NetworkPost post = {})
      : clients_(clients),
        set_viewpoint_(std::move(set_viewpoint)),
        providers_(providers),
        post_(std::move(post)) {}

  /// Puts glasses on or takes them off. Errors: the scene has no marker for them, or all are in use.
  Status update_glasses(const std::shared_ptr<WsClient>& client, const GlassesMessage& message);
  /// Takes a pose. Errors (at most one a second): no glasses are on; the pose is wrong.
  Status receive_pose(const std::shared_ptr<WsClient>& client,
                      const GlassesPoseMessage& message,
                      Clock::time_point now);
  Status receive_state(const std::shared_ptr<WsClient>& client, const GlassesStateMessage& message);
  /// Takes the announcement of a picture of the glasses' camera. Errors: no glasses are on, or they have a
  /// marker; the lens or the pose is nonsense. The picture is then left out.
  Status receive_view(const std::shared_ptr<WsClient>& client, const GlassesViewMessage& message);
  /// Takes the picture itself, if one was announced; while one is looked at others are left out. Errors: no
  /// JPEG, or another number.
  Status receive_view_image(const std::shared_ptr<WsClient>& client,
                            std::span<const std::uint8_t> bytes,
                            Clock::time_point now);
  void take_off(const std::shared_ptr<WsClient>& client);

  /// A line for each guest with glasses, for the operator.
  std::vector<std::string> lines() const;

  /// Takes the tracks of the session's update, and sends the parts' poses.
  void apply_update(const SessionUpdate& update);
  /// Updates all registrations, and sends what has changed. True: a state has changed, which all guests get.
  bool update_at(Clock::time_point now);

 private:
  std::vector<std::string> markers() const;
  std::shared_ptr<WsClient> user_of(const std::string& marker, const std::shared_ptr<WsClient>& but) const;
  Result<std::string> marker_for(const std::shared_ptr<WsClient>& client,
                                 const GlassesMessage& message) const;
  bool can_locate() const { return providers_ && providers_->locate_camera; }
  double session_s(Clock::time_point now) const;
  void send(const std::shared_ptr<WsClient>& client);
  void take_located(const std::shared_ptr<WsClient>& client,
                    const GlassesViewMessage& view,
                    const LocatedCamera& camera);

  const WsClients* clients_;
  SetViewpoint set_viewpoint_;
  const ImageProviders* providers_;
  NetworkPost post_;
  std::shared_ptr<const scene::Scene> scene_;
  std::string parts_;     // the newest message of parts
  Stamp session_at_;      // the session's clock …
  Clock::time_point at_;  // … at this moment
};

}  // namespace limn::remote
