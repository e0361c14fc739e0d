#include "remote/server.h"

#include <algorithm>

#include "core/data_folder.h"
#include "core/log.h"
#include "core/user_folder.h"
#include "device/udp_socket.h"
#include "remote/http/own_addresses.h"

namespace limn::remote {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::milliseconds k_publish_interval{50}, k_unwatched_publish_interval{1000};
constexpr std::chrono::milliseconds k_edit_time_budget{5};  // for edits, in one frame
constexpr std::size_t k_max_tracks = 600;                   // viewers' tracks in one update
constexpr std::chrono::seconds k_camera_delay{2};           // images of cameras may show a code for so long

bool is_expired(const EditRequest& request, std::chrono::steady_clock::time_point now) {
  return now - request.requested_at >= k_edit_timeout;
}

// All names and addresses by which people may reach this machine.
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

// The host part of a URL by which other machines reach this one.
std::string shown_host(const std::string& host) {
  std::string shown = host;
  if (is_unspecified(host)) {
    const std::vector<std::string> own = own_addresses();
    shown = own.empty() ? "127.0.0.1" : own.front();
  }
  return shown.find(':') == std::string::npos ? shown : "[" + shown + "]";
}

Result<std::optional<Certificate>> certificate_for(const ServeOptions& options, const std::string& host) {
  if (device::is_loopback(host) && !options.always_encrypted) return std::optional<Certificate>();
  fs::path keys = options.keys;
  if (keys.empty()) {
    LIMN_TRY(keys, user_folder());
  }
  LIMN_TRY(Certificate made, load_or_create_certificate(keys, certificate_hosts(host)));
  return std::optional(std::move(made));
}

}  // namespace

RequestHandler::Setup Server::handler_setup(const std::string& host,
                                            const std::optional<Certificate>& certificate) {
  return {.authentication = {.is_encrypted = certificate.has_value(),
                             .is_loopback = device::is_loopback(host),
                             .cookie = fmt::format("limn-{}", network_->port())},
          .authority = certificate ? certificate->authority : "",
          .files = {},
          .providers = {},
          .worker = &worker_,
          .submit_edit =
              [this](EditRequest request) {
                const std::lock_guard lock(mutex_);
                std::erase_if(edit_requests_,
                              [&](const EditRequest& old) { return is_expired(old, request.requested_at); });
                edit_requests_.push_back(std::move(request));
              },
          .set_viewpoint =
              [this](const std::string& guest, const std::optional<Eigen::Vector3d>& p_viewpoint_world) {
                const std::lock_guard lock(mutex_);
                viewpoints_[guest] = p_viewpoint_world;
              },
          .set_glasses =
              [this](std::vector<std::string> lines) {
                const std::lock_guard lock(mutex_);
                glasses_ = std::move(lines);
              },
          .set_has_guests = [this](bool has_guests) { has_guests_ = has_guests; },
          .post = [network = network_.get()](std::function<void()> job) { network->post(std::move(job)); }};
}

Result<std::unique_ptr<Server>> Server::open(const ServeOptions& options, ImageProviders providers) {
  const auto named = [](const Error& problem) {
    return Error{fmt::format("--serve: {}", problem.message), problem.wrong_usage};
  };
  const auto place = device::net_place(options.at, "127.0.0.1", true);
  if (!place) return named(place.error());
  fs::path page = options.page;
  if (page.empty()) {
    LIMN_TRY(page, data_file("remote/web"));
  }
  auto files = StaticFiles::read(page);
  if (!files) return named(files.error());
  const auto certificate = certificate_for(options, place->host);
  if (!certificate) return named(certificate.error());
  auto network = Network::open(*place, *certificate, options.limits);
  if (!network) return named(network.error());
  std::unique_ptr<Server> out(new Server());
  out->network_ = std::move(*network);
  out->update_providers_ = providers.update_session;
  out->code_.set_duration(options.code_duration);
  RequestHandler::Setup setup = out->handler_setup(place->host, *certificate);
  setup.files = std::move(*files);
  setup.providers = std::move(providers);
  out->handler_ = std::make_unique<RequestHandler>(std::move(setup));
  out->invite_guests(place->host, *certificate);
  out->network_->start(out->handler_.get());
  return out;
}

// Makes the invitation and logs it.
void Server::invite_guests(const std::string& host, const std::optional<Certificate>& certificate) {
  invitation_ = {
      fmt::format("{}://{}:{}/", certificate ? "https" : "http", shown_host(host), network_->port()),
      certificate ? certificate->fingerprint : "", certificate ? certificate->authority_fingerprint : "",
      handler_->sessions().pins()};
  log_info("live: the remote is at {}", invitation_.url);
  if (certificate) {
    log_info("live: its certificate's SHA-256 is {}", invitation_.fingerprint);
    log_info("live: that of limn.crt, for devices that shall trust it, is {}",
             invitation_.authority_fingerprint);
  }
  const auto& pins = invitation_.pins;
  log_info("live: PINs of the remote: look {}, work {}, operate {}", pins[0], pins[1], pins[2]);
}

Server::~Server() { stop(); }

void Server::stop() {
  if (!network_) return;
  network_->stop();
  update_providers_ = {};
  if (handler_) handler_->release_image_providers();
  worker_.close();
}

std::optional<EditRequest> Server::next_edit_request() {
  const std::lock_guard lock(mutex_);
  if (edit_requests_.empty()) return std::nullopt;
  EditRequest request = std::move(edit_requests_.front());
  edit_requests_.pop_front();
  return request;
}

void Server::apply_edits(session::Session* session, Stamp at) {
  const auto begun = Clock::now();
  std::map<std::string, std::optional<Eigen::Vector3d>> viewpoints;
  {
    const std::lock_guard lock(mutex_);
    viewpoints.swap(viewpoints_);
  }
  for (const auto& [guest, p_viewpoint_world] : viewpoints)
    session->note_tablet(guest, p_viewpoint_world, at);
  for (std::size_t i = 0; i < k_max_edits_at_once && Clock::now() - begun < k_edit_time_budget; ++i) {
    const auto request = next_edit_request();
    if (!request) break;
    if (is_expired(*request, Clock::now())) continue;
    const Status done = session->edit(request->edit, request->who, at);
    edit_results_.push_back({request->number, done ? "" : done.message()});
  }
}

void Server::apply_edits(const session::SessionMoment& moment) {
  apply_edits(&moment.session, moment.at);
  publish_state(moment.session, moment.telemetry, moment.health, moment.at);
}

std::vector<projector::Overlay> Server::overlays(session::Session* session) {
  return code_.overlays(session);
}

void Server::show_code(const std::string& projector, Role role) {
  const std::string& pin = invitation_.pins[static_cast<std::size_t>(role)];
  code_.show(projector, {invitation_.url_for(role), pin, name_of(role)},
             [this, role](std::chrono::steady_clock::time_point until) {
               network_->post([this, role, until] { handler_->hide_room(role, until + k_camera_delay); });
             });
  log_info("live: {} shows the code of the remote for {}", projector, name_of(role));
}

void Server::publish_state(const session::Session& session,
                           const session::Telemetry& telemetry,
                           const session::DeviceHealth& health,
                           Stamp at) {
  if (!begun_at_) begun_at_ = at;
  if (update_providers_) update_providers_(session);
  collect_viewer_tracks(session);
  // Files that the state mentions must be complete on the disk, since guests may request them at once.
  if (session.store().is_busy()) return;
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
    rig_ = std::make_shared<const Rig>(session.setup().rig);
    scenes_ = session.scenes();
  }
  hand_over_update({.state = session_state(session, telemetry, health, *begun_at_),
                    .projector_images = session.composed().projectors,
                    .looks = session.show_state().looks,
                    .scene = scene_,
                    .rig = rig_,
                    .scenes = scenes_,
                    .posed = session.composed().posed,
                    .viewer_tracks = std::exchange(viewer_tracks_, {}),
                    .at = at,
                    .made_at = now,
                    .edit_results = std::exchange(edit_results_, {})});
}

// What the cameras measured of the markers of viewers; each moment once.
void Server::collect_viewer_tracks(const session::Session& session) {
  const session::Percepts& percepts = session.percepts();
  if (percepts.captured_at == tracks_at_ || !has_guests_) return;
  tracks_at_ = percepts.captured_at;
  for (std::size_t i = 0; i < session.setup().scene.viewers.size(); ++i)
    for (const Track& track : percepts.tracks)
      if (track.body == scene::viewer_body(i) && track.tracking == TrackingState::measured &&
          viewer_tracks_.size() < k_max_tracks)
        viewer_tracks_.push_back(track);
}

// Hands an update to the network's thread. An update that it has not taken yet is replaced; its edit results
// are kept.
void Server::hand_over_update(SessionUpdate update) {
  {
    const std::lock_guard lock(mutex_);
    if (update_) {
      update.edit_results.insert(update.edit_results.begin(), update_->edit_results.begin(),
                                 update_->edit_results.end());
      update.viewer_tracks.insert(update.viewer_tracks.begin(), update_->viewer_tracks.begin(),
                                  update_->viewer_tracks.end());
    }
    update_ = std::move(update);
    if (std::exchange(is_update_posted_, true)) return;
  }
  network_->post([this] {
    std::optional<SessionUpdate> newest;
    {
      const std::lock_guard lock(mutex_);
      newest = std::exchange(update_, std::nullopt);
      is_update_posted_ = false;
    }
    if (newest) handler_->apply_update(std::move(*newest));
  });
}

}  // namespace limn::remote
