// What guests of the remote cost a live session, and how soon they see an edit. The time of a frame
// (detection, rendering, updates to guests) without guests is compared with that for four guests, in turns.
// Usage: limn bench remote [--rounds N (12)]
#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <charconv>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "core/log.h"
#include "core/median.h"
#include "core/scale_resolution.h"
#include "device/gl_context.h"
#include "remote/server.h"
#include "session/perception.h"
#include "session/session.h"
#include "sim/virtual_rig.h"
#include "tests/remote/remote_client.h"
#include "tracker/marker_image.h"

namespace limn::test {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;
using nlohmann::json;

constexpr double k_resolution = 0.5, k_lag_s = 0.06, k_period_s = 1 / 30.0;
constexpr int k_guests = 4, k_frames = 12;  // for each turn; the first frame is not counted
constexpr auto k_between_edits = 100ms;

double ms_since(Clock::time_point begun) {
  return std::chrono::duration<double, std::milli>(Clock::now() - begun).count();
}

// A session on the virtual studio. The virtual rig's rendering is not counted.
class ServedRoom {
 public:
  ServedRoom() : context_(device::GlContext::create().value()) {
    sim::World world =
        sim::load_world(fs::path(LIMN_SOURCE_DIR) / "config/worlds/studio.json", tracker::marker_image)
            .value();
    static_cast<void>(scale_resolution(k_resolution, &world.rig).ok());
    setup_.rig = world.rig;
    setup_.scene = *world.scene;
    rig_ = std::make_unique<sim::VirtualRig>(
        std::move(world),
        sim::VirtualRigOptions{.frame_period_s = k_period_s, .grab_waits_for_light = false});
    telemetry_.emplace(session::Telemetry::create({}).value());
    perception_.emplace(session::Perception::create(setup_.scene, setup_.rig).value());
    session_.emplace(session::Session::create(setup_, &*telemetry_, nullptr, false).value());
    health_.add({.name = "camera0", .kind = "camera"});
  }

  const session::SessionSetup& setup() const { return setup_; }

  // Duration of a frame, ms.
  double frame(remote::Server* server) {
    constexpr int k_cameras[] = {0};
    const std::vector<Frame> frames = rig_->expose(k_cameras);
    const auto begun = Clock::now();
    if (!frames.empty()) session_->update_percepts(perception_->watch(frames), ++moments_);
    server->apply_edits(&*session_, rig_->now());
    server->publish_state(*session_, *telemetry_, health_, rig_->now());
    session_->compose_and_record(rig_->now(), shifted(rig_->now(), k_lag_s));
    const double took_ms = ms_since(begun);
    for (std::size_t i = 0; i < setup_.rig.projectors.size(); ++i)
      static_cast<void>(
          rig_->projector(static_cast<int>(i)).show(session_->composed().projectors[i]).value());
    return took_ms;
  }

 private:
  device::GlContext context_;
  session::SessionSetup setup_;
  std::unique_ptr<sim::VirtualRig> rig_;
  std::optional<session::Telemetry> telemetry_;
  std::optional<session::Perception> perception_;
  std::optional<session::Session> session_;
  session::DeviceHealth health_;
  std::size_t moments_ = 0;
};

// Four guests who receive the state. One of them edits; with `rooms` all receive the live composite. Their
// own work is small and has the lowest priority.
class Guests {
 public:
  Guests(const remote::Server& server, bool rooms, std::vector<double>* late_ms) : late_ms_(late_ms) {
    const std::string pin = server.invitation().pins[1];
    for (int i = 0; i < k_guests; ++i) {
      const auto paired =
          RemoteClient(server.port())
              .post("/api/pair", json({{"pin", pin}, {"name", fmt::format("guest {}", i)}}).dump());
      sockets_.push_back(std::make_unique<RemoteClient>(server.port()));
      sockets_.back()->upgrade(json::parse(paired.body)["token"]);
      if (rooms) sockets_.back()->send_text(R"({"type": "pictures", "room": true})");
    }
    for (int i = 0; i < k_guests; ++i) threads_.emplace_back([this, i] { attend(i); });
  }
  ~Guests() {
    is_over_ = true;
    for (std::thread& thread : threads_) thread.join();
  }

 private:
  void attend(int number) {
    step_back(19);
    RemoteClient& socket = *sockets_[static_cast<std::size_t>(number)];
    while (!is_over_) {
      if (number == 0) edit(&socket);
      const auto message = socket.message(0.02);
      if (!message) continue;
      if (!message->is_text)
        socket.send_text(fmt::format("{{\"type\": \"seen\", \"picture\": {}}}", number_in(message->bytes)));
      else if (message->bytes.find("\"state\"") != std::string::npos)
        note(number, message->bytes);
    }
  }

  void edit(RemoteClient* socket) {
    const std::lock_guard lock(mutex_);
    if (Clock::now() - edited_at_ < k_between_edits) return;
    edited_at_ = Clock::now();
    seen_.assign(k_guests, false);
    ++edits_;
    socket->send_text(
        json({{"type", "edit"}, {"id", edits_}, {"action", "split_at"}, {"value", fmt::format("{}", edits_)}})
            .dump());
  }

  void note(int number, const std::string& state) {
    const std::lock_guard lock(mutex_);
    if (seen_.empty() || seen_[static_cast<std::size_t>(number)] ||
        state.find(fmt::format("\"split_mm\":{}.0", edits_)) == std::string::npos)
      return;
    seen_[static_cast<std::size_t>(number)] = true;
    late_ms_->push_back(ms_since(edited_at_));
  }

  static unsigned number_in(const std::string& bytes) {
    unsigned out = 0;
    for (std::size_t i = 8; i-- > 4;) out = out << 8 | static_cast<unsigned char>(bytes[i]);
    return out;
  }

  std::vector<std::unique_ptr<RemoteClient>> sockets_;
  std::vector<std::thread> threads_;
  std::atomic<bool> is_over_ = false;
  std::mutex mutex_;
  std::vector<double>* late_ms_;
  std::vector<bool> seen_;
  int edits_ = 0;
  Clock::time_point edited_at_;
};

int rounds_of(int argc, char** argv) {
  int rounds = 12;
  for (int i = 1; i + 1 < argc; ++i)
    if (std::strcmp(argv[i], "--rounds") == 0)
      std::from_chars(argv[i + 1], argv[i + 1] + std::strlen(argv[i + 1]), rounds);
  return std::max(1, rounds);
}

int run(int argc, char** argv) {
  set_log_level(LogLevel::warning);
  ServedRoom room;
  const fs::path keys = fs::temp_directory_path() / fmt::format("limn-remote-bench-{}", ::getpid());
  auto tablet_view = remote::TabletView::create(room.setup(), keys);
  if (!tablet_view) {
    fmt::print(stderr, "{}\n", tablet_view.message());
    return 1;
  }
  const remote::ServeOptions options{.at = "0", .page = {}, .keys = {}};
  const auto server = remote::Server::open(options, remote::image_providers(std::move(*tablet_view)));
  if (!server) {
    fmt::print(stderr, "{}\n", server.message());
    return 1;
  }
  const auto turn = [&] {
    std::vector<double> times;
    for (int i = 0; i < k_frames; ++i) {
      const double ms = room.frame(server->get());
      if (i > 0) times.push_back(ms);
    }
    return quantile(times, 0.5);
  };
  turn();
  std::vector<double> alone, states, images, late_ms, late_with_images_ms;
  alone.push_back(turn());
  // Each turn with guests is between two without, because other work on the machine varies.
  const auto beside = [&](bool rooms, std::vector<double>* late, std::vector<double>* shares) {
    double with = 0;
    {
      const Guests guests(**server, rooms, late);
      with = turn();
    }
    const double before = alone.back();
    alone.push_back(turn());
    shares->push_back(with / (0.5 * (before + alone.back())));
  };
  for (int round = 0; round < rounds_of(argc, argv); ++round) {
    beside(false, &late_ms, &states);
    beside(true, &late_with_images_ms, &images);
  }
  fmt::print("time of a frame (detection, updates to guests, rendering), in turns of {} frames\n",
             k_frames - 1);
  fmt::print("  without guests               {:.2f} ms (median; {:.2f} to {:.2f})\n", quantile(alone, 0.5),
             quantile(alone, 0.1), quantile(alone, 0.9));
  fmt::print("  four who receive the state   {:.3f} times that (median; {:.3f} to {:.3f})\n",
             quantile(states, 0.5), quantile(states, 0.1), quantile(states, 0.9));
  fmt::print("  four with the live composite {:.3f} times that (median; {:.3f} to {:.3f})\n",
             quantile(images, 0.5), quantile(images, 0.1), quantile(images, 0.9));
  fmt::print(
      "an edit is seen by four after {:.0f} ms (median), {:.0f} ms (95 %); with composites {:.0f}, {:.0f}\n",
      quantile(late_ms, 0.5), quantile(late_ms, 0.95), quantile(late_with_images_ms, 0.5),
      quantile(late_with_images_ms, 0.95));
  return 0;
}

}  // namespace
}  // namespace limn::test

int main(int argc, char** argv) { return limn::test::run(argc, argv); }
