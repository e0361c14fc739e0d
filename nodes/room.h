#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "core/result.h"
#include "nodes/messages.h"
#include "nodes/room_link.h"
#include "nodes/timing/clock_estimator.h"

namespace limn::nodes {

/// A machine of the room that can be heard.
struct Machine {
  Sender sender;
  Offer offer;
  std::optional<Health> health;  ///< a node's last
};

/// The room as this machine knows it. A thread of its own receives all messages, answers what the other
/// machines ask about the clock, and, on a node, compares the clock with the host's. Safe from several
/// threads.
class Room {
 public:
  explicit Room(std::unique_ptr<RoomLink> link);
  ~Room();
  Room(const Room&) = delete;
  Room& operator=(const Room&) = delete;

  const Sender& self() const { return link_->self(); }
  /// Says what this machine is and has. Error: the engine's message.
  Status offer(const Offer& offer);
  Status send(const Message& message);
  /// Setup::revision of the setup that this machine has sent last.
  std::uint64_t sent_setup() const { return sent_setup_; }

  /// The link's warnings of the last 10 seconds (RoomLink::problems).
  std::vector<std::string> problems() const { return link_->problems(); }

  /// The other machines that can be heard, by name.
  std::vector<Machine> machines() const;
  std::optional<Machine> find(const std::string& node) const;
  std::optional<Machine> host() const;

  /// For nodes: the host's clock; nullopt before the first answers, and without a host.
  std::optional<ClockEstimate> host_clock() const;
  /// For nodes: waits until a moment, a setup, a screen's image or an order is there, or the host comes or
  /// goes.
  void wait(std::chrono::nanoseconds limit);
  std::optional<Moment> take_moment();
  /// Waits until then. False: a black frame came before, which take_moment() gives.
  bool wait_without_black(Stamp until);
  std::optional<Setup> take_setup();
  /// The newest image of each screen that has one that was not taken yet.
  std::vector<ScreenImage> take_screen_images();
  /// An order, and the host that sent it.
  struct ReceivedOrder {
    Order order;
    std::string host;
  };
  std::vector<ReceivedOrder> take_orders();

  /// For the host: sends an order and waits for its answer. Error: the node's message, no answer in time, or
  /// no such machine.
  Result<Answer> ask(Order order, double limit_s);
  /// For the host: what a node's camera shows, the newest that was not taken; waits up to `limit` for it.
  std::optional<Detections> take_detections(const std::string& node,
                                            const std::string& camera,
                                            std::chrono::nanoseconds limit);

 private:
  void run();
  void compare_clocks();
  void note(Received received);
  void note_offer(const Sender& from, const Offer& offer);
  void note_departure(const Sender& from);

  std::unique_ptr<RoomLink> link_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::map<std::string, Machine> machines_;
  bool is_host_ = false;
  std::uint64_t clock_run_ = 0;  // the run of the host whose clock is estimated
  ClockEstimator clock_;
  std::uint64_t clock_requests_ = 0, orders_ = 0;
  Stamp asked_clock_at_;
  std::optional<Moment> moment_;
  std::map<std::string, ScreenImage> screen_images_;  // by screen
  std::optional<std::pair<Setup, Sender>> setup_;
  std::vector<ReceivedOrder> waiting_orders_;
  std::map<std::uint64_t, std::optional<Answer>> answers_;                // by order that somebody waits for
  std::map<std::pair<std::string, std::string>, Detections> detections_;  // by node and camera
  std::atomic<std::uint64_t> sent_setup_ = 0;
  bool has_arrived_ = false;
  std::atomic<bool> is_stopping_ = false;
  std::thread thread_;
};

}  // namespace limn::nodes
