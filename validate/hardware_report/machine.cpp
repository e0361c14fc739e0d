#include "validate/hardware_report/machine.h"

#include <fmt/format.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <nlohmann/json.hpp>
#include <thread>

#include "core/file.h"

namespace limn::validate {

using nlohmann::ordered_json;

ordered_json machine_json() {
  ordered_json json;
  utsname system{};
  uname(&system);
  json["system"] = fmt::format("{} {} {}", system.sysname, system.release, system.machine);
  if (const auto release = read_file("/etc/os-release")) {
    const std::string key = "PRETTY_NAME=\"";
    if (const std::size_t at = release->find(key); at != std::string::npos)
      json["release"] =
          release->substr(at + key.size(), release->find('"', at + key.size()) - at - key.size());
  }
  if (const auto processor = read_file("/proc/cpuinfo")) {
    const std::size_t at = processor->find("model name");
    const std::size_t colon = at == std::string::npos ? at : processor->find(": ", at);
    if (colon != std::string::npos)
      json["processor"] = processor->substr(colon + 2, processor->find('\n', colon) - colon - 2);
  }
  json["threads"] = std::thread::hardware_concurrency();
  const double bytes =
      static_cast<double>(sysconf(_SC_PHYS_PAGES)) * static_cast<double>(sysconf(_SC_PAGESIZE));
  json["memory"] = fmt::format("{:.1f} GiB", bytes / (1 << 30));
  return json;
}

ordered_json findings_json(std::span<const Finding> findings) {
  ordered_json json = ordered_json::array();
  for (const Finding& finding : findings) {
    const char* const state = finding.state == Finding::State::works   ? "works"
                              : finding.state == Finding::State::fails ? "fails"
                                                                       : "note";
    json.push_back({{"area", finding.area},
                    {"name", finding.name},
                    {"state", state},
                    {"text", finding.text},
                    {"advice", finding.advice}});
  }
  return json;
}

std::vector<std::string> odd_in(std::span<const Finding> findings) {
  std::vector<std::string> odd;
  for (const Finding& finding : findings)
    if (finding.state == Finding::State::fails || (finding.area == "gl" && !finding.advice.empty()))
      odd.push_back(fmt::format("{} {}: {}{}{}", finding.area, finding.name, finding.text,
                                finding.advice.empty() ? "" : ". ", finding.advice));
  return odd;
}

}  // namespace limn::validate
