#include "apps/room.h"

#include <unistd.h>

#include <array>
#include <csignal>
#include <optional>

#include "core/file.h"
#include "core/log.h"
#include "core/version.h"
#include "nodes/node.h"
#include "nodes/room_devices.h"
#include "nodes/room_keys.h"
#include "nodes/room_link.h"
#include "nodes/shared_files.h"

namespace limn::apps {
namespace {

namespace fs = std::filesystem;

constexpr double k_other_host_s = 1.5;  // in which a host that is in the room is heard
constexpr double k_offers_s = 4;        // until all nodes have offered their devices

std::atomic<bool> g_node_is_ended = false;
void end_node(int) { g_node_is_ended = true; }

std::string machine_name() {
  std::array<char, 256> name{};
  return gethostname(name.data(), name.size() - 1) == 0 && name[0] ? name.data() : "machine";
}

// `files` may be null: then no files are served.
nodes::Offer host_offer(const nodes::FileServer* files) {
  nodes::Offer offer{.is_host = true, .version = std::string(version())};
  if (!files) return offer;
  offer.servers = files->servers();
  offer.fingerprint = files->fingerprint();
  offer.token = files->token();
  return offer;
}

}  // namespace

Result<std::unique_ptr<nodes::Room>> enter_room(const RoomOptions& options, bool is_host) {
  LIMN_TRY(const fs::path folder, nodes::find_room(options.room));
  LIMN_TRY(std::unique_ptr<nodes::RoomLink> link,
           nodes::open_room_link({.room = folder,
                                  .node = options.name.empty() ? machine_name() : options.name,
                                  .is_host = is_host,
                                  .peers = options.peers,
                                  .interfaces = options.interfaces}));
  auto room = std::make_unique<nodes::Room>(std::move(link));
  if (is_host) LIMN_TRY_STATUS(nodes::check_no_other_host(*room, k_other_host_s));
  return room;
}

Result<std::unique_ptr<nodes::Room>> enter_room_for_orders(const RoomOptions& options) {
  LIMN_TRY(std::unique_ptr<nodes::Room> room, enter_room(options, true));
  LIMN_TRY_STATUS(room->offer(host_offer(nullptr)));
  return room;
}

Result<device::Devices> devices_in_room(const RoomOptions& options, const Rig& rig) {
  LIMN_TRY(const std::unique_ptr<nodes::Room> room, enter_room_for_orders(options));
  LIMN_TRY(device::Devices devices, nodes::wait_for_devices(*room, rig, k_offers_s));
  for (const device::DisplayConfig& display : devices.displays)
    log_info("live: {} is {} at {}", display.name, display.monitor, display.host);
  for (const device::CameraConfig& camera : devices.cameras)
    log_info("live: {} is {} at {}", camera.name, camera.source, camera.host);
  return devices;
}

Result<std::unique_ptr<HostedRoom>> HostedRoom::open(const RoomOptions& options,
                                                     const device::Devices& devices,
                                                     const fs::path& out_folder,
                                                     session::SessionSetup* setup) {
  std::unique_ptr<HostedRoom> out(new HostedRoom());
  LIMN_TRY(out->room_, enter_room(options, true));
  LIMN_TRY(calib::TemporaryFolder work, calib::TemporaryFolder::create());
  out->work_.emplace(std::move(work));
  LIMN_TRY(out->files_, nodes::FileServer::open());
  AppendLog log;
  if (!out_folder.empty()) {
    LIMN_TRY_STATUS(make_folder(out_folder));
    LIMN_TRY(log, AppendLog::create(out_folder / "frames.csv", nodes::k_frames_log_header));
  }
  LIMN_TRY(out->host_, nodes::RoomHost::open(out->room_.get(), out->files_.get(), devices, out->work_->path(),
                                             std::move(log), setup));
  LIMN_TRY_STATUS(out->room_->offer(host_offer(out->files_.get())));
  log_info("live: this machine is the host of the room {}", options.room);
  return out;
}

HostedRoom::~HostedRoom() = default;

Status create_room(const std::string& name, fs::path folder) {
  if (folder.empty()) {
    LIMN_TRY(folder, nodes::room_folder(name));
  }
  LIMN_TRY_STATUS(nodes::create_room(folder, name));
  log_info(
      "room {} was created in {}. Copy this folder to the same place on the other machines, and keep it "
      "secret.",
      name, folder.string());
  return {};
}

Status run_node(const NodeCommand& command) {
  g_node_is_ended = false;
  std::signal(SIGINT, end_node);
  std::signal(SIGTERM, end_node);
  LIMN_TRY(const std::unique_ptr<nodes::Room> room, enter_room(command.room, false));
  const Result<device::Desktop> desktop = device::Desktop::open();
  if (!desktop) log_info("node: no monitors are offered: {}", desktop.message());
  log_info("node: {} waits for a host in the room", room->self().node);
  LIMN_TRY(const calib::TemporaryFolder work, calib::TemporaryFolder::create());
  return nodes::run_node({.fetch = nodes::fetch_from_host(), .work = work.path(), .out = command.out},
                         room.get(), desktop ? &*desktop : nullptr, g_node_is_ended);
}

}  // namespace limn::apps
