#include "exchange/poses/posi_stage_net.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <optional>

#include "exchange/poses/pose_limits.h"

namespace limn::exchange {
namespace {

using Bytes = std::vector<std::uint8_t>;
using View = std::span<const std::uint8_t>;

constexpr std::uint16_t k_data = 0x6755, k_info = 0x6756;
constexpr std::uint16_t k_header = 0, k_data_list = 1, k_info_system = 1, k_info_list = 2, k_name = 0;
constexpr std::uint16_t k_position = 0, k_orientation = 2, k_status = 3, k_timestamp = 6;
constexpr std::size_t k_header_bytes = 12, k_chunk_header_bytes = 4;
constexpr std::uint8_t k_version_high = 2, k_version_low = 3;
constexpr std::size_t k_longest_packet = 1500, k_longest_name = 60;
constexpr double k_most_turn = 1e3;  // radians; a longer vector is a mistake

std::uint64_t whole(View bytes, std::size_t count) {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < count; ++i) value |= static_cast<std::uint64_t>(bytes[i]) << (8 * i);
  return value;
}

struct Chunk {
  std::uint16_t id = 0;
  View content;
};

// The chunk that begins the bytes, which are shortened by it.
Result<Chunk> first_chunk(View* bytes) {
  if (bytes->size() < k_chunk_header_bytes)
    return error("PosiStageNet: expected a chunk's header of 4 bytes, found {} bytes.", bytes->size());
  const auto header = static_cast<std::uint32_t>(whole(*bytes, k_chunk_header_bytes));
  const std::size_t length = header >> 16 & 0x7fff;
  *bytes = bytes->subspan(k_chunk_header_bytes);
  if (length > bytes->size())
    return error("PosiStageNet: expected the {} bytes of chunk {:04X}, found {}.", length, header & 0xffff,
                 bytes->size());
  const Chunk chunk{static_cast<std::uint16_t>(header & 0xffff), bytes->first(length)};
  *bytes = bytes->subspan(length);
  return chunk;
}

Result<std::vector<Chunk>> chunks_in(View bytes) {
  std::vector<Chunk> chunks;
  while (!bytes.empty()) {
    LIMN_TRY(const Chunk chunk, first_chunk(&bytes));
    if (chunks.size() == k_most_poses)
      return error("PosiStageNet: expected at most {} chunks beside each other, found more.", k_most_poses);
    chunks.push_back(chunk);
  }
  return chunks;
}

// Three numbers of 32 bits; a longer chunk is of a later version, whose further numbers are skipped.
Result<Eigen::Vector3d> vector_in(const Chunk& chunk, std::uint16_t tracker) {
  if (chunk.content.size() < 12)
    return error("PosiStageNet: tracker {}: expected 12 bytes of three numbers, found {}.", tracker,
                 chunk.content.size());
  Eigen::Vector3d out;
  for (std::size_t i = 0; i < 3; ++i)
    out[static_cast<int>(i)] =
        std::bit_cast<float>(static_cast<std::uint32_t>(whole(chunk.content.subspan(4 * i), 4)));
  return out;
}

Result<bool> is_lost_by(const Chunk& status, std::uint16_t tracker) {
  if (status.content.size() < 4)
    return error("PosiStageNet: tracker {}: expected 4 bytes of validity, found {}.", tracker,
                 status.content.size());
  const float validity = std::bit_cast<float>(static_cast<std::uint32_t>(whole(status.content, 4)));
  if (!std::isfinite(validity))
    return error("PosiStageNet: tracker {}: expected a finite validity, found {}.", tracker, validity);
  return validity <= 0;
}

// nullopt: a tracker without a position.
Result<std::optional<ForeignPose>> pose_in(const Chunk& tracker, double sent_at_s) {
  LIMN_TRY(const std::vector<Chunk> fields, chunks_in(tracker.content));
  ForeignPose pose;
  pose.sensor = std::to_string(tracker.id);
  pose.has_rotation = false;
  pose.time_s = sent_at_s;
  bool has_position = false;
  const std::string what = "PosiStageNet: tracker " + pose.sensor;
  for (const Chunk& field : fields) {
    if (field.id == k_position) {
      LIMN_TRY(pose.feed_from_sensor.translation, vector_in(field, tracker.id));
      LIMN_TRY_STATUS(check_position(pose.feed_from_sensor.translation, what));
      has_position = true;
    } else if (field.id == k_orientation) {
      LIMN_TRY(const Eigen::Vector3d turn, vector_in(field, tracker.id));
      if (!(turn.norm() <= k_most_turn))
        return error("{}: expected an orientation in radians, found {}, {}, {}.", what, turn.x(), turn.y(),
                     turn.z());
      pose.feed_from_sensor.rotation = exp_rotation(turn);
      pose.has_rotation = true;
    } else if (field.id == k_status) {
      LIMN_TRY(pose.is_lost, is_lost_by(field, tracker.id));
    } else if (field.id == k_timestamp && field.content.size() >= 8) {
      pose.time_s = 1e-6 * static_cast<double>(whole(field.content, 8));
    }
  }
  if (!has_position) return std::optional<ForeignPose>();
  pose.feed_from_sensor = mirrored(pose.feed_from_sensor);
  return std::optional(pose);
}

Status read_header(View content, PsnPacket* packet) {
  if (content.size() < k_header_bytes)
    return error("PosiStageNet: expected a packet header of {} bytes, found {}.", k_header_bytes,
                 content.size());
  if (content[8] != k_version_high)
    return error("PosiStageNet: expected version 2, found {}.{}.", content[8], content[9]);
  packet->sent_at_s = 1e-6 * static_cast<double>(whole(content, 8));
  packet->frame = content[10];
  packet->packets_of_frame = content[11];
  return {};
}

Status read_names(View list, PsnPacket* packet) {
  LIMN_TRY(const std::vector<Chunk> trackers, chunks_in(list));
  for (const Chunk& tracker : trackers) {
    LIMN_TRY(const std::vector<Chunk> fields, chunks_in(tracker.content));
    for (const Chunk& field : fields)
      if (field.id == k_name)
        packet->names[tracker.id] = printable_name(
            std::string(field.content.begin(), std::find(field.content.begin(), field.content.end(), 0)));
  }
  return {};
}

Status read_poses(View list, PsnPacket* packet) {
  LIMN_TRY(const std::vector<Chunk> trackers, chunks_in(list));
  for (const Chunk& tracker : trackers) {
    LIMN_TRY(std::optional<ForeignPose> pose, pose_in(tracker, packet->sent_at_s));
    if (pose) packet->poses.push_back(std::move(*pose));
  }
  return {};
}

void append(Bytes* bytes, std::uint64_t value, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) bytes->push_back(static_cast<std::uint8_t>(value >> (8 * i)));
}

void append(Bytes* bytes, const Bytes& more) { bytes->insert(bytes->end(), more.begin(), more.end()); }

Bytes chunk(std::uint16_t id, const Bytes& content, bool has_chunks) {
  Bytes bytes;
  append(&bytes, id | content.size() << 16 | static_cast<std::uint64_t>(has_chunks) << 31,
         k_chunk_header_bytes);
  append(&bytes, content);
  return bytes;
}

Bytes floats(const Eigen::Vector3d& values) {
  Bytes bytes;
  for (const double value : values)
    append(&bytes, std::bit_cast<std::uint32_t>(static_cast<float>(value)), 4);
  return bytes;
}

Bytes data_chunk(const PsnTracker& tracker) {
  const Pose pose = mirrored(tracker.room_from_sensor);
  Bytes validity, fields;
  append(&validity, std::bit_cast<std::uint32_t>(tracker.is_lost ? 0.0F : 1.0F), 4);
  append(&fields, chunk(k_position, floats(pose.translation), false));
  append(&fields, chunk(k_orientation, floats(log_rotation(pose.rotation)), false));
  append(&fields, chunk(k_status, validity, false));
  return chunk(tracker.number, fields, true);
}

Bytes name_chunk(const PsnTracker& tracker) {
  const std::string name = tracker.name.substr(0, k_longest_name);
  return chunk(tracker.number, chunk(k_name, Bytes(name.begin(), name.end()), false), true);
}

Bytes header_chunk(double at_s, std::uint8_t frame, std::size_t packets) {
  Bytes header;
  append(&header, static_cast<std::uint64_t>(std::llround(std::max(0.0, at_s) * 1e6)), 8);
  append(&header, {k_version_high, k_version_low, frame, static_cast<std::uint8_t>(packets)});
  return chunk(k_header, header, false);
}

// Packets that hold the trackers' chunks after `before` and a list's header, as many as needed.
std::vector<Bytes> packets(std::uint16_t kind,
                           std::uint16_t list,
                           const std::vector<Bytes>& trackers,
                           const Bytes& before,
                           double at_s,
                           std::uint8_t frame) {
  const std::size_t overhead = 3 * k_chunk_header_bytes + k_header_bytes + before.size();
  std::vector<Bytes> lists(1);
  for (const Bytes& tracker : trackers) {
    if (overhead + lists.back().size() + tracker.size() > k_longest_packet) lists.emplace_back();
    append(&lists.back(), tracker);
  }
  std::vector<Bytes> out;
  for (const Bytes& each : lists) {
    Bytes content = header_chunk(at_s, frame, lists.size());
    append(&content, before);
    append(&content, chunk(list, each, true));
    out.push_back(chunk(kind, content, true));
  }
  return out;
}

}  // namespace

Result<PsnPacket> psn_packet(std::span<const std::uint8_t> datagram) {
  if (datagram.size() > k_longest_poses)
    return error("PosiStageNet: expected a packet of at most {} bytes, found {}.", k_longest_poses,
                 datagram.size());
  LIMN_TRY(const Chunk root, first_chunk(&datagram));
  if (root.id != k_data && root.id != k_info)
    return error("PosiStageNet: expected a packet 6755 or 6756 of version 2, found {:04X}.", root.id);
  LIMN_TRY(const std::vector<Chunk> parts, chunks_in(root.content));
  if (parts.empty() || parts[0].id != k_header)
    return error("PosiStageNet: expected the packet's header first, found none.");
  PsnPacket packet;
  LIMN_TRY_STATUS(read_header(parts[0].content, &packet));
  for (const Chunk& part : std::span(parts).subspan(1)) {
    if (root.id == k_data && part.id == k_data_list) LIMN_TRY_STATUS(read_poses(part.content, &packet));
    if (root.id == k_info && part.id == k_info_list) LIMN_TRY_STATUS(read_names(part.content, &packet));
  }
  return packet;
}

std::vector<Bytes> psn_data(std::span<const PsnTracker> trackers, double at_s, std::uint8_t frame) {
  std::vector<Bytes> chunks;
  for (const PsnTracker& tracker : trackers) chunks.push_back(data_chunk(tracker));
  return packets(k_data, k_data_list, chunks, {}, at_s, frame);
}

std::vector<Bytes> psn_info(std::span<const PsnTracker> trackers, double at_s, std::uint8_t frame) {
  const std::string system = "Limn";
  std::vector<Bytes> chunks;
  for (const PsnTracker& tracker : trackers) chunks.push_back(name_chunk(tracker));
  return packets(k_info, k_info_list, chunks,
                 chunk(k_info_system, Bytes(system.begin(), system.end()), false), at_s, frame);
}

}  // namespace limn::exchange
