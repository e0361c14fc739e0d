// Poses of ROS 2 on Eclipse Cyclone DDS, with the names and qualities of its middleware (rmw).

#include <dds/dds.h>
#include <fmt/format.h>

#include <cstdlib>
#include <deque>
#include <map>
#include <memory>
#include <mutex>

#include "exchange/poses/pose_limits.h"
#include "nodes/dds/qualities.h"
#include "nodes/dds/ros_domain.h"
#include "nodes/dds/samples.h"
#include "nodes/ros_port.h"
#include "ros_poses.h"

namespace limn::nodes {
namespace {

using exchange::RosMessage;
using exchange::RosPose;
using Header = std_msgs_msg_dds__Header_;
using PoseStamped = geometry_msgs_msg_dds__PoseStamped_;
using TransformStamped = geometry_msgs_msg_dds__TransformStamped_;
using TransformMessage = tf2_msgs_msg_dds__TFMessage_;

constexpr std::size_t k_most_waiting = 128;
// The depths of rclcpp's default and of tf2's broadcaster.
constexpr int32_t k_pose_depth = 10, k_transforms_depth = 100;

const dds_topic_descriptor_t* type_of(bool has_transforms) {
  return has_transforms ? &tf2_msgs_msg_dds__TFMessage__desc : &geometry_msgs_msg_dds__PoseStamped__desc;
}

Qos common_qos(bool has_transforms) { return ros_qos(has_transforms ? k_transforms_depth : k_pose_depth); }
// ROS 2's default. A slow subscriber loses samples; the session does not wait for it.
Qos ros_writer_qos(bool has_transforms) {
  Qos qos = common_qos(has_transforms);
  dds_qset_reliability(qos.get(), DDS_RELIABILITY_RELIABLE, 0);
  return qos;
}
// Best effort, because such a reader hears reliable publishers, too; a reliable one would not hear the best
// effort ones that many motion capture drivers have (rmw_qos_profile_sensor_data).
Qos ros_reader_qos(bool has_transforms) {
  Qos qos = common_qos(has_transforms);
  dds_qset_reliability(qos.get(), DDS_RELIABILITY_BEST_EFFORT, 0);
  return qos;
}
// As tf2's listener has it: who comes late gets what was published before.
Qos static_reader_qos() {
  Qos qos = common_qos(true);
  dds_qset_reliability(qos.get(), DDS_RELIABILITY_RELIABLE, 0);
  dds_qset_durability(qos.get(), DDS_DURABILITY_TRANSIENT_LOCAL);
  return qos;
}

std::string text_of(const char* text) { return text ? text : ""; }

RosPose read_header(const Header& header, std::string sensor) {
  RosPose out;
  out.frame = text_of(header.frame_id);
  out.sensor = std::move(sensor);
  out.s = header.stamp.sec;
  out.ns = header.stamp.nanosec;
  return out;
}

RosPose read_pose(const PoseStamped& sample, const std::string& topic) {
  RosPose out = read_header(sample.header, topic);
  const auto& [p, q] = sample.pose;
  out.position_m = {p.x, p.y, p.z};
  out.rotation_xyzw = {q.x, q.y, q.z, q.w};
  return out;
}

RosPose read_transform(const TransformStamped& sample) {
  RosPose out = read_header(sample.header, text_of(sample.child_frame_id));
  const auto& [p, q] = sample.transform;
  out.position_m = {p.x, p.y, p.z};
  out.rotation_xyzw = {q.x, q.y, q.z, q.w};
  return out;
}

// Samples borrow the strings of the poses: Cyclone DDS's types have no const.
Header header_of(const RosPose& pose) { return {{pose.s, pose.ns}, const_cast<char*>(pose.frame.c_str())}; }

PoseStamped pose_sample(const RosPose& pose) {
  const auto& p = pose.position_m;
  const auto& q = pose.rotation_xyzw;
  return {header_of(pose), {{p[0], p[1], p[2]}, {q[0], q[1], q[2], q[3]}}};
}

TransformStamped transform_sample(const RosPose& pose) {
  const auto& p = pose.position_m;
  const auto& q = pose.rotation_xyzw;
  return {header_of(pose),
          const_cast<char*>(pose.sensor.c_str()),
          {{p[0], p[1], p[2]}, {q[0], q[1], q[2], q[3]}}};
}

class DdsRosPort final : public exchange::RosPort {
 public:
  ~DdsRosPort() override {
    for (const dds_entity_t entity : entities_) dds_delete(entity);
  }
  Status open(const RosNetwork& network);

  Result<std::size_t> subscribe(const std::string& topic) override;
  std::optional<RosMessage> next(std::size_t subscription) override;
  Status publish_pose(const std::string& topic, const RosPose& pose) override;
  Status publish_transforms(const std::string& topic, std::span<const RosPose> poses) override;

 private:
  struct Subscription;
  // A topic of a subscription: the one that it names, or that of the static transforms beside it.
  struct Inlet {
    Subscription* subscription = nullptr;
    bool is_static = false;
  };
  struct Subscription {
    std::string topic;
    bool has_transforms = false;
    Inlet moving{this, false}, fixed{this, true};
    std::mutex mutex;
    std::deque<RosMessage> waiting;
  };

  Result<dds_entity_t> writer_of(const std::string& topic, bool has_transforms);
  Status receive(Inlet* inlet);
  static void notice_data(dds_entity_t reader, void* inlet);
  static void keep(RosMessage message, Subscription* subscription);

  RosDomain domain_;
  std::vector<dds_entity_t> entities_;  // its readers and writers
  std::mutex mutex_;
  std::vector<std::unique_ptr<Subscription>> subscriptions_;
  std::map<std::string, dds_entity_t> writers_;
};

Status DdsRosPort::open(const RosNetwork& network) {
  LIMN_TRY(domain_, RosDomain::enter(network));
  return {};
}

Result<std::size_t> DdsRosPort::subscribe(const std::string& topic) {
  const std::lock_guard lock(mutex_);
  subscriptions_.push_back(std::make_unique<Subscription>());
  Subscription& subscription = *subscriptions_.back();
  subscription.topic = topic;
  subscription.has_transforms = exchange::has_transforms(topic);
  LIMN_TRY_STATUS(receive(&subscription.moving));
  if (subscription.has_transforms) LIMN_TRY_STATUS(receive(&subscription.fixed));
  return subscriptions_.size() - 1;
}

Status DdsRosPort::receive(Inlet* inlet) {
  const bool has_transforms = inlet->subscription->has_transforms;
  const std::string& named = inlet->subscription->topic;
  const std::string topic = inlet->is_static ? exchange::static_topic(named) : named;
  LIMN_TRY(const dds_entity_t made, domain_.topic(topic, type_of(has_transforms)));
  const std::unique_ptr<dds_listener_t, decltype(&dds_delete_listener)> listener(dds_create_listener(inlet),
                                                                                 &dds_delete_listener);
  dds_lset_data_available(listener.get(), &DdsRosPort::notice_data);
  const Qos qos = inlet->is_static ? static_reader_qos() : ros_reader_qos(has_transforms);
  const dds_entity_t reader = dds_create_reader(domain_.participant(), made, qos.get(), listener.get());
  if (reader < 0) return ros_failed("topic " + topic, reader);
  entities_.push_back(reader);
  return {};
}

void DdsRosPort::notice_data(dds_entity_t reader, void* argument) {
  const auto* inlet = static_cast<const Inlet*>(argument);
  Subscription* subscription = inlet->subscription;
  const Stamp arrived_at = now();
  take_all(reader, [&](const void* sample, const dds_sample_info_t& info) {
    if (!info.valid_data) return;
    RosMessage message{{}, arrived_at};
    if (subscription->has_transforms) {
      const auto& list = static_cast<const TransformMessage*>(sample)->transforms;
      // One more than is accepted, so that longer messages are refused.
      for (std::uint32_t k = 0; k < list._length && k <= exchange::k_most_poses; ++k) {
        message.poses.push_back(read_transform(list._buffer[k]));
        message.poses.back().is_static = inlet->is_static;
      }
    } else {
      message.poses.push_back(read_pose(*static_cast<const PoseStamped*>(sample), subscription->topic));
    }
    keep(std::move(message), subscription);
  });
}

void DdsRosPort::keep(RosMessage message, Subscription* subscription) {
  const std::lock_guard lock(subscription->mutex);
  if (subscription->waiting.size() == k_most_waiting) subscription->waiting.pop_front();
  subscription->waiting.push_back(std::move(message));
}

std::optional<RosMessage> DdsRosPort::next(std::size_t subscription) {
  Subscription* at = nullptr;
  {
    const std::lock_guard lock(mutex_);
    at = subscriptions_.at(subscription).get();
  }
  const std::lock_guard lock(at->mutex);
  if (at->waiting.empty()) return std::nullopt;
  RosMessage message = std::move(at->waiting.front());
  at->waiting.pop_front();
  return message;
}

Result<dds_entity_t> DdsRosPort::writer_of(const std::string& topic, bool has_transforms) {
  const std::lock_guard lock(mutex_);
  if (const auto known = writers_.find(topic); known != writers_.end()) return known->second;
  LIMN_TRY(const dds_entity_t made, domain_.topic(topic, type_of(has_transforms)));
  const Qos qos = ros_writer_qos(has_transforms);
  const dds_entity_t writer = dds_create_writer(domain_.participant(), made, qos.get(), nullptr);
  if (writer < 0) return ros_failed("topic " + topic, writer);
  entities_.push_back(writer);
  writers_[topic] = writer;
  return writer;
}

Status DdsRosPort::publish_pose(const std::string& topic, const RosPose& pose) {
  LIMN_TRY(const dds_entity_t writer, writer_of(topic, false));
  const PoseStamped sample = pose_sample(pose);
  const dds_return_t code = dds_write(writer, &sample);
  if (code < 0 && code != DDS_RETCODE_TIMEOUT) return ros_failed("topic " + topic, code);
  return {};
}

Status DdsRosPort::publish_transforms(const std::string& topic, std::span<const RosPose> poses) {
  LIMN_TRY(const dds_entity_t writer, writer_of(topic, true));
  std::vector<TransformStamped> transforms;
  for (const RosPose& pose : poses) transforms.push_back(transform_sample(pose));
  const auto count = static_cast<std::uint32_t>(transforms.size());
  const TransformMessage sample{{count, count, transforms.data(), false}};
  const dds_return_t code = dds_write(writer, &sample);
  if (code < 0 && code != DDS_RETCODE_TIMEOUT) return ros_failed("topic " + topic, code);
  return {};
}

}  // namespace
}  // namespace limn::nodes

extern "C" __attribute__((visibility("default"))) limn::exchange::RosPort* limn_open_ros_port(
    const limn::nodes::RosNetwork& network, std::string* problem) {
  auto port = std::make_unique<limn::nodes::DdsRosPort>();
  const limn::Status opened = port->open(network);
  if (opened) return port.release();
  *problem = opened.message();
  return nullptr;
}
