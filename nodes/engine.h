#pragma once

#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "core/frame.h"
#include "core/result.h"
#include "nodes/messages.h"
#include "nodes/room_keys.h"

namespace limn::nodes {

/// The topics of a room: one for each message that is sent, in the order of Message.
enum class Topic {
  offer,
  setup,
  moment,
  screen_image,
  clock_request,
  clock_answer,
  order,
  answer,
  health,
  detections
};
inline constexpr std::size_t k_topics = std::variant_size_v<Message> - 1;  // without Departure

/// Whether each receiver gets the topic's samples through a writer of its own, so that a slow receiver delays
/// nobody else.
constexpr bool is_directed(Topic topic) {
  return topic == Topic::order || topic == Topic::answer || topic == Topic::screen_image;
}
/// Whether a sample that is lost is sent again.
constexpr bool is_reliable(Topic topic) {
  return topic == Topic::order || topic == Topic::answer || topic == Topic::offer || topic == Topic::setup;
}
/// Whether samples wait in the engine until take_waiting() is called; others are reported when they come.
constexpr bool is_waiting(Topic topic) {
  return topic == Topic::order || topic == Topic::answer || topic == Topic::setup;
}
/// How long a program that is silent is remembered. When it is heard again within this time, what it missed
/// is sent again; later it is met anew.
inline constexpr double k_memory_s = 30;

/// What the engine reports. The functions are called from the engine's own threads or from take_waiting(),
/// and must return soon.
class EngineEvents {
 public:
  virtual ~EngineEvents() = default;
  /// A sample has come: a struct of limn_room.idl, valid during the call.
  virtual void receive_sample(Topic topic, const void* sample, Stamp arrived_at) = 0;
  virtual void notice_departure(const Sender& sender) = 0;
  /// Samples wait for take_waiting().
  virtual void notice_waiting() = 0;
  /// What the engine would print: a warning or an error.
  virtual void notice_warning(const std::string& text) = 0;
};

struct EngineOptions {
  RoomKeys keys;
  int domain = 0;  ///< room_domain() of its name
  Sender self;
  bool is_host = false;
  std::vector<std::string> peers, interfaces;
  double liveliness_s = 0.5;
};

/// What the engine knows of the other programs on the network.
struct NeighbourState {
  /// The longest time for which a program that the engine believes to be there has offered nothing. More than
  /// k_memory_s means that it has forgotten this one, which happens when only one of them was silent, and
  /// that the two do not meet again until this engine is closed and made again.
  double longest_silence_s = 0;
  /// Programs that name the same room and have not entered it within some seconds: their keys are others.
  std::size_t strangers = 0;
};

/// A data-distribution engine: the one type of which a shared library is loaded only for sessions with a
/// room.
class Engine {
 public:
  virtual ~Engine() = default;
  /// Sends a struct of limn_room.idl to all receivers of the topic. Error: the engine's.
  virtual Status write(Topic topic, const void* sample) = 0;
  /// Sends to one program, for directed topics. On reliable ones it waits up to 2 s until the program is
  /// connected, and up to 2 s until it has room; on others it does not wait.
  virtual Status write_to(const Sender& receiver, Topic topic, const void* sample) = 0;
  /// Connects the directed topics to a program early, so that write_to() need not wait.
  virtual void connect(const Sender& receiver) = 0;
  /// Forgets what a program that has gone did not take.
  virtual void forget(const Sender& receiver) = 0;
  /// Reports samples that wait.
  virtual void take_waiting() = 0;
  /// The state of the others; to be called about once a second.
  virtual NeighbourState neighbour_state() = 0;
};

/// Loads the engine's shared library. `events` must outlive the engine. Error: engine_function()'s, or the
/// engine's own.
Result<std::unique_ptr<Engine>> make_engine(const EngineOptions& options, EngineEvents* events);

/// The function that the shared library exports. `events` must outlive the engine. Null: it failed, and
/// `problem` says why.
using MakeEngine = Engine*(const EngineOptions& options, EngineEvents* events, std::string* problem);
inline constexpr const char* k_make_engine = "limn_make_room_engine";

}  // namespace limn::nodes
