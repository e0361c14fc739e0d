#include "remote/server.h"

#include <algorithm>

#include "core/log.h"
#include "core/user_folder.h"
#include "remote/http/own_addresses.h"

namespace limn::remote {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::milliseconds k_between_news{50}, k_between_unwatched{1000}, k_longest_hearing{5};

constexpr std::chrono::seconds k_cameras_late{2};  // after which no image shows a code any more

bool is_late(const Wish& wish, std::chrono::steady_clock::time_point now) {
  return now - wish.since >= k_longest_wish;
}

// What the certificate is for: however people may call this machine.
std::vector<std::string> names_of(const std::string& host) {
  std::vector<std::string> names = {"localhost", "127.0.0.1", "::1"};
  if (!is_any(host)) names.push_back(host);
  for (const std::string& address : own_addresses()) names.push_back(address);
  if (const std::string name = own_name(); !name.empty()) {
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
  if (is_any(host)) {
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
  LIMN_TRY(Certificate made, certificate_in(keys, names_of(host)));
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
  out->know_ = providers.know;
  out->code_.set_duration(options.code_lasts);
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
            std::erase_if(server->wishes_, [&](const Wish& old) { return is_late(old, wish.since); });
            server->wishes_.push_back(std::move(wish));
          },
      .place =
          [server](const std::string& guest, const std::optional<Eigen::Vector3d>& p_eye_world) {
            const std::lock_guard lock(server->mutex_);
            server->places_[guest] = p_eye_world;
          },
      .watched = [server](bool is_watched) { server->is_watched_ = is_watched; },
      .post = [network = out->network_.get()](std::function<void()> job) { network->post(std::move(job)); }});
  const bool is_encrypted = certificate->has_value();
  out->invitation_ = {fmt::format("{}://{}:{}/", is_encrypted ? "https" : "http", shown_host(place->host),
                                  out->network_->port()),
                      is_encrypted ? (*certificate)->fingerprint : "",
                      is_encrypted ? (*certificate)->authority_fingerprint : "",
                      out->reception_->guests().pins()};
  const apps::Invitation& told = out->invitation_;
  log_info("live: the remote is at {}", told.url);
  if (is_encrypted) {
    log_info("live: its certificate's SHA-256 is {}", told.fingerprint);
    log_info("live: that of limn.crt, for devices that shall trust it, is {}", told.authority_fingerprint);
  }
  log_info("live: PINs of the remote: look {}, work {}, operate {}", told.pins[0], told.pins[1],
           told.pins[2]);
  out->network_->start(out->reception_.get());
  return out;
}

Server::~Server() { stop(); }

void Server::stop() {
  if (!network_) return;
  network_->stop();
  know_ = {};
  if (reception_) reception_->blind();
  worker_.close();
}

std::optional<Wish> Server::next_wish() {
  const std::lock_guard lock(mutex_);
  if (wishes_.empty()) return std::nullopt;
  Wish wish = std::move(wishes_.front());
  wishes_.pop_front();
  return wish;
}

void Server::hear(apps::Session* session, Stamp at) {
  const auto begun = Clock::now();
  std::map<std::string, std::optional<Eigen::Vector3d>> places;
  {
    const std::lock_guard lock(mutex_);
    places.swap(places_);
  }
  for (const auto& [guest, p_eye_world] : places) session->see(guest, p_eye_world, at);
  for (std::size_t i = 0; i < k_most_at_once && Clock::now() - begun < k_longest_hearing; ++i) {
    const auto wish = next_wish();
    if (!wish) break;
    if (is_late(*wish, Clock::now())) continue;
    const Status done = session->edit(wish->edit, wish->who, at);
    outcomes_.push_back({wish->number, done ? "" : done.message()});
  }
}

void Server::hear(const apps::SessionMoment& moment) {
  hear(&moment.session, moment.at);
  tell(moment.session, moment.telemetry, moment.health, moment.at);
}

std::vector<apps::Overlay> Server::overlays(apps::Session* session) { return code_.overlays(session); }

void Server::show_code(const std::string& projector, Role role) {
  const std::string& pin = invitation_.pins[static_cast<std::size_t>(role)];
  code_.show(projector, {invitation_.url_for(role), pin, name_of(role)},
             [this, role](std::chrono::steady_clock::time_point until) {
               network_->post([this, role, until] { reception_->hide_room(role, until + k_cameras_late); });
             });
  log_info("live: {} shows the code of the remote for {}", projector, name_of(role));
}

void Server::tell(const apps::Session& session,
                  const apps::Telemetry& telemetry,
                  const apps::DeviceHealth& health,
                  Stamp at) {
  if (!begun_at_) begun_at_ = at;
  if (know_) know_(session);
  if (session.is_writing()) return;  // what people ask for as soon as they are told must be on the disk
  const auto now = Clock::now();
  const std::size_t edits = session.last_edit() ? session.last_edit()->count : 0;
  const bool is_due = !told_at_ || !outcomes_.empty() || edits != told_edits_ ||
                      now - *told_at_ >= (is_watched_ ? k_between_news : k_between_unwatched);
  if (!is_due) return;
  told_at_ = now;
  told_edits_ = edits;
  if (scenes_ != session.scenes()) {
    scene_ = std::make_shared<const scene::Scene>(session.setup().scene);
    scenes_ = session.scenes();
  }
  SessionNews news{state_of(session, telemetry, health, *begun_at_), session.painted().projectors,
                   session.show_state().looks, scene_, std::exchange(outcomes_, {})};
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
