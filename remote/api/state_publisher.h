#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "remote/api/session_update.h"
#include "remote/api/ws_client.h"
#include "scene/comments.h"

namespace limn::remote {

/// Makes the state message of docs/remote.md from the session's update, the clients and the comments, and
/// sends it to all clients when it has changed. Belongs to the network's thread.
class StatePublisher {
 public:
  /// `clients` must outlive this object.
  explicit StatePublisher(const WsClients* clients) : clients_(clients) {}

  /// Replaces the session's update; publish() sends it.
  void set_update(SessionUpdate update);
  /// The newest update; null before the first.
  const SessionUpdate* update() const { return update_ ? &*update_ : nullptr; }

  /// Sends the state to all clients if it differs from the last one. Does nothing before the first update.
  void publish(std::span<const scene::Comment> comments);
  /// The last message that was sent; null before the first.
  const std::shared_ptr<const std::string>& message() const { return message_; }
  /// Its number; 0 before the first.
  std::uint64_t number() const { return number_; }

 private:
  const WsClients* clients_;
  std::optional<SessionUpdate> update_;
  std::string published_;  // the last state without its number
  std::shared_ptr<const std::string> message_;
  std::uint64_t number_ = 0;
  std::uint64_t edit_number_ = 0;  // the number of the first state with the last edit
  std::size_t edit_count_ = 0;     // the session's count at the last edit
};

}  // namespace limn::remote
