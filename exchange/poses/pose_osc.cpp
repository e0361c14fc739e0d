#include "exchange/poses/pose_osc.h"

#include <cmath>
#include <string_view>

#include "exchange/poses/osc_message.h"
#include "exchange/poses/pose_limits.h"

namespace limn::exchange {
namespace {

using View = std::span<const std::uint8_t>;

constexpr int k_deepest_bundle = 2;
constexpr std::size_t k_bundle_header = 16;  // "#bundle", its time
constexpr double k_largest_time_s = 1e12;

// A message of a pose, as its address says.
struct Form {
  std::string sensor;
  std::size_t numbers_at = 0;  // how many arguments stand before the numbers
  bool has_rotation = true, is_lost = false;
};

// The name before the last part of an address: NAME of /a/NAME/pose.
std::optional<std::string> name_before(std::string_view path, std::string_view last) {
  if (!path.ends_with(last)) return std::nullopt;
  path.remove_suffix(last.size());
  const auto slash = path.rfind('/');
  if (slash == std::string_view::npos || slash + 1 == path.size()) return std::nullopt;
  return std::string(path.substr(slash + 1));
}

// nullopt: the address is none of a pose.
Result<std::optional<Form>> form_of(const OscMessage& message) {
  const std::string& path = message.path;
  const bool is_lost = path == "/limn/lost" || path == "/limn/state/lost";
  if (is_lost || path == "/limn/pose" || path == "/limn/state/pose") {
    const std::string* name = message.arguments.empty() ? nullptr : message.arguments[0].text();
    if (!name || name->empty()) return error("OSC: {}: expected a name as text first, found none.", path);
    return std::optional(Form{*name, 1, true, is_lost});
  }
  if (path == "/limn/state/prototype") return std::optional(Form{"prototype"});
  if (path.starts_with("/limn/")) return std::optional<Form>();
  if (auto name = name_before(path, "/pose")) return std::optional(Form{*name});
  if (auto name = name_before(path, "/position")) return std::optional(Form{*name, 0, false});
  return std::optional<Form>();
}

Result<std::vector<double>> numbers_of(const OscMessage& message, const Form& form) {
  const std::size_t count = form.has_rotation ? 7 : 3;
  const std::span<const OscArgument> arguments = std::span(message.arguments).subspan(form.numbers_at);
  std::vector<double> numbers;
  for (const OscArgument& argument : arguments)
    if (const auto number = argument.number(); number && std::isfinite(*number)) numbers.push_back(*number);
  if (numbers.size() == arguments.size() && (numbers.size() == count || numbers.size() == count + 1))
    return numbers;
  return error("OSC: {}: expected {} finite numbers{}, found {} arguments.", printable(message.path), count,
               form.has_rotation ? ": x, y, z and a quaternion" : ": x, y, z", arguments.size());
}

Result<std::optional<ForeignPose>> pose_of(View bytes,
                                           std::optional<double> time_s,
                                           const PoseOscOptions& options) {
  LIMN_TRY(const OscMessage message, parsed_osc(bytes));
  LIMN_TRY(const std::optional<Form> form, form_of(message));
  if (!form) return std::optional<ForeignPose>();
  ForeignPose pose;
  pose.sensor = form->sensor;
  pose.is_lost = form->is_lost;
  pose.has_rotation = form->has_rotation;
  pose.time_s = time_s;
  if (pose.is_lost) return std::optional(pose);
  LIMN_TRY(const std::vector<double> numbers, numbers_of(message, *form));
  const std::string what = "OSC: " + printable(message.path);
  pose.feed_from_sensor.translation = options.unit_m * Eigen::Vector3d(numbers[0], numbers[1], numbers[2]);
  LIMN_TRY_STATUS(check_position(pose.feed_from_sensor.translation, what));
  if (pose.has_rotation) {
    const std::size_t w = options.has_real_part_last ? 6 : 3, x = options.has_real_part_last ? 3 : 4;
    LIMN_TRY(pose.feed_from_sensor.rotation,
             rotation_of(numbers[w], numbers[x], numbers[x + 1], numbers[x + 2], what));
  }
  if (numbers.size() == (pose.has_rotation ? 8U : 4U)) {
    if (std::abs(numbers.back()) > k_largest_time_s)
      return error("{}: expected a time in seconds, found {}.", what, numbers.back());
    pose.time_s = numbers.back();
  }
  return std::optional(pose);
}

std::uint32_t whole_at(View bytes, std::size_t at) {
  return static_cast<std::uint32_t>(bytes[at]) << 24 | static_cast<std::uint32_t>(bytes[at + 1]) << 16 |
         static_cast<std::uint32_t>(bytes[at + 2]) << 8 | bytes[at + 3];
}

// The bundle's time, seconds since 1900; nullopt: "at once".
std::optional<double> bundle_time_s(View bytes) {
  const std::uint32_t seconds = whole_at(bytes, 8), fraction = whole_at(bytes, 12);
  if (seconds == 0) return std::nullopt;
  return seconds + fraction / 4294967296.0;
}

Status read(View bytes,
            std::optional<double> time_s,
            const PoseOscOptions& options,
            int depth,
            std::vector<ForeignPose>* poses) {
  if (!is_osc_bundle(bytes)) {
    LIMN_TRY(std::optional<ForeignPose> pose, pose_of(bytes, time_s, options));
    if (pose && poses->size() == k_most_poses)
      return error("OSC: expected at most {} poses in a bundle, found more.", k_most_poses);
    if (pose) poses->push_back(std::move(*pose));
    return {};
  }
  if (depth == k_deepest_bundle)
    return error("OSC: expected bundles in at most {} others, found more.", k_deepest_bundle - 1);
  if (bytes.size() < k_bundle_header)
    return error("OSC: expected a bundle's time, found {} bytes.", bytes.size());
  const auto own_time_s = bundle_time_s(bytes);
  bytes = bytes.subspan(k_bundle_header);
  while (!bytes.empty()) {
    const std::size_t length = bytes.size() < 4 ? bytes.size() : whole_at(bytes, 0);
    if (bytes.size() < 4 || length == 0 || length > bytes.size() - 4)
      return error("OSC: expected a message of the bundle, found {} bytes for {}.", bytes.size(), length);
    LIMN_TRY_STATUS(read(bytes.subspan(4, length), own_time_s, options, depth + 1, poses));
    bytes = bytes.subspan(4 + length);
  }
  return {};
}

}  // namespace

Result<std::vector<ForeignPose>> poses_of_osc(std::span<const std::uint8_t> datagram,
                                              const PoseOscOptions& options) {
  if (datagram.size() > k_longest_poses)
    return error("OSC: expected a datagram of at most {} bytes, found {}.", k_longest_poses, datagram.size());
  std::vector<ForeignPose> poses;
  LIMN_TRY_STATUS(read(datagram, std::nullopt, options, 0, &poses));
  return poses;
}

}  // namespace limn::exchange
