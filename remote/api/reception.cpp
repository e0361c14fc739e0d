#include "remote/api/reception.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "core/file.h"
#include "core/log.h"
#include "device/jpeg.h"
#include "remote/http/own_addresses.h"
#include "scene/glb.h"

namespace limn::remote {
namespace {

using nlohmann::ordered_json;

constexpr const char* k_schema = "limn.remote/1";
constexpr const char* k_comments = "comments.json";
constexpr const char *k_live = "/api/live", *k_authority = "/limn.crt";
constexpr int k_jpeg_quality = 85;
constexpr int k_bad = 400, k_unpaired = 401, k_forbidden = 403, k_absent = 404, k_wrong_method = 405,
              k_not_json = 415, k_too_many = 429, k_unavailable = 503;

std::string dumped(const ordered_json& json) {
  return json.dump(-1, ' ', false, ordered_json::error_handler_t::replace);
}

HttpResponse json_answer(std::string body) {
  return {200, "application/json", std::move(body), {{"Cache-Control", "no-store"}}};
}

HttpResponse unkept(const char* type, std::string bytes) {
  return {200, type, std::move(bytes), {{"Cache-Control", "no-store"}}};
}

bool is_json(const std::string& content_type) {
  const std::string type = content_type.substr(0, content_type.find(';'));
  return type == "application/json" || type == "application/json ";
}

// What stands between two ends of a path, decoded; nullopt: something else.
std::optional<std::string> name_in(const std::string& path, std::string_view begin, std::string_view end) {
  if (path.size() <= begin.size() + end.size() || !path.starts_with(begin) || !path.ends_with(end))
    return std::nullopt;
  return decoded(std::string_view(path).substr(begin.size(), path.size() - begin.size() - end.size()));
}

bool is_in(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

// A look's parts on the prototype, as a file for other programs; empty: there is nothing in it.
std::string assembly_of(const scene::Scene& scene, const scene::Look& look) {
  std::vector<scene::GlbNode> placed;
  if (scene.prototype) placed.push_back({"prototype", &scene.prototype->mesh, Pose()});
  for (const scene::Look::Part& part : look.parts) {
    const scene::Slot* slot = scene.find_slot(part.slot);
    if (!slot) continue;
    for (const scene::Variant& variant : slot->variants)
      if (variant.name == part.variant)
        placed.push_back({part.slot + " " + part.variant, &variant.mesh, part.prototype_from_part});
  }
  return placed.empty() ? "" : scene::encode_glb(placed);
}

const std::string k_hidden = "A code for other guests is in the light. The room comes back in a minute.";
const std::string k_late = "the session did not answer in time.";

std::string may_not(const AuthSessions::Guest& guest, const std::string& what, Role role) {
  return fmt::format("{}: expected the role {}, found {}. Pair with the PIN of {}.", what, name_of(role),
                     name_of(guest.role), name_of(role));
}

}  // namespace

// What paired guests may ask for. A path that ends with "/" is the beginning of many.
struct Reception::Route {
  const char* method;
  std::string path;
  Role role;
  void (Reception::*answer)(const Asked&, ResponseCallback);
};

// The network's side of one client.
class Reception::Connection : public WebSocketPeer {
 public:
  Connection(Reception* reception, std::shared_ptr<WsClient> client)
      : reception_(reception), client_(std::move(client)) {}

  void open(std::function<void()> wake) override {
    client_->wake = std::move(wake);
    reception_->greet(client_);
  }
  void receive_text(std::string_view text) override { reception_->hear_text(client_, text); }
  void receive_bytes(std::span<const std::uint8_t> bytes) override { reception_->hear_bytes(client_, bytes); }
  void close() override { reception_->gone(client_); }
  std::optional<Outgoing> next_message() override { return client_->outbox.next_message(); }
  bool is_over() const override { return client_->outbox.is_over(); }
  std::size_t longest_message() const override { return client_->longest_message(); }

 private:
  Reception* reception_;
  std::shared_ptr<WsClient> client_;
};

const std::vector<Reception::Route>& Reception::routes() {
  static const std::vector<Route> all = {
      {"POST", "/api/leave", Role::look, &Reception::post_leave},
      {"GET", "/api/state", Role::look, &Reception::get_state},
      {"GET", "/api/actions", Role::look, &Reception::get_actions},
      {"POST", "/api/edit", Role::look, &Reception::post_edit},  // then by action
      {"GET", "/picture/room.jpg", Role::look, &Reception::get_room},
      {"GET", "/picture/projector/", Role::look, &Reception::get_projector},
      {"GET", "/picture/look/", Role::look, &Reception::get_look_image},
      {"GET", "/picture/variant/", Role::look, &Reception::get_variant_image},
      {"GET", "/look/", Role::look, &Reception::get_look_assembly},
      {"POST", "/api/comment", Role::work, &Reception::post_comment},
  };
  return all;
}

Reception::Reception(Setup setup)
    : setup_(std::move(setup)),
      encoded_(std::make_shared<std::map<std::string, Encoded>>()),
      thumbnails_(std::make_shared<Thumbnails>()) {}

// Requests that nobody honest sends: from other pages, or under a name that somebody else gave this machine.
std::optional<HttpResponse> Reception::refuse(const HttpRequest& request) const {
  const std::string host = host_in(request.host);
  if (host.empty()) return error_response(k_bad, "expected a Host header, found none.");
  if (setup_.is_loopback && host != "localhost" && !is_loopback(host))
    return error_response(k_forbidden, "expected localhost or 127.0.0.1 as the host, found another name.");
  if (!request.origin.empty() &&
      request.origin != (setup_.is_encrypted ? "https://" : "http://") + request.host)
    return error_response(k_forbidden, "expected a request of Limn's own page, found one of another origin.");
  return std::nullopt;
}

std::optional<AuthSessions::Guest> Reception::guest_of(const HttpRequest& request) const {
  constexpr std::string_view k_bearer = "Bearer ";
  const std::string token = request.authorization.starts_with(k_bearer)
                                ? request.authorization.substr(k_bearer.size())
                                : cookie_in(request.cookie, setup_.cookie);
  return guests_.find(token, Clock::now());
}

void Reception::handle_request(const HttpRequest& request, ResponseCallback answering) {
  if (auto refused = refuse(request)) return answering(std::move(*refused));
  const auto path = path_of(request.target);
  if (!path) return answering(error_response(k_bad, "expected a path that begins with '/'."));
  const bool changes = request.method != "GET" && request.method != "HEAD";
  if (changes && !is_json(request.content_type))
    return answering(error_response(k_not_json, "expected Content-Type: application/json."));
  if (*path == "/api/pair")
    return answering(request.method == "POST" ? pair(request)
                                              : error_response(k_wrong_method, "/api/pair: expected POST."));
  if (!path->starts_with("/api/") && !path->starts_with("/picture/") && !path->starts_with("/look/"))
    return answering(file(request, *path));
  const auto guest = guest_of(request);
  if (!guest)
    return answering(error_response(k_unpaired, "expected a paired guest. POST /api/pair with a PIN."));
  if (*path == k_live)
    return answering(error_response(k_bad, "/api/live: expected an upgrade to a WebSocket."));
  for (const Route& route : routes()) {
    if (route.path.back() == '/' ? !path->starts_with(route.path) : *path != route.path) continue;
    if (request.method != route.method)
      return answering(
          error_response(k_wrong_method, fmt::format("{}: expected {}.", route.path, route.method)));
    if (guest->role < route.role)
      return answering(error_response(k_forbidden, may_not(*guest, route.path, route.role)));
    return (this->*route.answer)({*guest, *path, request.body, request.if_none_match}, std::move(answering));
  }
  answering(error_response(k_absent, "expected a path of docs/remote.md, found another one."));
}

HttpResponse Reception::file(const HttpRequest& request, const std::string& path) const {
  if (path == k_authority && request.method == "GET" && !setup_.authority.empty())
    return {200, "application/x-x509-ca-cert", setup_.authority, {{"Cache-Control", "no-cache"}}};
  const StaticFiles::File* file = setup_.files.find(path);
  if (!file) return error_response(k_absent, "expected a file of the page, found another path.");
  if (request.method != "GET" && request.method != "HEAD")
    return error_response(k_wrong_method, "expected GET or HEAD.");
  HttpResponse out{200, file->type, file->content, {{"Cache-Control", "no-cache"}, {"ETag", file->tag}}};
  if (request.if_none_match == file->tag) {
    out.status = 304;
    out.body.clear();
  }
  return out;
}

HttpResponse Reception::pair(const HttpRequest& request) {
  const auto wish = parse_pairing(request.body);
  if (!wish) return error_response(k_bad, wish.message());
  auto found = guests_.pair(wish->pin, wish->name, request.address, Clock::now(), guest_of(request));
  if (const auto* wait = std::get_if<AuthSessions::Wait>(&found)) {
    HttpResponse out =
        error_response(k_too_many, fmt::format("too many wrong PINs. Wait {} s.", wait->left.count()));
    out.headers.emplace_back("Retry-After", std::to_string(wait->left.count()));
    return out;
  }
  const auto* paired = std::get_if<AuthSessions::Paired>(&found);
  if (!paired) return error_response(k_unpaired, "this PIN is wrong. It stands in the operator's window.");
  setup_.watched(true);
  const auto life_s = std::chrono::seconds(k_session_life).count();
  HttpResponse out = json_answer(dumped({{"role", name_of(paired->guest.role)},
                                         {"name", paired->guest.name},
                                         {"token", paired->token},
                                         {"expires_s", life_s}}));
  out.headers.emplace_back(
      "Set-Cookie", fmt::format("{}={}; Path=/; HttpOnly; SameSite=Strict; Max-Age={}{}", setup_.cookie,
                                paired->token, life_s, setup_.is_encrypted ? "; Secure" : ""));
  return out;
}

void Reception::get_state(const Asked&, ResponseCallback answering) {
  answering(state_ ? json_answer(*state_) : error_response(k_unavailable, "the session has not begun yet."));
}

void Reception::get_actions(const Asked&, ResponseCallback answering) {
  answering(json_answer(actions_json()));
}

void Reception::hide_room(Role role, Clock::time_point until) {
  const bool is_hidden = Clock::now() < hidden_.second;
  hidden_ = {is_hidden ? std::max(role, hidden_.first) : role, std::max(until, hidden_.second)};
}

bool Reception::may_see_room(const AuthSessions::Guest& guest) const {
  return guest.role >= hidden_.first || Clock::now() >= hidden_.second;
}

void Reception::get_room(const Asked& asked, ResponseCallback answering) {
  if (!may_see_room(asked.guest)) return answering(error_response(k_unavailable, k_hidden));
  if (!setup_.providers.draw_room)
    return answering(error_response(k_unavailable, "this session has no live composite."));
  setup_.providers.draw_room([answering = std::move(answering)](const CompositeImage& seen) {
    answering(seen.jpeg.empty() ? error_response(k_absent, "no camera's picture has come yet.")
                                : unkept("image/jpeg", {seen.jpeg.begin(), seen.jpeg.end()}));
  });
}

void Reception::do_on_worker(std::function<HttpResponse()> job, ResponseCallback answering) {
  if (!setup_.worker->take([job = std::move(job), answering] { answering(job()); }))
    answering(error_response(k_unavailable, "too many pictures are asked for at once."));
}

void Reception::get_projector(const Asked& asked, ResponseCallback answering) {
  const auto name = name_in(asked.path, "/picture/projector/", ".jpg");
  std::size_t index = 0;
  const std::size_t count = news_ ? std::min(news_->state.projectors.size(), news_->projectors.size()) : 0;
  while (name && index < count && news_->state.projectors[index] != *name) ++index;
  if (!name || index >= count || news_->projectors[index].empty())
    return answering(error_response(k_absent, "expected a projector of the state, found another name."));
  do_on_worker(
      [known = encoded_, name = *name, image = news_->projectors[index]] {
        Encoded& encoded = (*known)[name];
        if (!encoded.jpeg || encoded.image.data != image.data) {
          const auto jpeg = device::encode_jpeg(image, k_jpeg_quality);
          encoded = {image, std::make_shared<const std::string>(jpeg.begin(), jpeg.end())};
        }
        return unkept("image/jpeg", *encoded.jpeg);
      },
      std::move(answering));
}

void Reception::get_look_image(const Asked& asked, ResponseCallback answering) {
  const auto name = name_in(asked.path, "/picture/look/", ".png");
  if (!name || !news_ || !is_in(news_->state.looks, *name))
    return answering(error_response(k_absent, "expected a look of the state, found another name."));
  do_on_worker(
      [path = news_->scene->folder / "looks" / (*name + ".png")] {
        auto png = read_file(path);
        return png ? unkept("image/png", std::move(*png))
                   : error_response(k_absent, "this look has no picture.");
      },
      std::move(answering));
}

void Reception::get_look_assembly(const Asked& asked, ResponseCallback answering) {
  const auto name = name_in(asked.path, "/look/", ".glb");
  const scene::Look* look = nullptr;
  if (name && news_)
    for (const scene::Look& each : news_->looks)
      if (each.name == *name) look = &each;
  if (!look) return answering(error_response(k_absent, "expected a look of the state, found another name."));
  do_on_worker(
      [scene = news_->scene, look = *look] {
        const std::string bytes = assembly_of(*scene, look);
        return bytes.empty() ? error_response(k_absent, "this look has no parts.")
                             : unkept("model/gltf-binary", bytes);
      },
      std::move(answering));
}

void Reception::get_variant_image(const Asked& asked, ResponseCallback answering) {
  constexpr std::string_view k_begin = "/picture/variant/";
  const auto slash = asked.path.find('/', k_begin.size());
  const auto slot =
      slash == std::string::npos
          ? std::nullopt
          : decoded(std::string_view(asked.path).substr(k_begin.size(), slash - k_begin.size()));
  const auto variant = name_in(asked.path, asked.path.substr(0, slash) + "/", ".png");
  if (!slot || !variant || !news_)
    return answering(error_response(k_absent, "expected a slot and a variant of the state, found others."));
  do_on_worker(
      [images = thumbnails_, scene = news_->scene, slot = *slot, variant = *variant] {
        const auto png = images->png(scene, slot, variant);
        return png ? unkept("image/png", **png) : error_response(k_absent, png.message());
      },
      std::move(answering));
}

void Reception::post_comment(const Asked& asked, ResponseCallback answering) {
  const auto found = parse_comment(asked.body);
  if (!found) return answering(error_response(k_bad, found.message()));
  auto refused = remark(asked.guest, *found, [answering](const std::string& why, std::uint64_t number) {
    answering(!why.empty() ? error_response(k_unavailable, why) : json_answer(dumped({{"number", number}})));
  });
  if (refused) answering(std::move(*refused));
}

void Reception::post_edit(const Asked& asked, ResponseCallback answering) {
  const auto edit = parse_edit(asked.body);
  if (!edit) return answering(error_response(k_bad, edit.message()));
  auto refused = wish(asked.guest, *edit, [answering](const std::string& why, std::uint64_t number) {
    answering(!why.empty() ? error_response(why == k_late ? k_unavailable : k_bad, why)
                           : json_answer(dumped({{"number", number}})));
  });
  if (refused) answering(std::move(*refused));
}

void Reception::post_leave(const Asked& asked, ResponseCallback answering) {
  if (const Status empty = parse_empty_body(asked.body); !empty)
    return answering(error_response(k_bad, empty.message()));
  guests_.end_session(asked.guest.number);
  HttpResponse out = json_answer("{}");
  out.headers.emplace_back("Set-Cookie", setup_.cookie + "=; Path=/; HttpOnly; SameSite=Strict; Max-Age=0");
  answering(std::move(out));
  update_at(Clock::now());
}

std::optional<HttpResponse> Reception::wish(const AuthSessions::Guest& guest,
                                            const scene::Edit& edit,
                                            Done done) {
  const Role role = role_for(edit.action);
  if (guest.role < role) return error_response(k_forbidden, may_not(guest, edit.action, role));
  if (wishes_.size() >= k_most_wishes)
    return error_response(k_too_many, "too many edits wait for the session. Try again in a moment.");
  const auto now = Clock::now();
  wishes_.emplace(++last_wish_, Waiting{std::move(done), now});
  setup_.wish({last_wish_, edit, guest.name, now});
  return std::nullopt;
}

void Reception::load_comments() {
  const auto path = news_->scene->folder / k_comments;
  comments_ = scene::load_comments(path);
  if (!*comments_) log_warning("live: {} Nobody can comment.", comments_->message());
}

std::optional<HttpResponse> Reception::remark(const AuthSessions::Guest& guest,
                                              const CommentRequest& remark,
                                              Done done) {
  if (guest.role < Role::work) return error_response(k_forbidden, may_not(guest, "comment", Role::work));
  if (!comments_) return error_response(k_unavailable, "the session has not begun yet.");
  if (!*comments_) return error_response(k_unavailable, comments_->message());
  if (!remark.slot.empty() && !news_->scene->find_slot(remark.slot))
    return error_response(k_bad, "slot: expected one of the state, found another.");
  if (!remark.look.empty() && !is_in(news_->state.looks, remark.look))
    return error_response(k_bad, "look: expected one of the state, found another.");
  auto comment = scene::make_comment(guest.name, remark.look, remark.slot, remark.text);
  if (!comment) return error_response(k_bad, comment.message());
  std::vector<scene::Comment>& all = **comments_;
  if (all.size() >= scene::k_most_comments)
    return error_response(k_unavailable, fmt::format("the project keeps {} comments at most.", all.size()));
  all.push_back(std::move(*comment));
  const bool is_taken = setup_.worker->take(
      [this, post = setup_.post, all, done = std::move(done), path = news_->scene->folder / k_comments] {
        const Status saved = scene::save_comments(path, all);
        post([this, done, why = saved ? "" : saved.message()] { done(why, number_); });
      });
  if (!is_taken) {
    all.pop_back();
    return error_response(k_unavailable, "too much is being saved. Try again in a moment.");
  }
  publish();
  return std::nullopt;
}

std::variant<std::shared_ptr<WsClient>, HttpResponse> Reception::admit(const HttpRequest& request) {
  if (auto refused = refuse(request)) return std::move(*refused);
  const auto guest = guest_of(request);
  if (!guest) return error_response(k_unpaired, "expected a paired guest. POST /api/pair with a PIN.");
  if (path_of(request.target) != k_live)
    return error_response(k_absent, "expected /api/live for a WebSocket.");
  auto client = std::make_shared<WsClient>();
  client->guest = *guest;
  return client;
}

std::variant<std::shared_ptr<WebSocketPeer>, HttpResponse> Reception::accept_web_socket(
    const HttpRequest& request) {
  auto admitted = admit(request);
  if (auto* refused = std::get_if<HttpResponse>(&admitted)) return std::move(*refused);
  return std::make_shared<Connection>(this, std::get<std::shared_ptr<WsClient>>(std::move(admitted)));
}

void Reception::greet(const std::shared_ptr<WsClient>& client) {
  visitors_.push_back(client);
  const ordered_json hello = {{"type", "hello"},
                              {"schema", k_schema},
                              {"role", name_of(client->guest.role)},
                              {"name", client->guest.name},
                              {"actions", ordered_json::parse(actions_json())}};
  client->outbox.add_answer(dumped(hello));
  client->outbox.set_state(state_);
  publish();
  client->wake();
}

void Reception::gone(const std::shared_ptr<WsClient>& client) {
  close_window(client);
  if (std::erase(visitors_, client) > 0) publish();
}

void Reception::close_window(const std::shared_ptr<WsClient>& client) {
  const std::string& name = client->guest.name;
  const bool was_open = !std::exchange(client->device, "").empty();
  const auto eye = guest_eyes_.find(name);
  if (eye != guest_eyes_.end() && eye->second.client.lock() == client) guest_eyes_.erase(eye);
  const bool is_last = std::none_of(visitors_.begin(), visitors_.end(), [&](const auto& other) {
    return other->guest.name == name && !other->device.empty();
  });
  if (was_open && is_last) setup_.place(name, std::nullopt);
  client->frame_waiting.reset();
}

void Reception::hear_text(const std::shared_ptr<WsClient>& client, std::string_view text) {
  if (!client->rate_limit.allows(Clock::now())) {
    client->outbox.end("too many messages");
    return client->wake();
  }
  const auto message = parse_message(text);
  if (!message) return refuse(client, parse_message_id(text), message.message());
  std::visit([&](const auto& each) { hear(client, each); }, *message);
}

void Reception::refuse(const std::shared_ptr<WsClient>& client,
                       std::optional<std::uint64_t> id,
                       const std::string& why) {
  ordered_json out = {{"type", "refused"}, {"id", nullptr}, {"why", why}};
  if (id) out["id"] = *id;
  client->outbox.add_answer(dumped(out));
  client->wake();
}

Reception::Done Reception::answer_to(const std::shared_ptr<WsClient>& client, std::uint64_t id) {
  return [this, client, id](const std::string& why, std::uint64_t number) {
    if (!why.empty()) return refuse(client, std::optional(id), why);
    client->outbox.add_answer(dumped({{"type", "done"}, {"id", id}, {"number", number}}));
    client->wake();
  };
}

void Reception::refuse(const std::shared_ptr<WsClient>& client,
                       std::uint64_t id,
                       const HttpResponse& refused) {
  refuse(client, std::optional(id), nlohmann::json::parse(refused.body)["error"].get<std::string>());
}

void Reception::hear(const std::shared_ptr<WsClient>& client, const EditMessage& message) {
  const auto refused = wish(client->guest, message.edit, answer_to(client, message.id));
  if (refused) refuse(client, message.id, *refused);
}

void Reception::hear(const std::shared_ptr<WsClient>& client, const CommentMessage& message) {
  const auto refused = remark(client->guest, message.comment, answer_to(client, message.id));
  if (refused) refuse(client, message.id, *refused);
}

void Reception::hear(const std::shared_ptr<WsClient>& client, const ImagesMessage& message) {
  if (message.room && !setup_.providers.draw_room)
    return refuse(client, std::nullopt, "this session has no live composite.");
  if (!client->wants_room) client->room_sent.reset();
  client->wants_room = message.room;
  client->room_in_flight.reset();
  ask_for_room(Clock::now());
}

void Reception::hear(const std::shared_ptr<WsClient>& client, const ImageShownMessage& message) {
  if (client->room_in_flight == message.image) client->room_in_flight.reset();
  ask_for_room(Clock::now());
}

void Reception::hear(const std::shared_ptr<WsClient>& client, const WindowMessage& message) {
  if (message.on && !setup_.providers.draw_window)
    return refuse(client, std::nullopt, "this session has no window.");
  const auto windows = std::count_if(visitors_.begin(), visitors_.end(), [&](const auto& other) {
    return other != client && !other->device.empty();
  });
  if (message.on && windows >= k_most_windows)
    return refuse(client, std::nullopt, fmt::format("{} windows are open; no more at once.", windows));
  if (!message.on) return close_window(client);
  if (client->device.empty()) guest_eyes_[client->guest.name] = {client, Clock::now()};
  client->device = message.device;
  client->parts = message.parts;
  client->frame_waiting.reset();
}

void Reception::hear_bytes(const std::shared_ptr<WsClient>& client, std::span<const std::uint8_t> bytes) {
  if (!client->rate_limit.allows(Clock::now())) {
    client->outbox.end("too many messages");
    return client->wake();
  }
  if (client->device.empty())
    return refuse(client, std::nullopt, "expected a message that begins the window before its pictures.");
  const auto found = parse_frame(bytes);
  if (!found) return refuse(client, std::nullopt, found.message());
  WsClient::Frame frame{found->number, {found->jpeg.begin(), found->jpeg.end()}};
  const bool is_busy = client->frame_in_flight && Clock::now() - client->frame_since < k_longest_look;
  if (is_busy)
    client->frame_waiting = std::move(frame);
  else
    look(client, std::move(frame));
}

// Whether a guest's window, among others of the same guest, is its tablet.
bool Reception::is_eye(const std::shared_ptr<WsClient>& client, Clock::time_point now) const {
  const auto eye = guest_eyes_.find(client->guest.name);
  return eye == guest_eyes_.end() || eye->second.client.lock() == client ||
         now - eye->second.at > std::chrono::duration<double>(apps::k_guest_place_lasts_s);
}

void Reception::look(const std::shared_ptr<WsClient>& client, WsClient::Frame frame) {
  client->frame_in_flight = frame.number;
  client->frame_since = Clock::now();
  setup_.providers.draw_window(
      {client->device, is_eye(client, client->frame_since) ? client->guest.name : "", client->parts},
      std::move(frame.jpeg),
      [this, post = setup_.post, weak = std::weak_ptr(client), number = frame.number](CompositeImage seen) {
        post([this, weak, number, seen = std::move(seen)] {
          if (const auto client = weak.lock()) looked(client, number, seen);
        });
      });
}

void Reception::looked(const std::shared_ptr<WsClient>& client,
                       std::uint32_t number,
                       const CompositeImage& seen) {
  if (client->frame_in_flight != number) return;
  client->frame_in_flight.reset();
  if (!client->device.empty()) {
    const auto now = Clock::now();
    if (seen.p_viewpoint_world && is_eye(client, now)) {
      guest_eyes_[client->guest.name] = {client, now};
      setup_.place(client->guest.name, seen.p_viewpoint_world);
    }
    client->outbox.set_image(ImageKind::window, std::make_shared<const std::string>(image_message(
                                                    ImageKind::window, number, seen.json, seen.jpeg)));
    client->wake();
  }
  if (client->frame_waiting) look(client, *std::exchange(client->frame_waiting, std::nullopt));
}

void Reception::ask_for_room(Clock::time_point now) {
  const bool is_resting = now < room_next_at_, is_recent = now - room_came_at_ < k_room_lasts;
  bool is_wanted = false;
  for (const auto& client : visitors_) {
    if (!client->wants_room || client->room_in_flight) continue;
    if (is_resting && client->room_sent == room_number_) continue;
    if (is_resting && is_recent)
      show_room(client);
    else
      is_wanted = true;
  }
  if (!is_wanted || room_is_asked_) return;
  room_is_asked_ = true;
  room_asked_at_ = now;
  setup_.providers.draw_room([this, post = setup_.post](CompositeImage seen) {
    post([this, seen = std::move(seen)] { room_came(seen); });
  });
}

void Reception::room_came(CompositeImage seen) {
  room_is_asked_ = false;
  room_came_at_ = Clock::now();
  const auto took = room_came_at_ - room_asked_at_;
  room_next_at_ = room_asked_at_ + std::max<Clock::duration>(k_between_rooms, k_room_rest * took);
  if (!room_message_ || seen.jpeg != room_.jpeg || seen.json != room_.json) {
    room_message_ = std::make_shared<const std::string>(
        image_message(ImageKind::room, ++room_number_, seen.json, seen.jpeg));
    room_ = std::move(seen);
    room_role_ = room_asked_at_ < hidden_.second ? hidden_.first : Role::look;
  }
  for (const auto& client : visitors_)
    if (client->wants_room && !client->room_in_flight && client->room_sent != room_number_) show_room(client);
}

void Reception::show_room(const std::shared_ptr<WsClient>& client) {
  client->room_in_flight = client->room_sent = room_number_;
  const bool may_see = may_see_room(client->guest) && client->guest.role >= room_role_;
  client->outbox.set_image(ImageKind::room,
                           may_see ? room_message_
                                   : std::make_shared<const std::string>(image_message(
                                         ImageKind::room, room_number_, dumped({{"why", k_hidden}}), {})));
  client->wake();
}

void Reception::take(SessionNews news) {
  if (news_) news.state = without_jitter(std::move(news.state), news_->state);
  const std::vector<Outcome> outcomes = std::exchange(news.outcomes, {});
  news_ = std::move(news);
  if (!comments_) load_comments();
  publish();
  for (const Outcome& outcome : outcomes) {
    const auto waiting = wishes_.extract(outcome.number);
    if (!waiting.empty()) waiting.mapped().done(outcome.why, number_);
  }
}

void Reception::publish() {
  if (!news_) return;
  ordered_json state = to_json(news_->state);
  const auto& edited = news_->state.last_edit;
  if (edited)
    state["last_edit"] = {{"who", edited->source},
                          {"action", edited->edit.action},
                          {"slot", edited->edit.slot},
                          {"value", edited->edit.value}};
  state["guests"] = ordered_json::array();
  for (const auto& client : visitors_)
    state["guests"].push_back({{"name", client->guest.name}, {"role", name_of(client->guest.role)}});
  state["comments"] = ordered_json::array();
  if (comments_ && *comments_) {
    const std::vector<scene::Comment>& all = **comments_;
    for (std::size_t i = all.size() > k_told_comments ? all.size() - k_told_comments : 0; i < all.size(); ++i)
      state["comments"].push_back({{"at", all[i].at},
                                   {"who", all[i].who},
                                   {"look", all[i].look},
                                   {"slot", all[i].slot},
                                   {"text", all[i].text}});
  }
  const bool is_edited = edited && edited->count != edit_count_;
  std::string text = dumped(state);
  if (text == told_ && !is_edited) return;
  told_ = std::move(text);
  ++number_;
  if (is_edited) {
    edit_count_ = edited->count;
    edit_number_ = number_;
  }
  if (edited) state["last_edit"]["number"] = edit_number_;
  ordered_json message = {{"type", "state"}, {"number", number_}};
  message.update(state);
  state_ = std::make_shared<const std::string>(dumped(message));
  for (const auto& client : visitors_) {
    client->outbox.set_state(state_);
    client->wake();
  }
}

void Reception::update_at(Clock::time_point now) {
  setup_.watched(guests_.count() > 0);
  for (const auto& client : visitors_) {
    if (guests_.is_valid(client->guest.number, now)) continue;
    client->outbox.end("the session is over. Pair again.");
    client->wake();
  }
  std::vector<Done> late;
  std::erase_if(wishes_, [&](auto& entry) {
    if (now - entry.second.since < k_longest_wish) return false;
    late.push_back(std::move(entry.second.done));
    return true;
  });
  for (const Done& done : late) done(k_late, number_);
  ask_for_room(now);
}

void Reception::close_clients(const std::string& why) {
  for (const auto& client : visitors_) {
    client->outbox.end(why);
    client->wake();
  }
}

}  // namespace limn::remote
