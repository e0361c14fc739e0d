// limn bench room: a host and simulated nodes, which receive the moments of a session and draw nothing. What
// the host's processor and the network carry, and how long a moment takes.

#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <memory>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "nodes/room.h"
#include "nodes/room_keys.h"

namespace limn::nodes {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

struct BenchOptions {
  int nodes = 8;
  int projectors = 2;  // for each node
  double seconds = 8;
  double rate_hz = 60;
};

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

// Runs a node until the bench creates the file `end`. A moment's painted_at is when it was sent.
int run_node(const fs::path& room, const BenchOptions& options, int number) {
  auto node = entered(room, fmt::format("node{}", number), false);
  if (!node) return fmt::print(stderr, "{}\n", node.message()), 1;
  Offer offer{.version = "bench"};
  for (int p = 0; p < options.projectors; ++p)
    offer.monitors.push_back({fmt::format("DP-{}", p), {1920, 1200}});
  if (!(*node)->offer(offer)) return 1;
  std::vector<double> delays_ms;
  Clock::time_point reported_at;
  while (!fs::exists(room / "end")) {
    (*node)->wait(std::chrono::milliseconds(20));
    if (const auto moment = (*node)->take_moment())
      delays_ms.push_back(1e3 * seconds_between(moment->frame.painted_at, now()));
    if (Clock::now() - reported_at < std::chrono::milliseconds(200)) continue;
    reported_at = Clock::now();
    Health health;
    health.shown = delays_ms.size();
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

Status measure(const fs::path& room, const BenchOptions& options) {
  LIMN_TRY(const std::unique_ptr<Room> host, entered(room, "host", true));
  LIMN_TRY_STATUS(host->offer({.is_host = true, .version = "bench"}));
  LIMN_TRY_STATUS(host->send(Setup{.revision = 1}));
  const auto begun = Clock::now();
  while (static_cast<int>(host->machines().size()) < options.nodes) {
    if (Clock::now() - begun > std::chrono::seconds(60))
      return error("room bench: expected {} nodes, heard {} within 60 s.", options.nodes,
                   host->machines().size());
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  const double found_s = std::chrono::duration<double>(Clock::now() - begun).count();
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
  fmt::print(
      "{:5} {:10} {:8.1f} {:10.1f} {:9.0f} {:9.2f} {:9.1f} {:9.1f} {:8.2f} {:8.2f} {:9.3f} {:9.3f} {:6}\n",
      options.nodes, options.nodes * options.projectors, found_s, 100 * processor / took_s, memory_mb(),
      (bytes - bytes_before) / took_s / 1e6, (bytes - bytes_before) / frames / 1e3,
      (packets - packets_before) / took_s, quantile(delays, 0.5), quantile(delays, 0.99),
      received / options.nodes / frames, least / frames, late);
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
  CLI11_PARSE(app, argc, argv);
  if (nodes.empty()) nodes = {1, 2, 4, 8, 16, 32};
  fmt::print(
      "                        host's     host's   network   network   delay of a moment   moments "
      "received\n");
  fmt::print(
      "nodes projectors  found s  CPU %  memory MB      MB/s  kB/frame  packets/s  median ms   99 % ms  mean "
      "share  "
      "least  late\n");
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

int main(int argc, char** argv) { return limn::nodes::run(argc, argv); }
