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
#include "core/log.h"
#include "core/screen_encoding.h"
#include "core/stopwatch.h"
#include "device/gl_context.h"
#include "device/jpeg.h"
#include "projector/composite_policy.h"
#include "projector/renderer.h"
#include "remote/tablet/intrinsics_store.h"
#include "remote/tablet/tablet_image.h"
#include "remote/tablet/tablet_localizer.h"
#include "scene/posed_scene.h"
#include "session/grid_and_split.h"
#include "session/stillness.h"
#include "tracker/family.h"

namespace limn::apps {
namespace {

using Answer = std::function<void(TabletView::Seen)>;

constexpr int k_quality = 80;  // of JPEG
constexpr projector::Smoothing k_smoothing{.samples = 4, .least_step = 0.25};
constexpr int k_niceness = 19;              // least: sessions and servers go before
constexpr std::size_t k_most_eyes = 8;      // devices that are known at a time
constexpr std::size_t k_most_waiting = 16;  // images that are not looked at yet
// How parts are drawn is decided so often, on images of a fourth of the size.
constexpr double k_decide_every_s = 0.5;
constexpr int k_coarser = 4;

// What a session said last.
struct Known {
  std::shared_ptr<const scene::Scene> scene;
  std::shared_ptr<const Rig> rig;
  int scenes = 0;
  scene::ShowState show_state;
  std::vector<Track> tracks;  // at the moment of `room`
  ComposeOptions paint;
  Frame room;
  std::string follows;  // the guest whom light shows `view` parts to
};

struct Guest {
  TabletView::Window window;
  std::vector<std::uint8_t> jpeg;
  Answer answer;
};

// What the bodies of a scene are as people paired markers with its slots.
std::vector<Body> bodies_of(const scene::Scene& scene, const scene::ShowState& show_state) {
  std::vector<Body> out;
  if (scene.prototype) out.push_back({"prototype", scene.prototype->markers});
  for (std::size_t i = 0; i < scene.slots.size(); ++i) {
    const scene::Slot& slot = scene.slots[i];
    const MarkerName& carrier = scene::slot_marker(scene, show_state, i);
    const double size_m = carrier == slot.marker ? slot.size_m : loose_size_m(scene);
    out.push_back({slot.name, {{carrier, size_m, Pose()}}});
  }
  return out;
}

// What carries what, as of the room's newest image.
std::vector<Track> tracks_of(const Known& known) {
  return scene::assign_tracks(*known.scene, known.show_state, known.tracks);
}

bool is_in_image(const Imager& view, const scene::Scene& scene, const scene::PosedScene& posed) {
  const auto p_middle = posed.world_from_prototype ? scene::middle_of(scene, posed) : std::nullopt;
  const auto px = p_middle ? view.project(*p_middle) : std::nullopt;
  return px && view.contains(*px);
}

TabletView::Seen nothing(const std::string& why) {
  return {nlohmann::json{{"sees", "nothing"}, {"why", why}, {"markers", 0}}.dump(), {}};
}

}  // namespace

struct TabletView::Impl {
  // Between threads.
  std::mutex mutex;
  std::condition_variable changed;
  bool is_ending = false;
  std::deque<Guest> guests;  // one a device, in the order of their asking
  std::vector<Answer> overtaken, rooms;
  std::shared_ptr<const Known> known;

  // The session's thread's.
  std::shared_ptr<const scene::Scene> told_scene;
  std::shared_ptr<const Rig> told_rig;
  int told_scenes = 0;

  // The onlooker's own.
  Rig rig;
  std::filesystem::path lens_folder;
  tracker::Families families;
  std::optional<device::GlContext> context;
  std::optional<projector::Renderer> renderer;
  int drawn_scenes = 0;  // which scene the renderer holds
  // How parts are drawn into the images of one camera.
  struct Shown {
    bool is_viewer = false;  // light shows `view` parts to this camera's eye
    std::vector<projector::CompositePolicy> policies = {};
    std::set<std::string> by_light_alone = {};  // slots of which nothing is left to draw
    Stamp decided_at = {};
  };
  // Left of the session's split another look is shown.
  struct Sides {
    Shown right, left;
  };
  struct Watching {
    std::string device;
    TabletLocalizer eye;
    Sides shown;
    TabletViewMode parts = TabletViewMode::as_screen;  // of the last image
  };
  std::deque<Watching> watching;                         // the one that asked last at the end
  Sides room{{.is_viewer = true}, {.is_viewer = true}};  // as the room's screen
  Eigen::AlignedBox3d prototype_box;                     // its own frame
  std::optional<Pose> held;  // world_from_prototype that is drawn by (stillness.h)

  std::thread thread;

  Status open(const scene::Scene& scene);
  void run();
  bool step();
  void learn();
  void keep(Watching* device);
  Seen seen_by(const Guest& guest, const Known& known);
  Seen seen_in_room(const Known& known);
  Watching& watching_of(const std::string& device);
  Status follow_scene(const Known& known);
  void measure(const scene::Scene& scene);
  cv::Mat with_parts(const Imager& camera,
                     const cv::Mat& image,
                     const scene::PosedScene& posed,
                     const Known& known,
                     TabletViewMode parts,
                     Shown* shown);
  cv::Mat drawn(const Imager& camera,
                const cv::Mat& image,
                const scene::PosedScene& posed,
                std::span<const Track> tracks,
                const Known& known,
                TabletViewMode parts,
                Sides* shown);
};

Status TabletView::Impl::open(const scene::Scene& scene) {
  setpriority(PRIO_PROCESS, static_cast<id_t>(syscall(SYS_gettid)), k_niceness);
  LIMN_TRY(context, device::GlContext::create(true));
  LIMN_TRY(renderer, projector::Renderer::create(scene, rig));
  renderer->set_smoothing(k_smoothing);
  measure(scene);
  return {};
}

void TabletView::Impl::measure(const scene::Scene& scene) {
  prototype_box.setEmpty();
  if (scene.prototype)
    for (const Eigen::Vector3f& p : scene.prototype->mesh.positions) prototype_box.extend(p.cast<double>());
}

void TabletView::Impl::run() {
  while (step()) {
  }
  for (Watching& device : watching) keep(&device);
  renderer.reset();
  context.reset();
}

// Waits for something to do, and does it. False: it is over.
bool TabletView::Impl::step() {
  std::optional<Guest> guest;
  std::vector<Answer> late, asking;
  std::shared_ptr<const Known> now;
  bool is_over = false;
  {
    std::unique_lock lock(mutex);
    changed.wait(lock, [&] { return is_ending || !guests.empty() || !overtaken.empty() || !rooms.empty(); });
    is_over = is_ending;
    late.swap(overtaken);
    asking.swap(rooms);
    now = known;
    if (is_over) {
      for (Guest& waiting : guests) late.push_back(std::move(waiting.answer));
      late.insert(late.end(), asking.begin(), asking.end());
      guests.clear();
      asking.clear();
    } else if (!guests.empty()) {
      guest = std::move(guests.front());
      guests.pop_front();
    }
  }
  const auto drawn = [&](const auto& draw) -> Seen {
    if (!now) return nothing("The session has not begun yet.");
    try {
      if (const Status ready = follow_scene(*now); !ready) return nothing(ready.message());
      return draw();
    } catch (const std::exception& bug) {
      log_warning("live: the window: this is a bug in Limn, please report it: {}", bug.what());
      return nothing("This picture could not be drawn into.");
    }
  };
  for (const Answer& answer : late)
    answer(nothing(is_over ? "The session is over." : "A newer picture came before this one's turn."));
  if (guest) {
    guest->answer(drawn([&] { return seen_by(*guest, *now); }));
    learn();
  }
  if (!asking.empty()) {
    const Seen room = drawn([&] { return seen_in_room(*now); });
    for (const Answer& answer : asking) answer(room);
  }
  return !is_over;
}

// What the last image tells of its lens, while its guest is not waiting.
void TabletView::Impl::learn() {
  if (watching.empty()) return;
  watching.back().eye.learn();
  if (watching.back().eye.has_learnt()) keep(&watching.back());
}

void TabletView::Impl::keep(Watching* device) {
  const std::vector<calib::IntrinsicsEstimate> lenses = device->eye.lenses();
  if (lenses.empty()) return;
  device->eye.note_kept();
  if (const Status kept = save_lenses(lens_folder, device->device, lenses); !kept)
    log_warning("live: {} What was found of a guest's lens is not kept.", kept.message());
}

// A scene that was edited, or a rig that was mended, is drawn from now on.
Status TabletView::Impl::follow_scene(const Known& known) {
  if (drawn_scenes == known.scenes && renderer && !context->is_lost()) return {};
  renderer.reset();
  if (context->is_lost()) {
    context.reset();
    LIMN_TRY(context, device::GlContext::create(true));
  }
  rig = *known.rig;
  LIMN_TRY(renderer, projector::Renderer::create(*known.scene, rig));
  renderer->set_smoothing(k_smoothing);
  measure(*known.scene);
  drawn_scenes = known.scenes;
  return {};
}

TabletView::Impl::Watching& TabletView::Impl::watching_of(const std::string& device) {
  const auto found =
      std::find_if(watching.begin(), watching.end(), [&](const Watching& w) { return w.device == device; });
  if (found != watching.end()) {
    std::rotate(found, found + 1, watching.end());
    return watching.back();
  }
  if (watching.size() >= k_most_eyes) {
    keep(&watching.front());
    watching.pop_front();
  }
  watching.push_back({device, TabletLocalizer(families, load_lenses(lens_folder, device)), {}});
  return watching.back();
}

// Parts over an image with another look left of the split, if there is one.
cv::Mat TabletView::Impl::drawn(const Imager& camera,
                                const cv::Mat& image,
                                const scene::PosedScene& posed,
                                std::span<const Track> tracks,
                                const Known& known,
                                TabletViewMode parts,
                                Sides* shown) {
  const cv::Mat right = with_parts(camera, image, posed, known, parts, &shown->right);
  const auto left = scene::left_of_split(*known.scene, known.show_state);
  const auto line =
      left ? split_line(camera, posed, prototype_box, known.show_state.split_mm) : std::optional<cv::Vec3d>();
  if (!line) return right;
  const scene::PosedScene other = scene::compose_scene(*known.scene, *left, tracks);
  return split_along(*line, with_parts(camera, image, other, known, parts, &shown->left), right);
}

// Parts over an image. As the room's screen treats them `view` parts that light shows to another eye than
// this camera's are drawn whole.
cv::Mat TabletView::Impl::with_parts(const Imager& camera,
                                     const cv::Mat& image,
                                     const scene::PosedScene& posed,
                                     const Known& known,
                                     TabletViewMode parts,
                                     Shown* shown) {
  const bool as_screen = parts == TabletViewMode::as_screen;
  if (parts == TabletViewMode::full || (as_screen && known.show_state.screen == scene::Screen::full))
    return renderer->composite(camera, image, posed, projector::Composite::full);
  const Stamp at = std::chrono::steady_clock::now();
  const double seconds =
      shown->decided_at == Stamp{} ? k_decide_every_s : seconds_between(shown->decided_at, at);
  if (seconds >= k_decide_every_s) {
    const auto coarse =
        resized(camera, std::max(1, camera.width / k_coarser), std::max(1, camera.height / k_coarser));
    const std::vector<projector::PartCoverage> coverage =
        renderer->coverage(posed, coarse ? *coarse : camera);
    shown->policies = projector::updated_policies(shown->policies, coverage, seconds);
    shown->by_light_alone.clear();
    for (projector::CompositePolicy& treatment : shown->policies) {
      if (as_screen && !shown->is_viewer && known.scene->find_slot(treatment.slot)->mode == scene::Mode::view)
        treatment = {treatment.slot, projector::Composite::full};
      if (treatment.full_weight() > 0) continue;
      for (const projector::PartCoverage& part : coverage)
        if (part.slot == treatment.slot && part.viewer_pixels > 0 && part.off_surface_share == 0)
          shown->by_light_alone.insert(part.slot);
    }
    shown->decided_at = at;
  }
  scene::PosedScene rest = posed;
  std::erase_if(rest.parts,
                [&](const scene::PosedPart& part) { return shown->by_light_alone.contains(part.slot); });
  return renderer->composite(camera, image, rest, shown->policies);
}

TabletView::Seen TabletView::Impl::seen_by(const Guest& guest, const Known& known) {
  if (!is_device_name(guest.window.device))
    return nothing("Expected a device's name of 8 to 64 letters, digits and -.");
  const Stamp begun = std::chrono::steady_clock::now();
  const auto image = decode_tablet_image(guest.jpeg);
  if (!image) return nothing(image.message());
  const double decode_ms = milliseconds_since(begun);

  const Stamp tracking = std::chrono::steady_clock::now();
  std::vector<Track> tracks = tracks_of(known);
  const Pose turned_from_world = steadied(&held, &tracks);
  Watching& device = watching_of(guest.window.device);
  const TabletPose observation = device.eye.look(*image, bodies_of(*known.scene, known.show_state), tracks);
  const double track_ms = milliseconds_since(tracking);
  if (!observation.view) return nothing(observation.why);

  const Stamp drawing = std::chrono::steady_clock::now();
  for (const Track& moved : observation.moved)
    for (Track& track : tracks)
      if (track.body == moved.body) track = moved;
  const scene::PosedScene posed = scene::compose_scene(*known.scene, known.show_state, tracks);
  const bool is_viewer = !guest.window.guest.empty() && guest.window.guest == known.follows;
  const bool is_as_before = is_viewer == device.shown.right.is_viewer && guest.window.parts == device.parts;
  if (!is_as_before) device.shown = {{.is_viewer = is_viewer}, {.is_viewer = is_viewer}};
  device.parts = guest.window.parts;
  const cv::Mat out = drawn(*observation.view, *image, posed, tracks, known, device.parts, &device.shown);
  const double composite_ms = milliseconds_since(drawing);

  const Stamp encoding = std::chrono::steady_clock::now();
  const Pose view_from_world = observation.view->imager_from_world * turned_from_world;
  Seen seen{{}, device::encode_jpeg(out, k_quality), view_from_world.inverse().translation};
  const double encode_ms = milliseconds_since(encoding);
  const Lens& lens = observation.view->lens;
  seen.json =
      nlohmann::json{
          {"sees", is_in_image(*observation.view, *known.scene, posed) ? "prototype" : "markers"},
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
           {{"decode", decode_ms}, {"track", track_ms}, {"composite", composite_ms}, {"encode", encode_ms}}}}
          .dump();
  return seen;
}

TabletView::Seen TabletView::Impl::seen_in_room(const Known& known) {
  const auto without = [](const char* why) { return Seen{nlohmann::json{{"why", why}}.dump(), {}}; };
  if (known.room.image.empty()) return without("The room's camera has shown nothing yet.");
  cv::Mat image = known.paint.is_linear_camera ? srgb_image(known.room.image) : known.room.image;
  if (image.channels() == 1) cv::cvtColor(image, image, cv::COLOR_GRAY2BGR);
  Imager camera = rig.cameras[0];
  const double scale = 1.0 * k_drawn_side / std::max(image.cols, image.rows);
  if (scale < 1) {
    const cv::Size size(cvRound(scale * image.cols), cvRound(scale * image.rows));
    const auto smaller = resized(camera, size.width, size.height);
    LIMN_CHECK(smaller.has_value());
    camera = *smaller;
    cv::resize(image, image, size, 0, 0, cv::INTER_AREA);
  }
  std::vector<Track> tracks = tracks_of(known);
  camera.imager_from_world = camera.imager_from_world * steadied(&held, &tracks).inverse();
  const scene::PosedScene posed = scene::compose_scene(*known.scene, known.show_state, tracks);
  const cv::Mat out = drawn(camera, image, posed, tracks, known, TabletViewMode::as_screen, &room);
  return {nlohmann::json{{"why", ""}}.dump(), device::encode_jpeg(out, k_quality)};
}

TabletView::TabletView(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

Result<std::unique_ptr<TabletView>> TabletView::create(const SessionSetup& setup,
                                                       std::filesystem::path lens_folder) {
  auto impl = std::make_unique<Impl>();
  impl->rig = setup.rig;
  impl->lens_folder = std::move(lens_folder);
  const std::vector<Body> bodies = scene::bodies(setup.scene);
  LIMN_TRY(impl->families, tracker::Families::load(tracker::families_of(bodies), setup.scene.folder));
  impl->told_scene = std::make_shared<scene::Scene>(setup.scene);
  impl->told_rig = std::make_shared<Rig>(setup.rig);
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

void TabletView::know(const Session& session) {
  if (impl_->told_scenes != session.scenes()) {
    impl_->told_scene = std::make_shared<scene::Scene>(session.setup().scene);
    impl_->told_rig = std::make_shared<Rig>(session.setup().rig);
    impl_->told_scenes = session.scenes();
  }
  const Percepts& watched = session.watched();
  auto known = std::make_shared<Known>(Known{.scene = impl_->told_scene,
                                             .rig = impl_->told_rig,
                                             .scenes = session.scenes(),
                                             .show_state = session.show_state(),
                                             .tracks = session.prediction().at_image,
                                             .paint = session.setup().paint,
                                             .room = watched.frames.empty() ? Frame{} : watched.frames[0],
                                             .follows = session.painted().follows});
  const std::lock_guard lock(impl_->mutex);
  impl_->known = std::move(known);
}

void TabletView::look(const Window& window,
                      std::vector<std::uint8_t> jpeg,
                      std::function<void(Seen)> answer) {
  {
    const std::lock_guard lock(impl_->mutex);
    const auto before = std::find_if(impl_->guests.begin(), impl_->guests.end(), [&](const Guest& guest) {
      return guest.window.device == window.device;
    });
    if (before == impl_->guests.end()) {
      if (impl_->guests.size() >= k_most_waiting) {
        impl_->overtaken.push_back(std::move(impl_->guests.front().answer));
        impl_->guests.pop_front();
      }
      impl_->guests.push_back({window, std::move(jpeg), std::move(answer)});
    } else {  // keeps its turn
      before->window = window;
      impl_->overtaken.push_back(std::exchange(before->answer, std::move(answer)));
      before->jpeg = std::move(jpeg);
    }
  }
  impl_->changed.notify_all();
}

void TabletView::room(std::function<void(Seen)> answer) {
  {
    const std::lock_guard lock(impl_->mutex);
    impl_->rooms.push_back(std::move(answer));
  }
  impl_->changed.notify_all();
}

}  // namespace limn::apps
