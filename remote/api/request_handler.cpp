#include "remote/api/request_handler.h"

#include <nlohmann/json.hpp>

#include "core/json_text.h"
#include "exchange/curves/csv_curves.h"
#include "exchange/curves/dxf_curves.h"
#include "remote/api/responses.h"
#include "remote/api/roles.h"
#include "remote/api/stroke_edit.h"
#include "remote/glasses/glasses_messages.h"
#include "scene/drawn_lines.h"

namespace limn::remote {
namespace {

using nlohmann::ordered_json;

constexpr const char* k_remote_schema = "limn.remote/1";
constexpr const char *k_web_socket_path = "/api/live", *k_authority_path = "/limn.crt";
constexpr const char* k_not_paired = "expected a paired guest. POST /api/pair with a PIN.";

bool is_json(const std::string& content_type) {
  const std::string type = content_type.substr(0, content_type.find(';'));
  return type == "application/json" || type == "application/json ";
}

}  // namespace

const std::vector<RequestHandler::Route>& RequestHandler::routes() {
  static const std::vector<Route> all = {
      {"POST", "/api/leave", Role::look, &RequestHandler::post_leave},
      {"GET", "/api/state", Role::look, &RequestHandler::get_state},
      {"GET", "/api/actions", Role::look, &RequestHandler::get_actions},
      {"POST", "/api/edit", Role::look,
       &RequestHandler::post_edit},  // the action's own role is checked later
      {"GET", "/api/lines.csv", Role::look, &RequestHandler::get_lines},
      {"GET", "/api/lines.dxf", Role::look, &RequestHandler::get_lines},
      {"GET", "/api/lines.step", Role::look, &RequestHandler::get_lines},
      {"GET", "/picture/room.jpg", Role::look, &RequestHandler::get_room_image},
      {"GET", "/picture/projector/", Role::look, &RequestHandler::get_projector_image},
      {"GET", "/picture/look/", Role::look, &RequestHandler::get_look_image},
      {"GET", "/picture/variant/", Role::look, &RequestHandler::get_variant_image},
      {"GET", "/look/", Role::look, &RequestHandler::get_look_assembly},
      {"GET", "/glasses/light.json", Role::look, &RequestHandler::get_glasses_light},
      {"GET", "/glasses/", Role::look, &RequestHandler::get_glasses_mesh},
      {"POST", "/api/comment", Role::work, &RequestHandler::post_comment},
  };
  return all;
}

// The side of a client that the network sees.
class RequestHandler::Connection : public WebSocketPeer {
 public:
  Connection(RequestHandler* handler, std::shared_ptr<WsClient> client)
      : handler_(handler), client_(std::move(client)) {}

  void open(std::function<void()> wake) override {
    client_->wake = std::move(wake);
    handler_->add_client(client_);
  }
  void receive_text(std::string_view text) override { handler_->receive_text(client_, text); }
  void receive_bytes(std::span<const std::uint8_t> bytes) override {
    handler_->receive_bytes(client_, bytes);
  }
  void close() override { handler_->remove_client(client_); }
  std::optional<Outgoing> next_message() override { return client_->outbox.next_message(); }
  bool is_over() const override { return client_->outbox.is_over(); }
  std::size_t longest_message() const override { return client_->longest_message(); }

 private:
  RequestHandler* handler_;
  std::shared_ptr<WsClient> client_;
};

RequestHandler::RequestHandler(Setup setup)
    : setup_(std::move(setup)),
      authentication_(setup_.authentication),
      state_(&clients_),
      edits_(setup_.submit_edit),
      comments_(setup_.worker, setup_.post),
      session_files_(setup_.worker),
      room_images_(&clients_, &setup_.providers, setup_.post),
      tablet_windows_(&clients_, &setup_.providers, setup_.set_viewpoint, setup_.post),
      glasses_(&clients_, setup_.set_viewpoint, &setup_.providers, setup_.post) {}

// ---- HTTP ----

void RequestHandler::handle_request(const HttpRequest& request, ResponseCallback respond) {
  if (auto refusal = authentication_.check_origin(request)) return respond(std::move(*refusal));
  const auto path = path_of(request.target);
  if (!path) return respond(error_response(k_http_bad_request, "expected a path that begins with '/'."));
  const bool changes = request.method != "GET" && request.method != "HEAD";
  if (changes && !is_json(request.content_type))
    return respond(error_response(k_http_unsupported_media_type, "expected Content-Type: application/json."));
  if (*path == "/api/pair")
    return respond(request.method == "POST"
                       ? pair_guest(request)
                       : error_response(k_http_method_not_allowed, "/api/pair: expected POST."));
  if (!path->starts_with("/api/") && !path->starts_with("/picture/") && !path->starts_with("/look/") &&
      !path->starts_with("/glasses/"))
    return respond(static_file(request, *path));
  const auto guest = authentication_.guest_of(request);
  if (!guest) return respond(error_response(k_http_unauthorized, k_not_paired));
  if (*path == k_web_socket_path)
    return respond(error_response(k_http_bad_request, "/api/live: expected an upgrade to a WebSocket."));
  route_request({*guest, *path, request.body}, request.method, std::move(respond));
}

void RequestHandler::route_request(const AuthenticatedRequest& request,
                                   const std::string& method,
                                   ResponseCallback respond) {
  for (const Route& route : routes()) {
    if (route.path.back() == '/' ? !request.path.starts_with(route.path) : request.path != route.path)
      continue;
    if (method != route.method)
      return respond(error_response(k_http_method_not_allowed,
                                    fmt::format("{}: expected {}.", route.path, route.method)));
    if (request.guest.role < route.role) return respond(role_refusal(request.guest, route.path, route.role));
    return (this->*route.handle)(request, std::move(respond));
  }
  respond(error_response(k_http_not_found, "expected a path of docs/remote.md, found another one."));
}

HttpResponse RequestHandler::static_file(const HttpRequest& request, const std::string& path) const {
  if (path == k_authority_path && request.method == "GET" && !setup_.authority.empty())
    return {200, "application/x-x509-ca-cert", setup_.authority, {{"Cache-Control", "no-cache"}}};
  const StaticFiles::File* file = setup_.files.find(path);
  if (!file) return error_response(k_http_not_found, "expected a file of the page, found another path.");
  if (request.method != "GET" && request.method != "HEAD")
    return error_response(k_http_method_not_allowed, "expected GET or HEAD.");
  HttpResponse out{200, file->type, file->content, {{"Cache-Control", "no-cache"}, {"ETag", file->tag}}};
  if (request.if_none_match == file->tag) {
    out.status = 304;
    out.body.clear();
  }
  return out;
}

HttpResponse RequestHandler::pair_guest(const HttpRequest& request) {
  HttpResponse out = authentication_.pair_guest(request);
  if (out.status == 200) setup_.set_has_guests(true);
  return out;
}

void RequestHandler::get_state(const AuthenticatedRequest&, ResponseCallback respond) {
  respond(state_.message() ? json_response(*state_.message())
                           : error_response(k_http_unavailable, "the session has not begun yet."));
}

void RequestHandler::get_actions(const AuthenticatedRequest&, ResponseCallback respond) {
  respond(json_response(actions_json()));
}

// The curves that are shown, in the prototype's frame, as a file.
void RequestHandler::get_lines(const AuthenticatedRequest& request, ResponseCallback respond) {
  const SessionUpdate* update = state_.update();
  std::vector<exchange::NamedCurve> curves;
  if (update && update->scene) curves = scene::shown_curves(*update->scene, update->posed);
  if (curves.empty())
    return respond(
        error_response(k_http_not_found, "expected lines with curves that are shown, found none."));
  if (request.path.ends_with(".step"))
    return session_files_.send_step_curves(std::move(curves), std::move(respond));
  if (request.path.ends_with(".dxf"))
    return respond(
        {200, "image/vnd.dxf", exchange::encode_dxf_curves(curves), {{"Cache-Control", "no-store"}}});
  respond(
      {200, "text/csv; charset=utf-8", exchange::encode_csv_curves(curves), {{"Cache-Control", "no-store"}}});
}

void RequestHandler::get_room_image(const AuthenticatedRequest& request, ResponseCallback respond) {
  room_images_.send_image(request.guest, std::move(respond));
}

void RequestHandler::get_projector_image(const AuthenticatedRequest& request, ResponseCallback respond) {
  session_files_.send_projector_image(request.path, state_.update(), std::move(respond));
}

void RequestHandler::get_look_image(const AuthenticatedRequest& request, ResponseCallback respond) {
  session_files_.send_look_image(request.path, state_.update(), std::move(respond));
}

void RequestHandler::get_look_assembly(const AuthenticatedRequest& request, ResponseCallback respond) {
  session_files_.send_look_assembly(request.path, state_.update(), std::move(respond));
}

void RequestHandler::get_variant_image(const AuthenticatedRequest& request, ResponseCallback respond) {
  session_files_.send_variant_image(request.path, state_.update(), std::move(respond));
}

void RequestHandler::get_glasses_mesh(const AuthenticatedRequest& request, ResponseCallback respond) {
  session_files_.send_mesh(request.path, state_.update(), std::move(respond));
}

void RequestHandler::get_glasses_light(const AuthenticatedRequest&, ResponseCallback respond) {
  const SessionUpdate* update = state_.update();
  respond(update && update->rig ? json_response(glasses_light_json(*update->rig))
                                : error_response(k_http_unavailable, "the session has not begun yet."));
}

void RequestHandler::post_comment(const AuthenticatedRequest& request, ResponseCallback respond) {
  const auto comment = parse_comment(request.body);
  if (!comment) return respond(error_response(k_http_bad_request, comment.message()));
  auto refusal =
      add_comment(request.guest, *comment, [respond](const std::string& why, std::uint64_t number) {
        respond(!why.empty() ? error_response(k_http_unavailable, why)
                             : json_response(json_text({{"number", number}})));
      });
  if (refusal) respond(std::move(*refusal));
}

void RequestHandler::post_edit(const AuthenticatedRequest& request, ResponseCallback respond) {
  const auto edit = parse_edit(request.body);
  if (!edit) return respond(error_response(k_http_bad_request, edit.message()));
  auto refusal = edits_.add(request.guest, *edit, [respond](const std::string& why, std::uint64_t number) {
    const int failed = why == k_edit_timed_out ? k_http_unavailable : k_http_bad_request;
    respond(!why.empty() ? error_response(failed, why) : json_response(json_text({{"number", number}})));
  });
  if (refusal) respond(std::move(*refusal));
}

void RequestHandler::post_leave(const AuthenticatedRequest& request, ResponseCallback respond) {
  if (const Status empty = parse_empty_body(request.body); !empty)
    return respond(error_response(k_http_bad_request, empty.message()));
  respond(authentication_.end_session(request.guest));
  update_at(Clock::now());
}

// ---- WebSocket ----

std::variant<std::shared_ptr<WebSocketPeer>, HttpResponse> RequestHandler::accept_web_socket(
    const HttpRequest& request) {
  if (auto refusal = authentication_.check_origin(request)) return std::move(*refusal);
  const auto guest = authentication_.guest_of(request);
  if (!guest) return error_response(k_http_unauthorized, k_not_paired);
  if (path_of(request.target) != k_web_socket_path)
    return error_response(k_http_not_found, "expected /api/live for a WebSocket.");
  auto client = std::make_shared<WsClient>();
  client->guest = *guest;
  client->number = ++client_numbers_;
  return std::make_shared<Connection>(this, std::move(client));
}

void RequestHandler::add_client(const ClientPtr& client) {
  clients_.push_back(client);
  const ordered_json hello = {{"type", "hello"},
                              {"schema", k_remote_schema},
                              {"role", name_of(client->guest.role)},
                              {"name", client->guest.name},
                              {"actions", ordered_json::parse(actions_json())}};
  client->outbox.add_answer(json_text(hello));
  client->outbox.set_state(state_.message());
  publish_state();
  client->wake();
}

void RequestHandler::remove_client(const ClientPtr& client) {
  tablet_windows_.close_window(client);
  glasses_.take_off(client);
  if (std::erase(clients_, client) > 0) publish_state();
}

// Ends a client that sends too many messages.
bool RequestHandler::is_within_rate(const ClientPtr& client) {
  if (client->rate_limit.allows(Clock::now())) return true;
  client->outbox.end("too many messages");
  client->wake();
  return false;
}

void RequestHandler::receive_text(const ClientPtr& client, std::string_view text) {
  if (!is_within_rate(client)) return;
  const auto message = parse_message(text);
  if (!message) return refuse_message(client, parse_message_id(text), message.message());
  std::visit([&](const auto& each) { handle_message(client, each); }, *message);
}

void RequestHandler::receive_bytes(const ClientPtr& client, std::span<const std::uint8_t> bytes) {
  if (!is_within_rate(client)) return;
  const Status received = client->glasses && client->glasses->announced
                              ? glasses_.receive_view_image(client, bytes, Clock::now())
                              : tablet_windows_.receive_frame(client, bytes);
  if (!received) refuse_message(client, std::nullopt, received.message());
}

void RequestHandler::handle_message(const ClientPtr& client, const EditMessage& message) {
  const auto refusal = edits_.add(client->guest, message.edit, answer_to(client, message.id));
  if (refusal) refuse_message(client, message.id, *refusal);
}

void RequestHandler::handle_message(const ClientPtr& client, const CommentMessage& message) {
  const auto refusal = add_comment(client->guest, message.comment, answer_to(client, message.id));
  if (refusal) refuse_message(client, message.id, *refusal);
}

void RequestHandler::handle_message(const ClientPtr& client, const StrokeMessage& message) {
  const Imager* camera = message.in_window ? client->window.shown.find(message.image)
                                           : room_images_.shown_image(client->guest, message.image);
  if (!camera)
    return refuse_message(
        client, message.id,
        "picture: expected one that shows the prototype and was sent lately, found another.");
  const auto edit = stroke_edit(message, *camera);
  if (!edit) return refuse_message(client, message.id, edit.message());
  if (const auto refusal = edits_.add(client->guest, *edit, answer_to(client, message.id)))
    refuse_message(client, message.id, *refusal);
}

void RequestHandler::handle_message(const ClientPtr& client, const ImagesMessage& message) {
  const Status subscribed = room_images_.subscribe(client, message.room);
  if (!subscribed) refuse_message(client, std::nullopt, subscribed.message());
}

void RequestHandler::handle_message(const ClientPtr& client, const ImageShownMessage& message) {
  room_images_.mark_shown(client, message.image);
}

void RequestHandler::handle_message(const ClientPtr& client, const WindowMessage& message) {
  const Status updated = tablet_windows_.update_window(client, message);
  if (!updated) refuse_message(client, std::nullopt, updated.message());
}

void RequestHandler::handle_message(const ClientPtr& client, const GlassesMessage& message) {
  const Status updated = glasses_.update_glasses(client, message);
  if (!updated) refuse_message(client, std::nullopt, updated.message());
  publish_state();
}

void RequestHandler::handle_message(const ClientPtr& client, const GlassesPoseMessage& message) {
  const Status received = glasses_.receive_pose(client, message, Clock::now());
  if (!received) refuse_message(client, std::nullopt, received.message());
}

void RequestHandler::handle_message(const ClientPtr& client, const GlassesViewMessage& message) {
  const Status received = glasses_.receive_view(client, message);
  if (!received) refuse_message(client, std::nullopt, received.message());
}

void RequestHandler::handle_message(const ClientPtr& client, const GlassesStateMessage& message) {
  const Status received = glasses_.receive_state(client, message);
  if (!received) refuse_message(client, std::nullopt, received.message());
}

EditCallback RequestHandler::answer_to(const ClientPtr& client, std::uint64_t id) {
  return [this, client, id](const std::string& why, std::uint64_t number) {
    if (!why.empty()) return refuse_message(client, std::optional(id), why);
    client->outbox.add_answer(json_text({{"type", "done"}, {"id", id}, {"number", number}}));
    client->wake();
  };
}

void RequestHandler::refuse_message(const ClientPtr& client,
                                    std::optional<std::uint64_t> id,
                                    const std::string& why) {
  ordered_json out = {{"type", "refused"}, {"id", nullptr}, {"why", why}};
  if (id) out["id"] = *id;
  client->outbox.add_answer(json_text(out));
  client->wake();
}

// The same reason as over HTTP.
void RequestHandler::refuse_message(const ClientPtr& client, std::uint64_t id, const HttpResponse& refusal) {
  refuse_message(client, std::optional(id), nlohmann::json::parse(refusal.body)["error"].get<std::string>());
}

std::optional<HttpResponse> RequestHandler::add_comment(const AuthSessions::Guest& guest,
                                                        const CommentRequest& comment,
                                                        EditCallback callback) {
  auto refusal = comments_.add(
      guest, comment, state_.update(),
      [this, callback = std::move(callback)](const std::string& why) { callback(why, state_.number()); });
  if (!refusal) publish_state();
  return refusal;
}

// ---- The session and time ----

void RequestHandler::apply_update(SessionUpdate update) {
  const std::vector<EditResult> results = std::exchange(update.edit_results, {});
  glasses_.apply_update(update);
  state_.set_update(std::move(update));
  comments_.load_once(state_.update()->scene->folder);
  publish_state();
  edits_.finish(results, state_.number());
}

void RequestHandler::update_at(Clock::time_point now) {
  setup_.set_has_guests(sessions().count() > 0);
  for (const auto& client : clients_) {
    if (sessions().is_valid(client->guest.number, now)) continue;
    client->outbox.end("the session is over. Pair again.");
    client->wake();
  }
  edits_.expire(now, state_.number());
  room_images_.update_at(now);
  if (glasses_.update_at(now)) publish_state();
}

void RequestHandler::close_clients(const std::string& why) {
  for (const auto& client : clients_) {
    client->outbox.end(why);
    client->wake();
  }
}

}  // namespace limn::remote
