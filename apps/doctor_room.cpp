#include "apps/doctor_room.h"

#include <chrono>
#include <cstdlib>
#include <thread>

#include "core/file.h"
#include "core/names.h"
#include "core/version.h"

namespace limn::apps {
namespace {

using State = Finding::State;

// With smaller buffers for what arrives a busy machine lost up to 3 % of the moments.
constexpr long k_least_buffer = 4 << 20;                    // bytes
constexpr auto k_listen = std::chrono::milliseconds(2500);  // the machines are heard, and the clocks compared

Finding versions(const nodes::Machine& machine) {
  const std::string& found = machine.offer.version;
  if (machine.offer.protocol == nodes::k_protocol && found == version())
    return {"room", machine.sender.node, State::works,
            fmt::format("{}, version {}", machine.offer.is_host ? "host" : "node", found), ""};
  return {"room", machine.sender.node, State::fails,
          fmt::format("expected version {} as here, found {}", version(), found),
          "Install the same version of Limn on all machines of the room."};
}

Finding devices(const nodes::Machine& machine) {
  return {"room", machine.sender.node, State::works,
          fmt::format("monitors: {}; cameras: {}; {}", joined_names(machine.offer.monitors),
                      machine.offer.cameras.empty() ? "none" : joined_names(machine.offer.cameras),
                      machine.offer.renderer),
          ""};
}

Finding health(const nodes::Machine& machine) {
  const std::string& name = machine.sender.node;
  if (!machine.health)
    return {"room", name, State::fails, "expected word of its health, found none",
            "Start limn node there again."};
  const nodes::Health& health = *machine.health;
  if (!health.problems.empty()) return {"room", name, State::fails, health.problems.front(), ""};
  return {"room", name, State::works,
          fmt::format(
              "host's clock minus its own {:.6f} s, ± {:.2f} ms (95 %); draws a frame in {:.1f} ms; light "
              "{:.1f} ms after the call; {} frames shown, {} missed",
              health.clock_offset_s, 2e3 * health.clock_stddev_s, health.draw_ms, 1e3 * health.latency_s,
              health.shown, health.missed),
          ""};
}

Finding receive_buffer() {
  const auto text = read_file("/proc/sys/net/core/rmem_max");
  const long most = text ? std::strtol(text->c_str(), nullptr, 10) : 0;
  if (!text) return {"room", "network", State::note, text.message(), ""};
  if (most >= k_least_buffer)
    return {"room", "network", State::works, fmt::format("receive buffers of up to {} bytes", most), ""};
  return {
      "room", "network", State::note,
      fmt::format("expected receive buffers of at least {} bytes, found a limit of {}: a busy machine loses "
                  "messages",
                  k_least_buffer, most),
      fmt::format("sudo sysctl net.core.rmem_max={}", k_least_buffer)};
}

}  // namespace

std::vector<Finding> examined_room(const RoomOptions& options) {
  const auto room = enter_room(options, false);
  if (!room) return {{"room", options.room, State::fails, room.message(), ""}};
  std::this_thread::sleep_for(k_listen);
  std::vector<Finding> findings;
  for (const nodes::Machine& machine : (*room)->machines()) {
    findings.push_back(versions(machine));
    if (machine.offer.is_host || findings.back().state == State::fails) continue;
    findings.push_back(devices(machine));
    findings.push_back(health(machine));
  }
  if (const auto clock = (*room)->host_clock())
    findings.push_back(
        {"room", "network", State::works,
         fmt::format("a message to the host and back takes {:.2f} ms", 1e3 * clock->round_trip_s), ""});
  if (findings.empty())
    findings.push_back(
        {"room", options.room, State::fails, "expected other machines, heard none for 2.5 s",
         "Start limn node --join there. If the switch blocks multicast, name an address with --peer; on "
         "machines with several networks name one with --interface."});
  for (const std::string& problem : (*room)->problems())
    findings.push_back({"room", "network", State::fails, problem, ""});
  findings.push_back(receive_buffer());
  return findings;
}

}  // namespace limn::apps
