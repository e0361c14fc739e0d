#pragma once

#include <atomic>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "calib/temporary_folder.h"
#include "core/result.h"
#include "device/devices_file.h"
#include "nodes/file_server.h"
#include "nodes/room.h"
#include "nodes/room_host.h"
#include "session/recording.h"

namespace limn::apps {

/// How a command enters a room.
struct RoomOptions {
  std::string room;                          ///< the name or folder of a room; empty: none
  std::string name = {};                     ///< this machine's name in it; empty: the machine's own
  std::vector<std::string> peers = {};       ///< addresses of machines, for networks without multicast
  std::vector<std::string> interfaces = {};  ///< network interfaces to use; empty: all
};

/// Enters a room. A host is refused where another one is. Errors: no such room, its keys, the network.
Result<std::unique_ptr<nodes::Room>> enter_room(const RoomOptions& options, bool is_host);
/// Enters a room as a host without a session, which uses the nodes' displays and cameras by orders.
Result<std::unique_ptr<nodes::Room>> enter_room_for_orders(const RoomOptions& options);

/// The rig's devices in a room without a devices file: those that its nodes offer (nodes/room_devices.h).
/// Enters the room for some seconds.
Result<device::Devices> devices_in_room(const RoomOptions& options, const Rig& rig);

/// This machine as the host of a session in a room.
class HostedRoom {
 public:
  /// Enters the room and shares the session's files with its nodes. `setup` becomes what the nodes will read,
  /// to the last bit. Errors: enter_room()'s; no port for the files' server; files that cannot be read.
  /// `out`: folder for frames.csv, which lists the images that nodes have to show; empty: none.
  static Result<std::unique_ptr<HostedRoom>> open(const RoomOptions& options,
                                                  const device::Devices& devices,
                                                  const std::filesystem::path& out,
                                                  session::SessionSetup* setup);
  ~HostedRoom();

  nodes::Room* room() { return room_.get(); }
  session::SessionClient* client() { return host_.get(); }

 private:
  HostedRoom() = default;

  std::optional<calib::TemporaryFolder> work_;
  std::unique_ptr<nodes::FileServer> files_;
  std::unique_ptr<nodes::Room> room_;
  std::unique_ptr<nodes::RoomHost> host_;
};

/// `limn room create NAME`: makes a room's keys in `folder`; empty: the user's own folder of rooms.
Status create_room(const std::string& name, std::filesystem::path folder);

struct NodeCommand {
  RoomOptions room;
  std::filesystem::path out;  ///< folder for shown.csv; empty: none
};

/// `limn node --join ROOM`: this machine's monitors and cameras serve the room until a signal comes.
Status run_node(const NodeCommand& command);

}  // namespace limn::apps
