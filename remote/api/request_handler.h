#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "core/worker_thread.h"
#include "remote/api/authentication.h"
#include "remote/api/comment_store.h"
#include "remote/api/glasses_clients.h"
#include "remote/api/messages.h"
#include "remote/api/pending_edits.h"
#include "remote/api/room_image_publisher.h"
#include "remote/api/session_files.h"
#include "remote/api/session_update.h"
#include "remote/api/state_publisher.h"
#include "remote/api/tablet_windows.h"
#include "remote/api/ws_client.h"
#include "remote/http/http.h"
#include "remote/http/http_handler.h"
#include "remote/http/static_files.h"
#include "remote/tablet/image_providers.h"

namespace limn::remote {

/// The API of docs/remote.md: routes HTTP requests and WebSocket messages to the classes that answer them,
/// after it has checked who asks and with which role. It has no sockets; the network calls it, on its thread,
/// to which this object belongs.
class RequestHandler : public HttpHandler {
 public:
  using Clock = std::chrono::steady_clock;

  struct Setup {
    Authentication::Setup authentication;
    std::string
        authority;  ///< The authority's certificate (DER), for devices to trust; empty: there is none.
    StaticFiles files;
    ImageProviders providers;
    WorkerThread* worker = nullptr;
    std::function<void(EditRequest)> submit_edit;  ///< Hands an edit to the session.
    SetViewpoint set_viewpoint;
    std::function<void(std::vector<std::string>)> set_glasses;  ///< Lines about glasses for the operator.
    std::function<void(bool)> set_has_guests;  ///< Tells the session whether anybody is paired.
    NetworkPost post;
  };
  explicit RequestHandler(Setup setup);

  void handle_request(const HttpRequest& request, ResponseCallback respond) override;
  std::variant<std::shared_ptr<WebSocketPeer>, HttpResponse> accept_web_socket(
      const HttpRequest& request) override;
  void update_at(Clock::time_point now) override;
  void close_clients(const std::string& why) override;
  std::size_t client_count() const override { return clients_.size(); }

  const AuthSessions& sessions() const { return authentication_.sessions(); }

  /// Until then, only guests of this role or a higher one see images of the room.
  void hide_room(Role role, Clock::time_point until) { room_images_.hide(role, until); }
  /// Publishes the session's update and answers the edits that it has finished.
  void apply_update(SessionUpdate update);
  /// Destroys the image providers, which answer for the last time. Call it when the network's thread has
  /// ended.
  void release_image_providers() { setup_.providers = {}; }

 private:
  class Connection;
  using ClientPtr = std::shared_ptr<WsClient>;

  // What paired guests may request. A path that ends with "/" is the beginning of many paths.
  struct Route {
    const char* method;
    std::string path;
    Role role;
    void (RequestHandler::*handle)(const AuthenticatedRequest&, ResponseCallback);
  };
  static const std::vector<Route>& routes();

  HttpResponse static_file(const HttpRequest& request, const std::string& path) const;
  HttpResponse pair_guest(const HttpRequest& request);
  void route_request(const AuthenticatedRequest& request,
                     const std::string& method,
                     ResponseCallback respond);

  void get_state(const AuthenticatedRequest& request, ResponseCallback respond);
  void get_actions(const AuthenticatedRequest& request, ResponseCallback respond);
  void get_lines(const AuthenticatedRequest& request, ResponseCallback respond);
  void get_room_image(const AuthenticatedRequest& request, ResponseCallback respond);
  void get_projector_image(const AuthenticatedRequest& request, ResponseCallback respond);
  void get_look_image(const AuthenticatedRequest& request, ResponseCallback respond);
  void get_look_assembly(const AuthenticatedRequest& request, ResponseCallback respond);
  void get_variant_image(const AuthenticatedRequest& request, ResponseCallback respond);
  void get_glasses_mesh(const AuthenticatedRequest& request, ResponseCallback respond);
  void get_glasses_light(const AuthenticatedRequest& request, ResponseCallback respond);
  void post_comment(const AuthenticatedRequest& request, ResponseCallback respond);
  void post_edit(const AuthenticatedRequest& request, ResponseCallback respond);
  void post_leave(const AuthenticatedRequest& request, ResponseCallback respond);

  void add_client(const ClientPtr& client);
  void remove_client(const ClientPtr& client);
  bool is_within_rate(const ClientPtr& client);
  void receive_text(const ClientPtr& client, std::string_view text);
  void receive_bytes(const ClientPtr& client, std::span<const std::uint8_t> bytes);

  void handle_message(const ClientPtr& client, const EditMessage& message);
  void handle_message(const ClientPtr& client, const CommentMessage& message);
  void handle_message(const ClientPtr& client, const StrokeMessage& message);
  void handle_message(const ClientPtr& client, const ImagesMessage& message);
  void handle_message(const ClientPtr& client, const ImageShownMessage& message);
  void handle_message(const ClientPtr& client, const WindowMessage& message);
  void handle_message(const ClientPtr& client, const GlassesMessage& message);
  void handle_message(const ClientPtr& client, const GlassesPoseMessage& message);
  void handle_message(const ClientPtr& client, const GlassesViewMessage& message);
  void handle_message(const ClientPtr& client, const GlassesStateMessage& message);

  std::optional<HttpResponse> add_comment(const AuthSessions::Guest& guest,
                                          const CommentRequest& comment,
                                          EditCallback callback);
  EditCallback answer_to(const ClientPtr& client, std::uint64_t id);
  void refuse_message(const ClientPtr& client, std::optional<std::uint64_t> id, const std::string& why);
  void refuse_message(const ClientPtr& client, std::uint64_t id, const HttpResponse& refusal);
  void publish_state() {
    if (setup_.set_glasses) setup_.set_glasses(glasses_.lines());
    state_.publish(comments_.newest());
  }

  Setup setup_;
  Authentication authentication_;
  WsClients clients_;
  std::uint64_t client_numbers_ = 0;
  StatePublisher state_;
  PendingEdits edits_;
  CommentStore comments_;
  SessionFiles session_files_;
  RoomImagePublisher room_images_;
  TabletWindows tablet_windows_;
  GlassesClients glasses_;
};

}  // namespace limn::remote
