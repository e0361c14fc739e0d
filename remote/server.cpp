#include "remote/server.h"

#include <algorithm>

#include "core/log.h"
#include "core/user_folder.h"
#include "remote/http/own_addresses.h"

namespace limn::remote {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::milliseconds k_publish_interval{50}, k_unwatched_publish_interval{1000},
    k_edit_time_budget{5};

constexpr std::chrono::seconds k_camera_delay{2};  // after which no image shows a code any more

bool is_expired(const Wish& wish, std::chrono::steady_clock::time_point now) {
  return now - wish.since >= k_longest_wish;
}

// What the certificate is for: however people may call this machine.
std::vector<std::string> certificate_hosts(const std::string& host) {
  std::vector<std::string> names = {"localhost", "127.0.0.1", "::1"};
  if (!is_unspecified(host)) names.push_back(host);
  for (const std::string& address : own_addresses()) names.push_back(address);
  if (const std::string name = own_host_name(); !name.empty()) {
    names.push_back(name);
    names.push_back(name + ".local");
  }
  std::sort(names.begin(), names.end());
  names.erase(std::unique(names.begin(), names.end()), names.end());
  return names;
}

// Under which address other machines reach it.
std::string shown_host(const std::string& host) {
  std::string shown = host;
  if (is_unspecified(host)) {
    const std::vector<std::string> own = own_addresses();
    shown = own.empty() ? "127.0.0.1" : own.front();
  }
  return shown.find(':') == std::string::npos ? shown : "[" + shown + "]";
}

Result<std::optional<Certificate>> certificate_for(const ServeOptions& options, const std::string& host) {
  if (is_loopback(host) && !options.always_encrypted) return std::optional<Certificate>();
  fs::path keys = options.keys;
  if (keys.empty()) {
    LIMN_TRY(keys, user_folder());
  }
  LIMN_TRY(Certificate made, load_or_create_certificate(keys, certificate_hosts(host)));
  return std::optional(std::move(made));
}

}  // namespace

Result<std::unique_ptr<Server>> Server::open(const ServeOptions& options, ImageProviders providers) {
  const auto named = [](const Error& problem) {
    return Error{fmt::format("--serve: {}", problem.message), problem.wrong_usage};
  };
  const auto place = apps::net_place(options.at, "127.0.0.1", true);
  if (!place) return named(place.error());
  auto files =
      StaticFiles::read(options.page.empty() ? fs::path(LIMN_SOURCE_DIR) / "remote/web" : options.page);
  if (!files) return named(files.error());
  const auto certificate = certificate_for(options, place->host);
  if (!certificate) return named(certificate.error());
  auto network = Network::open(*place, *certificate, options.limits);
  if (!network) return named(network.error());
  std::unique_ptr<Server> out(new Server());
  out->network_ = std::move(*network);
  out->update_providers_ = providers.update_session;
  out->code_.set_duration(options.code_duration);
  Server* server = out.get();
  out->reception_ = std::make_unique<Reception>(Reception::Setup{
      .is_encrypted = certificate->has_value(),
      .is_loopback = is_loopback(place->host),
      .authority = certificate->has_value() ? (*certificate)->authority : "",
      .cookie = fmt::format("limn-{}", out->network_->port()),
      .files = std::move(*files),
      .providers = std::move(providers),
      .worker = &out->worker_,
      .wish =
          [server](Wish wish) {
            const std::lock_guard lock(server->mutex_);
            std::erase_if(server->edit_requests_,
                          [&](const Wish& old) { return is_expired(old, wish.since); });
            server->edit_requests_.push_back(std::move(wish));
          },
      .place =
          [server](const std::string& guest, const std::optional<Eigen::Vector3d>& p_viewpoint_world) {
            const std::lock_guard lock(server->mutex_);
            server->viewpoints_[guest] = p_viewpoint_world;
          },
      .watched = [server](bool has_guests) { server->has_guests_ = has_guests; },
      .post = [network = out->network_.get()](std::function<void()> job) { network->post(std::move(job)); }});
  const bool is_encrypted = certificate->has_value();
  out->invitation_ = {fmt::format("{}://{}:{}/", is_encrypted ? "https" : "http", shown_host(place->host),
                                  out->network_->port()),
                      is_encrypted ? (*certificate)->fingerprint : "",
                      is_encrypted ? (*certificate)->authority_fingerprint : "",
                      out->reception_->guests().pins()};
  const apps::Invitation& invitation = out->invitation_;
  log_info("live: the remote is at {}", invitation.url);
  if (is_encrypted) {
    log_info("live: its certificate's SHA-256 is {}", invitation.fingerprint);
    log_info("live: that of limn.crt, for devices that shall trust it, is {}",
             invitation.authority_fingerprint);
  }
  log_info("live: PINs of the remote: look {}, work {}, operate {}", invitation.pins[0], invitation.pins[1],
           invitation.pins[2]);
  out->network_->start(out->reception_.get());
  return out;
}

Server::~Server() { stop(); }

void Server::stop() {
  if (!network_) return;
  network_->stop();
  update_providers_ = {};
  if (reception_) reception_->blind();
  worker_.close();
}

std::optional<Wish> Server::next_edit_request() {
  const std::lock_guard lock(mutex_);
  if (edit_requests_.empty()) return std::nullopt;
  Wish wish = std::move(edit_requests_.front());
  edit_requests_.pop_front();
  return wish;
}

void Server::apply_edits(apps::Session* session, Stamp at) {
  const auto begun = Clock::now();
  std::map<std::string, std::optional<Eigen::Vector3d>> viewpoints;
  {
    const std::lock_guard lock(mutex_);
    viewpoints.swap(viewpoints_);
  }
  for (const auto& [guest, p_viewpoint_world] : viewpoints) session->see(guest, p_viewpoint_world, at);
  for (std::size_t i = 0; i < k_max_edits_at_once && Clock::now() - begun < k_edit_time_budget; ++i) {
    const auto wish = next_edit_request();
    if (!wish) break;
    if (is_expired(*wish, Clock::now())) continue;
    const Status done = session->edit(wish->edit, wish->who, at);
    edit_results_.push_back({wish->number, done ? "" : done.message()});
  }
}

void Server::hear(const apps::SessionMoment& moment) {
  apply_edits(&moment.session, moment.at);
  publish_state(moment.session, moment.telemetry, moment.health, moment.at);
}

std::vector<apps::Overlay> Server::overlays(apps::Session* session) { return code_.overlays(session); }

void Server::show_code(const std::string& projector, Role role) {
  const std::string& pin = invitation_.pins[static_cast<std::size_t>(role)];
  code_.show(projector, {invitation_.url_for(role), pin, name_of(role)},
             [this, role](std::chrono::steady_clock::time_point until) {
               network_->post([this, role, until] { reception_->hide_room(role, until + k_camera_delay); });
             });
  log_info("live: {} shows the code of the remote for {}", projector, name_of(role));
}

void Server::publish_state(const apps::Session& session,
                           const apps::Telemetry& telemetry,
                           const apps::DeviceHealth& health,
                           Stamp at) {
  if (!begun_at_) begun_at_ = at;
  if (update_providers_) update_providers_(session);
  if (session.is_writing()) return;  // what people ask for as soon as the state shows it must be on the disk
  const auto now = Clock::now();
  const std::size_t edits = session.last_edit() ? session.last_edit()->count : 0;
  const bool is_due =
      !published_at_ || !edit_results_.empty() || edits != published_edits_ ||
      now - *published_at_ >= (has_guests_ ? k_publish_interval : k_unwatched_publish_interval);
  if (!is_due) return;
  published_at_ = now;
  published_edits_ = edits;
  if (scenes_ != session.scenes()) {
    scene_ = std::make_shared<const scene::Scene>(session.setup().scene);
    scenes_ = session.scenes();
  }
  SessionNews news{session_state(session, telemetry, health, *begun_at_), session.painted().projectors,
                   session.show_state().looks, scene_, std::exchange(edit_results_, {})};
  {
    const std::lock_guard lock(mutex_);
    if (news_)  // not taken yet
      news.outcomes.insert(news.outcomes.begin(), news_->outcomes.begin(), news_->outcomes.end());
    news_ = std::move(news);
    if (std::exchange(is_news_posted_, true)) return;
  }
  network_->post([this] {
    std::optional<SessionNews> newest;
    {
      const std::lock_guard lock(mutex_);
      newest = std::exchange(news_, std::nullopt);
      is_news_posted_ = false;
    }
    if (newest) reception_->take(std::move(*newest));
  });
}

}  // namespace limn::remote
