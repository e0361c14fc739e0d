// The engine of a room on Eclipse Cyclone DDS: a shared library that nodes/engine_library.cpp loads.

#include <dds/dds.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>
#include <memory>
#include <mutex>
#include <thread>
#include <utility>

#include "core/program_library.h"
#include "limn_room.h"
#include "nodes/dds/domain_config.h"
#include "nodes/dds/neighbourhood.h"
#include "nodes/dds/qualities.h"
#include "nodes/dds/samples.h"
#include "nodes/engine.h"

namespace limn::nodes {
namespace {

constexpr auto k_longest_match = std::chrono::seconds(2);

// The topics that a role sends, and those that it receives.
bool is_from_host(Topic topic) {
  return topic == Topic::setup || topic == Topic::moment || topic == Topic::order ||
         topic == Topic::screen_image;
}
bool is_for_host(Topic topic) { return topic == Topic::detections; }
bool is_sent(Topic topic, bool is_host) { return is_host ? !is_for_host(topic) : !is_from_host(topic); }
bool is_received(Topic topic, bool is_host) { return is_sent(topic, !is_host); }

class DdsEngine final : public Engine {
 public:
  explicit DdsEngine(EngineEvents* events) : events_(events) {}
  ~DdsEngine() override;
  Status open(const EngineOptions& options);

  Status write(Topic topic, const void* sample) override;
  Status write_to(const Sender& receiver, Topic topic, const void* sample) override;
  void connect(const Sender& receiver) override;
  void forget(const Sender& receiver) override;
  void take_waiting() override;
  NeighbourState neighbour_state() override;

 private:
  struct Reading {
    DdsEngine* engine = nullptr;
    Topic topic = Topic::offer;
    dds_entity_t reader = 0;
  };
  struct Writing {
    dds_entity_t publisher = 0, writer = 0;
    bool is_confirmed = false;  // by its receiver
  };
  using Directed = std::map<std::pair<Sender, Topic>, Writing>;

  Status open_topic(Topic topic, const EngineOptions& options, dds_entity_t subscriber);
  Result<dds_entity_t> directed_writer(const Sender& receiver, Topic topic);
  dds_return_t begin_directed(const Sender& receiver, Topic topic, dds_entity_t writer, const void* sample);
  void take_samples(Topic topic, dds_entity_t reader);
  void report_presence(const limn_v1_Offer& offer, const dds_sample_info_t& info);
  static void notice_data(dds_entity_t reader, void* reading);
  static std::string in_words(std::string text);
  static void print(void* engine, const dds_log_data_t* data);
  Error failed(const char* what, dds_return_t code);

  EngineEvents* events_;
  bool is_host_ = false;
  dds_entity_t domain_ = 0, participant_ = 0;
  std::array<dds_entity_t, k_topics> topics_{}, writers_{};
  std::array<Reading, k_topics> readings_;
  std::mutex directed_mutex_;
  Directed directed_;
  Neighbourhood neighbourhood_;
  std::mutex log_mutex_;
  std::string last_log_;
};

DdsEngine::~DdsEngine() {
  if (domain_ > 0) dds_delete(domain_);
  dds_set_log_sink(nullptr, nullptr);
}

// The engine's own last line says more than the code.
Error DdsEngine::failed(const char* what, dds_return_t code) {
  const std::lock_guard lock(log_mutex_);
  return error("room: expected {} to succeed, found: {}{}{}.", what, dds_strretcode(code),
               last_log_.empty() ? "" : ": ", last_log_);
}

// What the engine prints, in words for people; empty: it means nothing to them.
std::string DdsEngine::in_words(std::string text) {
  const auto has = [&text](const char* part) { return text.find(part) != std::string::npos; };
  if (has("malformed packet") || has("deserialization failed") || has("invalid parameter list") ||
      has("Invalid ParticipantBuiltinTopicData"))
    return "datagrams come that are no program's of a room: something else uses its ports, or somebody "
           "disturbs it.";
  if (has("Certificate not valid") || has("handshake")) return "";  // NeighbourState::strangers
  if (has("ddsi_udp_conn_write")) return "nothing can be sent: a cable is unplugged, or the network is down.";
  if (has("Remote secure participant") && has("not allowed"))
    return "";  // It came before this one was ready.
  while (!text.empty() && (text.back() == '\n' || text.back() == ' ')) text.pop_back();
  return text;
}

void DdsEngine::print(void* engine, const dds_log_data_t* data) {
  auto* self = static_cast<DdsEngine*>(engine);
  const std::string text = in_words(data->message);
  if (text.empty()) return;
  self->events_->notice_warning(text);
  const std::lock_guard lock(self->log_mutex_);
  self->last_log_ = text;
}

Status DdsEngine::open(const EngineOptions& options) {
  is_host_ = options.is_host;
  LIMN_TRY(const std::string config, domain_config(options));
  LIMN_TRY(const Qos secure, secure_qos(options.keys));
  dds_set_log_sink(&DdsEngine::print, this);
  const auto domain = static_cast<dds_domainid_t>(options.domain);
  domain_ = dds_create_domain(domain, config.c_str());
  if (domain_ < 0) return failed("opening the network", domain_);
  participant_ = dds_create_participant(domain, secure.get(), nullptr);
  if (participant_ < 0) return failed("entering the room with its keys", participant_);
  const Qos own = partition_qos(options.self);
  const dds_entity_t subscriber = dds_create_subscriber(participant_, own.get(), nullptr);
  if (subscriber < 0) return failed("making a subscriber", subscriber);
  for (std::size_t i = 0; i < k_topics; ++i)
    LIMN_TRY_STATUS(open_topic(static_cast<Topic>(i), options, subscriber));
  const dds_entity_t offers = readings_[static_cast<std::size_t>(Topic::offer)].reader;
  if (const dds_return_t code = neighbourhood_.open(participant_, offers); code < 0)
    return failed("finding others", code);
  return {};
}

Status DdsEngine::open_topic(Topic topic, const EngineOptions& options, dds_entity_t subscriber) {
  const auto i = static_cast<std::size_t>(topic);
  const auto [name, type] = description_of(topic);
  topics_[i] = dds_create_topic(participant_, type, name, nullptr, nullptr);
  if (topics_[i] < 0) return failed("making a topic", topics_[i]);
  if (is_sent(topic, is_host_) && !is_directed(topic)) {
    const Qos qos = writer_qos(topic, options.liveliness_s);
    writers_[i] = dds_create_writer(participant_, topics_[i], qos.get(), nullptr);
    if (writers_[i] < 0) return failed("making a writer", writers_[i]);
  }
  if (!is_received(topic, is_host_)) return {};
  readings_[i] = {this, topic, 0};
  const std::unique_ptr<dds_listener_t, decltype(&dds_delete_listener)> listener(
      dds_create_listener(&readings_[i]), &dds_delete_listener);
  dds_lset_data_available(listener.get(), &DdsEngine::notice_data);
  const Qos qos = reader_qos(topic);
  readings_[i].reader = dds_create_reader(is_directed(topic) ? subscriber : participant_, topics_[i],
                                          qos.get(), listener.get());
  if (readings_[i].reader < 0) return failed("making a reader", readings_[i].reader);
  return {};
}

void DdsEngine::notice_data(dds_entity_t reader, void* reading) {
  const auto& at = *static_cast<const Reading*>(reading);
  if (is_waiting(at.topic))
    at.engine->events_->notice_waiting();
  else
    at.engine->take_samples(at.topic, reader);
}

void DdsEngine::take_waiting() {
  for (const Reading& at : readings_)
    if (at.reader > 0 && is_waiting(at.topic)) take_samples(at.topic, at.reader);
}

void DdsEngine::take_samples(Topic topic, dds_entity_t reader) {
  const Stamp arrived_at = now();
  take_all(reader, [&](const void* sample, const dds_sample_info_t& info) {
    if (info.valid_data) events_->receive_sample(topic, sample, arrived_at);
    if (topic == Topic::offer) report_presence(*static_cast<const limn_v1_Offer*>(sample), info);
  });
}

void DdsEngine::report_presence(const limn_v1_Offer& offer, const dds_sample_info_t& info) {
  if (info.instance_state != DDS_IST_ALIVE) {
    events_->notice_departure({offer.node ? offer.node : "", offer.run});
  } else if (info.valid_data) {
    neighbourhood_.note_offer(info.publication_handle);
  }
}

NeighbourState DdsEngine::neighbour_state() { return neighbourhood_.state(); }

Status DdsEngine::write(Topic topic, const void* sample) {
  const dds_entity_t writer = writers_[static_cast<std::size_t>(topic)];
  if (writer <= 0)
    return error("room: expected a message that a {} may send, found {}. Send it from the other side.",
                 is_host_ ? "host" : "node", description_of(topic).name);
  const dds_return_t code = dds_write(writer, sample);
  if (code < 0) return failed("sending", code);
  return {};
}

Result<dds_entity_t> DdsEngine::directed_writer(const Sender& receiver, Topic topic) {
  const std::lock_guard lock(directed_mutex_);
  if (!is_sent(topic, is_host_))
    return error("room: expected a message that a node may send, found {}. Send it from the host.",
                 description_of(topic).name);
  Writing& at = directed_[{receiver, topic}];
  if (at.writer > 0) return at.writer;
  const Qos partition = partition_qos(receiver), qos = writer_qos(topic, 0);
  at.publisher = dds_create_publisher(participant_, partition.get(), nullptr);
  at.writer = dds_create_writer(at.publisher, topics_[static_cast<std::size_t>(topic)], qos.get(), nullptr);
  if (at.writer < 0) return failed("making a writer", at.writer);
  return at.writer;
}

Status DdsEngine::write_to(const Sender& receiver, Topic topic, const void* sample) {
  LIMN_TRY(const dds_entity_t writer, directed_writer(receiver, topic));
  dds_return_t code = is_reliable(topic) ? begin_directed(receiver, topic, writer, sample) : DDS_RETCODE_OK;
  if (code == DDS_RETCODE_OK) code = dds_write(writer, sample);
  if (code == DDS_RETCODE_OK) return {};
  return error(
      "machine '{}': expected it to accept a message within some seconds, found: {}. Check its network, or "
      "restart Limn on it.",
      receiver.node, dds_strretcode(code));
}

// Before the first sample, waits until the receiver has confirmed something that means nothing to it. Until
// then it may not know this writer, and what it misses comes out of order.
dds_return_t DdsEngine::begin_directed(const Sender& receiver,
                                       Topic topic,
                                       dds_entity_t writer,
                                       const void* sample) {
  constexpr auto k_pause = std::chrono::milliseconds(2);
  {
    const std::lock_guard lock(directed_mutex_);
    if (const auto found = directed_.find({receiver, topic});
        found != directed_.end() && found->second.is_confirmed)
      return DDS_RETCODE_OK;
  }
  const Stamp end = now() + k_longest_match;
  dds_publication_matched_status_t matched{};
  for (; matched.current_count == 0; std::this_thread::sleep_for(k_pause)) {
    const dds_return_t code = dds_get_publication_matched_status(writer, &matched);
    if (code < 0 || now() >= end) return code < 0 ? code : DDS_RETCODE_TIMEOUT;
  }
  dds_return_t code = dds_dispose(writer, sample);
  if (code == DDS_RETCODE_OK)
    code = dds_wait_for_acks(writer, std::max<dds_duration_t>(0, (end - now()).count()));
  const std::lock_guard lock(directed_mutex_);
  if (const auto found = directed_.find({receiver, topic});
      code == DDS_RETCODE_OK && found != directed_.end())
    found->second.is_confirmed = true;
  return code;
}

void DdsEngine::connect(const Sender& receiver) {
  const Topic topic = is_host_ ? Topic::order : Topic::answer;
  if (const auto writer = directed_writer(receiver, topic); !writer)
    events_->notice_warning(writer.message());
}

void DdsEngine::forget(const Sender& receiver) {
  std::vector<dds_entity_t> publishers;
  {
    const std::lock_guard lock(directed_mutex_);
    std::erase_if(directed_, [&](const auto& entry) {
      if (entry.first.first != receiver) return false;
      publishers.push_back(entry.second.publisher);
      return true;
    });
  }
  for (const dds_entity_t publisher : publishers) dds_delete(publisher);
}

}  // namespace
}  // namespace limn::nodes

LIMN_LIBRARY_VERSION(LIMN_VERSION)

extern "C" __attribute__((visibility("default"))) limn::nodes::Engine* limn_make_room_engine(
    const limn::nodes::EngineOptions& options, limn::nodes::EngineEvents* events, std::string* problem) {
  auto engine = std::make_unique<limn::nodes::DdsEngine>(events);
  const limn::Status opened = engine->open(options);
  if (opened) return engine.release();
  *problem = opened.message();
  return nullptr;
}
