// limn bench room: a host and simulated nodes, which receive the moments of a session and draw nothing. What
// the host's processor and the network carry, how long a moment takes, and when displays that refresh 60
// times a second change: those of all nodes refresh together (genlock), at moments that nobody is told.

#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <optional>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "nodes/file_server.h"
#include "nodes/refresh.h"
#include "nodes/room.h"
#include "nodes/room_keys.h"
#include "nodes/shared_files.h"
#include "nodes/timing/display_schedule.h"

namespace limn::nodes {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

struct BenchOptions {
  int nodes = 8;
  int projectors = 2;  // for each node
  double seconds = 8;
  double rate_hz = 60;
  bool is_aligned = true;  // the host chooses moments at which displays refresh
  double files_mb = 0;     // of a scene that the first node fetches meanwhile
};

constexpr double k_refresh_s = 1 / 60.0, k_electronics_s = 5e-3;
constexpr double k_network_s = 0.004, k_unknown_latency_s = 0.02;  // as in a session (remote_devices.cpp)

// The light of an image that a display gets now: at its next refresh.
Stamp light_after(Stamp called_at) {
  const double refreshes = std::ceil(seconds_between(Stamp{}, called_at) / k_refresh_s);
  return shifted(Stamp{}, refreshes * k_refresh_s + k_electronics_s);
}

// Shows the frames of a node; a line for each: its number, its light (s), and how far that is from the wanted
// moment (ms).
class SimulatedDisplay {
 public:
  explicit SimulatedDisplay(const fs::path& log) : log_(log) { log_.precision(15); }

  void show(const session::FrameDescription& frame, const std::optional<ClockEstimate>& clock) {
    if (!clock) return;
    const Stamp wanted = clock->to_local(frame.shown_at);
    std::this_thread::sleep_until(schedule_.call_at(wanted));
    const Stamp called_at = now(), shown_at = light_after(called_at);
    schedule_.note(called_at, shown_at);
    log_ << frame.number << ' ' << seconds_between(Stamp{}, shown_at) << ' '
         << 1e3 * seconds_between(wanted, shown_at) << '\n';
  }
  void report(const std::optional<ClockEstimate>& clock, Health* health) const {
    health->latency_s = schedule_.latency_s();
    if (const auto period_s = schedule_.refresh_s(); period_s && clock)
      health->refreshes = {{clock->to_other(schedule_.last_shown_at()), *period_s}};
  }

 private:
  DisplaySchedule schedule_;
  std::ofstream log_;
};

// When the light of a frame that is sent now is expected, and what the host makes of it.
Stamp light_at(const Room& host, bool is_aligned) {
  double latency_s = 0;
  std::vector<Refresh> refreshes;
  for (const Machine& machine : host.machines()) {
    if (!machine.health) continue;
    latency_s = std::max(latency_s, machine.health->latency_s);
    for (const Refresh& each : machine.health->refreshes) refreshes.push_back(each);
  }
  const Stamp expected = shifted(now(), k_network_s + (latency_s > 0 ? latency_s : k_unknown_latency_s));
  return is_aligned ? refresh_near(expected, refreshes) : expected;
}

// A frame as in a session with a car: poses of 30 bodies, 20 parts of which two fade, rings and names.
session::FrameDescription busy_frame(int projectors) {
  session::FrameDescription frame;
  for (int i = 0; i < 30; ++i) {
    Track track;
    track.body = fmt::format("body {}", i);
    track.world_from_body.translation = {0.1 * i, 0.02 * i, 0.3};
    track.covariance.setIdentity();
    frame.tracks.push_back(track);
  }
  frame.posed.world_from_prototype = Pose();
  for (int i = 0; i < 20; ++i)
    frame.posed.parts.push_back(
        {fmt::format("slot {}", i), "a variant", Pose(Eigen::Quaterniond::Identity(), {0.1 * i, 0, 0})});
  frame.viewer = viewer_imager(Pose(), 1280, 800, 40);
  for (std::size_t i = 0; i < 2; ++i) frame.fading.push_back({frame.posed.parts[i], 0.5});
  for (std::size_t i = 0; i < 20; ++i)
    frame.signs.push_back(projector::RingOverlay{i % static_cast<std::size_t>(projectors), Pose(), 0.04,
                                                 cv::Scalar(90, 220, 90), 0.7});
  return frame;
}

Result<std::unique_ptr<Room>> entered(const fs::path& room, const std::string& name, bool is_host) {
  LIMN_TRY(
      auto link,
      open_room_link({.room = room, .node = name, .is_host = is_host, .peers = {}, .interfaces = {"lo"}}));
  return std::make_unique<Room>(std::move(link));
}

// Fetches the host's files, once the moments have come for a while; writes how long it took.
void fetch_files(const Setup& setup, const Offer& host, const fs::path& room) {
  std::this_thread::sleep_for(std::chrono::seconds(2));
  const auto begun = Clock::now();
  const Status fetched = fetch_from_host(room / "cache")(setup, host, room / "fetched");
  if (!fetched) fmt::print(stderr, "{}\n", fetched.message());
  std::ofstream(room / "files") << std::chrono::duration<double>(Clock::now() - begun).count();
}

// Runs a node until the bench creates the file `end`. A moment's painted_at is when it was sent.
int run_node(const fs::path& room, const BenchOptions& options, int number) {
  auto node = entered(room, fmt::format("node{}", number), false);
  if (!node) return fmt::print(stderr, "{}\n", node.message()), 1;
  Offer offer{.version = "bench"};
  for (int p = 0; p < options.projectors; ++p)
    offer.monitors.push_back({fmt::format("DP-{}", p), {1920, 1200}});
  if (!(*node)->offer(offer)) return 1;
  std::vector<double> delays_ms;
  SimulatedDisplay display(room / fmt::format("light-{}", number));
  Clock::time_point reported_at;
  std::jthread fetching;
  while (!fs::exists(room / "end")) {
    (*node)->wait(std::chrono::milliseconds(20));
    const auto host = (*node)->host();
    if (const auto setup = number == 0 ? (*node)->take_setup() : std::nullopt; setup && !setup->files.empty())
      fetching =
          std::jthread([setup = *setup, offer = host->offer, room] { fetch_files(setup, offer, room); });
    if (const auto moment = (*node)->take_moment()) {
      delays_ms.push_back(1e3 * seconds_between(moment->frame.painted_at, now()));
      display.show(moment->frame, (*node)->host_clock());
    }
    if (Clock::now() - reported_at < std::chrono::milliseconds(200)) continue;
    reported_at = Clock::now();
    Health health;
    health.shown = delays_ms.size();
    display.report((*node)->host_clock(), &health);
    (void)(*node)->send(health);
  }
  std::ofstream out(room / fmt::format("delays-{}", number));
  for (const double delay : delays_ms) out << delay << ' ';
  return 0;
}

double processor_s() {
  rusage used{};
  getrusage(RUSAGE_SELF, &used);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return seconds(used.ru_utime) + seconds(used.ru_stime);
}

// Bytes and packets that the loopback has carried.
std::pair<double, double> carried() {
  std::ifstream file("/proc/net/dev");
  for (std::string line; std::getline(file, line);) {
    const std::size_t colon = line.find(':');
    if (colon == std::string::npos || line.substr(0, colon).find("lo") == std::string::npos) continue;
    std::istringstream numbers(line.substr(colon + 1));
    double bytes = 0, packets = 0;
    numbers >> bytes >> packets;
    return {bytes, packets};
  }
  return {};
}

double memory_mb() {
  std::ifstream file("/proc/self/statm");
  double all = 0, resident = 0;
  file >> all >> resident;
  return resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1e6;
}

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  std::ranges::sort(values);
  return values[std::min(values.size() - 1,
                         static_cast<std::size_t>(share * static_cast<double>(values.size())))];
}

// What the displays of all nodes did, but for the first frames, in which they learn their refresh.
struct Light {
  std::vector<double> from_wanted_ms;
  std::vector<double> skew_ms;  // between the first and the last node, for each frame that all have shown
};
Light read_light(const fs::path& room, int nodes) {
  constexpr int k_first_frames = 60;
  Light out;
  struct Frame {
    double first_s = 1e18, last_s = 0;
    int nodes = 0;
  };
  std::map<int, Frame> frames;
  for (int number = 0; number < nodes; ++number) {
    std::ifstream file(room / fmt::format("light-{}", number));
    int frame = 0;
    for (double at_s = 0, from_ms = 0; file >> frame >> at_s >> from_ms;) {
      if (frame <= k_first_frames) continue;
      out.from_wanted_ms.push_back(std::abs(from_ms));
      Frame& all = frames[frame];
      all = {std::min(all.first_s, at_s), std::max(all.last_s, at_s), all.nodes + 1};
    }
  }
  for (const auto& [number, frame] : frames)
    if (frame.nodes == nodes) out.skew_ms.push_back(1e3 * (frame.last_s - frame.first_s));
  return out;
}

Status measure(const fs::path& room, const BenchOptions& options) {
  LIMN_TRY(const std::unique_ptr<Room> host, entered(room, "host", true));
  LIMN_TRY(const std::unique_ptr<FileServer> server, FileServer::open());
  Setup setup{.revision = 1};
  if (options.files_mb > 0) {
    const fs::path scene = room / "session/scene";
    fs::create_directories(scene);
    std::ofstream(scene / "mesh.bin") << std::string(static_cast<std::size_t>(1e6 * options.files_mb), 'x');
    LIMN_TRY(setup.files, server->share(room / "session"));
  }
  LIMN_TRY_STATUS(host->offer({.is_host = true,
                               .version = "bench",
                               .servers = server->servers(),
                               .fingerprint = server->fingerprint(),
                               .token = server->token()}));
  const auto begun = Clock::now();
  while (static_cast<int>(host->machines().size()) < options.nodes) {
    if (Clock::now() - begun > std::chrono::seconds(60))
      return error("room bench: expected {} nodes, heard {} within 60 s.", options.nodes,
                   host->machines().size());
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  const double found_s = std::chrono::duration<double>(Clock::now() - begun).count();
  LIMN_TRY_STATUS(host->send(setup));
  std::this_thread::sleep_for(std::chrono::seconds(2));

  Moment moment{1, busy_frame(options.nodes * options.projectors)};
  const auto [bytes_before, packets_before] = carried();
  const double processor_before = processor_s();
  const auto first = Clock::now();
  const int frames = static_cast<int>(options.seconds * options.rate_hz);
  int late = 0;
  for (int i = 0; i < frames; ++i) {
    const auto due = first + std::chrono::duration_cast<Clock::duration>(
                                 std::chrono::duration<double>(i / options.rate_hz));
    std::this_thread::sleep_until(due);
    late += Clock::now() - due > std::chrono::milliseconds(5);
    moment.frame.number = static_cast<std::uint64_t>(i) + 1;
    moment.frame.painted_at = now();
    moment.frame.shown_at = light_at(*host, options.is_aligned);
    LIMN_TRY_STATUS(host->send(moment));
  }
  const double took_s = std::chrono::duration<double>(Clock::now() - first).count();
  const double processor = processor_s() - processor_before;
  const auto [bytes, packets] = carried();
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  std::ofstream(room / "end").close();
  for (int i = 0; i < options.nodes; ++i) wait(nullptr);

  double received = 0, least = 1e9;
  std::vector<double> delays;
  for (int number = 0; number < options.nodes; ++number) {
    std::ifstream file(room / fmt::format("delays-{}", number));
    const std::size_t before = delays.size();
    for (double delay = 0; file >> delay;) delays.push_back(delay);
    const auto count = static_cast<double>(delays.size() - before);
    received += count;
    least = std::min(least, count);
  }
  const Light light = read_light(room, options.nodes);
  fmt::print(
      "{:5} {:10} {:8.1f} {:10.1f} {:9.0f} {:9.2f} {:9.1f} {:9.1f} {:8.2f} {:8.2f} {:9.3f} {:9.3f} {:6} "
      "{:9.2f} "
      "{:8.2f} {:9.2f} {:8.2f}\n",
      options.nodes, options.nodes * options.projectors, found_s, 100 * processor / took_s, memory_mb(),
      (bytes - bytes_before) / took_s / 1e6, (bytes - bytes_before) / frames / 1e3,
      (packets - packets_before) / took_s, quantile(delays, 0.5), quantile(delays, 0.99),
      received / options.nodes / frames, least / frames, late, quantile(light.from_wanted_ms, 0.5),
      quantile(light.from_wanted_ms, 0.99), quantile(light.skew_ms, 0.5), quantile(light.skew_ms, 0.99));
  double files_s = 0;
  if (std::ifstream(room / "files") >> files_s)
    fmt::print("      meanwhile {:.0f} MB of files came to the first node in {:.1f} s\n", options.files_mb,
               files_s);
  return {};
}

int run(int argc, char** argv) {
  CLI::App app(
      "Messages of a room with simulated nodes on the loopback: the host's processor, bytes, delays");
  BenchOptions options;
  std::vector<int> nodes;
  app.add_option("--nodes", nodes, "Numbers of nodes, up to 32; without it 1 2 4 8 16 32");
  app.add_option("--projectors", options.projectors, "Projectors of each node")->capture_default_str();
  app.add_option("--seconds", options.seconds, "Length of each measurement")->capture_default_str();
  app.add_option("--rate", options.rate_hz, "Moments in a second")->capture_default_str();
  app.add_option("--files", options.files_mb, "MB of a scene that the first node fetches meanwhile");
  bool is_unaligned = false;
  app.add_flag("--unaligned", is_unaligned, "The host takes no notice of the displays' refreshes");
  CLI11_PARSE(app, argc, argv);
  options.is_aligned = !is_unaligned;
  if (nodes.empty()) nodes = {1, 2, 4, 8, 16, 32};
  fmt::print(
      "                        host's     host's   network   network   delay of a moment   moments "
      "received          light from wanted   skew of nodes\n");
  fmt::print(
      "nodes projectors  found s  CPU %  memory MB      MB/s  kB/frame  packets/s  median ms   99 % ms  mean "
      "share  "
      "least  late  median ms  99 % ms  median ms  99 % ms\n");
  for (const int count : nodes) {
    options.nodes = count;
    const fs::path room = fs::temp_directory_path() / fmt::format("limn-room-bench-{}-{}", getpid(), count);
    if (const Status made = create_room(room, fmt::format("bench-{}-{}", getpid(), count)); !made)
      return fmt::print(stderr, "{}\n", made.message()), 1;
    std::fflush(stdout);
    for (int number = 0; number < count; ++number)
      if (fork() == 0) _exit(run_node(room, options, number));
    const Status measured = measure(room, options);
    std::ofstream(room / "end").close();
    while (wait(nullptr) > 0) {
    }
    std::error_code ignored;
    fs::remove_all(room, ignored);
    if (!measured) return fmt::print(stderr, "{}\n", measured.message()), 1;
  }
  return 0;
}

}  // namespace
}  // namespace limn::nodes

int main(int argc, char** argv) try {
  return limn::nodes::run(argc, argv);
} catch (const std::exception& problem) {
  std::fprintf(stderr, "%s\n", problem.what());
  return 1;
}
