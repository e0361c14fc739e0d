#include "nodes/room_link.h"

#include <time.h>

#include <algorithm>
#include <condition_variable>
#include <map>
#include <mutex>
#include <optional>
#include <random>
#include <set>
#include <shared_mutex>
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
constexpr std::size_t k_most_warnings = 20;  // different texts
constexpr double k_problem_s = 10;

// The machine that a message is for; null: it is for all.
const std::string* receiver_of(const Message& message) {
  return std::visit(
      [](const auto& one) -> const std::string* {
        if constexpr (requires { one.to; }) return &one.to;
        return nullptr;
      },
      message);
}

// What a best-effort message replaces: the one of the same kind and sender, and for the same screen or
// camera.
bool is_replaced(const Received& old, const Received& fresh) {
  if (old.message.index() != fresh.message.index() || old.from != fresh.from) return false;
  if (const auto* before = std::get_if<ScreenImage>(&old.message))
    return before->screen == std::get<ScreenImage>(fresh.message).screen;
  const auto* before = std::get_if<Detections>(&old.message);
  return !before || before->found.camera == std::get<Detections>(fresh.message).found.camera;
}

// Seconds on a clock that also counts while the machine sleeps.
double seconds_with_sleep() {
  timespec at{};
  ::clock_gettime(CLOCK_BOOTTIME, &at);
  return static_cast<double>(at.tv_sec) + 1e-9 * static_cast<double>(at.tv_nsec);
}

class EngineLink final : public RoomLink, private EngineEvents {
 public:
  explicit EngineLink(EngineOptions options) : options_(std::move(options)) {}
  ~EngineLink() override;
  Status open();

  const Sender& self() const override { return options_.self; }
  Status send(const Message& message) override;
  std::vector<Received> take_messages(std::chrono::nanoseconds wait) override;
  LinkCounts counts() const override;
  std::vector<std::string> problems() const override;

 private:
  void receive_sample(Topic topic, const void* sample, Stamp arrived_at) override;
  void notice_departure(const Sender& sender) override;
  void notice_waiting() override;
  void notice_warning(const std::string& text) override;

  void keep(Received received);
  void keep_offer(Received received);
  Status write(const WireSample& sample);
  Status send_to_all_runs(const std::string& machine, const WireSample& sample);
  void attend(const std::stop_token& stop);
  void tell_engine(const std::vector<Sender>& departed, const std::vector<Sender>& arrived);
  void repeat(const std::optional<Message>& message);
  void note_sleep(double seconds);
  bool is_forgotten(double awake_s);
  void enter_again();

  const EngineOptions options_;
  mutable std::mutex mutex_;
  std::condition_variable_any changed_;
  std::vector<Received> newest_, queued_;  // best effort; reliable
  std::set<Sender> met_;  // who is there, also those who sent an order or answer before their offer came
  std::map<Sender, Offer> present_;               // who is there, and its last offer
  std::vector<Sender> departed_, arrived_;        // that the engine has not been told
  bool has_waiting_ = false;                      // in the engine
  std::optional<Message> own_offer_, own_setup_;  // what was sent last
  LinkCounts counts_;
  std::map<std::string, Stamp> problems_;  // and when each came last
  std::set<std::string> printed_;
  std::mutex taking_;
  std::shared_mutex engine_mutex_;  // locked alone by who changes the pointer
  std::unique_ptr<Engine> engine_;  // null: it could not be made again
  std::jthread attending_;
};

EngineLink::~EngineLink() {
  attending_ = {};
  engine_.reset();  // before the members that its threads use
}

Status EngineLink::open() {
  LIMN_TRY(engine_, make_engine(options_, this));
  attending_ = std::jthread([this](const std::stop_token& stop) { attend(stop); });
  return {};
}

Status EngineLink::send(const Message& message) {
  LIMN_TRY_STATUS(check_message(message));
  const WireSample sample = to_wire(message, options_.self);
  if (is_directed(sample.topic)) return send_to_all_runs(*receiver_of(message), sample);
  if (sample.topic == Topic::offer || sample.topic == Topic::setup) {
    const std::lock_guard lock(mutex_);
    (sample.topic == Topic::offer ? own_offer_ : own_setup_) = message;
  }
  return write(sample);
}

Status EngineLink::write(const WireSample& sample) {
  const std::shared_lock lock(engine_mutex_);
  if (!engine_)
    return error("room: expected a network, found none. It is opened again as soon as there is one.");
  return engine_->write(sample.topic, sample.sample.get());
}

Status EngineLink::send_to_all_runs(const std::string& machine, const WireSample& sample) {
  std::vector<Sender> runs;
  {
    const std::lock_guard lock(mutex_);
    for (const Sender& sender : met_)
      if (sender.node == machine) runs.push_back(sender);
  }
  if (runs.empty())
    return error("machine '{}': expected it in the room, found that it is not there. Start limn node on it.",
                 machine);
  Status first;
  const std::shared_lock lock(engine_mutex_);
  for (const Sender& run : runs) {
    if (!engine_) break;
    const Status sent = engine_->write_to(run, sample.topic, sample.sample.get());
    if (!sent && first) first = sent;
  }
  return first;
}

std::vector<Received> EngineLink::take_messages(std::chrono::nanoseconds wait) {
  const std::lock_guard one_at_a_time(taking_);
  {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, wait, [this] { return has_waiting_ || !newest_.empty() || !queued_.empty(); });
    has_waiting_ = false;
  }
  {
    const std::shared_lock lock(engine_mutex_);
    if (engine_) engine_->take_waiting();
  }
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
  if (receiver && *receiver != options_.self.node) return;
  const std::lock_guard lock(mutex_);
  ++counts_.received;
  if (is_directed(topic) || topic == Topic::offer) met_.insert(received->from);
  if (topic == Topic::offer)
    keep_offer(std::move(*received));
  else
    keep(std::move(*received));
}

void EngineLink::keep(Received received) {
  if (is_waiting(static_cast<Topic>(received.message.index()))) {
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
  if (known == present_.end() && options_.is_host != offer.is_host) arrived_.push_back(received.from);
  present_[received.from] = offer;
  queued_.push_back(std::move(received));
  changed_.notify_all();
}

void EngineLink::notice_departure(const Sender& sender) {
  const std::lock_guard lock(mutex_);
  met_.erase(sender);
  if (present_.erase(sender) == 0) return;
  departed_.push_back(sender);
  queued_.push_back({Departure{}, sender, now()});
  changed_.notify_all();
}

void EngineLink::notice_waiting() {
  const std::lock_guard lock(mutex_);
  has_waiting_ = true;
  changed_.notify_all();
}

void EngineLink::notice_warning(const std::string& text) {
  {
    const std::lock_guard lock(mutex_);
    ++counts_.warnings;
    const Stamp at = now();
    if (problems_.size() >= k_most_warnings && !problems_.contains(text))
      std::erase_if(problems_,
                    [at](const auto& entry) { return seconds_between(entry.second, at) > k_problem_s; });
    if (problems_.size() >= k_most_warnings && !problems_.contains(text)) return;
    problems_[text] = at;
    if (printed_.size() >= k_most_warnings || !printed_.insert(text).second) return;
  }
  log_warning("room: {}", text);
}

std::vector<std::string> EngineLink::problems() const {
  const std::lock_guard lock(mutex_);
  std::vector<std::string> out;
  for (const auto& entry : problems_)
    if (seconds_between(entry.second, now()) <= k_problem_s) out.push_back(entry.first);
  return out;
}

// Runs on a thread of its own: what takes the engine long, the repeated offer, and the return after a long
// sleep.
void EngineLink::attend(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  Stamp next = now() + k_offer_interval;
  double awake_s = seconds_with_sleep();
  while (!stop.stop_requested()) {
    changed_.wait_until(lock, stop, next, [this] { return !departed_.empty() || !arrived_.empty(); });
    const std::vector<Sender> departed = std::exchange(departed_, {}), arrived = std::exchange(arrived_, {});
    const std::optional<Message> offer = own_offer_;
    lock.unlock();
    tell_engine(departed, arrived);
    if (now() >= next) {
      next = now() + k_offer_interval;
      repeat(offer);
      const double before_s = std::exchange(awake_s, seconds_with_sleep());
      note_sleep(awake_s - before_s);
      if (is_forgotten(before_s)) enter_again();
    }
    lock.lock();
  }
}

void EngineLink::tell_engine(const std::vector<Sender>& departed, const std::vector<Sender>& arrived) {
  const std::shared_lock lock(engine_mutex_);
  if (!engine_) return;
  for (const Sender& sender : departed) engine_->forget(sender);
  for (const Sender& sender : arrived) engine_->connect(sender);
}

void EngineLink::repeat(const std::optional<Message>& message) {
  if (!message) return;
  if (const Status sent = write(to_wire(*message, options_.self)); !sent) notice_warning(sent.message());
}

void EngineLink::note_sleep(double seconds) {
  constexpr double k_slept_s = 5;  // a busy machine runs a thread sooner
  if (seconds > k_slept_s)
    notice_warning(
        fmt::format("this program did not run for {:.0f} s: the machine slept, or somebody stopped it. "
                    "Switch off its sleep while it belongs to a room (systemd-inhibit --what=sleep:idle "
                    "limn ...).",
                    seconds));
}

// Whether others have forgotten this program while it did not run, as a laptop that sleeps, or while nobody
// heard it.
bool EngineLink::is_forgotten(double awake_s) {
  constexpr double k_margin_s = 2;
  if (seconds_with_sleep() - awake_s > k_memory_s - k_margin_s) return true;
  NeighbourState others;
  {
    const std::shared_lock lock(engine_mutex_);
    if (!engine_) return true;
    others = engine_->neighbour_state();
  }
  if (others.strangers > 0)
    notice_warning(
        fmt::format("a program with other keys tries to enter a room named {}. If it belongs here, copy the "
                    "folder with the room's "
                    "keys from here to its machine; else rename one of the two rooms.",
                    options_.keys.name));
  return others.longest_silence_s > k_memory_s + k_margin_s;
}

void EngineLink::enter_again() {
  std::optional<Message> offer, setup;
  {
    const std::lock_guard alone(engine_mutex_);
    const bool was_open = engine_ != nullptr;
    engine_.reset();  // Only one at a time can be in a room.
    auto made = make_engine(options_, this);
    if (made)
      engine_ = std::move(*made);
    else if (was_open)
      notice_warning(made.message());
    const std::lock_guard lock(mutex_);
    for (const auto& entry : std::exchange(present_, {}))
      queued_.push_back({Departure{}, entry.first, now()});
    met_.clear();
    ++counts_.entries;
    offer = own_offer_;
    setup = own_setup_;
    changed_.notify_all();
  }
  repeat(offer);
  repeat(setup);
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
  auto link = std::make_unique<EngineLink>(std::move(engine));
  LIMN_TRY_STATUS(link->open());
  return std::unique_ptr<RoomLink>(std::move(link));
}

}  // namespace limn::nodes
