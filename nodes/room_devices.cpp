#include "nodes/room_devices.h"

#include <algorithm>
#include <chrono>
#include <set>
#include <thread>

namespace limn::nodes {
namespace {

// A monitor or camera of a machine.
struct Place {
  std::string machine;
  OfferedDevice device;
};

std::vector<Place> places(std::span<const Machine> machines, std::vector<OfferedDevice> Offer::*offered) {
  std::vector<Place> out;
  for (const Machine& machine : machines)
    if (!machine.offer.is_host && machine.offer.protocol == k_protocol)
      for (const OfferedDevice& device : machine.offer.*offered) out.push_back({machine.sender.node, device});
  return out;
}

std::string text_of(const Imager& imager, const std::vector<Place>& fitting) {
  std::string out = fmt::format("{} ({}x{}):", imager.name, imager.width, imager.height);
  for (const Place& place : fitting) out += fmt::format(" {} at {},", place.device.name, place.machine);
  if (fitting.empty()) return out + " nothing";
  out.pop_back();
  return out;
}

// Where there is exactly one for each imager, and no two imagers have the same one.
bool is_only_reading(const std::vector<std::vector<Place>>& fitting) {
  std::set<std::pair<std::string, std::string>> taken;
  return std::ranges::all_of(fitting, [&](const std::vector<Place>& places) {
    return places.size() == 1 && taken.insert({places[0].machine, places[0].device.name}).second;
  });
}

}  // namespace

Result<device::Devices> offered_devices(std::span<const Machine> machines, const Rig& rig) {
  const std::vector<Place> monitors = places(machines, &Offer::monitors);
  const std::vector<Place> cameras = places(machines, &Offer::cameras);
  std::vector<std::vector<Place>> fitting;
  std::string found;
  for (const Imager& projector : rig.projectors) {
    auto& fits = fitting.emplace_back();
    std::ranges::copy_if(monitors, std::back_inserter(fits), [&](const Place& place) {
      return place.device.size == cv::Size(projector.width, projector.height);
    });
    found += text_of(projector, fits) + "; ";
  }
  for (const Imager& camera : rig.cameras) found += text_of(camera, fitting.emplace_back(cameras)) + "; ";
  if (found.size() > 2) found.resize(found.size() - 2);
  if (!is_only_reading(fitting))
    return error(
        "--room: expected --devices with it, or nodes that offer exactly one monitor of each projector's "
        "size "
        "and one camera, found {}. Write a devices file that says which device is plugged into which "
        "machine.",
        found);
  device::Devices out;
  for (std::size_t i = 0; i < rig.projectors.size(); ++i) {
    const Place& place = fitting[i][0];
    out.displays.push_back({.name = rig.projectors[i].name,
                            .host = place.machine,
                            .monitor = place.device.name,
                            .size = place.device.size});
  }
  for (std::size_t i = 0; i < rig.cameras.size(); ++i) {
    const Place& place = fitting[rig.projectors.size() + i][0];
    device::CameraConfig camera{.name = rig.cameras[i].name, .host = place.machine};
    camera.source = place.device.name;
    out.cameras.push_back(std::move(camera));
  }
  return out;
}

Result<device::Devices> wait_for_devices(const Room& room, const Rig& rig, double limit_s) {
  const Stamp begun = now();
  while (true) {
    auto found = offered_devices(room.machines(), rig);
    if (found || seconds_between(begun, now()) >= limit_s) return found;
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
}

}  // namespace limn::nodes
