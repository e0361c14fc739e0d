// Images of ROS 2 on Eclipse Cyclone DDS, with the names and qualities of its middleware (rmw).

#include <dds/dds.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string_view>

#include "nodes/dds/ros_domain.h"
#include "nodes/dds/samples.h"
#include "nodes/ros_image_feed.h"
#include "ros_images.h"

namespace limn::nodes {
namespace {

using Image = sensor_msgs_msg_dds__Image_;
using CompressedImage = sensor_msgs_msg_dds__CompressedImage_;

constexpr auto k_between_looks = std::chrono::milliseconds(20);  // for a publisher

const dds_topic_descriptor_t* image_type_of(std::string_view name) {
  for (const auto* type : {&sensor_msgs_msg_dds__Image__desc, &sensor_msgs_msg_dds__CompressedImage__desc})
    if (name == type->m_typename) return type;
  return nullptr;
}

// "std_msgs/String" for std_msgs::msg::dds_::String_.
std::string type_for_people(std::string_view name) {
  const std::size_t package = name.find("::"), last = name.rfind("::");
  if (package == name.npos || !name.ends_with('_')) return std::string(name);
  const std::string_view own = name.substr(last + 2);
  return std::string(name.substr(0, package)) + "/" + std::string(own.substr(0, own.size() - 1));
}

template <class Octets>
std::span<const std::uint8_t> bytes_of(const Octets& data) {
  return {data._buffer, data._buffer ? data._length : 0};
}
std::string_view view_of(const char* text) { return text ? text : ""; }

class DdsRosImages final : public RosImageFeed {
 public:
  explicit DdsRosImages(std::string topic) : topic_(std::move(topic)) {}
  ~DdsRosImages() override {
    for (const dds_entity_t entity : {reader_, made_topic_, publications_})
      if (entity > 0) dds_delete(entity);
  }
  Status open(const RosNetwork& network);

  bool next(Stamp until, const Use& use) override;
  RosPublishers publishers() override;

 private:
  // The types by the topics that somebody publishes now, and how many do.
  struct Published {
    std::string type;
    std::size_t count = 0;
  };
  std::map<std::string, std::vector<Published>> published() const;
  const dds_topic_descriptor_t* published_type() const;
  Status receive(const dds_topic_descriptor_t* type);
  bool wait(Stamp until);
  bool use_newest(Stamp arrived_at, const Use& use) const;
  static void notice_data(dds_entity_t reader, void* self);

  const std::string topic_;
  RosDomain domain_;
  dds_entity_t publications_ = 0, made_topic_ = 0, reader_ = 0;
  const dds_topic_descriptor_t* type_ = nullptr;
  std::mutex mutex_;
  std::condition_variable has_come_;
  std::optional<Stamp> arrived_at_;  // the newest image's, until it is used
};

Status DdsRosImages::open(const RosNetwork& network) {
  LIMN_TRY(domain_, RosDomain::enter(network));
  publications_ =
      dds_create_reader(domain_.participant(), DDS_BUILTIN_TOPIC_DCPSPUBLICATION, nullptr, nullptr);
  if (publications_ < 0) return ros_failed("the list of publishers", publications_);
  return {};
}

std::map<std::string, std::vector<DdsRosImages::Published>> DdsRosImages::published() const {
  constexpr std::size_t k_most = 4096;
  std::map<std::string, std::vector<Published>> out;
  std::vector<void*> samples(k_most);
  std::vector<dds_sample_info_t> infos(k_most);
  const int count = dds_read(publications_, samples.data(), infos.data(), k_most, k_most);
  for (std::size_t i = 0; static_cast<int>(i) < count; ++i) {
    if (!infos[i].valid_data || infos[i].instance_state != DDS_ALIVE_INSTANCE_STATE) continue;
    const auto& at = *static_cast<const dds_builtintopic_endpoint_t*>(samples[i]);
    const std::string_view topic = view_of(at.topic_name);
    if (!topic.starts_with("rt/")) continue;
    auto& types = out[std::string(topic.substr(2))];
    auto found = std::ranges::find(types, view_of(at.type_name), &Published::type);
    if (found == types.end()) found = types.insert(found, {std::string(view_of(at.type_name)), 0});
    ++found->count;
  }
  if (count > 0) dds_return_loan(publications_, samples.data(), count);
  return out;
}

const dds_topic_descriptor_t* DdsRosImages::published_type() const {
  const auto all = published();
  const auto here = all.find(topic_);
  if (here == all.end()) return nullptr;
  for (const Published& each : here->second)
    if (const auto* type = image_type_of(each.type)) return type;
  return nullptr;
}

RosPublishers DdsRosImages::publishers() {
  RosPublishers out;
  for (const auto& [topic, types] : published())
    for (const Published& each : types) {
      const bool is_here = topic == topic_, is_image = image_type_of(each.type) != nullptr;
      if (is_image) out.image_topics.push_back(topic);
      if (is_here && is_image) out.count += each.count;
      if (is_here && !is_image) out.other_type = type_for_people(each.type);
    }
  out.image_topics.erase(std::unique(out.image_topics.begin(), out.image_topics.end()),
                         out.image_topics.end());
  return out;
}

// Best effort, as drivers of cameras publish; such a reader hears reliable publishers, too.
Status DdsRosImages::receive(const dds_topic_descriptor_t* type) {
  LIMN_TRY(made_topic_, domain_.topic(topic_, type));
  const Qos qos = ros_qos(1);
  dds_qset_reliability(qos.get(), DDS_RELIABILITY_BEST_EFFORT, 0);
  const std::unique_ptr<dds_listener_t, decltype(&dds_delete_listener)> listener(dds_create_listener(this),
                                                                                 &dds_delete_listener);
  dds_lset_data_available(listener.get(), &DdsRosImages::notice_data);
  type_ = type;
  reader_ = dds_create_reader(domain_.participant(), made_topic_, qos.get(), listener.get());
  if (reader_ < 0) return ros_failed("topic " + topic_, reader_);
  return {};
}

void DdsRosImages::notice_data(dds_entity_t, void* self) {
  auto* const feed = static_cast<DdsRosImages*>(self);
  const std::lock_guard lock(feed->mutex_);
  feed->arrived_at_ = now();
  feed->has_come_.notify_one();
}

// Whether a reader of the topic's type is there, or came until then.
bool DdsRosImages::wait(Stamp until) {
  while (reader_ == 0) {
    if (const auto* type = published_type()) return receive(type).ok();
    if (now() >= until) return false;
    std::this_thread::sleep_until(std::min(until, now() + k_between_looks));
  }
  return reader_ > 0;
}

bool DdsRosImages::next(Stamp until, const Use& use) {
  if (!wait(until)) return false;
  for (;;) {
    Stamp arrived_at;
    {
      std::unique_lock lock(mutex_);
      if (!has_come_.wait_until(lock, until, [this] { return arrived_at_.has_value(); })) return false;
      arrived_at = *arrived_at_;
      arrived_at_.reset();
    }
    if (use_newest(arrived_at, use)) return true;
  }
}

bool DdsRosImages::use_newest(Stamp arrived_at, const Use& use) const {
  bool is_used = false;
  take_all(reader_, [&](const void* sample, const dds_sample_info_t& info) {
    if (!info.valid_data) return;
    is_used = true;
    device::RosImage image;
    if (type_ == &sensor_msgs_msg_dds__Image__desc) {
      const auto& raw = *static_cast<const Image*>(sample);
      image = {false,    view_of(raw.encoding), raw.width,         raw.height,
               raw.step, raw.is_bigendian != 0, bytes_of(raw.data)};
      use(image, {raw.header.stamp.sec, raw.header.stamp.nanosec, arrived_at});
    } else {
      const auto& stored = *static_cast<const CompressedImage*>(sample);
      image.is_compressed = true;
      image.encoding = view_of(stored.format);
      image.bytes = bytes_of(stored.data);
      use(image, {stored.header.stamp.sec, stored.header.stamp.nanosec, arrived_at});
    }
  });
  return is_used;
}

}  // namespace
}  // namespace limn::nodes

extern "C" __attribute__((visibility("default"))) limn::nodes::RosImageFeed* limn_open_ros_images(
    const limn::nodes::RosNetwork& network, const std::string& topic, std::string* problem) {
  auto feed = std::make_unique<limn::nodes::DdsRosImages>(topic);
  const limn::Status opened = feed->open(network);
  if (opened) return feed.release();
  *problem = opened.message();
  return nullptr;
}
