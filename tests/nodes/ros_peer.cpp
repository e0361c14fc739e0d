// A program that takes part in ROS 2 as far as its middleware is concerned, for tests: ros_peer DOMAIN
// publish|arm|images|hd|listen. It uses Cyclone DDS alone, prints "ready", and leaves when its input ends.
//
//   publish   each 20 ms: PoseStamped on /mocap/wand (best effort), /mocap/nan (every second one with a NaN)
//   and
//             /mocap/lost (its frame changes), and a TFMessage on /tf
//   arm       once, at the start, on /tf_static (kept for who comes late): hand as seen from arm; each 20 ms
//   on /tf
//             arm as seen from map, which moves by 1 m/s along x
//   images    each 20 ms, with the stamp of the present: an Image of 64 x 48 on /camera/image_raw (rgb8, rows
//   of
//             200 bytes, best effort) and on /camera/grey (mono8, reliable, stamp 0), a CompressedImage on
//             /camera/image_raw/compressed (the bytes of the file that JPEG names, see the environment), an
//             Image of an encoding that nobody knows on /camera/odd, one that becomes smaller on
//             /camera/shrinking
//   hd        30 times a second an Image of 1920 x 1080, rgb8, on /camera/image_raw
//   listen    prints each writer of topics that begin with rt/: "writer TOPIC TYPE RELIABILITY DURABILITY";
//   the bytes of
//             each PoseStamped on /limn/poses/badge: "cdr HEX"; each transform of /tf: "tf FRAME CHILD X Y Z
//             QX QY QZ QW"

#include <dds/dds.h>
#include <dds/ddsi/ddsi_serdata.h>
#include <poll.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <limits>
#include <string>
#include <thread>
#include <vector>

#include "ros_images.h"
#include "ros_poses.h"

namespace {

using PoseStamped = geometry_msgs_msg_dds__PoseStamped_;
using TransformStamped = geometry_msgs_msg_dds__TransformStamped_;
using TransformMessage = tf2_msgs_msg_dds__TFMessage_;

constexpr int k_depth = 10;
const dds_topic_descriptor_t* const k_pose = &geometry_msgs_msg_dds__PoseStamped__desc;
const dds_topic_descriptor_t* const k_transforms = &tf2_msgs_msg_dds__TFMessage__desc;

bool input_has_ended() {
  pollfd input{STDIN_FILENO, POLLIN, 0};
  return ::poll(&input, 1, 0) > 0;
}

dds_entity_t made(dds_entity_t entity) {
  if (entity >= 0) return entity;
  std::fprintf(stderr, "ros_peer: %s\n", dds_strretcode(entity));
  std::exit(1);
}

dds_qos_t* quality(dds_reliability_kind_t reliability) {
  dds_qos_t* qos = dds_create_qos();
  dds_qset_reliability(qos, reliability, DDS_SECS(1));
  dds_qset_durability(qos, DDS_DURABILITY_VOLATILE);
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, k_depth);
  return qos;
}

dds_entity_t writer(dds_entity_t participant,
                    const char* topic,
                    const dds_topic_descriptor_t* type,
                    dds_reliability_kind_t reliability) {
  const dds_entity_t at = made(dds_create_topic(participant, type, topic, nullptr, nullptr));
  return made(dds_create_writer(participant, at, quality(reliability), nullptr));
}

dds_entity_t reader(dds_entity_t participant, const char* topic, const dds_topic_descriptor_t* type) {
  const dds_entity_t at = made(dds_create_topic(participant, type, topic, nullptr, nullptr));
  return made(dds_create_reader(participant, at, quality(DDS_RELIABILITY_RELIABLE), nullptr));
}

PoseStamped pose_of(int i, const char* frame, double x) {
  return {{{100 + i / 50, static_cast<std::uint32_t>(i % 50) * 20'000'000}, const_cast<char*>(frame)},
          {{x, 2, 3}, {0.5, -0.5, 0.5, 0.5}}};
}

TransformStamped transform_of(int i, const char* child, double x) {
  const PoseStamped pose = pose_of(i, "map", x);
  return {pose.header, const_cast<char*>(child), {{x, 2, 3}, {0.5, -0.5, 0.5, 0.5}}};
}

void publish(dds_entity_t participant) {
  const dds_entity_t wand = writer(participant, "rt/mocap/wand", k_pose, DDS_RELIABILITY_BEST_EFFORT);
  const dds_entity_t nan = writer(participant, "rt/mocap/nan", k_pose, DDS_RELIABILITY_RELIABLE);
  const dds_entity_t lost = writer(participant, "rt/mocap/lost", k_pose, DDS_RELIABILITY_RELIABLE);
  const dds_entity_t transforms = writer(participant, "rt/tf", k_transforms, DDS_RELIABILITY_RELIABLE);
  for (int i = 0; !input_has_ended(); ++i) {
    const PoseStamped good = pose_of(i, "map", 1);
    const PoseStamped bad = pose_of(i, "map", i % 2 ? std::numeric_limits<double>::quiet_NaN() : 1);
    const PoseStamped astray = pose_of(i, i % 2 ? "odom" : "map", 1);
    std::array<TransformStamped, 2> list{transform_of(i, "other", 7), transform_of(i, "wand", -1)};
    const TransformMessage message{{2, 2, list.data(), false}};
    dds_write(wand, &good);
    dds_write(nan, &bad);
    dds_write(lost, &astray);
    dds_write(transforms, &message);
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
}

void write_transform(dds_entity_t writer, TransformStamped transform) {
  const TransformMessage message{{1, 1, &transform, false}};
  dds_write(writer, &message);
}

void publish_arm(dds_entity_t participant) {
  const dds_entity_t topic =
      made(dds_create_topic(participant, k_transforms, "rt/tf_static", nullptr, nullptr));
  dds_qos_t* kept = quality(DDS_RELIABILITY_RELIABLE);
  dds_qset_durability(kept, DDS_DURABILITY_TRANSIENT_LOCAL);  // tf2's StaticTransformBroadcaster
  dds_qset_history(kept, DDS_HISTORY_KEEP_LAST, 1);
  const dds_entity_t fixed = made(dds_create_writer(participant, topic, kept, nullptr));
  const dds_entity_t moving = writer(participant, "rt/tf", k_transforms, DDS_RELIABILITY_RELIABLE);
  TransformStamped hand = transform_of(0, "hand", 0.25);
  static char arm[] = "arm";
  hand.header.frame_id = arm;
  write_transform(fixed, hand);
  for (int i = 0; !input_has_ended(); ++i) {
    write_transform(moving, transform_of(i, "arm", 0.02 * i));
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
}

using Image = sensor_msgs_msg_dds__Image_;
using CompressedImage = sensor_msgs_msg_dds__CompressedImage_;
const dds_topic_descriptor_t* const k_image = &sensor_msgs_msg_dds__Image__desc;
const dds_topic_descriptor_t* const k_compressed = &sensor_msgs_msg_dds__CompressedImage__desc;

std_msgs_msg_dds__Header_ header_now() {
  const auto ns = std::chrono::duration_cast<std::chrono::nanoseconds>(
                      std::chrono::system_clock::now().time_since_epoch())
                      .count();
  static char frame[] = "camera";
  return {{static_cast<std::int32_t>(ns / 1'000'000'000), static_cast<std::uint32_t>(ns % 1'000'000'000)},
          frame};
}

// The bytes that tests/nodes/ros_camera_test.cpp expects.
void fill(std::vector<std::uint8_t>* bytes) {
  for (std::size_t i = 0; i < bytes->size(); ++i) (*bytes)[i] = static_cast<std::uint8_t>(i * 7 + i / 200);
}

Image image_of(const char* encoding,
               std::uint32_t width,
               std::uint32_t height,
               std::uint32_t step,
               std::vector<std::uint8_t>* bytes) {
  const auto size = static_cast<std::uint32_t>(bytes->size());
  return {
      header_now(), height, width, const_cast<char*>(encoding), 0, step, {size, size, bytes->data(), false}};
}

void publish_images(dds_entity_t participant) {
  const dds_entity_t raw = writer(participant, "rt/camera/image_raw", k_image, DDS_RELIABILITY_BEST_EFFORT);
  const dds_entity_t grey = writer(participant, "rt/camera/grey", k_image, DDS_RELIABILITY_RELIABLE);
  const dds_entity_t odd = writer(participant, "rt/camera/odd", k_image, DDS_RELIABILITY_RELIABLE);
  const dds_entity_t shrinking =
      writer(participant, "rt/camera/shrinking", k_image, DDS_RELIABILITY_RELIABLE);
  const dds_entity_t compressed =
      writer(participant, "rt/camera/image_raw/compressed", k_compressed, DDS_RELIABILITY_BEST_EFFORT);
  const dds_entity_t pose = writer(participant, "rt/camera/pose", k_pose, DDS_RELIABILITY_RELIABLE);
  const char* path = std::getenv("JPEG");
  std::ifstream file(path ? path : "", std::ios::binary);
  std::vector<std::uint8_t> jpeg{std::istreambuf_iterator<char>(file), {}};
  std::vector<std::uint8_t> bytes(std::size_t{200} * 48);
  fill(&bytes);
  static char format[] = "rgb8; jpeg compressed bgr8";
  for (int i = 0; !input_has_ended(); ++i) {
    const Image colours = image_of("rgb8", 64, 48, 200, &bytes);
    Image levels = image_of("mono8", 64, 48, 200, &bytes);
    levels.header.stamp = {0, 0};
    const Image unknown = image_of("hyperspectral8", 64, 48, 200, &bytes);
    const Image smaller = image_of("mono8", i < 50 ? 64 : 32, 48, 200, &bytes);
    const auto size = static_cast<std::uint32_t>(jpeg.size());
    const CompressedImage stored{header_now(), format, {size, size, jpeg.data(), false}};
    const PoseStamped place = pose_of(i, "map", 1);
    dds_write(raw, &colours);
    dds_write(grey, &levels);
    dds_write(odd, &unknown);
    dds_write(shrinking, &smaller);
    dds_write(compressed, &stored);
    dds_write(pose, &place);
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
}

void publish_hd(dds_entity_t participant) {
  const dds_entity_t raw = writer(participant, "rt/camera/image_raw", k_image, DDS_RELIABILITY_BEST_EFFORT);
  std::vector<std::uint8_t> bytes(std::size_t{1920} * 3 * 1080);
  fill(&bytes);
  for (auto due = std::chrono::steady_clock::now(); !input_has_ended();
       due += std::chrono::microseconds(33'333)) {
    const Image image = image_of("rgb8", 1920, 1080, 5760, &bytes);
    dds_write(raw, &image);
    std::this_thread::sleep_until(due);
  }
}

void print_writers(dds_entity_t publications) {
  void* sample = nullptr;
  dds_sample_info_t info;
  while (dds_take(publications, &sample, &info, 1, 1) == 1) {
    const auto& at = *static_cast<const dds_builtintopic_endpoint_t*>(sample);
    if (info.valid_data && std::string(at.topic_name).starts_with("rt/")) {
      dds_reliability_kind_t reliability{};
      dds_durability_kind_t durability{};
      dds_qget_reliability(at.qos, &reliability, nullptr);
      dds_qget_durability(at.qos, &durability);
      std::printf("writer %s %s %s %s\n", at.topic_name, at.type_name,
                  reliability == DDS_RELIABILITY_RELIABLE ? "reliable" : "best_effort",
                  durability == DDS_DURABILITY_VOLATILE ? "volatile" : "kept");
    }
    dds_return_loan(publications, &sample, 1);
    sample = nullptr;
  }
}

void print_bytes(dds_entity_t poses) {
  ddsi_serdata* data = nullptr;
  dds_sample_info_t info;
  while (dds_takecdr(poses, &data, 1, &info, DDS_ANY_STATE) == 1) {
    std::vector<unsigned char> bytes(ddsi_serdata_size(data));
    if (info.valid_data) {
      ddsi_serdata_to_ser(data, 0, bytes.size(), bytes.data());
      std::printf("cdr ");
      for (const unsigned char byte : bytes) std::printf("%02x", byte);
      std::printf("\n");
    }
    ddsi_serdata_unref(data);
  }
}

void print_transforms(dds_entity_t transforms) {
  void* sample = nullptr;
  dds_sample_info_t info;
  while (dds_take(transforms, &sample, &info, 1, 1) == 1) {
    const auto& list = static_cast<const TransformMessage*>(sample)->transforms;
    for (std::uint32_t i = 0; info.valid_data && i < list._length; ++i) {
      const TransformStamped& at = list._buffer[i];
      const auto& [p, q] = at.transform;
      std::printf("tf %s %s %.9f %.9f %.9f %.9f %.9f %.9f %.9f\n", at.header.frame_id, at.child_frame_id, p.x,
                  p.y, p.z, q.x, q.y, q.z, q.w);
    }
    dds_return_loan(transforms, &sample, 1);
    sample = nullptr;
  }
}

void listen(dds_entity_t participant) {
  const dds_entity_t publications =
      made(dds_create_reader(participant, DDS_BUILTIN_TOPIC_DCPSPUBLICATION, nullptr, nullptr));
  const dds_entity_t poses = reader(participant, "rt/limn/poses/badge", k_pose);
  const dds_entity_t transforms = reader(participant, "rt/tf", k_transforms);
  while (!input_has_ended()) {
    print_writers(publications);
    print_bytes(poses);
    print_transforms(transforms);
    std::fflush(stdout);
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
}

}  // namespace

int main(int count, char** words) {
  if (count != 3) return 2;
  const auto domain = static_cast<dds_domainid_t>(std::atoi(words[1]));
  made(dds_create_domain(domain,
                         "<CycloneDDS><Domain><General><Interfaces><NetworkInterface address=\"127.0.0.1\"/>"
                         "</Interfaces></General></Domain></CycloneDDS>"));
  const dds_entity_t participant = made(dds_create_participant(domain, nullptr, nullptr));
  std::puts("ready");
  std::fflush(stdout);
  const std::string what = words[2];
  if (what == "publish")
    publish(participant);
  else if (what == "arm")
    publish_arm(participant);
  else if (what == "images")
    publish_images(participant);
  else if (what == "hd")
    publish_hd(participant);
  else
    listen(participant);
}
