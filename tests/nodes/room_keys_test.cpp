#include "nodes/room_keys.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cstdlib>
#include <fstream>
#include <set>

#include "core/file.h"
#include "nodes/room_certificates.h"
#include "tests/nodes/a_room.h"

namespace limn::nodes {
namespace {

namespace fs = std::filesystem;
using test::ARoom;

unsigned mode_of(const fs::path& path) {
  struct stat found {};
  return ::stat(path.c_str(), &found) == 0 ? found.st_mode & 07777u : 0;
}

bool has(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

TEST(RoomKeys, ANewRoomCanBeLoadedByBothRoles) {
  const ARoom room;
  const auto host = load_room(room.folder(), RoomRole::host), node = load_room(room.folder(), RoomRole::node);
  ASSERT_TRUE(host) << host.message();
  ASSERT_TRUE(node) << node.message();
  EXPECT_EQ(host->name, room.name());
  EXPECT_EQ(node->name, room.name());
  EXPECT_NE(host->private_key, node->private_key);
  EXPECT_TRUE(has(node->private_key, "PRIVATE KEY"));
  EXPECT_FALSE(has(node->certificate, "PRIVATE KEY"));
  EXPECT_TRUE(has(node->governance, "<allow_unauthenticated_participants>false"));
}

TEST(RoomKeys, OnlyTheOwnerCanReadThem) {
  const ARoom room;
  EXPECT_EQ(mode_of(room.folder()), 0700u);
  int files = 0;
  for (const auto& entry : fs::directory_iterator(room.folder())) {
    ++files;
    EXPECT_EQ(mode_of(entry.path()), 0600u) << entry.path();
  }
  EXPECT_EQ(files, 5);
  ::chmod((room.folder() / "node.pem").c_str(), 0640);
  const auto loaded = load_room(room.folder(), RoomRole::node);
  ASSERT_FALSE(loaded);
  EXPECT_TRUE(has(loaded.message(), "chmod 600")) << loaded.message();
  EXPECT_TRUE(load_room(room.folder(), RoomRole::host));  // whose key nobody else can read
}

TEST(RoomKeys, TheAuthoritysKeyIsNotKept) {
  const ARoom room;
  std::set<std::string> keys;
  for (const auto& entry : fs::directory_iterator(room.folder())) {
    const std::string text = read_file(entry.path()).value();
    if (has(text, "PRIVATE KEY")) keys.insert(entry.path().filename().string());
  }
  EXPECT_EQ(keys, (std::set<std::string>{"host.pem", "node.pem"}));
}

TEST(RoomKeys, NothingIsOverwritten) {
  const ARoom room;
  const std::string before = read_file(room.folder() / "host.pem").value();
  const Status again = create_room(room.folder(), room.name());
  ASSERT_FALSE(again);
  EXPECT_TRUE(has(again.message(), room.folder().string() + ": expected a new folder")) << again.message();
  EXPECT_EQ(read_file(room.folder() / "host.pem").value(), before);
  const fs::path file = room.folder().parent_path() / "file";
  ASSERT_TRUE(write_file(file, "mine"));
  EXPECT_FALSE(create_room(file, "room"));
  const fs::path empty = room.folder().parent_path() / "empty";  // which a rename would replace
  fs::create_directory(empty);
  EXPECT_FALSE(create_room(empty, "room"));
  EXPECT_TRUE(fs::remove(empty));
  EXPECT_EQ(read_file(file).value(), "mine");
  for (const auto& entry : fs::directory_iterator(room.folder().parent_path()))
    EXPECT_TRUE(entry.path() == file || entry.path() == room.folder()) << entry.path() << " was left behind";
}

TEST(RoomKeys, NamesAreLettersAndDigits) {
  const ARoom room;
  const fs::path folder = room.folder().parent_path() / "new";
  for (const std::string& name : {std::string(), std::string("a b"), std::string("../a"),
                                  std::string(41, 'a'), std::string("a<b"), std::string("\xc3\xa4")}) {
    EXPECT_FALSE(create_room(folder, name)) << name;
    EXPECT_FALSE(fs::exists(folder));
  }
  EXPECT_TRUE(create_room(folder, std::string(40, 'Z')));
}

TEST(RoomKeys, AMachineForNodesNeedsNoKeyOfTheHost) {
  const ARoom room;
  fs::remove(room.folder() / "host.pem");
  EXPECT_TRUE(load_room(room.folder(), RoomRole::node));
  const auto host = load_room(room.folder(), RoomRole::host);
  ASSERT_FALSE(host);
  EXPECT_TRUE(has(host.message(), "those of nodes only")) << host.message();
}

TEST(RoomKeys, MissingAndDamagedFilesAreNamed) {
  for (const char* name : {"authority.pem", "node.pem", "governance.p7s", "permissions.p7s"}) {
    const ARoom room;
    const fs::path path = room.folder() / name;
    std::string text = read_file(path).value();
    ASSERT_TRUE(write_file(path, text.substr(0, text.size() / 2)));
    fs::permissions(path, fs::perms::owner_read | fs::perms::owner_write);
    const auto damaged = load_room(room.folder(), RoomRole::node);
    ASSERT_FALSE(damaged) << name;
    EXPECT_TRUE(has(damaged.message(), name[0] == 'a' ? "authority.pem" : name)) << damaged.message();
    fs::remove(path);
    const auto missing = load_room(room.folder(), RoomRole::node);
    ASSERT_FALSE(missing) << name;
    EXPECT_TRUE(has(missing.message(), name)) << missing.message();
  }
}

TEST(RoomKeys, AChangedPermissionIsRefused) {
  const ARoom room;
  const fs::path path = room.folder() / "permissions.p7s";
  std::string text = read_file(path).value();
  const std::string topic = "limn_v1_health";
  const std::size_t at = text.find(topic);
  ASSERT_NE(at, std::string::npos);
  text.replace(at, topic.size(), "limn_v1_moment");
  ASSERT_TRUE(write_file(path, text));
  const auto loaded = load_room(room.folder(), RoomRole::node);
  ASSERT_FALSE(loaded);
  EXPECT_TRUE(has(loaded.message(), "permissions.p7s")) << loaded.message();
}

TEST(RoomKeys, FilesOfAnotherRoomDoNotFit) {
  const ARoom room, other;
  fs::copy_file(other.folder() / "node.pem", room.folder() / "node.pem",
                fs::copy_options::overwrite_existing);
  const auto loaded = load_room(room.folder(), RoomRole::node);
  ASSERT_FALSE(loaded);
  EXPECT_TRUE(has(loaded.message(), "node.pem")) << loaded.message();
}

TEST(RoomKeys, ValidityEndsAfterTenYears) {
  constexpr std::time_t k_day = 86400;
  const std::time_t now = std::time(nullptr);
  const RoomFiles files = make_room_files("room", now);
  const auto at = [&](std::time_t moment) {
    const auto read = read_identity(files.node, files.authority, "node.pem", moment);
    return read ? std::string("valid") : read.message();
  };
  EXPECT_EQ(at(now), "valid");
  EXPECT_EQ(at(now + 3640 * k_day), "valid");
  EXPECT_TRUE(has(at(now + 3660 * k_day), "have expired")) << at(now + 3660 * k_day);
  EXPECT_TRUE(has(at(0), "clock is wrong")) << at(0);
}

TEST(RoomKeys, ARoomIsFoundByPathAndByName) {
  const ARoom room;
  const fs::path config = room.folder().parent_path() / "config";
  ::setenv("XDG_CONFIG_HOME", config.c_str(), 1);
  EXPECT_EQ(find_room(room.folder().string()).value(), room.folder());
  const auto none = find_room("studio");
  ASSERT_FALSE(none);
  EXPECT_TRUE(has(none.message(), "limn room create studio")) << none.message();
  const fs::path folder = room_folder("studio").value();
  EXPECT_EQ(folder, config / "limn" / "rooms" / "studio");
  ASSERT_TRUE(create_room(folder, "studio"));
  EXPECT_EQ(find_room("studio").value(), folder);
  EXPECT_FALSE(find_room("no/such/folder"));
  EXPECT_FALSE(find_room("../studio"));
}

TEST(RoomKeys, DomainsAreSpreadAndNeverThatOfRos2) {
  std::set<int> domains;
  for (int i = 0; i < 1000; ++i) domains.insert(room_domain("room-" + std::to_string(i)));
  EXPECT_EQ(*domains.begin(), 1);
  EXPECT_EQ(*domains.rbegin(), 99);
  EXPECT_EQ(domains.size(), 99u);
}

}  // namespace
}  // namespace limn::nodes
