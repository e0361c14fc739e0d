#include "apps/doctor_room.h"

#include <chrono>
#include <thread>

#include "core/names.h"
#include "core/version.h"

namespace limn::apps {
namespace {

using State = Finding::State;

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
  return findings;
}

}  // namespace limn::apps
