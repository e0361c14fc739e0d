#include "nodes/room.h"

#include <algorithm>
#include <utility>

#include "core/log.h"

namespace limn::nodes {
namespace {

constexpr std::size_t k_most_cameras = 1024;  // whose detections are kept
constexpr auto k_receive_wait = std::chrono::milliseconds(20);

}  // namespace

Room::Room(std::unique_ptr<RoomLink> link) : link_(std::move(link)), thread_([this] { run(); }) {}

Room::~Room() {
  is_stopping_ = true;
  thread_.join();
}

Status Room::offer(const Offer& offer) {
  {
    const std::lock_guard lock(mutex_);
    is_host_ = offer.is_host;
  }
  return link_->send(offer);
}

Status Room::send(const Message& message) {
  if (const auto* setup = std::get_if<Setup>(&message)) sent_setup_ = setup->revision;
  return link_->send(message);
}

void Room::run() {
  while (!is_stopping_) {
    for (Received& received : link_->take_messages(k_receive_wait)) note(std::move(received));
    compare_clocks();
  }
}

// Asks the host for its time.
void Room::compare_clocks() {
  ClockRequest request;
  {
    const std::lock_guard lock(mutex_);
    const auto host = std::ranges::find_if(machines_, [](const auto& m) { return m.second.offer.is_host; });
    const double asked_s = seconds_between(asked_clock_at_, now());  // ago; negative: the clock has stepped
    if (is_host_ || host == machines_.end() || (asked_s >= 0 && asked_s < clock_.wanted_interval_s())) return;
    asked_clock_at_ = now();
    request = {host->first, ++clock_requests_, now()};
  }
  if (const Status sent = link_->send(request); !sent) log_warning("room: {}", sent.message());
}

void Room::note(Received received) {
  const Stamp arrived_at = received.arrived_at;
  const Sender& from = received.from;
  if (const auto* request = std::get_if<ClockRequest>(&received.message)) {
    // Another thread's work must not delay this answer: its time would count as the network's.
    const Status sent =
        link_->send(ClockAnswer{from.node, request->number, request->sent_at, arrived_at, now()});
    if (!sent) log_warning("room: {}", sent.message());
    return;
  }
  const std::lock_guard lock(mutex_);
  const auto machine = machines_.find(from.node);
  const bool is_known = machine != machines_.end() && machine->second.sender == from;
  const bool is_from_host = is_known && machine->second.offer.is_host;
  if (const auto* offer = std::get_if<Offer>(&received.message)) {
    note_offer(from, *offer);
  } else if (std::holds_alternative<Departure>(received.message)) {
    note_departure(from);
  } else if (auto* answer = std::get_if<ClockAnswer>(&received.message)) {
    if (is_from_host && from.run == clock_run_)
      clock_.add({answer->asked_at, answer->received_at, answer->sent_at, arrived_at});
    return;
  } else if (auto* moment = std::get_if<Moment>(&received.message)) {
    if (!is_from_host) return;
    moment_ = std::move(*moment);
  } else if (auto* image = std::get_if<ScreenImage>(&received.message)) {
    if (!is_from_host) return;
    screen_images_[image->screen] = std::move(*image);
  } else if (auto* setup = std::get_if<Setup>(&received.message)) {
    setup_ = {std::move(*setup), from};  // it may come before its sender's offer
  } else if (auto* order = std::get_if<Order>(&received.message)) {
    // Only a host may send orders (the keys of its role allow it), and this may come before its offer.
    waiting_orders_.push_back({std::move(*order), from.node});
  } else if (auto* done = std::get_if<Answer>(&received.message)) {
    if (const auto waiting = answers_.find(done->number); waiting != answers_.end())
      waiting->second = std::move(*done);
  } else if (auto* health = std::get_if<Health>(&received.message)) {
    if (is_known) machine->second.health = std::move(*health);
    return;
  } else if (auto* seen = std::get_if<Detections>(&received.message)) {
    if (!is_known ||
        (detections_.size() >= k_most_cameras && !detections_.contains({from.node, seen->found.camera})))
      return;
    detections_[{from.node, seen->found.camera}] = std::move(*seen);
  }
  has_arrived_ = true;
  changed_.notify_all();
}

// A new run of a known machine replaces the old one.
void Room::note_offer(const Sender& from, const Offer& offer) {
  Machine& machine = machines_[from.node];
  if (!(machine.sender == from)) machine = {from, offer, std::nullopt};
  machine.offer = offer;
  if (!offer.is_host || clock_run_ == from.run) return;
  clock_run_ = from.run;
  clock_ = ClockEstimator();
  asked_clock_at_ = {};
}

// Its setup and moments are no longer valid, its orders are not answered any more.
void Room::note_departure(const Sender& from) {
  const auto machine = machines_.find(from.node);
  if (machine == machines_.end() || !(machine->second.sender == from)) return;  // an earlier run
  if (machine->second.offer.is_host) {
    moment_.reset();
    screen_images_.clear();
    if (setup_ && setup_->second == from) setup_.reset();
    waiting_orders_.clear();
  }
  machines_.erase(machine);
  std::erase_if(detections_, [&](const auto& entry) { return entry.first.first == from.node; });
}

std::vector<Machine> Room::machines() const {
  const std::lock_guard lock(mutex_);
  std::vector<Machine> out;
  for (const auto& [name, machine] : machines_) out.push_back(machine);
  return out;
}

std::optional<Machine> Room::find(const std::string& node) const {
  const std::lock_guard lock(mutex_);
  const auto found = machines_.find(node);
  return found == machines_.end() ? std::nullopt : std::optional(found->second);
}

std::optional<Machine> Room::host() const {
  const std::lock_guard lock(mutex_);
  for (const auto& [name, machine] : machines_)
    if (machine.offer.is_host) return machine;
  return std::nullopt;
}

std::optional<ClockEstimate> Room::host_clock() const {
  const std::lock_guard lock(mutex_);
  return clock_.estimate(now());
}

void Room::wait(std::chrono::nanoseconds limit) {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, limit, [&] { return has_arrived_; });
  has_arrived_ = false;
}

bool Room::wait_without_black(Stamp until) {
  std::unique_lock lock(mutex_);
  const auto is_black = [&] { return moment_ && moment_->frame.is_black; };
  // A clock that steps back meanwhile makes the rest of the wait longer than the whole was.
  const double whole_s = seconds_between(now(), until);
  changed_.wait_until(lock, until, [&] { return is_black() || seconds_between(now(), until) > whole_s; });
  return !is_black();
}

std::optional<Moment> Room::take_moment() {
  const std::lock_guard lock(mutex_);
  return std::exchange(moment_, std::nullopt);
}

std::vector<ScreenImage> Room::take_screen_images() {
  const std::lock_guard lock(mutex_);
  std::vector<ScreenImage> out;
  for (auto& [screen, image] : std::exchange(screen_images_, {})) out.push_back(std::move(image));
  return out;
}

std::optional<Setup> Room::take_setup() {
  const std::lock_guard lock(mutex_);
  const auto host = setup_ ? machines_.find(setup_->second.node) : machines_.end();
  if (host == machines_.end() || !host->second.offer.is_host || !(host->second.sender == setup_->second))
    return std::nullopt;
  return std::exchange(setup_, std::nullopt)->first;
}

std::vector<Room::ReceivedOrder> Room::take_orders() {
  const std::lock_guard lock(mutex_);
  return std::exchange(waiting_orders_, {});
}

Result<Answer> Room::ask(Order order, double limit_s) {
  const std::string node = order.to;
  std::unique_lock lock(mutex_);
  const auto is_there = [&] { return machines_.contains(node); };
  if (!is_there())
    return error("{}: expected this machine in the room, found none. Is limn node running on it?", node);
  const std::uint64_t number = order.number = ++orders_;
  answers_[number];
  lock.unlock();
  const Status sent = link_->send(order);
  lock.lock();
  const auto is_answered = [&] { return answers_[number].has_value(); };
  if (sent)
    changed_.wait_for(lock, std::chrono::duration<double>(limit_s),
                      [&] { return is_answered() || !is_there(); });
  const std::optional<Answer> answer = std::move(answers_[number]);
  answers_.erase(number);
  if (!sent) return sent.error();
  if (!answer && !is_there()) return error("{}: expected an answer, but the machine has gone.", node);
  if (!answer) return error("{}: expected an answer within {:.1f} s, found none.", node, limit_s);
  if (!answer->error.empty()) return error("{}: {}", node, answer->error);
  return *answer;
}

std::optional<Detections> Room::take_detections(const std::string& node,
                                                const std::string& camera,
                                                std::chrono::nanoseconds limit) {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, limit, [&] { return detections_.contains({node, camera}); });
  auto taken = detections_.extract({node, camera});
  return taken ? std::optional(std::move(taken.mapped())) : std::nullopt;
}

}  // namespace limn::nodes
