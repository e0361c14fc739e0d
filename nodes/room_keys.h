#pragma once

#include <filesystem>
#include <string>

#include "core/result.h"

namespace limn::nodes {

/// What a program may do in a room. Only a host may send Setup, Moment and Order.
enum class RoomRole { host, node };

/// What a machine needs to enter a room, each as the text of a PEM or S/MIME document (DDS Security 1.1, 9.3
/// and 9.4).
struct RoomKeys {
  std::string name;         ///< the room's
  std::string authority;    ///< the certificate that signed all others
  std::string certificate;  ///< the role's
  std::string private_key;
  std::string governance;   ///< nobody without keys, everything encrypted
  std::string permissions;  ///< which role may send what
};

/// How long the keys of a room are valid.
inline constexpr int k_room_years = 10;

/// Makes the keys of a new room: a folder that only its owner can read, which people copy to the other
/// machines. The authority's private key is not kept, so nobody can add keys later. The folder appears with
/// all its files or not at all. Error: the name is not 1 to 40 letters (a to z), digits, "-" and "_";
/// something exists there; the folder cannot be written.
Status create_room(const std::filesystem::path& folder, const std::string& name);

/// Reads and checks the keys of a role. A machine that shall never be the host needs no host.pem. Error: a
/// file is missing or damaged, others can read a private key, the keys have expired or this machine's clock
/// is wrong.
Result<RoomKeys> load_room(const std::filesystem::path& folder, RoomRole role);

/// The folder of a room that people name: a path (it exists or contains a slash), or a name below
/// $XDG_CONFIG_HOME/limn/rooms (~/.config/limn/rooms). Error: there is none.
Result<std::filesystem::path> find_room(const std::string& text);
/// The folder that find_room() finds by this name.
Result<std::filesystem::path> room_folder(const std::string& name);

/// The DDS domain of a room, 1 to 99, from its name. Rooms with the same domain ignore each other.
int room_domain(const std::string& name);

}  // namespace limn::nodes
