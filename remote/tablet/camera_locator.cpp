#include "remote/tablet/camera_locator.h"

#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <optional>
#include <thread>

#include "core/log.h"
#include "remote/tablet/square_bodies.h"
#include "remote/tablet/tablet_image.h"
#include "remote/tablet/tablet_localizer.h"
#include "scene/posed_scene.h"
#include "session/stillness.h"
#include "tracker/family.h"

namespace limn::remote {
namespace {

constexpr int k_locator_niceness = 19;  // the lowest priority, as the tablets'
constexpr std::size_t k_max_cameras = 8, k_max_waiting = 16;
constexpr double k_least_focal = 0.2, k_most_focal = 10;  // shares of the width; 136 and 6 degrees
constexpr double k_square = 0.03;                         // fx and fy may differ by this share
constexpr double k_focal_share = 1e-3;                    // standard deviations, as GlassesOptions has them
constexpr double k_distortion = 0.01;

struct Snapshot {
  std::shared_ptr<const scene::Scene> scene;
  scene::ShowState show_state;
  std::vector<Track> tracks;
};

struct WaitingImage {
  std::uint64_t camera = 0;
  StatedLens lens;
  std::vector<std::uint8_t> jpeg;
  LocatedCallback answer;
};

calib::IntrinsicsEstimate estimate_of(const StatedLens& lens) {
  calib::IntrinsicsEstimate out = calib::prior_intrinsics(lens.width, lens.height);
  const double focal = 0.5 * (lens.fx + lens.fy), stddev_px = k_focal_share * focal;
  out.values << focal, lens.cx, lens.cy, 0, 0;
  calib::Vector5d deviations;
  deviations << stddev_px, stddev_px, stddev_px, k_distortion, k_distortion;
  out.covariance = deviations.cwiseAbs2().asDiagonal();
  return out;
}

bool is_same(const StatedLens& a, const StatedLens& b) {
  constexpr double k_same_px = 0.1;
  return a.width == b.width && a.height == b.height && std::abs(a.fx - b.fx) < k_same_px &&
         std::abs(a.fy - b.fy) < k_same_px && std::abs(a.cx - b.cx) < k_same_px &&
         std::abs(a.cy - b.cy) < k_same_px;
}

LocatedCamera not_located(const std::string& why, bool is_refused = false) {
  LocatedCamera out;
  out.is_refused = is_refused;
  out.why = why;
  return out;
}

}  // namespace

Status check_lens(const StatedLens& lens) {
  if (lens.width < 16 || lens.height < 16 || lens.width > k_drawn_side || lens.height > k_drawn_side)
    return error("size: expected 16 to {} pixels a side, found {} x {}.", k_drawn_side, lens.width,
                 lens.height);
  if (!std::isfinite(lens.fx) || !std::isfinite(lens.fy) || !std::isfinite(lens.cx) ||
      !std::isfinite(lens.cy))
    return error("lens_px: expected finite numbers, found others.");
  if (!(lens.fx > k_least_focal * lens.width && lens.fx < k_most_focal * lens.width))
    return error("lens_px: expected a focal length of {} to {} times the width ({} px), found {:.4g} px.",
                 k_least_focal, k_most_focal, lens.width, lens.fx);
  if (!(std::abs(lens.fx / lens.fy - 1) < k_square))
    return error("lens_px: expected square pixels, found the focal lengths {:.4g} and {:.4g} px.", lens.fx,
                 lens.fy);
  if (lens.cx < 0 || lens.cy < 0 || lens.cx > lens.width || lens.cy > lens.height)
    return error("lens_px: expected a centre in the picture, found {:.4g}, {:.4g}.", lens.cx, lens.cy);
  return {};
}

struct CameraLocator::Impl {
  // Shared by all threads.
  std::mutex mutex;
  std::condition_variable changed;
  bool is_ending = false;
  std::deque<WaitingImage> images;
  std::vector<LocatedCallback> overtaken;
  std::shared_ptr<const Snapshot> newest;

  // Used by the session's thread alone.
  std::shared_ptr<const scene::Scene> session_scene;
  int session_scenes = 0;

  // Used by the locator's own thread alone.
  tracker::Families families;
  struct Camera {
    std::uint64_t number = 0;
    StatedLens lens;
    TabletLocalizer localizer;
  };
  std::deque<Camera> cameras;  // in the order of their last use
  std::optional<Pose> still_world_from_prototype;
  std::thread thread;

  void run();
  TabletLocalizer& localizer_of(std::uint64_t number, const StatedLens& lens);
  LocatedCamera located(const WaitingImage& waiting, const Snapshot* snapshot);
};

void CameraLocator::Impl::run() {
  setpriority(PRIO_PROCESS, static_cast<id_t>(syscall(SYS_gettid)), k_locator_niceness);
  for (bool is_over = false; !is_over;) {
    std::optional<WaitingImage> waiting;
    std::vector<LocatedCallback> unanswered;
    std::shared_ptr<const Snapshot> snapshot;
    {
      std::unique_lock lock(mutex);
      changed.wait(lock, [&] { return is_ending || !images.empty() || !overtaken.empty(); });
      is_over = is_ending;
      unanswered.swap(overtaken);
      snapshot = newest;
      if (is_over) {
        for (WaitingImage& each : images) unanswered.push_back(std::move(each.answer));
        images.clear();
      } else if (!images.empty()) {
        waiting = std::move(images.front());
        images.pop_front();
      }
    }
    for (const LocatedCallback& answer : unanswered)
      answer(not_located(is_over ? "The session is over." : "A newer picture came before this one's turn."));
    if (waiting) waiting->answer(located(*waiting, snapshot.get()));
  }
}

TabletLocalizer& CameraLocator::Impl::localizer_of(std::uint64_t number, const StatedLens& lens) {
  const auto found = std::find_if(cameras.begin(), cameras.end(),
                                  [&](const Camera& camera) { return camera.number == number; });
  if (found != cameras.end() && is_same(found->lens, lens)) {
    std::rotate(found, found + 1, cameras.end());
    return cameras.back().localizer;
  }
  if (found != cameras.end()) cameras.erase(found);
  if (cameras.size() >= k_max_cameras) cameras.pop_front();
  const calib::IntrinsicsEstimate stated = estimate_of(lens);
  cameras.push_back({number, lens, TabletLocalizer(families, std::span(&stated, 1))});
  return cameras.back().localizer;
}

LocatedCamera CameraLocator::Impl::located(const WaitingImage& waiting, const Snapshot* snapshot) {
  if (!snapshot) return not_located("The session has not begun yet.");
  try {
    const auto image = decode_tablet_image(waiting.jpeg);
    if (!image) return not_located("picture: " + image.message(), true);
    if (image->cols != waiting.lens.width || image->rows != waiting.lens.height)
      return not_located(fmt::format("picture: expected {} x {} pixels, as it was announced, found {} x {}.",
                                     waiting.lens.width, waiting.lens.height, image->cols, image->rows),
                         true);
    std::vector<Track> tracks =
        scene::assign_tracks(*snapshot->scene, snapshot->show_state, snapshot->tracks);
    const Pose turned_from_world = session::steadied(&still_world_from_prototype, &tracks);
    const TabletPose pose =
        localizer_of(waiting.camera, waiting.lens)
            .localize(*image, square_bodies(*snapshot->scene, snapshot->show_state), tracks);
    if (!pose.view) return not_located(pose.why);
    LocatedCamera out;
    out.is_located = true;
    out.camera_from_world = pose.view->imager_from_world * turned_from_world;
    out.covariance = pose.covariance;
    out.by_lens = pose.by_lens;
    return out;
  } catch (const std::exception& bug) {
    log_warning("live: glasses: this is a bug in Limn, please report it: {}", bug.what());
    return not_located("This picture could not be used.");
  }
}

CameraLocator::CameraLocator(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {
  impl_->thread = std::thread([impl = impl_.get()] { impl->run(); });
}

Result<std::unique_ptr<CameraLocator>> CameraLocator::create(const session::SessionSetup& setup) {
  auto impl = std::make_unique<Impl>();
  const std::vector<Body> bodies = scene::bodies(setup.scene);
  LIMN_TRY(impl->families, tracker::Families::load(tracker::families_of(bodies), setup.scene.folder));
  return std::unique_ptr<CameraLocator>(new CameraLocator(std::move(impl)));
}

CameraLocator::~CameraLocator() {
  {
    const std::lock_guard lock(impl_->mutex);
    impl_->is_ending = true;
  }
  impl_->changed.notify_all();
  impl_->thread.join();
}

void CameraLocator::update_session(const session::Session& session) {
  if (!impl_->session_scene || impl_->session_scenes != session.scenes()) {
    impl_->session_scene = std::make_shared<scene::Scene>(session.setup().scene);
    impl_->session_scenes = session.scenes();
  }
  auto snapshot = std::make_shared<Snapshot>(
      Snapshot{impl_->session_scene, session.show_state(), session.prediction().at_image});
  const std::lock_guard lock(impl_->mutex);
  impl_->newest = std::move(snapshot);
}

void CameraLocator::locate(std::uint64_t camera,
                           const StatedLens& lens,
                           std::vector<std::uint8_t> jpeg,
                           LocatedCallback answer) {
  {
    const std::lock_guard lock(impl_->mutex);
    auto& images = impl_->images;
    auto old = std::find_if(images.begin(), images.end(),
                            [&](const WaitingImage& waiting) { return waiting.camera == camera; });
    if (old == images.end() && images.size() >= k_max_waiting) old = images.begin();
    if (old != images.end()) {
      impl_->overtaken.push_back(std::move(old->answer));
      images.erase(old);
    }
    images.push_back({camera, lens, std::move(jpeg), std::move(answer)});
  }
  impl_->changed.notify_all();
}

}  // namespace limn::remote
