#include "session/pose_feeds.h"

#include <algorithm>
#include <array>
#include <chrono>

#include "core/config.h"
#include "core/log.h"
#include "core/names.h"
#include "exchange/poses/pose_limits.h"

namespace limn::session {
namespace {

constexpr auto k_longest_reading = std::chrono::milliseconds(5);
constexpr double k_between_refusals_s = 1;
constexpr int k_most_thrown_away = 4096;  // datagrams of a flood in one call

// The names by which a trackers' file calls the scene's bodies, and the tracker's names for them.
std::map<std::string, tracker::FeedBody> named_bodies(const scene::Scene& scene) {
  std::map<std::string, tracker::FeedBody> out;
  for (const std::string& name : scene::body_names(scene)) out[name] = {"", name, std::nullopt};
  if (out.erase(scene::section_body()) > 0) out["section"] = {"", scene::section_body(), std::nullopt};
  if (out.erase(scene::pen_body()) > 0) out["pen"] = {"", scene::pen_body(), std::nullopt};
  for (std::size_t i = 0; i < scene.viewers.size(); ++i) {
    const scene::Viewer& viewer = scene.viewers[i];
    out.erase(scene::viewer_body(i));
    if (!viewer.marker && !viewer.is_tracked) continue;
    const tracker::FeedBody body{"", scene::viewer_body(i), std::nullopt, viewer.p_eye_marker.isZero()};
    out.emplace("viewer", body);
    out[fmt::format("viewer {}", i)] = body;
  }
  return out;
}

tracker::FeedBody read_body(const ConfigNode& node,
                            const std::string& sensor,
                            const std::map<std::string, tracker::FeedBody>& known) {
  const bool is_object = node.is_object();
  if (is_object) node.only({"body", "body_from_sensor"});
  const ConfigNode name = is_object ? node.at("body") : node;
  std::vector<std::string> names;
  for (const auto& [each, body] : known) names.push_back(each);
  const auto found = known.find(name.text());
  if (found == known.end()) {
    name.problem(
        fmt::format("expected a body of the scene ({}), found '{}'.", joined_names(names), name.text()));
    return {};
  }
  tracker::FeedBody body = found->second;
  body.sensor = sensor;
  if (is_object)
    if (const auto pose = node.find("body_from_sensor")) body.body_from_sensor = pose->pose();
  return body;
}

device::NetPlace read_place(const ConfigNode& node) {
  const auto place =
      device::net_place(node.is_number() ? std::to_string(node.integer()) : node.text(), "127.0.0.1");
  if (place) return *place;
  node.problem(place.message());
  return {};
}

FeedConfig read_feed(const ConfigNode& node, const std::map<std::string, tracker::FeedBody>& known) {
  node.only({"name", "protocol", "receive", "from", "bodies", "world_from_feed", "delay_ms", "left_handed",
             "unit", "quaternion", "frame"});
  FeedConfig feed;
  feed.setup.name = node.at("name").text();
  feed.decoder = exchange::read_decoder_options(node);
  const bool is_ros = feed.decoder.protocol == exchange::PoseProtocol::ros;
  if (!is_ros) feed.receive = read_place(node.at("receive"));
  if (const auto from = node.find("from")) {
    feed.from = device::numeric_address(from->text()).value_or("");
    if (is_ros) from->problem("expected this key without the protocol ros, found it with it.");
    if (feed.from.empty())
      from->problem(
          fmt::format("expected a numeric address such as 192.168.7.20, found '{}'.", from->text()));
  }
  if (const auto pose = node.find("world_from_feed")) feed.setup.world_from_feed = pose->pose();
  if (const auto delay = node.find("delay_ms")) feed.setup.delay_s = 1e-3 * delay->number();
  if (!(feed.setup.delay_s >= 0 && feed.setup.delay_s <= 1))
    node.at("delay_ms").problem("expected 0 to 1000, found another number.");
  const ConfigNode bodies = node.at("bodies");
  for (const std::string& sensor : bodies.keys()) {
    const tracker::FeedBody body = read_body(bodies.at(sensor), sensor, known);
    if (const Status checked = exchange::check_sensor(feed.decoder, sensor); !checked)
      bodies.at(sensor).problem(checked.message());
    const auto is_taken = [&](const tracker::FeedBody& other) { return other.body == body.body; };
    if (std::ranges::any_of(feed.setup.bodies, is_taken))
      bodies.at(sensor).problem("expected each body once, found it twice.");
    feed.setup.bodies.push_back(body);
    feed.decoder.sensors.insert(sensor);
  }
  if (feed.setup.bodies.empty()) bodies.problem("expected a sensor and its body, found none.");
  return feed;
}

}  // namespace

Result<std::vector<FeedConfig>> load_feeds(const std::filesystem::path& path, const scene::Scene& scene) {
  LIMN_TRY(const Config config, Config::load(path, "limn.trackers/1"));
  config.root().only({"schema", "trackers"});
  std::vector<FeedConfig> feeds;
  for (const ConfigNode& node : config.root().at("trackers").items()) {
    feeds.push_back(read_feed(node, named_bodies(scene)));
    for (std::size_t i = 0; i + 1 < feeds.size(); ++i)
      if (feeds[i].setup.name == feeds.back().setup.name)
        node.at("name").problem("expected another name for each tracker, found it twice.");
  }
  LIMN_TRY_STATUS(config.status());
  return feeds;
}

Result<std::unique_ptr<PoseFeeds>> PoseFeeds::open(const std::vector<FeedConfig>& configs,
                                                   exchange::RosPort* ros) {
  auto out = std::make_unique<PoseFeeds>();
  for (const FeedConfig& config : configs) {
    Feed feed{config.setup.name, config.from, exchange::PoseDecoder(config.decoder)};
    if (config.decoder.protocol == exchange::PoseProtocol::ros) {
      LIMN_CHECK(ros);
      LIMN_TRY(feed.subscription, ros->subscribe(config.decoder.topic));
      feed.ros = ros;
    } else {
      auto socket = device::UdpSocket::receiving(config.receive);
      if (!socket) return error("tracker {}: receive: {}", config.setup.name, socket.message());
      feed.socket = std::move(*socket);
    }
    log_info("live: receives poses of tracker {} ({}) at {}", feed.name,
             exchange::k_pose_protocols.text(config.decoder.protocol),
             feed.ros ? config.decoder.topic
                      : fmt::format("{}, UDP port {}", config.receive.host, feed.socket->port()));
    out->feeds_.push_back(std::move(feed));
  }
  return out;
}

FeedInput PoseFeeds::received(Stamp at, bool is_real_time) {
  FeedInput out;
  out.poses.resize(feeds_.size());
  for (std::size_t i = 0; i < feeds_.size(); ++i) {
    FeedInput one;
    one.poses.resize(1);
    const Stamp until = now() + k_longest_reading / static_cast<int>(feeds_.size());
    receive(at, is_real_time, until, &feeds_[i], &one);
    feeds_[i].read_at = at;
    out.poses[i] = std::move(one.poses[0]);
    out.notes.insert(out.notes.end(), one.notes.begin(), one.notes.end());
  }
  return out;
}

std::optional<PoseFeeds::Arrival> PoseFeeds::next_arrival(Feed* feed) {
  if (feed->ros) {
    const auto message = feed->ros->next(feed->subscription);
    if (!message) return std::nullopt;
    return Arrival{feed->decoder.decoded(message->poses), seconds_between(message->arrived_at, now())};
  }
  std::array<std::uint8_t, exchange::k_longest_poses + 1> bytes{};
  const auto datagram = feed->socket->next(bytes);
  if (!datagram) return std::nullopt;
  if (!feed->from.empty() && datagram->from != feed->from)
    return Arrival{
        error("expected datagrams of {} only (\"from\"), found one of {}", feed->from, datagram->from)};
  const std::span<const std::uint8_t> received(bytes.data(), std::min(datagram->length, bytes.size()));
  return Arrival{feed->decoder.decoded(received), datagram->age_s};
}

void PoseFeeds::receive(Stamp at, bool is_real_time, Stamp until, Feed* feed, FeedInput* out) {
  int count = 0;
  for (; count < k_most_at_once && now() < until; ++count) {
    auto arrival = next_arrival(feed);
    if (!arrival) break;
    if (!arrival->poses) {
      refuse(arrival->poses.message(), at, feed, out);
      continue;
    }
    // On a virtual rig that is slow the session's clock goes slower than the wall's for a while.
    const Stamp arrived_at =
        is_real_time ? std::clamp(shifted(at, -arrival->age_s), feed->read_at.value_or(Stamp{}), at) : at;
    for (ForeignPose& pose : *arrival->poses) out->poses[0].push_back({std::move(pose), arrived_at});
  }
  if (const std::string problem = feed->decoder.take_problem(); !problem.empty())
    refuse(problem, at, feed, out);
  if (count < k_most_at_once) return;
  int thrown_away = 0;
  while (thrown_away < k_most_thrown_away && now() < until && next_arrival(feed)) ++thrown_away;
  if (thrown_away > 0)
    refuse(fmt::format("expected at most {} messages in a frame, found {} more, which are left out",
                       k_most_at_once, thrown_away),
           at, feed, out);
}

void PoseFeeds::refuse(const std::string& why, Stamp at, Feed* feed, FeedInput* out) {
  if (feed->refused_at && seconds_between(*feed->refused_at, at) < k_between_refusals_s) {
    ++feed->unreported;
    return;
  }
  out->notes.push_back(
      fmt::format("tracker {}: {}{}", feed->name, why,
                  feed->unreported > 0 ? fmt::format(" ({} more refused meanwhile)", feed->unreported) : ""));
  feed->refused_at = at;
  feed->unreported = 0;
}

}  // namespace limn::session
