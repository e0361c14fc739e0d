#include "nodes/room_link.h"

#include <algorithm>
#include <condition_variable>
#include <map>
#include <mutex>
#include <random>
#include <thread>

#include "core/log.h"
#include "nodes/engine.h"
#include "nodes/from_wire.h"
#include "nodes/message_check.h"
#include "nodes/to_wire.h"

namespace limn::nodes {
namespace {

// The offer is repeated, because a machine that was silent for a while counts as there again with its next
// offer.
constexpr auto k_offer_interval = std::chrono::seconds(1);
constexpr std::uint64_t k_most_warnings = 20;  // the engine's, for each link

// The machine that a message is for; null: it is for all.
const std::string* receiver_of(const Message& message) {
  return std::visit(
      [](const auto& one) -> const std::string* {
        if constexpr (requires { one.to; }) return &one.to;
        return nullptr;
      },
      message);
}

// What a best-effort message replaces: the one of the same kind, sender and camera.
bool is_replaced(const Received& old, const Received& fresh) {
  if (old.message.index() != fresh.message.index() || old.from != fresh.from) return false;
  const auto *one = std::get_if<Sighting>(&old.message), *other = std::get_if<Sighting>(&fresh.message);
  return !one || one->camera == other->camera;
}

class EngineLink final : public RoomLink, private EngineEvents {
 public:
  explicit EngineLink(Sender self, bool is_host) : self_(std::move(self)), is_host_(is_host) {}
  ~EngineLink() override;
  Status open(const EngineOptions& options);

  const Sender& self() const override { return self_; }
  Status send(const Message& message) override;
  std::vector<Received> take_messages(std::chrono::nanoseconds wait) override;
  LinkCounts counts() const override;

 private:
  void receive_sample(Topic topic, const void* sample, Stamp arrived_at) override;
  void notice_departure(const Sender& sender) override;
  void notice_waiting() override;
  void notice_warning(const std::string& text) override;

  void keep(Received received);
  void keep_offer(Received received);
  Status send_to_all_runs(const std::string& machine, const WireSample& sample);
  void repeat_offer(const std::stop_token& stop);

  const Sender self_;
  const bool is_host_;
  mutable std::mutex mutex_;
  std::condition_variable_any changed_;
  std::vector<Received> newest_, queued_;   // best effort; reliable
  std::map<Sender, Offer> present_;         // who is there, and its last offer
  std::vector<Sender> departed_, arrived_;  // that the engine has not been told
  bool is_waiting_ = false;                 // in the engine
  Message own_offer_ = Departure{};         // none yet
  LinkCounts counts_;
  std::mutex taking_;
  std::unique_ptr<Engine> engine_;
  std::jthread repeating_;
};

EngineLink::~EngineLink() {
  repeating_ = {};
  engine_.reset();  // before the members that its threads use
}

Status EngineLink::open(const EngineOptions& options) {
  LIMN_TRY(engine_, make_engine(options, this));
  repeating_ = std::jthread([this](const std::stop_token& stop) { repeat_offer(stop); });
  return {};
}

Status EngineLink::send(const Message& message) {
  LIMN_TRY_STATUS(check_message(message));
  const WireSample sample = to_wire(message, self_);
  if (is_directed(sample.topic)) return send_to_all_runs(*receiver_of(message), sample);
  if (sample.topic == Topic::offer) {
    const std::lock_guard lock(mutex_);
    own_offer_ = message;
  }
  return engine_->write(sample.topic, sample.sample.get());
}

Status EngineLink::send_to_all_runs(const std::string& machine, const WireSample& sample) {
  std::vector<Sender> runs;
  {
    const std::lock_guard lock(mutex_);
    for (const auto& entry : present_)
      if (entry.first.node == machine) runs.push_back(entry.first);
  }
  if (runs.empty())
    return error("machine '{}': expected it in the room, found that it is not there. Start limn node on it.",
                 machine);
  Status first;
  for (const Sender& run : runs) {
    const Status sent = engine_->write_to(run, sample.topic, sample.sample.get());
    if (!sent && first) first = sent;
  }
  return first;
}

std::vector<Received> EngineLink::take_messages(std::chrono::nanoseconds wait) {
  const std::lock_guard one_at_a_time(taking_);
  {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, wait, [this] { return is_waiting_ || !newest_.empty() || !queued_.empty(); });
    is_waiting_ = false;
  }
  engine_->take_waiting();
  const std::lock_guard lock(mutex_);
  std::vector<Received> out = std::exchange(queued_, {});
  std::move(newest_.begin(), newest_.end(), std::back_inserter(out));
  newest_.clear();
  return out;
}

LinkCounts EngineLink::counts() const {
  const std::lock_guard lock(mutex_);
  return counts_;
}

void EngineLink::receive_sample(Topic topic, const void* sample, Stamp arrived_at) {
  auto received = from_wire(topic, sample, arrived_at);
  if (!received) {
    const std::lock_guard lock(mutex_);
    if (counts_.refused++ == 0) log_warning("room: a message is left out: {}", received.message());
    return;
  }
  const std::string* receiver = receiver_of(received->message);
  if (receiver && *receiver != self_.node) return;
  const std::lock_guard lock(mutex_);
  ++counts_.received;
  if (topic == Topic::offer)
    keep_offer(std::move(*received));
  else
    keep(std::move(*received));
}

void EngineLink::keep(Received received) {
  if (is_reliable(static_cast<Topic>(received.message.index()))) {
    queued_.push_back(std::move(received));
    return;
  }
  std::erase_if(newest_, [&](const Received& old) { return is_replaced(old, received); });
  newest_.push_back(std::move(received));
  changed_.notify_all();
}

void EngineLink::keep_offer(Received received) {
  const Offer& offer = std::get<Offer>(received.message);
  const auto known = present_.find(received.from);
  if (known != present_.end() && known->second == offer) return;  // a repeated one
  if (known == present_.end() && is_host_ != offer.is_host) arrived_.push_back(received.from);
  present_[received.from] = offer;
  queued_.push_back(std::move(received));
  changed_.notify_all();
}

void EngineLink::notice_departure(const Sender& sender) {
  const std::lock_guard lock(mutex_);
  if (present_.erase(sender) == 0) return;
  departed_.push_back(sender);
  queued_.push_back({Departure{}, sender, now()});
  changed_.notify_all();
}

void EngineLink::notice_waiting() {
  const std::lock_guard lock(mutex_);
  is_waiting_ = true;
  changed_.notify_all();
}

void EngineLink::notice_warning(const std::string& text) {
  {
    const std::lock_guard lock(mutex_);
    if (++counts_.warnings > k_most_warnings) return;
  }
  log_warning("room: {}", text);
}

// Runs on a thread of its own. What takes the engine long is done here, too.
void EngineLink::repeat_offer(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  for (Stamp next = now() + k_offer_interval; !stop.stop_requested();) {
    changed_.wait_until(lock, stop, next, [this] { return !departed_.empty() || !arrived_.empty(); });
    const std::vector<Sender> departed = std::exchange(departed_, {}), arrived = std::exchange(arrived_, {});
    const Message offer = now() >= next ? own_offer_ : Message(Departure{});
    lock.unlock();
    for (const Sender& sender : departed) engine_->forget(sender);
    for (const Sender& sender : arrived) engine_->connect(sender);
    if (std::holds_alternative<Offer>(offer)) {
      const WireSample sample = to_wire(offer, self_);
      if (const Status sent = engine_->write(sample.topic, sample.sample.get()); !sent)
        notice_warning(sent.message());
    }
    if (now() >= next) next = now() + k_offer_interval;
    lock.lock();
  }
}

std::uint64_t random_run() {
  std::random_device random;
  return (static_cast<std::uint64_t>(random()) << 32) | random();
}

}  // namespace

Result<std::unique_ptr<RoomLink>> open_room_link(const RoomLinkOptions& options) {
  if (!is_node_name(options.node))
    return error(
        "machine's name '{}': expected 1 to 64 letters from a to z, digits, '-', '_' and '.'. Choose another "
        "with "
        "--name.",
        options.node);
  EngineOptions engine;
  LIMN_TRY(engine.keys, load_room(options.room, options.is_host ? RoomRole::host : RoomRole::node));
  engine.domain = room_domain(engine.keys.name);
  engine.self = {options.node, random_run()};
  engine.is_host = options.is_host;
  engine.peers = options.peers;
  engine.interfaces = options.interfaces;
  engine.liveliness_s = options.liveliness_s;
  auto link = std::make_unique<EngineLink>(engine.self, options.is_host);
  LIMN_TRY_STATUS(link->open(engine));
  return std::unique_ptr<RoomLink>(std::move(link));
}

}  // namespace limn::nodes
