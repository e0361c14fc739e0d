#include "remote/tablet/tablet_view.h"

#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <future>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <set>
#include <thread>

#include "core/config.h"
#include "core/json_text.h"
#include "core/log.h"
#include "core/screen_encoding.h"
#include "core/stopwatch.h"
#include "device/gl_context.h"
#include "device/jpeg.h"
#include "projector/composite_policy.h"
#include "projector/overlays/grid_and_split.h"
#include "projector/renderer.h"
#include "remote/tablet/intrinsics_store.h"
#include "remote/tablet/square_bodies.h"
#include "remote/tablet/tablet_image.h"
#include "remote/tablet/tablet_localizer.h"
#include "scene/posed_scene.h"
#include "session/stillness.h"
#include "tracker/family.h"

namespace limn::remote {
namespace {

constexpr int k_quality = 80;  // JPEG quality, 0 to 100
constexpr projector::Smoothing k_smoothing{.samples = 4, .least_step = 0.25};
constexpr int k_niceness = 19;                      // the lowest priority: sessions and servers go first
constexpr std::size_t k_max_devices_in_memory = 8;  // the device that was not used longest is dropped
constexpr std::size_t k_max_waiting_frames = 16;
// How parts are composited is decided at this interval, on images of a fourth of the size.
constexpr double k_policy_interval_s = 0.5;
constexpr int k_policy_image_divisor = 4;

// The session's state that images are drawn from.
struct SessionSnapshot {
  std::shared_ptr<const scene::Scene> scene;
  std::shared_ptr<const Rig> rig;
  int scenes = 0;
  scene::ShowState show_state;
  std::vector<Track> tracks;  // at the moment of `room`
  session::ComposeOptions paint;
  Frame room;
  std::string follows;  // the guest whose viewpoint `view` parts are projected for
};

// A tablet's image that waits to be drawn into.
struct WaitingFrame {
  TabletWindow window;
  std::vector<std::uint8_t> jpeg;
  ImageCallback answer;
};

// The tracks of the scene's bodies at the moment of the room's newest image.
std::vector<Track> tracks_of(const SessionSnapshot& snapshot) {
  return scene::assign_tracks(*snapshot.scene, snapshot.show_state, snapshot.tracks);
}

bool is_in_image(const Imager& view, const scene::Scene& scene, const scene::PosedScene& posed) {
  const auto p_middle = posed.world_from_prototype ? scene::middle_of(scene, posed) : std::nullopt;
  const auto px = p_middle ? view.project(*p_middle) : std::nullopt;
  return px && view.contains(*px);
}

// The camera with the prototype's frame for its world.
std::optional<Imager> over_prototype(Imager camera, const scene::PosedScene& posed) {
  if (!posed.world_from_prototype) return std::nullopt;
  camera.imager_from_world = camera.imager_from_world * *posed.world_from_prototype;
  return camera;
}

CompositeImage no_image(const std::string& why) {
  return {json_text(nlohmann::json{{"sees", "nothing"}, {"why", why}, {"markers", 0}}), {}};
}

}  // namespace

struct TabletView::Impl {
  // Shared by all threads.
  std::mutex mutex;
  std::condition_variable changed;
  bool is_ending = false;
  std::deque<WaitingFrame> frames;  // one for each device, in the order of their requests
  std::vector<ImageCallback> overtaken, room_callbacks;
  std::shared_ptr<const SessionSnapshot> newest_snapshot;

  // Used by the session's thread alone.
  std::shared_ptr<const scene::Scene> session_scene;
  std::shared_ptr<const Rig> session_rig;
  int session_scenes = 0;

  // Used by the view's own thread alone.
  Rig rig;
  std::filesystem::path lens_folder;
  tracker::Families families;
  std::optional<device::GlContext> context;
  std::optional<projector::Renderer> renderer;
  int drawn_scenes = 0;  // the number of the scene that the renderer holds
  // How parts are composited into the images of one camera.
  struct DrawState {
    bool is_viewer = false;  // `view` parts are projected for this camera's viewpoint
    std::vector<projector::CompositePolicy> policies = {};
    std::set<std::string> fully_projected = {};  // slots of which nothing is left to draw: light shows all
    Stamp decided_at = {};
  };
  // The two sides of the session's split; another look is shown on the left.
  struct SplitDrawState {
    DrawState right, left;
  };
  struct Device {
    std::string name;
    TabletLocalizer localizer;
    SplitDrawState draw_state;
    TabletViewMode parts = TabletViewMode::as_screen;  // what the last image shows
  };
  std::deque<Device> devices;                                     // in the order of their last use
  SplitDrawState room{{.is_viewer = true}, {.is_viewer = true}};  // as the room's screen
  Eigen::AlignedBox3d prototype_box;                              // in the prototype's frame
  std::optional<Pose> still_world_from_prototype;                 // without jitter (stillness.h)

  std::thread thread;

  Status open(const scene::Scene& scene);
  void run();
  bool step();
  void update_intrinsics();
  void save_lenses_of(Device* device);
  CompositeImage frame_with_parts(const WaitingFrame& frame, const SessionSnapshot& snapshot);
  CompositeImage room_with_parts(const SessionSnapshot& snapshot);
  Device& device_state(const std::string& device);
  Status update_renderer(const SessionSnapshot& snapshot);
  void update_prototype_box(const scene::Scene& scene);
  cv::Mat composite_of(const Imager& camera,
                       const cv::Mat& image,
                       const scene::PosedScene& posed,
                       const SessionSnapshot& snapshot,
                       TabletViewMode parts,
                       DrawState* draw_state);
  cv::Mat split_composite(const Imager& camera,
                          const cv::Mat& image,
                          const scene::PosedScene& posed,
                          std::span<const Track> tracks,
                          const SessionSnapshot& snapshot,
                          TabletViewMode parts,
                          SplitDrawState* draw_state);
};

Status TabletView::Impl::open(const scene::Scene& scene) {
  setpriority(PRIO_PROCESS, static_cast<id_t>(syscall(SYS_gettid)), k_niceness);
  LIMN_TRY(context, device::GlContext::create(true));
  LIMN_TRY(renderer, projector::Renderer::create(scene, rig));
  renderer->set_smoothing(k_smoothing);
  update_prototype_box(scene);
  return {};
}

void TabletView::Impl::update_prototype_box(const scene::Scene& scene) {
  prototype_box.setEmpty();
  if (scene.prototype)
    for (const Eigen::Vector3f& p : scene.prototype->mesh.positions) prototype_box.extend(p.cast<double>());
}

void TabletView::Impl::run() {
  while (step()) {
  }
  for (Device& device : devices) save_lenses_of(&device);
  renderer.reset();
  context.reset();
}

// Waits for a request and answers it. False: the view is being destroyed.
bool TabletView::Impl::step() {
  std::optional<WaitingFrame> frame;
  std::vector<ImageCallback> unanswered, waiting_for_room;
  std::shared_ptr<const SessionSnapshot> now;
  bool is_over = false;
  {
    std::unique_lock lock(mutex);
    changed.wait(
        lock, [&] { return is_ending || !frames.empty() || !overtaken.empty() || !room_callbacks.empty(); });
    is_over = is_ending;
    unanswered.swap(overtaken);
    waiting_for_room.swap(room_callbacks);
    now = newest_snapshot;
    if (is_over) {
      for (WaitingFrame& waiting : frames) unanswered.push_back(std::move(waiting.answer));
      unanswered.insert(unanswered.end(), waiting_for_room.begin(), waiting_for_room.end());
      frames.clear();
      waiting_for_room.clear();
    } else if (!frames.empty()) {
      frame = std::move(frames.front());
      frames.pop_front();
    }
  }
  const auto draw_safely = [&](const auto& draw) -> CompositeImage {
    if (!now) return no_image("The session has not begun yet.");
    try {
      if (const Status ready = update_renderer(*now); !ready) return no_image(ready.message());
      return draw();
    } catch (const std::exception& bug) {
      log_warning("live: the window: this is a bug in Limn, please report it: {}", bug.what());
      return no_image("This picture could not be drawn into.");
    }
  };
  for (const ImageCallback& answer : unanswered)
    answer(no_image(is_over ? "The session is over." : "A newer picture came before this one's turn."));
  if (frame) {
    frame->answer(draw_safely([&] { return frame_with_parts(*frame, *now); }));
    update_intrinsics();
  }
  if (!waiting_for_room.empty()) {
    const CompositeImage room = draw_safely([&] { return room_with_parts(*now); });
    for (const ImageCallback& answer : waiting_for_room) answer(room);
  }
  return !is_over;
}

// Updates the lens from the last image. Its guest has the answer already and does not wait.
void TabletView::Impl::update_intrinsics() {
  if (devices.empty()) return;
  devices.back().localizer.update_intrinsics();
  if (devices.back().localizer.has_better_lenses()) save_lenses_of(&devices.back());
}

void TabletView::Impl::save_lenses_of(Device* device) {
  const std::vector<calib::IntrinsicsEstimate> lenses = device->localizer.lenses();
  if (lenses.empty()) return;
  device->localizer.mark_lenses_saved();
  if (const Status saved = save_lenses(lens_folder, device->name, lenses); !saved)
    log_warning("live: {} The estimate of a guest's lens is not saved.", saved.message());
}

// Replaces the renderer when the scene or the rig has changed, or when the GL context is lost.
Status TabletView::Impl::update_renderer(const SessionSnapshot& snapshot) {
  if (drawn_scenes == snapshot.scenes && renderer && !context->is_lost()) return {};
  renderer.reset();
  if (context->is_lost()) {
    context.reset();
    LIMN_TRY(context, device::GlContext::create(true));
  }
  rig = *snapshot.rig;
  LIMN_TRY(renderer, projector::Renderer::create(*snapshot.scene, rig));
  renderer->set_smoothing(k_smoothing);
  update_prototype_box(*snapshot.scene);
  drawn_scenes = snapshot.scenes;
  return {};
}

TabletView::Impl::Device& TabletView::Impl::device_state(const std::string& device) {
  const auto found =
      std::find_if(devices.begin(), devices.end(), [&](const Device& each) { return each.name == device; });
  if (found != devices.end()) {
    std::rotate(found, found + 1, devices.end());
    return devices.back();
  }
  if (devices.size() >= k_max_devices_in_memory) {
    save_lenses_of(&devices.front());
    devices.pop_front();
  }
  devices.push_back({device, TabletLocalizer(families, load_lenses(lens_folder, device)), {}});
  return devices.back();
}

// An image with parts; left of the session's split, if there is one, the parts of the other look.
cv::Mat TabletView::Impl::split_composite(const Imager& camera,
                                          const cv::Mat& image,
                                          const scene::PosedScene& posed,
                                          std::span<const Track> tracks,
                                          const SessionSnapshot& snapshot,
                                          TabletViewMode parts,
                                          SplitDrawState* draw_state) {
  cv::Mat right = composite_of(camera, image, posed, snapshot, parts, &draw_state->right);
  const auto left = scene::left_of_split(*snapshot.scene, snapshot.show_state);
  const auto line = left ? projector::split_line(camera, posed, prototype_box, snapshot.show_state.split_mm)
                         : std::optional<cv::Vec3d>();
  if (!line) return right;
  const scene::PosedScene other = scene::compose_scene(*snapshot.scene, *left, tracks);
  return projector::split_along(*line, composite_of(camera, image, other, snapshot, parts, &draw_state->left),
                                right);
}

// An image with parts. As the room's screen shows them, `view` parts are drawn whole if they are projected
// for another viewpoint than this camera's.
cv::Mat TabletView::Impl::composite_of(const Imager& camera,
                                       const cv::Mat& image,
                                       const scene::PosedScene& posed,
                                       const SessionSnapshot& snapshot,
                                       TabletViewMode parts,
                                       DrawState* draw_state) {
  const bool as_screen = parts == TabletViewMode::as_screen;
  if (parts == TabletViewMode::full || (as_screen && snapshot.show_state.screen == scene::Screen::full))
    return renderer->composite(camera, image, posed, projector::Composite::full);
  const Stamp at = std::chrono::steady_clock::now();
  const double seconds =
      draw_state->decided_at == Stamp{} ? k_policy_interval_s : seconds_between(draw_state->decided_at, at);
  if (seconds >= k_policy_interval_s) {
    const auto coarse = resized(camera, std::max(1, camera.width / k_policy_image_divisor),
                                std::max(1, camera.height / k_policy_image_divisor));
    const std::vector<projector::PartCoverage> coverage =
        renderer->coverage(posed, coarse ? *coarse : camera);
    draw_state->policies = projector::updated_policies(draw_state->policies, coverage, seconds);
    draw_state->fully_projected.clear();
    for (projector::CompositePolicy& treatment : draw_state->policies) {
      if (as_screen && !draw_state->is_viewer &&
          snapshot.scene->find_slot(treatment.slot)->mode == scene::Mode::view)
        treatment = {treatment.slot, projector::Composite::full};
      if (treatment.full_weight() > 0) continue;
      for (const projector::PartCoverage& part : coverage)
        if (part.slot == treatment.slot && part.viewer_pixels > 0 && part.off_surface_share == 0)
          draw_state->fully_projected.insert(part.slot);
    }
    draw_state->decided_at = at;
  }
  scene::PosedScene rest = posed;
  std::erase_if(rest.parts, [&](const scene::PosedPart& part) {
    return draw_state->fully_projected.contains(part.slot);
  });
  return renderer->composite(camera, image, rest, draw_state->policies);
}

CompositeImage TabletView::Impl::frame_with_parts(const WaitingFrame& frame,
                                                  const SessionSnapshot& snapshot) {
  if (!is_device_name(frame.window.device))
    return no_image("Expected a device's name of 8 to 64 letters, digits and -.");
  const Stamp begun = std::chrono::steady_clock::now();
  const auto image = decode_tablet_image(frame.jpeg);
  if (!image) return no_image(image.message());
  const double decode_ms = milliseconds_since(begun);

  const Stamp tracking = std::chrono::steady_clock::now();
  std::vector<Track> tracks = tracks_of(snapshot);
  const Pose turned_from_world = session::steadied(&still_world_from_prototype, &tracks);
  Device& device = device_state(frame.window.device);
  const TabletPose observation =
      device.localizer.localize(*image, square_bodies(*snapshot.scene, snapshot.show_state), tracks);
  const double track_ms = milliseconds_since(tracking);
  if (!observation.view) return no_image(observation.why);

  const Stamp drawing = std::chrono::steady_clock::now();
  for (const Track& moved : observation.moved)
    for (Track& track : tracks)
      if (track.body == moved.body) track = moved;
  const scene::PosedScene posed = scene::compose_scene(*snapshot.scene, snapshot.show_state, tracks);
  const bool is_viewer = !frame.window.guest.empty() && frame.window.guest == snapshot.follows;
  const bool is_as_before =
      is_viewer == device.draw_state.right.is_viewer && frame.window.parts == device.parts;
  if (!is_as_before) device.draw_state = {{.is_viewer = is_viewer}, {.is_viewer = is_viewer}};
  device.parts = frame.window.parts;
  const cv::Mat out =
      split_composite(*observation.view, *image, posed, tracks, snapshot, device.parts, &device.draw_state);
  const double composite_ms = milliseconds_since(drawing);

  const Stamp encoding = std::chrono::steady_clock::now();
  const Pose view_from_world = observation.view->imager_from_world * turned_from_world;
  CompositeImage result{{}, device::encode_jpeg(out, k_quality), view_from_world.inverse().translation};
  result.over_prototype = over_prototype(*observation.view, posed);
  const double encode_ms = milliseconds_since(encoding);
  const Lens& lens = observation.view->lens;
  result.json = json_text(nlohmann::json{
      {"sees", is_in_image(*observation.view, *snapshot.scene, posed) ? "prototype" : "markers"},
      {"why", ""},
      {"markers", observation.markers},
      {"view_from_world", to_json(view_from_world)},
      {"rms_px", observation.rms_px},
      {"lens",
       {{"model", lens.model.name()},
        {"values", lens.values},
        {"focal_stddev_px", observation.focal_stddev_px},
        {"frames", observation.lens_frames}}},
      {"ms",
       {{"decode", decode_ms}, {"track", track_ms}, {"composite", composite_ms}, {"encode", encode_ms}}}});
  return result;
}

CompositeImage TabletView::Impl::room_with_parts(const SessionSnapshot& snapshot) {
  const auto without = [](const char* why) {
    return CompositeImage{json_text(nlohmann::json{{"why", why}}), {}};
  };
  if (snapshot.room.image.empty()) return without("The room's camera has shown nothing yet.");
  cv::Mat image = snapshot.paint.is_linear_camera ? srgb_image(snapshot.room.image) : snapshot.room.image;
  if (image.channels() == 1) cv::cvtColor(image, image, cv::COLOR_GRAY2BGR);
  Imager camera = rig.cameras[rig.first_visible_camera()];
  const double scale = 1.0 * k_drawn_side / std::max(image.cols, image.rows);
  if (scale < 1) {
    const cv::Size size(cvRound(scale * image.cols), cvRound(scale * image.rows));
    const auto smaller = resized(camera, size.width, size.height);
    LIMN_CHECK(smaller.has_value());
    camera = *smaller;
    cv::resize(image, image, size, 0, 0, cv::INTER_AREA);
  }
  std::vector<Track> tracks = tracks_of(snapshot);
  camera.imager_from_world =
      camera.imager_from_world * session::steadied(&still_world_from_prototype, &tracks).inverse();
  const scene::PosedScene posed = scene::compose_scene(*snapshot.scene, snapshot.show_state, tracks);
  const cv::Mat out =
      split_composite(camera, image, posed, tracks, snapshot, TabletViewMode::as_screen, &room);
  return {json_text(nlohmann::json{{"why", ""}}),
          device::encode_jpeg(out, k_quality),
          {},
          over_prototype(camera, posed)};
}

TabletView::TabletView(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

Result<std::unique_ptr<TabletView>> TabletView::create(const session::SessionSetup& setup,
                                                       std::filesystem::path lens_folder) {
  auto impl = std::make_unique<Impl>();
  impl->rig = setup.rig;
  impl->lens_folder = std::move(lens_folder);
  const std::vector<Body> bodies = scene::bodies(setup.scene);
  LIMN_TRY(impl->families, tracker::Families::load(tracker::families_of(bodies), setup.scene.folder));
  impl->session_scene = std::make_shared<scene::Scene>(setup.scene);
  impl->session_rig = std::make_shared<Rig>(setup.rig);
  std::promise<Status> opened;
  std::future<Status> is_open = opened.get_future();
  impl->thread = std::thread([impl = impl.get(), &setup, &opened] {
    Status status = impl->open(setup.scene);
    const bool is_well = status.ok();
    opened.set_value(std::move(status));
    if (is_well) impl->run();
  });
  Status status = is_open.get();
  std::unique_ptr<TabletView> out(new TabletView(std::move(impl)));
  if (!status) return status.error();
  return out;
}

TabletView::~TabletView() {
  {
    const std::lock_guard lock(impl_->mutex);
    impl_->is_ending = true;
  }
  impl_->changed.notify_all();
  impl_->thread.join();
}

void TabletView::update_session(const session::Session& session) {
  if (impl_->session_scenes != session.scenes()) {
    impl_->session_scene = std::make_shared<scene::Scene>(session.setup().scene);
    impl_->session_rig = std::make_shared<Rig>(session.setup().rig);
    impl_->session_scenes = session.scenes();
  }
  const session::Percepts& percepts = session.percepts();
  auto snapshot = std::make_shared<SessionSnapshot>(
      SessionSnapshot{.scene = impl_->session_scene,
                      .rig = impl_->session_rig,
                      .scenes = session.scenes(),
                      .show_state = session.show_state(),
                      .tracks = session.prediction().at_image,
                      .paint = session.setup().paint,
                      .room = percepts.frames.empty() ? Frame{} : percepts.frames[percepts.screen_camera],
                      .follows = session.composed().follows});
  const std::lock_guard lock(impl_->mutex);
  impl_->newest_snapshot = std::move(snapshot);
}

void TabletView::draw_window(const TabletWindow& window,
                             std::vector<std::uint8_t> jpeg,
                             ImageCallback answer) {
  {
    const std::lock_guard lock(impl_->mutex);
    const auto before =
        std::find_if(impl_->frames.begin(), impl_->frames.end(),
                     [&](const WaitingFrame& frame) { return frame.window.device == window.device; });
    if (before == impl_->frames.end()) {
      if (impl_->frames.size() >= k_max_waiting_frames) {
        impl_->overtaken.push_back(std::move(impl_->frames.front().answer));
        impl_->frames.pop_front();
      }
      impl_->frames.push_back({window, std::move(jpeg), std::move(answer)});
    } else {  // the new image takes the place of the waiting one
      before->window = window;
      impl_->overtaken.push_back(std::exchange(before->answer, std::move(answer)));
      before->jpeg = std::move(jpeg);
    }
  }
  impl_->changed.notify_all();
}

void TabletView::draw_room(ImageCallback answer) {
  {
    const std::lock_guard lock(impl_->mutex);
    impl_->room_callbacks.push_back(std::move(answer));
  }
  impl_->changed.notify_all();
}

}  // namespace limn::remote
