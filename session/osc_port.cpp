#include "session/osc_port.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>

#include "core/log.h"

namespace limn::session {
namespace {

constexpr auto k_longest_receiving = std::chrono::milliseconds(5);
constexpr auto k_between_refusals = std::chrono::seconds(1);
constexpr auto k_between_all = std::chrono::seconds(1);
constexpr float k_same_mm = 0.05F, k_same_turn = 0.0003F;  // mm; quaternion element, 0.03 degrees

std::vector<OscValue> values_of(const Pose& pose) {
  const Eigen::Vector3f mm = (1e3 * pose.translation).cast<float>();
  Eigen::Quaternionf q = pose.rotation.cast<float>();
  if (q.w() < 0) q.coeffs() *= -1;
  return {mm.x(), mm.y(), mm.z(), q.w(), q.x(), q.y(), q.z()};
}

// Poses that differ only by tracking noise count as the same.
bool is_same(const std::vector<OscValue>& a, const std::vector<OscValue>& b) {
  if (a.size() != b.size()) return false;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const float *x = std::get_if<float>(&a[i]), *y = std::get_if<float>(&b[i]);
    const float limit = i + 4 < a.size() ? k_same_mm : k_same_turn;
    if (x && y ? !(std::abs(*x - *y) <= limit) : a[i] != b[i]) return false;
  }
  return true;
}

}  // namespace

Result<OscPort> OscPort::open(const std::string& receive_at,
                              const std::string& send_to,
                              const std::string& from) {
  OscPort out;
  const auto named = [](const char* option, const Error& problem) {
    return Error{fmt::format("{}: {}", option, problem.message), problem.wrong_usage};
  };
  if (!from.empty() && receive_at.empty())
    return usage_error("--osc-from: expected --osc with it, found none.");
  const auto sender = device::numeric_address(from);
  if (!from.empty() && !sender)
    return usage_error("--osc-from: expected a numeric address such as 192.168.7.20, found '{}'.", from);
  out.from_ = sender.value_or("");
  if (!receive_at.empty()) {
    const auto place = device::net_place(receive_at, "127.0.0.1", true);
    if (!place) return named("--osc", place.error());
    auto socket = device::UdpSocket::receiving(*place);
    if (!socket) return named("--osc", socket.error());
    out.input_ = std::move(*socket);
    log_info("live: receives OSC at {}, UDP port {}", place->host, out.port());
    if (from.empty() && !device::is_loopback(place->host))
      log_warning(
          "live: OSC asks nobody for a PIN: every program that reaches {} can change the session. "
          "--osc-from ADDRESS accepts one machine only.",
          place->host);
  }
  if (!send_to.empty()) {
    const auto place = device::net_place(send_to, "127.0.0.1");
    if (!place) return named("--osc-to", place.error());
    auto socket = device::UdpSocket::sending(*place);
    if (!socket) return named("--osc-to", socket.error());
    out.output_ = std::move(*socket);
  }
  return out;
}

void OscPort::apply_edits(Session* session, Telemetry* telemetry, Stamp at) {
  if (!input_) return;
  std::array<std::uint8_t, k_longest_osc + 1> bytes{};
  const Stamp begun = now();
  for (int i = 0; i < k_most_at_once && now() - begun < k_longest_receiving; ++i) {
    const auto datagram = input_->next(bytes);
    if (!datagram) break;
    if (!from_.empty() && datagram->from != from_) {
      refuse(
          fmt::format("expected messages of {} only (--osc-from), found one of {}.", from_, datagram->from),
          telemetry, at);
      continue;
    }
    const auto edit = edit_of_osc({bytes.data(), std::min(datagram->length, bytes.size())});
    const Status done = edit ? session->edit(*edit, "osc", at) : Status(edit.error());
    if (!done) refuse(done.message(), telemetry, at);
  }
  if (unreported_ > 0 && at - *refused_at_ >= k_between_refusals) refuse("further messages", telemetry, at);
}

void OscPort::refuse(const std::string& why, Telemetry* telemetry, Stamp at) {
  if (refused_at_ && at - *refused_at_ < k_between_refusals) {
    ++unreported_;
    return;
  }
  const std::string more = unreported_ > 0 ? fmt::format(" ({} more refused meanwhile)", unreported_) : "";
  telemetry->note(at, fmt::format("OSC refused: {}{}", why, more));
  log_warning("live: OSC: {}{}", why, more);
  refused_at_ = at;
  unreported_ = 0;
}

void OscPort::publish_state(const Session& session, Stamp at) {
  if (!output_) return;
  if (!sent_all_at_ || at - *sent_all_at_ >= k_between_all) {
    sent_all_at_ = at;
    sent_.clear();
  }
  const scene::ShowState& show_state = session.show_state();
  const scene::PosedScene& posed = session.composed().posed;
  const auto put_all = [&](const std::string& name, std::vector<OscValue> values) {
    put(name, "/limn/state/" + name, std::move(values));
  };
  const Pose from_world = posed.world_from_prototype ? posed.world_from_prototype->inverse() : Pose{};
  if (posed.world_from_prototype) put_all("prototype", values_of(*posed.world_from_prototype));
  const std::vector<scene::Slot>& slots = session.setup().scene.slots;
  for (std::size_t i = 0; i < slots.size(); ++i) {
    const std::string& slot = slots[i].name;
    put("variant " + slot, "/limn/state/variant", {slot, show_state.slots[i].variant});
    const scene::PosedPart* shown = nullptr;
    for (const scene::PosedPart& part : posed.parts)
      if (part.slot == slot) shown = &part;
    std::vector<OscValue> values = {slot};
    if (shown)
      for (OscValue& value : values_of(from_world * shown->world_from_part))
        values.push_back(std::move(value));
    put("pose " + slot, shown ? "/limn/state/pose" : "/limn/state/lost", std::move(values));
  }
  const int looks = static_cast<int>(show_state.looks.size());
  for (int i = 0; i < std::max(1, looks); ++i)
    put(fmt::format("looks {}", i), "/limn/state/looks",
        {i, looks, looks > 0 ? show_state.looks[static_cast<std::size_t>(i)].name : std::string()});
  put_all("look", {show_state.look});
  put_all("blackout", {static_cast<int>(show_state.blackout)});
  put_all("freeze", {static_cast<int>(show_state.frozen)});
  put_all("marker_states", {static_cast<int>(show_state.marker_states)});
  put_all("screen", {scene::screen_names()[static_cast<std::size_t>(show_state.screen)]});
  for (const scene::Output& output : show_state.screens)
    put("output " + output.name, "/limn/state/output",
        {output.name, scene::screen_names()[static_cast<std::size_t>(output.shows)]});
  put_all("viewer", {show_state.viewer});
}

void OscPort::put(const std::string& key, const std::string& path, std::vector<OscValue> arguments) {
  const auto known = sent_.find(key);
  if (known != sent_.end() && is_same(known->second, arguments)) return;
  output_->send(osc_message(path, arguments));
  sent_[key] = std::move(arguments);
}

}  // namespace limn::session
