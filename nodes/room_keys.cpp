#include "nodes/room_keys.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <ctime>

#include "core/file.h"
#include "core/user_folder.h"
#include "nodes/room_certificates.h"

namespace limn::nodes {
namespace {

namespace fs = std::filesystem;

constexpr const char *k_authority = "authority.pem", *k_host = "host.pem", *k_node = "node.pem",
                     *k_governance = "governance.p7s", *k_permissions = "permissions.p7s";
constexpr std::size_t k_longest_room = 40;

Status check_room_name(const std::string& name) {
  const bool is_valid = !name.empty() && name.size() <= k_longest_room &&
                        std::all_of(name.begin(), name.end(), [](unsigned char c) {
                          return c < 0x80 && (std::isalnum(c) || c == '-' || c == '_');
                        });
  if (is_valid) return {};
  return error(
      "room '{}': expected a name with 1 to {} letters from a to z, digits, '-' and '_'. Choose such a name.",
      name, k_longest_room);
}

Error room_write_error(const fs::path& path) {
  return error("{}: expected to write here, found: {}. Choose a folder that can be written.", path.string(),
               std::strerror(errno));
}

Status write_private_file(const fs::path& path, const std::string& content) {
  const int handle = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, S_IRUSR | S_IWUSR);
  if (handle < 0) return room_write_error(path);
  std::size_t at = 0;
  while (at < content.size()) {
    const ssize_t written = ::write(handle, content.data() + at, content.size() - at);
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) break;
    at += static_cast<std::size_t>(written);
  }
  const bool is_done = at == content.size() && ::fsync(handle) == 0;
  if (::close(handle) != 0 || !is_done) return room_write_error(path);
  return {};
}

Status write_room_files(const RoomFiles& files, const fs::path& folder) {
  LIMN_TRY_STATUS(write_private_file(folder / k_authority, files.authority));
  LIMN_TRY_STATUS(write_private_file(folder / k_host, files.host));
  LIMN_TRY_STATUS(write_private_file(folder / k_node, files.node));
  LIMN_TRY_STATUS(write_private_file(folder / k_governance, files.governance));
  return write_private_file(folder / k_permissions, files.permissions);
}

Error room_exists(const fs::path& folder) {
  return error("{}: expected a new folder, found one that exists. Choose another name, or remove it first.",
               folder.string());
}

// Renames a folder unless something has that name.
Status move_room(const fs::path& from, const fs::path& to) {
  if (::renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), RENAME_NOREPLACE) == 0) return {};
  if (errno == EEXIST) return room_exists(to);
  if (errno != EINVAL) return room_write_error(to);
  std::error_code ignored;  // The file system lacks that function.
  if (fs::exists(fs::symlink_status(to, ignored))) return room_exists(to);
  return ::rename(from.c_str(), to.c_str()) == 0 ? Status() : Status(room_write_error(to));
}

Status check_is_private(const fs::path& path) {
  struct stat found {};
  if (::stat(path.c_str(), &found) != 0) return {};
  if ((found.st_mode & (S_IRWXG | S_IRWXO)) == 0) return {};
  return error(
      "{}: expected a key that its owner alone can read (mode 600), found mode {:o}. Run: chmod 600 '{}'. If "
      "others "
      "may have read it, make a new room.",
      path.string(), found.st_mode & 07777u, path.string());
}

Result<std::string> read_room_file(const fs::path& path) {
  std::error_code ignored;
  if (!fs::exists(path, ignored))
    return error(
        "{}: expected a file of a room's keys, found none. Copy the room's folder from a machine on which it "
        "works, or "
        "make a room with limn room create.",
        path.string());
  return read_file(path);
}

}  // namespace

Status create_room(const fs::path& folder, const std::string& name) {
  LIMN_TRY_STATUS(check_room_name(name));
  std::error_code ignored;
  if (fs::exists(fs::symlink_status(folder, ignored))) return room_exists(folder);
  const fs::path parent = fs::absolute(folder, ignored).parent_path();
  LIMN_TRY_STATUS(make_folder(parent));
  std::string temporary = (parent / ".room.XXXXXX").string();
  if (::mkdtemp(temporary.data()) == nullptr) return room_write_error(parent);  // with mode 700
  Status done = write_room_files(make_room_files(name, std::time(nullptr)), temporary);
  if (done) done = move_room(temporary, folder);
  if (!done) fs::remove_all(temporary, ignored);
  return done;
}

Result<RoomKeys> load_room(const fs::path& folder, RoomRole role) {
  const fs::path identity_path = folder / (role == RoomRole::host ? k_host : k_node);
  std::error_code ignored;
  if (role == RoomRole::host && !fs::exists(identity_path, ignored) && fs::exists(folder / k_node, ignored))
    return error(
        "{}: expected the keys of a host, found those of nodes only. Run the host on a machine that has "
        "host.pem, or "
        "copy it from there.",
        folder.string());
  RoomKeys keys;
  LIMN_TRY(keys.authority, read_room_file(folder / k_authority));
  LIMN_TRY(keys.governance, read_room_file(folder / k_governance));
  LIMN_TRY(keys.permissions, read_room_file(folder / k_permissions));
  LIMN_TRY(const std::string pem, read_room_file(identity_path));
  LIMN_TRY_STATUS(check_is_private(identity_path));
  LIMN_TRY(RoomIdentity identity,
           read_identity(pem, keys.authority, identity_path.string(), std::time(nullptr)));
  LIMN_TRY_STATUS(check_document(keys.governance, keys.authority, (folder / k_governance).string()));
  LIMN_TRY_STATUS(check_document(keys.permissions, keys.authority, (folder / k_permissions).string()));
  LIMN_TRY_STATUS(check_room_name(identity.name));
  if (keys.permissions.find("limn_v1_detections") == std::string::npos)
    return error(
        "{}: expected the permissions that this version needs, found ones of an earlier version. Run limn "
        "room "
        "create again, and copy the new folder to all machines.",
        (folder / k_permissions).string());
  keys.name = std::move(identity.name);
  keys.certificate = std::move(identity.certificate);
  keys.private_key = std::move(identity.private_key);
  return keys;
}

Result<fs::path> room_folder(const std::string& name) {
  LIMN_TRY_STATUS(check_room_name(name));
  LIMN_TRY(const fs::path folder, user_folder());
  return folder / "rooms" / name;
}

Result<fs::path> find_room(const std::string& text) {
  std::error_code ignored;
  if (text.find('/') != std::string::npos || fs::is_directory(text, ignored)) {
    if (fs::is_directory(text, ignored)) return fs::path(text);
    return error(
        "{}: expected a room's folder, found none. Check the path, or make one with limn room create.", text);
  }
  LIMN_TRY(const fs::path folder, room_folder(text));
  if (fs::is_directory(folder, ignored)) return folder;
  return error(
      "{}: expected the keys of room '{}' here, found none. Copy the room's folder from a machine on which "
      "it works, or "
      "make one with limn room create {}.",
      folder.string(), text, text);
}

int room_domain(const std::string& name) {
  constexpr std::uint32_t k_basis = 2166136261, k_prime = 16777619;  // FNV-1a
  constexpr std::uint32_t k_domains = 99;                            // 0 is where ROS 2 is
  std::uint32_t hash = k_basis;
  for (const char c : name) hash = (hash ^ static_cast<unsigned char>(c)) * k_prime;
  return 1 + static_cast<int>(hash % k_domains);
}

}  // namespace limn::nodes
