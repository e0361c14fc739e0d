#include "nodes/dds/qualities.h"

#include <dlfcn.h>
#include <fmt/format.h>

#include <filesystem>

#include "limn_room.h"

namespace limn::nodes {
namespace {

namespace fs = std::filesystem;

constexpr dds_duration_t k_longest_write = DDS_SECS(2);
constexpr int32_t k_most_waiting = 32;  // orders or answers at a reader; then their writers wait
// At least the configured SynchronousDeliveryPriorityThreshold: the receiving thread itself delivers such
// samples.
constexpr int32_t k_direct_delivery = 1;

Qos common_qos(Topic topic) {
  Qos qos(dds_create_qos());
  if (is_directed(topic) && is_reliable(topic))
    dds_qset_history(qos.get(), DDS_HISTORY_KEEP_ALL, 0);
  else
    dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, 1);
  if (is_reliable(topic)) {
    dds_qset_reliability(qos.get(), DDS_RELIABILITY_RELIABLE, k_longest_write);
  } else {
    dds_qset_reliability(qos.get(), DDS_RELIABILITY_BEST_EFFORT, 0);
    // A screen's image is large, and nothing else may wait for it.
    if (topic != Topic::screen_image) dds_qset_transport_priority(qos.get(), k_direct_delivery);
  }
  if (is_reliable(topic) && !is_directed(topic)) {
    dds_qset_durability(qos.get(), DDS_DURABILITY_TRANSIENT_LOCAL);
    dds_qset_durability_service(qos.get(), 0, DDS_HISTORY_KEEP_LAST, 1, DDS_LENGTH_UNLIMITED,
                                DDS_LENGTH_UNLIMITED, DDS_LENGTH_UNLIMITED);
  }
  return qos;
}

// The folder with the plugins: that of the engine, or one below it that is named after the engine (Debian).
fs::path plugin_folder() {
  constexpr const char* k_plugin = "libdds_security_auth.so";
  Dl_info info{};
  if (::dladdr(reinterpret_cast<void*>(&dds_create_participant), &info) == 0 || !info.dli_fname) return {};
  std::error_code ignored;
  fs::path folder = fs::weakly_canonical(info.dli_fname, ignored).parent_path();
  if (fs::exists(folder / k_plugin, ignored)) return folder;
  for (const auto& entry : fs::directory_iterator(folder, ignored)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with("libddsc") && fs::exists(entry.path() / k_plugin, ignored)) return entry.path();
  }
  return {};
}

void set_plugin(const std::string& kind,
                const fs::path& library,
                const std::string& functions,
                dds_qos_t* qos) {
  dds_qset_prop(qos, fmt::format("dds.sec.{}.library.path", kind).c_str(), library.c_str());
  dds_qset_prop(qos, fmt::format("dds.sec.{}.library.init", kind).c_str(), ("init_" + functions).c_str());
  dds_qset_prop(qos, fmt::format("dds.sec.{}.library.finalize", kind).c_str(),
                ("finalize_" + functions).c_str());
}

}  // namespace

TopicDescription description_of(Topic topic) {
  switch (topic) {
    case Topic::offer:
      return {"limn_v1_offer", &limn_v1_Offer_desc};
    case Topic::setup:
      return {"limn_v1_setup", &limn_v1_Setup_desc};
    case Topic::moment:
      return {"limn_v1_moment", &limn_v1_Moment_desc};
    case Topic::screen_image:
      return {"limn_v1_screen_image", &limn_v1_ScreenImage_desc};
    case Topic::clock_request:
      return {"limn_v1_clock_request", &limn_v1_ClockRequest_desc};
    case Topic::clock_answer:
      return {"limn_v1_clock_answer", &limn_v1_ClockAnswer_desc};
    case Topic::order:
      return {"limn_v1_order", &limn_v1_Order_desc};
    case Topic::answer:
      return {"limn_v1_answer", &limn_v1_Answer_desc};
    case Topic::health:
      return {"limn_v1_health", &limn_v1_Health_desc};
    case Topic::detections:
      return {"limn_v1_detections", &limn_v1_Detections_desc};
  }
  return {};
}

Qos writer_qos(Topic topic, double liveliness_s) {
  Qos qos = common_qos(topic);
  if (topic == Topic::offer)
    dds_qset_liveliness(qos.get(), DDS_LIVELINESS_AUTOMATIC, static_cast<dds_duration_t>(liveliness_s * 1e9));
  return qos;
}

Qos reader_qos(Topic topic) {
  Qos qos = common_qos(topic);
  dds_qset_ignorelocal(qos.get(), DDS_IGNORELOCAL_PARTICIPANT);
  if (is_directed(topic) && is_reliable(topic))
    dds_qset_resource_limits(qos.get(), k_most_waiting, DDS_LENGTH_UNLIMITED, DDS_LENGTH_UNLIMITED);
  return qos;
}

Qos partition_qos(const Sender& receiver) {
  Qos qos(dds_create_qos());
  dds_qset_partition1(qos.get(), fmt::format("{}/{:016x}", receiver.node, receiver.run).c_str());
  return qos;
}

Result<Qos> secure_qos(const RoomKeys& keys) {
  const fs::path plugins = plugin_folder();
  if (plugins.empty())
    return error(
        "room: expected the plugins of DDS Security (libdds_security_auth.so) beside Cyclone DDS, found "
        "none. Install "
        "Debian's package of Cyclone DDS.");
  Qos qos(dds_create_qos());
  set_plugin("auth", plugins / "libdds_security_auth.so", "authentication", qos.get());
  set_plugin("access", plugins / "libdds_security_ac.so", "access_control", qos.get());
  set_plugin("crypto", plugins / "libdds_security_crypto.so", "crypto", qos.get());
  const auto set = [&qos](const char* name, const std::string& document) {
    dds_qset_prop(qos.get(), name, ("data:," + document).c_str());
  };
  set("dds.sec.auth.identity_ca", keys.authority);
  set("dds.sec.auth.identity_certificate", keys.certificate);
  set("dds.sec.auth.private_key", keys.private_key);
  set("dds.sec.access.permissions_ca", keys.authority);
  set("dds.sec.access.governance", keys.governance);
  set("dds.sec.access.permissions", keys.permissions);
  return qos;
}

}  // namespace limn::nodes
