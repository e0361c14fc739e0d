#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "nodes/room_keys.h"
#include "nodes/room_link.h"

namespace limn::test {

/// A new room in a temporary folder, whose name no other test has at the same time. Rooms of tests use the
/// loopback.
class ARoom {
 public:
  ARoom();
  ~ARoom();
  ARoom(const ARoom&) = delete;
  ARoom& operator=(const ARoom&) = delete;

  const std::filesystem::path& folder() const { return folder_; }
  const std::string& name() const { return name_; }
  /// A link of this process, which has offered itself.
  std::unique_ptr<nodes::RoomLink> open_link(const std::string& node,
                                             nodes::RoomRole role,
                                             const std::vector<std::string>& peers = {}) const;

 private:
  std::filesystem::path temporary_, folder_;
  std::string name_;
};

/// The program room_peer on its own process.
class Peer {
 public:
  /// Starts it and waits until it has entered the room of `folder`. `role` is "host" or "node".
  Peer(const std::filesystem::path& folder,
       const std::string& node,
       const std::string& role,
       const std::string& what,
       std::uint64_t number = 0,
       const std::string& peer = "");
  ~Peer();
  Peer(const Peer&) = delete;
  Peer& operator=(const Peer&) = delete;

  void send_signal(int signal) const;
  /// Ends its input, so that it leaves, and waits until it has ended. Its exit code; -1 when it was killed.
  int leave();

 private:
  int process_ = -1, input_ = -1;
};

/// Takes messages until one is accepted, which is returned; nullopt: none was within the time.
std::optional<nodes::Received> wait_for(nodes::RoomLink& link,
                                        const std::function<bool(const nodes::Received&)>& accept,
                                        std::chrono::milliseconds longest = std::chrono::seconds(10));
/// As wait_for(), for a message of one kind from a machine.
template <class Kind>
std::optional<nodes::Received> wait_for(nodes::RoomLink& link,
                                        const std::string& node,
                                        std::chrono::milliseconds longest = std::chrono::seconds(10)) {
  return wait_for(
      link,
      [&](const nodes::Received& got) {
        return std::holds_alternative<Kind>(got.message) && got.from.node == node;
      },
      longest);
}

}  // namespace limn::test
