#include "remote/api/auth_sessions.h"

#include <arpa/inet.h>
#include <openssl/crypto.h>
#include <openssl/rand.h>

#include <algorithm>

namespace limn::remote {
namespace {

constexpr std::uint32_t k_pins = 1000000;

void draw(unsigned char* bytes, std::size_t count) {
  LIMN_CHECK(RAND_bytes(bytes, static_cast<int>(count)) == 1);
}

std::string drawn_pin() {
  constexpr std::uint32_t k_fair = 0xffffffffu / k_pins * k_pins;  // below it all PINs are as likely
  std::uint32_t number = k_fair;
  while (number >= k_fair) draw(reinterpret_cast<unsigned char*>(&number), sizeof number);
  return fmt::format("{:06}", number % k_pins);
}

bool is_same(const std::string& a, const std::string& b) {
  return a.size() == b.size() && CRYPTO_memcmp(a.data(), b.data(), a.size()) == 0;
}

template <std::size_t N>
std::string hex_of(const std::array<unsigned char, N>& bytes) {
  std::string text;
  for (const unsigned char byte : bytes) text += fmt::format("{:02x}", byte);
  return text;
}

std::optional<std::array<unsigned char, k_token_bytes>> token_of(const std::string& hex) {
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

std::string in_small_letters(std::string text) {
  for (char& c : text)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return text;
}

// What counts as one place: an IPv4 address, an IPv6 network.
std::string place_of(const std::string& address) {
  in6_addr six{};
  if (inet_pton(AF_INET6, address.c_str(), &six) != 1) return address;
  std::fill(std::begin(six.s6_addr) + 8, std::end(six.s6_addr), std::uint8_t{0});
  char text[INET6_ADDRSTRLEN] = {};
  return inet_ntop(AF_INET6, &six, text, sizeof text);
}

}  // namespace

AuthSessions::AuthSessions() {
  for (std::string& pin : pins_) {
    std::string drawn = drawn_pin();
    while (std::find(pins_.begin(), pins_.end(), drawn) != pins_.end()) drawn = drawn_pin();
    pin = std::move(drawn);
  }
}

std::string AuthSessions::told_apart(const std::string& name) const {
  const auto is_taken = [&](const std::string& wanted) {
    return std::any_of(sessions_.begin(), sessions_.end(), [&](const Session& session) {
      return in_small_letters(session.guest.name) == in_small_letters(wanted);
    });
  };
  std::string out = name;
  for (int i = 2; is_taken(out); ++i) out = fmt::format("{} ({})", name, i);
  return out;
}

std::optional<AuthSessions::Wait> AuthSessions::wait_of(const Tries& tries, Time now) const {
  if (!tries.waits_until || now >= *tries.waits_until) return std::nullopt;
  return Wait{std::chrono::ceil<std::chrono::seconds>(*tries.waits_until - now)};
}

void AuthSessions::note_wrong(Tries* tries, int most, Time now) {
  tries->last = now;
  if (++tries->wrong < most) return;
  tries->wrong = 0;
  tries->waits_until = now + tries->next_wait;
  tries->next_wait = std::min(2 * tries->next_wait, std::chrono::minutes(k_longest_wait));
}

AuthSessions::Tries* AuthSessions::tries_of(const std::string& address, Time now) {
  std::erase_if(tries_, [&](const auto& entry) { return now - entry.second.last > k_forgets_after; });
  const std::string place = place_of(address);
  if (tries_.size() >= k_most_addresses && !tries_.contains(place))
    tries_.erase(std::min_element(tries_.begin(), tries_.end(), [](const auto& a, const auto& b) {
      return a.second.last < b.second.last;
    }));
  return &tries_[place];
}

std::variant<AuthSessions::Paired, AuthSessions::WrongPin, AuthSessions::Wait> AuthSessions::pair(
    const std::string& pin,
    const std::string& name,
    const std::string& address,
    Time now,
    const std::optional<Guest>& replaced) {
  if (now - of_all_.last > k_forgets_after) of_all_ = {};
  Tries* tries = tries_of(address, now);
  tries->last = now;
  if (const auto wait = wait_of(of_all_, now)) return *wait;
  if (const auto wait = wait_of(*tries, now)) return *wait;
  std::optional<Role> role;
  for (const Role each : {Role::look, Role::work, Role::operate})
    if (is_same(pin, this->pin(each))) role = each;
  if (!role) {
    note_wrong(tries, k_most_wrong, now);
    note_wrong(&of_all_, k_most_wrong_of_all, now);
    return WrongPin{};
  }
  std::erase_if(sessions_, [&](const Session& session) { return now >= session.guest.until; });
  if (replaced) leave(replaced->number);
  if (sessions_.size() >= k_most_sessions) sessions_.erase(sessions_.begin());
  Session session;
  draw(session.token.data(), session.token.size());
  session.guest = {++last_number_, told_apart(name), *role, now + k_session_life};
  sessions_.push_back(session);
  return Paired{hex_of(session.token), session.guest};
}

std::optional<AuthSessions::Guest> AuthSessions::find(const std::string& token, Time now) const {
  const auto bytes = token_of(token);
  if (!bytes) return std::nullopt;
  std::optional<Guest> found;
  for (const Session& session : sessions_)
    if (CRYPTO_memcmp(session.token.data(), bytes->data(), bytes->size()) == 0) found = session.guest;
  if (found && now >= found->until) return std::nullopt;
  return found;
}

bool AuthSessions::lives(std::uint64_t guest, Time now) const {
  return std::any_of(sessions_.begin(), sessions_.end(), [&](const Session& session) {
    return session.guest.number == guest && now < session.guest.until;
  });
}

void AuthSessions::leave(std::uint64_t guest) {
  std::erase_if(sessions_, [&](const Session& session) { return session.guest.number == guest; });
}

}  // namespace limn::remote
