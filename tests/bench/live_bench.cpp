// How many frames a second a session on the virtual rig makes, divided by the camera's 30: as fast as it can,
// and in real time, where the effort follows. Then what a live session costs apart from rendering: processor
// time for each 1280x1024 frame (JPEG decoding, marker detection, poses, filter, hand-over), compared with
// libapriltag's detection in the same frames. Also what a recording adds to a frame's time, how long an edit
// takes, and whether memory grows. Usage: limn bench live [--frames N (60)] [--session: only the virtual
// session]
#include <fmt/core.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <charconv>
#include <chrono>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <numeric>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <optional>

#include "core/image_io.h"
#include "core/latest.h"
#include "core/median.h"
#include "core/scale_resolution.h"
#include "device/gl_context.h"
#include "device/jpeg.h"
#include "session/perception.h"
#include "session/recording.h"
#include "session/requests/script.h"
#include "session/session.h"
#include "session/session_output.h"
#include "session/virtual_session.h"
#include "sim/virtual_rig.h"
#include "tests/bench/tracker_peers.h"
#include "tracker/marker_image.h"
#include "tracker/predict.h"

namespace limn::test {
namespace {

namespace fs = std::filesystem;
using session::Perception;
using session::Percepts;
using session::Session;
using session::SessionSetup;

constexpr double k_lag_s = 0.06;

double processor_ms() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return 1e3 * static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_nsec);
}

double wall_ms() {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

double resident_mib() {
  std::ifstream file("/proc/self/statm");
  double all = 0, resident = 0;
  file >> all >> resident;
  return resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / (1 << 20);
}

double mean(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

sim::World whole_studio() {
  return sim::load_world(fs::path(LIMN_SOURCE_DIR) / "config/worlds/studio.json", tracker::marker_image)
      .value();
}

// The studio, seen by a camera of 1280x1024.
sim::World studio() {
  sim::World world = whole_studio();
  Imager& camera = world.rig.cameras[0];
  constexpr int k_width = 1280, k_height = 1024;
  camera.lens = Lens::pinhole(1467, 1467, 0.5 * (k_width - 1), 0.5 * (k_height - 1));
  camera.width = k_width;
  camera.height = k_height;
  return world;
}

struct Shot {
  std::string jpeg;
  Stamp captured_at;
};

// A session's frames as a camera would send them: illuminated by the session's own images, with a marker in a
// hand.
std::vector<Shot> shots(int count, SessionSetup* setup) {
  sim::World world = studio();
  setup->rig = world.rig;
  setup->scene = *world.scene;
  sim::VirtualRig rig(std::move(world), {.grab_waits_for_light = false});
  session::Script script;
  script.sways.push_back({"aruco_4x4_50:0", 0, 1e9, {0.05, 0, 0}, 0.5});
  auto room = session::ScriptedRoom::create(script, &rig).value();
  auto perception = Perception::create(setup->scene, setup->rig).value();
  auto session = Session::create(*setup, nullptr, nullptr, false).value();
  std::vector<Shot> out;
  for (int i = 0; i < count; ++i) {
    room.set(seconds_between(Stamp{}, rig.next_exposure()));
    const int camera = 0;
    const auto frames = rig.expose(std::span(&camera, 1));
    std::vector<std::uint8_t> jpeg;
    cv::imencode(".jpg", frames[0].image, jpeg, {cv::IMWRITE_JPEG_QUALITY, 90});
    out.push_back({std::string(jpeg.begin(), jpeg.end()), frames[0].captured_at});
    session.update_percepts(perception.watch(frames), static_cast<std::size_t>(i) + 1);
    const auto& painted = session.compose_and_record(rig.now(), shifted(rig.now(), 0.04));
    for (std::size_t k = 0; k < painted.projectors.size(); ++k)
      (void)rig.projector(static_cast<int>(k)).show(painted.projectors[k]).value();
  }
  return out;
}

Frame decoded(const Shot& shot, const SessionSetup& setup) {
  Frame frame = device::decode_frame(shot.jpeg).value();
  frame.camera = setup.rig.cameras[0].name;
  frame.captured_at = shot.captured_at;
  return frame;
}

constexpr std::size_t k_rounds = 10;

// A format in which a camera sends images, and how it is decoded.
struct Wire {
  std::string name;
  std::function<std::function<Frame()>(const Shot&)> decoder;  // decodes a shot
};

std::vector<Wire> wires() {
  const auto jpeg = [](bool grey) {
    return [grey](const Shot& shot) {
      return [&shot, grey] { return device::decode_frame(shot.jpeg, {.grey = grey}).value(); };
    };
  };
  const auto raw = [](const Shot& shot) {
    return [sent = device::decode_frame(shot.jpeg, {.grey = true}).value().image] {
      Frame frame;
      frame.image = sent.clone();  // copied out of the driver's buffer
      return frame;
    };
  };
  return {{"colour JPEG", jpeg(false)}, {"JPEG, brightness only", jpeg(true)}, {"raw brightness", raw}};
}

void print_cost(const std::vector<Shot>& shots, const SessionSetup& setup, const Wire& wire) {
  const std::string family = "apriltag_36h11";
  const Peer apriltag = apriltag_peer(std::span(&family, 1), 2, 1);
  auto perception = Perception::create(setup.scene, setup.rig, setup.watch).value();
  Latest<std::vector<Frame>> frames;
  Latest<Percepts> seen;
  std::vector<double> decode, watch, filter, hand, theirs;
  std::size_t markers = 0;
  std::vector<std::function<Frame()>> decoders;
  for (const Shot& shot : shots) decoders.push_back(wire.decoder(shot));
  for (std::size_t i = 0; i < k_rounds * shots.size(); ++i) {
    const Stamp captured_at = shifted(shots[0].captured_at, static_cast<double>(i) / 30);
    const double begun = processor_ms();
    Frame frame = decoders[i % shots.size()]();
    const double was_decoded = processor_ms();
    frame.camera = setup.rig.cameras[0].name;
    frame.captured_at = captured_at;
    frames.put({std::move(frame)});
    const auto taken = frames.take_newest({});
    const double was_taken = processor_ms();
    const Percepts& percepts = perception.watch(*taken);
    const double was_watched = processor_ms();
    seen.put(percepts);
    const auto known = seen.take_newest({});
    const auto tracks = tracker::predicted(known->motions, shifted(captured_at, k_lag_s));
    const double was_handed = processor_ms();
    markers += percepts.detections[0].size();
    decode.push_back(was_decoded - begun);
    watch.push_back(was_watched - was_taken);
    filter.push_back(percepts.filter_ms);
    hand.push_back(was_taken - was_decoded + was_handed - was_watched);
    LIMN_CHECK(!tracks.empty());
    const cv::Mat grey = to_grey(taken->front().image);
    const double peer_begun = processor_ms();
    (void)apriltag.detect(grey, nullptr);
    theirs.push_back(processor_ms() - peer_begun);
  }
  const double ours = mean(decode) + mean(watch) + mean(hand);
  fmt::print("{}: {} frames of 1280x1024, {:.1f} markers each; mean processor ms\n", wire.name, decode.size(),
             static_cast<double>(markers) / static_cast<double>(decode.size()));
  fmt::print(
      "decode {:.2f}, find markers {:.2f}, poses and motions {:.2f} (wall-clock time), hand-over and "
      "prediction {:.2f}; sum {:.2f}\n",
      mean(decode), mean(watch) - mean(filter), mean(filter), mean(hand), ours);
  fmt::print(
      "libapriltag (36h11, decimate 2, one thread), detection alone: {:.2f}; the sum divided by it: {:.2f} "
      "(without decoding {:.2f})\n",
      mean(theirs), ours / mean(theirs), (ours - mean(decode)) / mean(theirs));
}

// The least work of any JPEG decoder: the codes must be read one after the other, whatever is done with them.
void print_codes(const std::vector<Shot>& shots) {
  std::vector<double> times;
  for (std::size_t i = 0; i < k_rounds * shots.size(); ++i) {
    const std::string& jpeg = shots[i % shots.size()].jpeg;
    const double begun = processor_ms();
    (void)device::decode_jpeg({reinterpret_cast<const std::uint8_t*>(jpeg.data()), jpeg.size()},
                              {.grey = true, .longest_side = 160})
        .value();
    times.push_back(processor_ms() - begun);
  }
  fmt::print("reading a JPEG's codes (brightness at an eighth of the size): {:.2f} ms\n", mean(times));
}

// Cost of one frame of a session: decoding, perception and rendering.
struct FrameCost {
  double wall_ms = 0, processor_ms = 0;  // in all threads, including the recording's
};
FrameCost session_cost(const std::vector<Shot>& shots, const SessionSetup& setup, const fs::path& record) {
  std::unique_ptr<session::Recorder> recorder;
  if (!record.empty()) recorder = session::Recorder::create(record, setup).value();
  auto perception = Perception::create(setup.scene, setup.rig, setup.watch).value();
  auto session = Session::create(setup, nullptr, recorder.get(), false).value();
  std::vector<double> times;
  std::size_t moments = 0;
  const double begun_processor = processor_ms();
  for (const Shot& shot : shots) {
    const double begun = wall_ms();
    const std::vector<Frame> frames = {decoded(shot, setup)};
    if (recorder) recorder->record_frames(frames);
    session.update_percepts(perception.watch(frames), ++moments);
    session.compose_and_record(shifted(shot.captured_at, 0.02), shifted(shot.captured_at, k_lag_s));
    session.check_drift(shifted(shot.captured_at, 0.02));
    times.push_back(wall_ms() - begun);
  }
  if (recorder) {
    const auto ended = recorder->ended();
    fmt::print("{}", ended ? "the recording ended: " + *ended + "\n" : "");
    (void)recorder->finish();
  }
  return {median(times), (processor_ms() - begun_processor) / static_cast<double>(shots.size())};
}

// Time from a person's edit to the first images that show it, by wall clock, without the display: the rest of
// the frame in which the edit arrives (at a uniformly distributed moment) and the whole next frame.
void print_edits(const std::vector<Shot>& shots, const SessionSetup& setup) {
  auto perception = Perception::create(setup.scene, setup.rig, setup.watch).value();
  auto session = Session::create(setup, nullptr, nullptr, false).value();
  std::vector<double> waits;
  double before_ms = 0;
  for (std::size_t i = 0; i < shots.size(); ++i) {
    const double begun = wall_ms();
    const bool is_edited = i % 3 == 2;
    if (is_edited) LIMN_CHECK(session.edit({"next_variant", "mirror", ""}, "bench", shots[i].captured_at));
    const std::vector<Frame> frames = {decoded(shots[i], setup)};
    session.update_percepts(perception.watch(frames), i + 1);
    session.compose_and_record(shifted(shots[i].captured_at, 0.02), shifted(shots[i].captured_at, k_lag_s));
    const double painted_ms = wall_ms() - begun;
    session.check_drift(shifted(shots[i].captured_at, 0.02));
    constexpr int k_moments = 20;
    if (is_edited)
      for (int k = 0; k < k_moments; ++k) waits.push_back((k + 0.5) / k_moments * before_ms + painted_ms);
    before_ms = wall_ms() - begun;
  }
  fmt::print(
      "from an edit to the first images that show it, without the display: {:.0f} ms (median), {:.0f} ms (95 "
      "%)\n",
      quantile(waits, 0.5), quantile(waits, 0.95));
}

void print_recording(const std::vector<Shot>& shots, const SessionSetup& setup) {
  const fs::path folder = fs::temp_directory_path() / fmt::format("limn-bench-live-{}", getpid());
  std::vector<double> without, with, processor_without, processor_with;
  for (int i = 0; i < 3; ++i) {
    const FrameCost alone = session_cost(shots, setup, {}), recorded = session_cost(shots, setup, folder);
    without.push_back(alone.wall_ms);
    with.push_back(recorded.wall_ms);
    processor_without.push_back(alone.processor_ms);
    processor_with.push_back(recorded.processor_ms);
    fs::remove_all(folder);
  }
  fmt::print(
      "a frame of the session (decoding, perception, rendering): {:.1f} ms; with recording {:.1f} ms: "
      "{:+.1f} %\n",
      median(without), median(with), 100 * (median(with) / median(without) - 1));
  fmt::print("its processor time in all threads: {:.1f} ms; with recording {:.1f} ms: {:+.1f} %\n",
             median(processor_without), median(processor_with),
             100 * (median(processor_with) / median(processor_without) - 1));
}

void print_memory(const std::vector<Shot>& shots, const SessionSetup& setup) {
  auto perception = Perception::create(setup.scene, setup.rig, setup.watch).value();
  double first_mib = 0;
  double at_s = 0;
  for (std::size_t round = 0; round < k_rounds; ++round) {
    for (const Shot& shot : shots) {
      at_s += 1 / 30.0;
      Frame frame = decoded(shot, setup);
      frame.captured_at = shifted(shot.captured_at, at_s);
      (void)perception.watch(std::span(&frame, 1));
    }
    if (round == 0) first_mib = resident_mib();
  }
  fmt::print("memory after {} and {} frames of perception: {:.1f} and {:.1f} MiB\n", shots.size(),
             k_rounds * shots.size(), first_mib, resident_mib());
}

// What moves in a session on the virtual rig: this marker, with what is attached to it; empty: nothing.
struct Motion {
  std::string name, marker;
};

constexpr double k_period_s = 1 / 30.0;

// A session on the virtual rig. No recording, and nobody looks at the screen.
class VirtualPlay {
 public:
  VirtualPlay(double share, const Motion& motion)
      : rig_(coarser(share), session::virtual_rig_options(k_period_s)) {
    session::Script script;
    if (!motion.marker.empty()) script.sways.push_back({motion.marker, 0, 1e9, {0.05, 0, 0}, 0.5});
    room_.emplace(session::ScriptedRoom::create(script, &rig_).value());
    setup_.rig = rig_.world().rig;
    setup_.scene = *rig_.world().scene;
    output_.emplace(session::SessionOutput::open({}, {}, &setup_).value());
    perception_.emplace(Perception::create(setup_.scene, setup_.rig, setup_.watch).value());
    session_.emplace(Session::create(setup_, &output_->telemetry(), nullptr, false).value());
  }
  const Rig& rig() const { return rig_.world().rig; }
  const Session& session() const { return *session_; }
  // Median of a measure of telemetry; number of frames so far.
  double stage_ms(const char* name) { return output_->telemetry().summary()[name]["median"].get<double>(); }
  int frames() { return output_->telemetry().summary()["pictures"].get<int>(); }
  void play(double seconds, const session::RealTime* real_time = nullptr) {
    const session::SessionParts parts{*perception_, *session_, *output_};
    const std::atomic<bool> is_ended = false;
    LIMN_CHECK(
        session::play_virtually(seconds_of(rig_.now()) + seconds, real_time, is_ended, &rig_, &*room_, parts)
            .ok());
  }

 private:
  static sim::World coarser(double share) {
    sim::World world = whole_studio();
    LIMN_CHECK(scale_resolution(share, &world.rig).ok());
    return world;
  }

  sim::VirtualRig rig_;
  SessionSetup setup_;
  std::optional<session::ScriptedRoom> room_;
  std::optional<session::SessionOutput> output_;
  std::optional<Perception> perception_;
  std::optional<Session> session_;
};

// As fast as the machine can. 1: as many frames a second as the camera sends.
void print_pace(double share, const Motion& motion, int frames) {
  VirtualPlay played(share, motion);
  played.play(20 * k_period_s);  // the prototype comes to rest, and everything is prepared
  const double begun = wall_ms(), begun_processor = processor_ms();
  played.play(frames * k_period_s);
  const double frame_ms = (wall_ms() - begun) / frames;
  const Imager &camera = played.rig().cameras[0], &projector = played.rig().projectors[0];
  fmt::print(
      "  camera {:>4}x{:<4} projectors {:>4}x{:<4} {:<16} {:5.2f}  {:7.1f}  {:7.1f}  {:7.1f}  {:7.1f}\n",
      camera.width, camera.height, projector.width, projector.height, motion.name,
      1e3 * k_period_s / frame_ms, frame_ms, (processor_ms() - begun_processor) / frames,
      played.stage_ms("detect_ms") + played.stage_ms("filter_ms"), played.stage_ms("paint_ms"));
}

// As a session that people take part in: the effort follows the machine.
void print_real_time(const Motion& motion) {
  constexpr double k_settle_s = 12, k_seconds = 4;
  VirtualPlay played(1, motion);
  const Rig whole = played.rig();
  session::RealTime real_time{whole, k_period_s, session::efforts_for(whole, true)};
  played.play(k_settle_s, &real_time);
  const auto share = [&] { return 1.0 * played.rig().cameras[0].width / whole.cameras[0].width; };
  for (std::size_t i = 0; i < real_time.efforts.size(); ++i)
    if (session::sentence(real_time.efforts[i]) == played.session().pace()) real_time.first = i;
  const int before = played.frames();
  played.play(k_seconds, &real_time);
  fmt::print("  in real time, {}: {:.2f} of the camera's frames at {:.0f} % of the resolution. {}\n",
             motion.name, (played.frames() - before) * k_period_s / k_seconds, 100 * share(),
             played.session().pace());
}

void print_paces(int frames) {
  const std::vector<Motion> motions = {{"nothing moves", ""}, {"a marker moves", "aruco_4x4_50:0"}};
  fmt::print(
      "virtual session: frames a second divided by the camera's; ms a frame: by the clock, by processors, "
      "markers, projectors' images\n");
  for (const double share : {1.0, 0.5})
    for (const Motion& motion : motions) print_pace(share, motion, frames);
  for (const Motion& motion : motions) print_real_time(motion);
}

int run(int argc, char** argv) {
  int count = 60;
  bool only_session = false;
  for (int i = 1; i < argc; ++i) {
    if (std::strcmp(argv[i], "--session") == 0) {
      only_session = true;
      continue;
    }
    const bool is_frames = std::strcmp(argv[i], "--frames") == 0 && i + 1 < argc;
    const char* text = is_frames ? argv[++i] : "";
    const auto parsed = std::from_chars(text, text + std::strlen(text), count);
    if (!is_frames || parsed.ec != std::errc() || *parsed.ptr != '\0' || count < 3 || count > 10000) {
      fmt::print(stderr, "live_bench: expected --frames N (3 to 10000) or --session, found '{}'.\n", argv[i]);
      return 2;
    }
  }
  const auto context = device::GlContext::create();
  if (!context) {
    fmt::print(stderr, "live_bench: {}\n", context.message());
    return 1;
  }
  print_paces(count);
  if (only_session) return 0;
  SessionSetup setup;
  const std::vector<Shot> frames = shots(count, &setup);
  for (const Wire& wire : wires()) print_cost(frames, setup, wire);
  print_codes(frames);
  print_edits(frames, setup);
  print_recording(frames, setup);
  print_memory(frames, setup);
  return 0;
}

}  // namespace
}  // namespace limn::test

int main(int argc, char** argv) { return limn::test::run(argc, argv); }
