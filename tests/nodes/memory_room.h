#pragma once

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "nodes/room_link.h"

/// A room in memory: links of one process that need no network and no keys.
namespace limn::test {

class MemoryLink;

/// What the links have in common. A link that joins late gets the last offers and setups.
class MemoryRoom {
 public:
  void join(MemoryLink* link);
  /// The other links get a Departure.
  void leave(MemoryLink* link);
  void send(MemoryLink* from, const nodes::Message& message);

 private:
  std::mutex mutex_;
  std::vector<MemoryLink*> links_;
  std::vector<std::pair<MemoryLink*, nodes::Message>> kept_;
};

class MemoryLink final : public nodes::RoomLink {
 public:
  MemoryLink(MemoryRoom* room, const std::string& node) : room_(room) {
    static std::uint64_t runs = 0;
    self_ = {node, ++runs};
    room_->join(this);
  }
  ~MemoryLink() override { room_->leave(this); }

  const nodes::Sender& self() const override { return self_; }
  Status send(const nodes::Message& message) override {
    room_->send(this, message);
    return {};
  }
  std::vector<nodes::Received> take_messages(std::chrono::nanoseconds wait) override {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, wait, [&] { return !waiting_.empty(); });
    return std::exchange(waiting_, {});
  }
  void receive(const nodes::Sender& from, const nodes::Message& message) {
    {
      const std::lock_guard lock(mutex_);
      waiting_.push_back({message, from, now()});
    }
    changed_.notify_all();
  }

 private:
  MemoryRoom* room_;
  nodes::Sender self_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<nodes::Received> waiting_;
};

inline bool is_kept(const nodes::Message& message) {
  return std::holds_alternative<nodes::Offer>(message) || std::holds_alternative<nodes::Setup>(message);
}

inline void MemoryRoom::join(MemoryLink* link) {
  const std::lock_guard lock(mutex_);
  for (const auto& [from, message] : kept_) link->receive(from->self(), message);
  links_.push_back(link);
}

inline void MemoryRoom::leave(MemoryLink* link) {
  const std::lock_guard lock(mutex_);
  std::erase(links_, link);
  std::erase_if(kept_, [&](const auto& kept) { return kept.first == link; });
  for (MemoryLink* other : links_) other->receive(link->self(), nodes::Departure{});
}

inline void MemoryRoom::send(MemoryLink* from, const nodes::Message& message) {
  const std::lock_guard lock(mutex_);
  if (is_kept(message)) {
    std::erase_if(kept_, [&](const auto& kept) {
      return kept.first == from && kept.second.index() == message.index();
    });
    kept_.emplace_back(from, message);
  }
  const auto receiver = std::visit(
      [](const auto& value) -> std::optional<std::string> {
        if constexpr (requires { value.to; }) return value.to;
        return std::nullopt;
      },
      message);
  for (MemoryLink* link : links_)
    if (link != from && (!receiver || *receiver == link->self().node)) link->receive(from->self(), message);
}

}  // namespace limn::test
