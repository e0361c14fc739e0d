#include "nodes/node.h"

#include <algorithm>
#include <chrono>
#include <deque>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/file.h"
#include "core/log.h"
#include "core/names.h"
#include "core/stopwatch.h"
#include "core/version.h"
#include "device/gl_context.h"
#include "nodes/node_devices.h"
#include "nodes/node_frames.h"
#include "nodes/node_screens.h"
#include "nodes/orders.h"
#include "tracker/camera_encoding.h"

namespace limn::nodes {
namespace {

constexpr auto k_message_wait = std::chrono::milliseconds(20);
constexpr double k_fade_s = 0.4;  // after the host has gone, which is noticed half a second later
constexpr double k_health_every_s = 0.2;
constexpr double k_monitors_every_s = 1;
constexpr double k_try_again_s = 2;    // after a setup could not be loaded
constexpr double k_settled_s = 1.5;    // in the room; a host that is there has been found by then
constexpr double k_drawing_s = 0.5;    // after a frame; later nothing is drawn, as in a calibration
constexpr double k_clock_limit_s = 3;  // for the first comparison of the clocks

bool has_same_content(const Setup& a, const Setup& b) { return a.files == b.files && a.devices == b.devices; }

// What the node does between messages, on the thread of the OpenGL context.
class NodeLoop {
 public:
  NodeLoop(const NodeOptions& options,
           Room* room,
           const device::Desktop* desktop,
           const device::GlContext& context,
           AppendLog log)
      : room_(room),
        displays_(desktop),
        screens_(&displays_),
        cameras_(room),
        loader_(options.fetch, options.work),
        deviations_(options.fetch, options.work / "deviation"),
        log_(std::move(log)) {
    offer_.version = version();
    offer_.renderer = context.description();
    if (options.offers_cameras) offer_.cameras = NodeCameras::found();
  }

  void step() {
    offer_monitors();
    room_->wait(k_message_wait);
    note_host();
    load_setup();
    if (auto loaded = loader_.take_loaded()) begin(std::move(*loaded));
    if (const auto layer = deviations_.take_loaded()) use_deviation(*layer);
    carry_out_orders();
    screens_.receive(room_->take_screen_images());
    if (const auto moment = room_->take_moment()) show(*moment);
    screens_.show();
    if (gone_at_) fade();
    report();
  }

  void end() {
    displays_.darken();
    log_.flush();
  }

 private:
  struct WaitingOrder {
    Order order;
    std::string host;
    std::future<cv::Mat> image;  // that it brings, decoded
  };

  void offer_monitors() {
    if (offered_at_ && seconds_between(*offered_at_, now()) < k_monitors_every_s) return;
    std::vector<OfferedDevice> monitors = displays_.monitors();
    const bool is_new = !offered_at_ || monitors != offer_.monitors;
    offered_at_ = now();
    if (!is_new) return;
    offer_.monitors = std::move(monitors);
    if (const Status sent = room_->offer(offer_); !sent) log_warning("node: {}", sent.message());
  }

  void note_host() {
    const std::optional<Machine> host = room_->host();
    if (host && (!host_ || host_->sender.run != host->sender.run)) greet(*host);
    if (host_ && !host) {
      setup_.reset();
      log_warning("node: the host {} has gone; the light fades out until it is back", host_->sender.node);
      gone_at_ = now();
      orders_.clear();
      cameras_.close_cameras();
      screens_.clear();
    }
    host_ = host;
  }

  void greet(const Machine& host) {
    if (host.offer.protocol != k_protocol)
      log_warning(
          "node: the host {} has version {}, and this machine has {}. Install the same version on both.",
          host.sender.node, host.offer.version, version());
    else
      log_info("node: {} is the host", host.sender.node);
  }

  // The newest setup. One that could not be loaded is tried again.
  void load_setup() {
    if (auto setup = room_->take_setup()) {
      setup_ = std::move(*setup);
      load_at_ = now();
    }
    if (!host_ || !setup_ || !load_at_ || now() < *load_at_ || !deviations_.is_idle()) return;
    load_at_.reset();
    const bool draws = frames_ && loader_.is_idle() && drawn_;
    // A host that was restarted with the same session finds it drawn already.
    if (draws && has_same_content(*drawn_, *setup_)) return adopt();
    // Frames go on while the new deviation from the CAD comes.
    if (draws && differ_in_deviation_only(*drawn_, *setup_)) {
      adopt();
      return deviations_.load(*setup_, *host_);
    }
    loading_ = setup_;
    loader_.load(*setup_, *host_);
  }

  void adopt() {
    frames_->adopt(host_->sender.run, setup_->revision);
    for (CameraTask& task : camera_tasks_) task.search.setup = setup_->revision;
    cameras_.detect(camera_tasks_);
  }

  void use_deviation(const Result<DeviationLoader::Layer>& layer) {
    if (!frames_ || !host_ || deviations_.host_run() != host_->sender.run) return;  // its host has gone
    if (layer) {
      frames_->use_deviation(*layer);
      drawn_ = deviations_.setup();
      return;
    }
    log_warning("node: {}", layer.message());
    if (!load_at_) load_at_ = shifted(now(), k_try_again_s);
  }

  void begin(Result<LoadedSetup> loaded) {
    if (loaded && host_ && loaded->run != host_->sender.run) return;  // its host has gone
    drawn_.reset();
    const std::string problem_before = std::exchange(problem_, {});
    frames_.reset();
    if (loaded) {
      detect(*loaded);
      screens_.set_devices(loaded->devices, loaded->session.rig, room_->self().node);
    } else {
      camera_tasks_.clear();
      cameras_.detect({});
      screens_.set_devices({}, {}, room_->self().node);
    }
    auto frames = loaded ? NodeFrames::create(std::move(*loaded), room_->self().node, &displays_)
                         : Result<std::unique_ptr<NodeFrames>>(loaded.error());
    if (frames) {
      frames_ = std::move(*frames);
      drawn_ = loading_;
      gone_at_.reset();
      return;
    }
    load_at_ = shifted(now(), k_try_again_s);
    problem_ = frames.message();
    if (problem_ == problem_before) return;
    log_warning("node: {}", problem_);
  }

  // In the images of the session's cameras that are plugged in here.
  void detect(const LoadedSetup& loaded) {
    const session::SessionSetup& session = loaded.session;
    const auto wanted = session::camera_detector_setup(session.scene, session.watch.full_scan_every);
    camera_tasks_.clear();
    if (!wanted) log_warning("node: {}", wanted.message());
    for (const device::CameraConfig& config : loaded.devices.cameras) {
      const Imager* camera = find_named(session.rig.cameras, config.name);
      if (wanted && config.host == room_->self().node && camera)
        camera_tasks_.push_back(
            {config, {loaded.revision, *wanted, *camera, tracker::encoding_of(session.rig, *camera)}});
    }
    cameras_.detect(camera_tasks_);
  }

  // Orders that come before the clocks are compared wait for that.
  void carry_out_orders() {
    for (Room::ReceivedOrder& received : room_->take_orders()) {
      std::future<cv::Mat> image = std::async(is_drawing() ? std::launch::async : std::launch::deferred,
                                              [order = received.order] { return image_of(order); });
      orders_.push_back({std::move(received.order), std::move(received.host), std::move(image)});
    }
    if (orders_.empty()) waits_since_.reset();
    if (!orders_.empty() && !waits_since_) waits_since_ = now();
    if (!room_->host_clock() && waits_since_ && seconds_between(*waits_since_, now()) < k_clock_limit_s)
      return;
    while (!orders_.empty()) {
      if (orders_.front().image.wait_for(std::chrono::seconds(0)) == std::future_status::timeout) return;
      carry_out(&orders_.front());
      orders_.pop_front();
    }
  }

  // Whether frames are shown now, which must not wait for the decoding of an image.
  bool is_drawing() const { return frames_ && shown_at_ && seconds_between(*shown_at_, now()) < k_drawing_s; }

  void carry_out(WaitingOrder* waiting) {
    const Order& order = waiting->order;
    if (is_for_camera(order)) return cameras_.carry_out(order, waiting->host);
    Answer answer = carried_out(order, waiting->image.get(), room_->host_clock(), &displays_);
    answer.to = waiting->host;
    if (const Status sent = room_->send(answer); !sent) log_warning("node: {}", sent.message());
  }

  void show(const Moment& moment) {
    if (!frames_) return;
    gone_at_.reset();
    shown_at_ = now();
    frames_->show(
        moment, room_->host_clock(), [this](Stamp until) { return room_->wait_without_black(until); }, &log_);
  }

  void fade() {
    const double share = 1 - seconds_between(*gone_at_, now()) / k_fade_s;
    if (frames_) frames_->dim(share);
    if (share > 0) return;
    gone_at_.reset();
    displays_.darken();
    log_info("node: the light is out");
  }

  void report() {
    const double reported_s = seconds_between(reported_at_, now());  // ago; negative: the clock has stepped
    if (reported_s >= 0 && reported_s < k_health_every_s) return;
    reported_at_ = now();
    Health health;
    const std::optional<ClockEstimate> clock = room_->host_clock();
    if (clock) {
      health.clock_offset_s = 1e-9 * static_cast<double>(clock->offset.count());
      health.clock_stddev_s = clock->stddev_s;
    }
    if (frames_) frames_->report(clock, &health);
    screens_.report(&health);
    if (!problem_.empty()) health.problems.push_back(problem_);
    health.has_no_host = !host_ && seconds_between(entered_at_, now()) > k_settled_s;
    if (const Status sent = room_->send(health); !sent) log_warning("node: {}", sent.message());
  }

  Room* room_;
  NodeDisplays displays_;
  NodeScreens screens_;
  CameraWorker cameras_;
  SetupLoader loader_;
  DeviationLoader deviations_;
  AppendLog log_;
  const Stamp entered_at_ = now();
  Offer offer_;
  std::optional<Stamp> offered_at_;
  std::optional<Machine> host_;
  std::deque<WaitingOrder> orders_;
  std::optional<Stamp> waits_since_;
  std::optional<Setup> setup_;            // the host's last
  std::optional<Setup> loading_;          // the last one that was given to the loader
  std::optional<Setup> drawn_;            // that of the frames
  std::vector<CameraTask> camera_tasks_;  // likewise
  std::optional<Stamp> load_at_;          // when it is to be loaded
  std::unique_ptr<NodeFrames> frames_;
  std::string problem_;            // why there are no frames
  std::optional<Stamp> shown_at_;  // the last frame
  std::optional<Stamp> gone_at_;   // when the host was found to have gone, while the light fades
  Stamp reported_at_;
};

}  // namespace

Status run_node(const NodeOptions& options,
                Room* room,
                const device::Desktop* desktop,
                const std::atomic<bool>& is_ended) {
  LIMN_TRY(const device::GlContext context, device::GlContext::create());
  AppendLog log;
  if (!options.out.empty()) {
    LIMN_TRY_STATUS(make_folder(options.out));
    LIMN_TRY(log, AppendLog::create(options.out / "shown.csv", k_shown_log_header));
  }
  NodeLoop loop(options, room, desktop, context, std::move(log));
  while (!is_ended) loop.step();
  loop.end();
  return {};
}

}  // namespace limn::nodes
