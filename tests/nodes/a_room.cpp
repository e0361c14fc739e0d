#include "tests/nodes/a_room.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cstdlib>

#include "core/result.h"
#include "nodes/room_keys.h"

namespace limn::test {

namespace fs = std::filesystem;

ARoom::ARoom() {
  static std::atomic<int> rooms = 0;
  std::string text = (fs::temp_directory_path() / "limn-room.XXXXXX").string();
  LIMN_CHECK(::mkdtemp(text.data()) != nullptr);
  temporary_ = text;
  name_ = fmt::format("test-{}-{}", ::getpid(), rooms++);
  folder_ = temporary_ / name_;
  const Status made = nodes::create_room(folder_, name_);
  LIMN_CHECK(made.ok());
}

ARoom::~ARoom() {
  std::error_code ignored;
  fs::remove_all(temporary_, ignored);
}

std::unique_ptr<nodes::RoomLink> ARoom::open_link(const std::string& node,
                                                  nodes::RoomRole role,
                                                  const std::vector<std::string>& peers) const {
  nodes::RoomLinkOptions options;
  options.room = folder_;
  options.node = node;
  options.is_host = role == nodes::RoomRole::host;
  options.interfaces = {"lo"};
  options.peers = peers;
  auto link = nodes::open_room_link(options).value();
  nodes::Offer offer;
  offer.is_host = options.is_host;
  LIMN_CHECK(link->send(offer).ok());
  return link;
}

Peer::Peer(const fs::path& folder,
           const std::string& node,
           const std::string& role,
           const std::string& what,
           std::uint64_t number,
           const std::string& peer) {
  std::array<int, 2> input{}, output{};
  LIMN_CHECK(::pipe2(input.data(), O_CLOEXEC) == 0 && ::pipe2(output.data(), O_CLOEXEC) == 0);
  const std::string count = std::to_string(number);
  process_ = ::fork();
  if (process_ == 0) {
    ::dup2(input[0], STDIN_FILENO);
    ::dup2(output[1], STDOUT_FILENO);
    ::execl(LIMN_ROOM_PEER, "room_peer", folder.c_str(), node.c_str(), role.c_str(), what.c_str(),
            count.c_str(), peer.empty() ? nullptr : peer.c_str(), nullptr);
    ::_exit(127);
  }
  ::close(input[0]);
  ::close(output[1]);
  input_ = input[1];
  char first = 0;
  const bool is_ready = process_ > 0 && ::read(output[0], &first, 1) == 1;
  ::close(output[0]);
  LIMN_CHECK(is_ready);
}

Peer::~Peer() {
  send_signal(SIGKILL);
  leave();
}

void Peer::send_signal(int signal) const {
  if (process_ > 0) ::kill(process_, signal);
}

int Peer::leave() {
  if (input_ >= 0) ::close(std::exchange(input_, -1));
  if (process_ <= 0) return -1;
  int status = 0;
  ::waitpid(std::exchange(process_, -1), &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

std::optional<nodes::Received> wait_for(nodes::RoomLink& link,
                                        const std::function<bool(const nodes::Received&)>& accept,
                                        std::chrono::milliseconds longest) {
  for (const Stamp end = now() + longest; now() < end;)
    for (nodes::Received& received : link.take_messages(std::chrono::milliseconds(20)))
      if (accept(received)) return std::move(received);
  return std::nullopt;
}

}  // namespace limn::test
