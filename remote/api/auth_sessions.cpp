#include "remote/api/auth_sessions.h"

#include <arpa/inet.h>
#include <openssl/crypto.h>
#include <openssl/rand.h>

#include <algorithm>

#include "remote/api/guest_name.h"

namespace limn::remote {
namespace {

constexpr std::uint32_t k_pins = 1000000;

void fill_with_random(unsigned char* bytes, std::size_t count) {
  LIMN_CHECK(RAND_bytes(bytes, static_cast<int>(count)) == 1);
}

std::string random_pin() {
  constexpr std::uint32_t k_limit = 0xffffffffu / k_pins * k_pins;  // below it all PINs are equally likely
  std::uint32_t number = k_limit;
  while (number >= k_limit) fill_with_random(reinterpret_cast<unsigned char*>(&number), sizeof number);
  return fmt::format("{:06}", number % k_pins);
}

bool is_same(const std::string& a, const std::string& b) {
  return a.size() == b.size() && CRYPTO_memcmp(a.data(), b.data(), a.size()) == 0;
}

template <std::size_t N>
std::string to_hex(const std::array<unsigned char, N>& bytes) {
  std::string text;
  for (const unsigned char byte : bytes) text += fmt::format("{:02x}", byte);
  return text;
}

std::optional<std::array<unsigned char, k_token_bytes>> token_from_hex(const std::string& hex) {
  std::array<unsigned char, k_token_bytes> bytes{};
  if (hex.size() != 2 * bytes.size()) return std::nullopt;
  for (std::size_t i = 0; i < hex.size(); ++i) {
    const char c = hex[i];
    const int digit = c >= '0' && c <= '9' ? c - '0' : c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
    if (digit < 0) return std::nullopt;
    bytes[i / 2] = static_cast<unsigned char>(bytes[i / 2] << 4 | digit);
  }
  return bytes;
}

// The network whose attempts are counted together: one IPv4 address, or an IPv6 network (/64).
std::string network_of(const std::string& address) {
  in6_addr six{};
  if (inet_pton(AF_INET6, address.c_str(), &six) != 1) return address;
  std::fill(std::begin(six.s6_addr) + 8, std::end(six.s6_addr), std::uint8_t{0});
  char text[INET6_ADDRSTRLEN] = {};
  return inet_ntop(AF_INET6, &six, text, sizeof text);
}

}  // namespace

AuthSessions::AuthSessions() {
  for (std::string& pin : pins_) {
    std::string pin_candidate = random_pin();
    while (std::find(pins_.begin(), pins_.end(), pin_candidate) != pins_.end()) pin_candidate = random_pin();
    pin = std::move(pin_candidate);
  }
}

std::string AuthSessions::unique_name(const std::string& name) const {
  const auto is_taken = [&](const std::string& wanted) {
    return std::any_of(sessions_.begin(), sessions_.end(),
                       [&](const Session& session) { return look_alike(session.guest.name, wanted); });
  };
  std::string out = name;
  for (int i = 2; is_taken(out); ++i) out = fmt::format("{} ({})", name, i);
  return out;
}

std::optional<AuthSessions::Wait> AuthSessions::wait_of(const Attempts& attempts, Time now) const {
  if (!attempts.locked_until || now >= *attempts.locked_until) return std::nullopt;
  return Wait{std::chrono::ceil<std::chrono::seconds>(*attempts.locked_until - now)};
}

void AuthSessions::count_wrong_pin(Attempts* attempts, int most, Time now) {
  attempts->last = now;
  if (++attempts->wrong < most) return;
  attempts->wrong = 0;
  attempts->locked_until = now + attempts->next_wait;
  attempts->next_wait = std::min(2 * attempts->next_wait, std::chrono::minutes(k_longest_wait));
}

AuthSessions::Attempts* AuthSessions::attempts_of(const std::string& address, Time now) {
  std::erase_if(attempts_, [&](const auto& entry) { return now - entry.second.last > k_attempts_kept_for; });
  const std::string network = network_of(address);
  if (attempts_.size() >= k_max_addresses && !attempts_.contains(network))
    attempts_.erase(std::min_element(attempts_.begin(), attempts_.end(), [](const auto& a, const auto& b) {
      return a.second.last < b.second.last;
    }));
  return &attempts_[network];
}

std::variant<AuthSessions::Paired, AuthSessions::WrongPin, AuthSessions::Wait> AuthSessions::pair(
    const std::string& pin,
    const std::string& name,
    const std::string& address,
    Time now,
    const std::optional<Guest>& replaced) {
  if (now - all_attempts_.last > k_attempts_kept_for) all_attempts_ = {};
  Attempts* attempts = attempts_of(address, now);
  attempts->last = now;
  if (const auto wait = wait_of(all_attempts_, now)) return *wait;
  if (const auto wait = wait_of(*attempts, now)) return *wait;
  std::optional<Role> role;
  for (const Role each : {Role::look, Role::work, Role::operate})
    if (is_same(pin, this->pin(each))) role = each;
  if (!role) {
    count_wrong_pin(attempts, k_max_wrong_pins, now);
    count_wrong_pin(&all_attempts_, k_max_wrong_pins_of_all, now);
    return WrongPin{};
  }
  std::erase_if(sessions_, [&](const Session& session) { return now >= session.guest.until; });
  if (replaced) end_session(replaced->number);
  const auto has_role = [&](const Session& session) { return session.guest.role == *role; };
  if (std::count_if(sessions_.begin(), sessions_.end(), has_role) >= static_cast<int>(k_max_sessions))
    sessions_.erase(std::find_if(sessions_.begin(), sessions_.end(), has_role));
  Session session;
  fill_with_random(session.token.data(), session.token.size());
  session.guest = {++last_number_, unique_name(name), *role, now + k_session_life};
  sessions_.push_back(session);
  return Paired{to_hex(session.token), session.guest};
}

std::optional<AuthSessions::Guest> AuthSessions::find(const std::string& token, Time now) const {
  const auto bytes = token_from_hex(token);
  if (!bytes) return std::nullopt;
  std::optional<Guest> found;
  for (const Session& session : sessions_)
    if (CRYPTO_memcmp(session.token.data(), bytes->data(), bytes->size()) == 0) found = session.guest;
  if (found && now >= found->until) return std::nullopt;
  return found;
}

bool AuthSessions::is_valid(std::uint64_t guest, Time now) const {
  return std::any_of(sessions_.begin(), sessions_.end(), [&](const Session& session) {
    return session.guest.number == guest && now < session.guest.until;
  });
}

void AuthSessions::end_session(std::uint64_t guest) {
  std::erase_if(sessions_, [&](const Session& session) { return session.guest.number == guest; });
}

}  // namespace limn::remote
