#include "remote/server.h"

#include <algorithm>
#include <limits>
#include <opencv2/imgproc.hpp>

#include "remote/own_addresses.h"
#include "core/log.h"
#include "core/user_folder.h"

namespace limn::apps {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::milliseconds k_between_news{50}, k_between_unwatched{1000}, k_longest_hearing{5};

constexpr std::chrono::seconds k_cameras_late{2};  // after which no image shows a code any more
constexpr double k_code_share = 0.5;               // of a projector's shorter side, without a prototype
constexpr std::chrono::milliseconds k_between_searches{300}, k_longest_search{2000};
constexpr int k_pin_px = 360;            // a PIN's sign, as it is kept
constexpr double k_least_pin_px = 50;    // in the projector's image
constexpr int k_dark = 8;                // display value
constexpr int k_module_px = 12;          // of the code, as it is kept
constexpr double k_least_module_px = 2;  // of the projector's image, that a phone still reads
constexpr double k_code_light = 0.75;    // display value: white paper would outshine all else

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

// Where the prototype is free of markers and, if there is room, of parts.
std::optional<OverlayPlace> free_place(Session* session,
                                    std::size_t projector,
                                    cv::Size shape,
                                    double least_px) {
  cv::Mat points = session->free_surface(projector);
  if (points.empty() || shape.empty()) return std::nullopt;
  const Rig& rig = session->setup().rig;
  const Imager& imager = rig.projectors[projector];
  const Pose& world_from_prototype = *session->painted().posed.world_from_prototype;
  const Eigen::Vector3d d_up_world =
      (rig.cameras.empty() ? imager : rig.cameras[0]).imager_from_world.rotation.inverse() *
      Eigen::Vector3d(0, -1, 0);
  const auto place = [&](const cv::Mat& free) {
    return overlay_place(imager, world_from_prototype, free,
                      world_from_prototype.rotation.inverse() * d_up_world, shape, least_px);
  };
  cv::Mat parts, free = points.clone();
  cv::cvtColor(session->painted().projectors[projector], parts, cv::COLOR_BGR2GRAY);
  free.setTo(cv::Scalar::all(std::numeric_limits<double>::quiet_NaN()), parts > k_dark);
  const auto beside = place(free);
  return beside ? beside : place(points);
}

}  // namespace

Result<std::unique_ptr<Server>> Server::open(const ServeOptions& options, ImageProviders providers) {
  const auto named = [](const Error& problem) {
    return Error{fmt::format("--serve: {}", problem.message), problem.wrong_usage};
  };
  const auto place = net_place(options.at, "127.0.0.1", true);
  if (!place) return named(place.error());
  auto files = StaticFiles::read(options.page.empty() ? fs::path(LIMN_SOURCE_DIR) / "remote/web" : options.page);
  if (!files) return named(files.error());
  const auto certificate = certificate_for(options, place->host);
  if (!certificate) return named(certificate.error());
  auto network = Network::open(*place, *certificate, options.limits);
  if (!network) return named(network.error());
  std::unique_ptr<Server> out(new Server());
  out->network_ = std::move(*network);
  out->know_ = providers.know;
  out->code_lasts_ = options.code_lasts;
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
  const Invitation& told = out->invitation_;
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

void Server::apply_requests(Session* session, Stamp at) {
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

void Server::show_code(const std::string& projector, Role role) {
  code_ = {};
  code_.projector = projector;
  code_.role = role;
  log_info("live: {} shows the code of the remote for {}", projector, name_of(role));
}

// The code begins with a place for it; after a while without one, too: the prototype may not be seen.
bool Server::has_code_begun(Session* session, std::size_t projector) {
  if (code_.until) return true;
  const auto now = Clock::now();
  const std::string& pin = invitation_.pins[static_cast<std::size_t>(code_.role)];
  if (!code_.asked) {
    code_.asked = now;
    code_.sign =
        k_code_light * pairing_code_image(invitation_.url_for(code_.role), pin, name_of(code_.role), k_module_px);
  }
  if (code_.searched && now - *code_.searched < k_between_searches) return false;
  code_.searched = now;
  code_.place =
      free_place(session, projector, code_.sign.size(), k_least_module_px * code_.sign.cols / k_module_px);
  if (!code_.place && now - *code_.asked < k_longest_search) return false;
  if (!code_.place) {
    const cv::Mat smaller = k_code_light * pin_image(pin, name_of(code_.role), k_pin_px);
    code_.place = free_place(session, projector, smaller.size(), k_least_pin_px);
    if (code_.place) code_.sign = smaller;
  }
  code_.until = now + code_lasts_;
  network_->post([this, role = code_.role, until = *code_.until + k_cameras_late] {
    reception_->hide_room(role, until);
  });
  return true;
}

cv::Mat Server::projector_image(Session* session, std::size_t projector) {
  const ComposedFrame& painted = session->painted();
  const cv::Mat& image = painted.projectors[projector];
  const Imager& imager = session->setup().rig.projectors[projector];
  if (imager.name != code_.projector || session->show_state().blackout) return image;
  if (!has_code_begun(session, projector)) return image;
  if (Clock::now() >= *code_.until) code_ = {};
  if (code_.sign.empty()) return image;
  cv::Mat out = image.clone();
  if (code_.place) {
    if (painted.posed.world_from_prototype)
      draw_pairing_overlay(code_.sign, *code_.place, imager, *painted.posed.world_from_prototype, &out);
    return out;
  }
  const int module_px =
      static_cast<int>(k_code_share * std::min(out.cols, out.rows) * k_module_px / code_.sign.cols);
  if (module_px < 1) return image;
  cv::Mat plain;
  cv::resize(code_.sign, plain, {}, 1.0 * module_px / k_module_px, 1.0 * module_px / k_module_px,
             cv::INTER_AREA);
  plain.copyTo(out(cv::Rect({(out.cols - plain.cols) / 2, (out.rows - plain.rows) / 2}, plain.size())));
  return out;
}

void Server::publish_state(const Session& session,
                           const Telemetry& telemetry,
                           const DeviceHealth& health,
                           Stamp at) {
  if (!begun_at_) begun_at_ = at;
  if (know_) know_(session);
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

}  // namespace limn::apps
