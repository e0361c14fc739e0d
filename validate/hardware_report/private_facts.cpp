#include "validate/hardware_report/private_facts.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>
#include <netpacket/packet.h>
#include <pwd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdlib>
#include <sstream>
#include <string>
#include <vector>

#include "core/file.h"
#include "device/address.h"

namespace limn::validate {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> split(const std::string& text, const std::string& separators) {
  std::vector<std::string> parts;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.size(), text.find_first_of(separators, at));
    if (end > at) parts.push_back(text.substr(at, end - at));
    at = end + 1;
  }
  return parts;
}

bool has_digit(const std::string& text) {
  return std::ranges::any_of(text, [](unsigned char c) { return std::isdigit(c); });
}

void add_host(PrivateWords* words, const std::string& name) {
  words->add(name, "(machine)");
  words->add(name.substr(0, name.find('.')), "(machine)");
}

// The names that /etc/hosts gives this machine, and the network's name.
void add_host_names(PrivateWords* words, const fs::path& root) {
  std::array<char, 256> host{};
  if (gethostname(host.data(), host.size() - 1) == 0) add_host(words, host.data());
  for (const auto& [file, is_hosts] :
       {std::pair{"etc/hosts", true}, {"etc/resolv.conf", false}, {"etc/hostname", false}}) {
    const auto text = read_file(root / file);
    if (!text) continue;
    for (const std::string& line : split(*text, "\n")) {
      std::vector<std::string> parts = split(line.substr(0, line.find('#')), " \t");
      if (parts.empty()) continue;
      const bool is_named = is_hosts || parts[0] == "search" || parts[0] == "domain";
      if (parts[0] == "nameserver" && parts.size() > 1) words->add(parts[1], "(address)");
      if (parts.size() == 1) add_host(words, parts[0]);
      if (is_named && !parts[0].starts_with("ff0"))
        for (std::size_t i = 1; i < parts.size(); ++i)
          if (!parts[i].starts_with("ip6-")) add_host(words, parts[i]);
    }
  }
}

void add_user(PrivateWords* words) {
  for (const char* variable : {"USER", "LOGNAME", "SUDO_USER"})
    if (const char* const name = std::getenv(variable)) words->add(name, "(user)");
  const auto add_home = [words](const std::string& folder) {
    if (folder.size() > 1)
      words->add(folder.back() == '/' ? folder.substr(0, folder.size() - 1) : folder, "(home)");
  };
  if (const char* const home = std::getenv("HOME")) add_home(home);
  const passwd* const user = getpwuid(getuid());
  if (!user) return;
  words->add(user->pw_name, "(user)");
  add_home(user->pw_dir);
  const std::string full = user->pw_gecos ? user->pw_gecos : "";
  const std::string name = full.substr(0, full.find(','));
  words->add(name, "(user)");
  for (const std::string& part : split(name, " ")) words->add(part, "(user)");
}

void add_addresses(PrivateWords* words) {
  ifaddrs* all = nullptr;
  if (getifaddrs(&all) != 0) return;
  for (const ifaddrs* one = all; one; one = one->ifa_next) {
    if (!one->ifa_addr || (one->ifa_flags & IFF_LOOPBACK)) continue;
    std::array<char, INET6_ADDRSTRLEN> text{};
    if (one->ifa_addr->sa_family == AF_INET)
      inet_ntop(AF_INET, &reinterpret_cast<const sockaddr_in*>(one->ifa_addr)->sin_addr, text.data(),
                text.size());
    if (one->ifa_addr->sa_family == AF_INET6)
      inet_ntop(AF_INET6, &reinterpret_cast<const sockaddr_in6*>(one->ifa_addr)->sin6_addr, text.data(),
                text.size());
    if (text[0] != '\0') words->add(text.data(), "(address)");
    if (one->ifa_addr->sa_family != AF_PACKET) continue;
    const auto* link = reinterpret_cast<const sockaddr_ll*>(one->ifa_addr);
    std::string with_colons, bare;
    for (int i = 0; i < link->sll_halen; ++i) {
      with_colons += fmt::format("{}{:02x}", i > 0 ? ":" : "", link->sll_addr[i]);
      bare += fmt::format("{:02x}", link->sll_addr[i]);
    }
    if (bare.find_first_not_of('0') == std::string::npos) continue;
    words->add(with_colons, "(address)");
    words->add(bare, "(address)");
  }
  freeifaddrs(all);
}

// The first word of a file, added if it may be a serial number and not a count.
void add_serial_in(PrivateWords* words, const fs::path& file) {
  const auto text = read_file(file);
  if (!text) return;
  const std::vector<std::string> parts = split(*text, "\n");
  if (!parts.empty() && parts[0].size() >= 6 && parts[0].find_first_not_of('0') != std::string::npos)
    words->add(parts[0], "(serial)");
}

void add_serials(PrivateWords* words, const fs::path& root) {
  std::error_code none;
  for (const auto& entry : fs::directory_iterator(root / "sys/bus/usb/devices", none))
    add_serial_in(words, entry.path() / "serial");
  for (const char* name : {"product_serial", "board_serial", "chassis_serial", "product_uuid"})
    add_serial_in(words, root / "sys/class/dmi/id" / name);
  add_serial_in(words, root / "etc/machine-id");
  add_serial_in(words, root / "proc/sys/kernel/random/boot_id");
}

// The parts of SCHEME://[NAME:PASSWORD@]HOST[:PORT][/PATH][?QUERY]. A password may have slashes.
void add_url(PrivateWords* words, const std::string& source, std::size_t mark) {
  words->add(source, source.substr(0, mark + 3) + "(address)");
  const std::string shown = source.substr(0, source.find('?'));
  words->add(device::without_login(shown), source.substr(0, mark + 3) + "(address)");
  std::string rest = source.substr(mark + 3);
  if (const std::size_t at = rest.substr(0, rest.find('?')).rfind('@'); at != std::string::npos) {
    const std::string login = rest.substr(0, at);
    const std::size_t colon = login.find(':');
    words->add(login, "(login)");
    words->add(login.substr(0, colon), "(user)");
    if (colon != std::string::npos) words->add(login.substr(colon + 1), "(password)");
    if (colon != std::string::npos)
      for (const std::string& part : split(login.substr(colon + 1), "/")) words->add(part, "(password)");
    rest = rest.substr(at + 1);
  }
  const std::size_t path = std::min(rest.size(), rest.find_first_of("/?"));
  const std::string machine = rest.substr(0, path);
  words->add(machine, "(address)");
  const bool is_v6 = machine.starts_with('[');
  words->add(is_v6 ? machine.substr(1, machine.find(']') - 1) : machine.substr(0, machine.rfind(':')),
             "(address)");
  words->add(rest.substr(path), "/(path)");
  for (const std::string& part : split(rest.substr(path), "/?&"))
    if (part.size() >= 6 || part.find('=') != std::string::npos) {
      words->add(part, "(path)");
      if (const std::size_t is = part.find('='); is != std::string::npos && part.size() > is + 4)
        words->add(part.substr(is + 1), "(path)");
    }
}

void add_source(PrivateWords* words, const std::string& source) {
  if (const std::size_t mark = source.find("://"); mark != std::string::npos)
    return add_url(words, source, mark);
  const std::size_t colon = source.find(':');
  const std::string kind = colon == std::string::npos ? "" : source.substr(0, colon);
  const std::string name = source.substr(kind.empty() ? 0 : colon + 1);
  if (kind == "gige") {
    const std::size_t last = name.rfind('-');
    words->add(name, last == std::string::npos ? "(address)" : name.substr(0, last) + "-(serial)");
    if (last != std::string::npos && name.size() - last > 4) words->add(name.substr(last + 1), "(serial)");
  } else if (kind == "v4l2") {
    // usb-MAKER_MODEL_SERIAL-video-index0
    const std::string file = fs::path(name).filename().string();
    const std::string id = file.substr(0, file.rfind("-video-index"));
    const std::size_t last = id.rfind('_');
    if (!file.starts_with("usb-") || last == std::string::npos) return;
    words->add(id, id.substr(0, last) + "_(serial)");
    if (has_digit(id.substr(last + 1)) && id.size() - last > 4) words->add(id.substr(last + 1), "(serial)");
  } else if (kind.empty()) {
    add_folder_of(words, name);
  }
}

}  // namespace

void add_machine(PrivateWords* words, const fs::path& root) {
  add_host_names(words, root);
  add_user(words);
  add_addresses(words);
  add_serials(words, root);
}

void add_devices(PrivateWords* words, const device::Devices& devices) {
  for (const device::CameraConfig& camera : devices.cameras) {
    words->add(camera.host, "(machine)");
    add_source(words, camera.source);
  }
  for (const device::DisplayConfig& display : devices.displays) words->add(display.host, "(machine)");
  if (!devices.file.empty()) add_folder_of(words, devices.file);
}

void add_folder_of(PrivateWords* words, const fs::path& path) {
  std::error_code none;
  const fs::path whole = fs::absolute(path, none).lexically_normal();
  const std::string folder = (whole.has_filename() ? whole : whole.parent_path()).parent_path().string();
  if (folder.size() > 1) words->add(folder, "(folder)");
}

}  // namespace limn::validate
