#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "remote/api/roles.h"

namespace limn::remote {

/// Random bytes of a token.
constexpr std::size_t k_token_bytes = 32;
/// How long a guest's session lasts, and how many of each role there are at once. One more ends the oldest of
/// that role, so that who has one role's PIN ends no session of another role.
constexpr std::chrono::hours k_session_life{12};
constexpr std::size_t k_max_sessions = 256;
/// Wrong PINs after which pairing is locked: from one address for that address, from all for everybody.
constexpr int k_max_wrong_pins = 10, k_max_wrong_pins_of_all = 100;
/// The time of the first lock. It doubles with every lock, up to the second value.
constexpr std::chrono::minutes k_first_wait{1}, k_longest_wait{16};
/// An address without a wrong PIN for this long is forgotten, and so are the oldest of too many addresses.
constexpr std::chrono::minutes k_attempts_kept_for{60};
constexpr std::size_t k_max_addresses = 1024;

/// Pairs guests by PIN and keeps their sessions. Each role has a PIN, drawn at random for every object.
/// Belongs to one thread. The caller passes the time, so that hours can pass in a test.
class AuthSessions {
 public:
  using Time = std::chrono::steady_clock::time_point;

  struct Guest {
    std::uint64_t number = 0;  ///< The session's number, which is never used again.
    std::string name;
    Role role = Role::look;
    Time until;
  };
  struct Paired {
    std::string token;  ///< 256 random bits in hexadecimal, which identify the session.
    Guest guest;
  };
  struct WrongPin {};
  struct Wait {
    std::chrono::seconds left;
  };

  AuthSessions();

  /// One PIN of six digits for each role; all differ.
  const std::array<std::string, 3>& pins() const { return pins_; }
  const std::string& pin(Role role) const { return pins_[static_cast<std::size_t>(role)]; }

  /// Begins a session for somebody who knows a PIN. `address` is a numeric IP address; all addresses of an
  /// IPv6 network (/64) count as one. While pairing is locked (Wait) no PIN is compared, so that the answer
  /// does not show whether it is right. A second guest of a name that looks alike is called "Ann (2)".
  /// `replaced` is the session that the guest has already; it ends.
  std::variant<Paired, WrongPin, Wait> pair(const std::string& pin,
                                            const std::string& name,
                                            const std::string& address,
                                            Time now,
                                            const std::optional<Guest>& replaced = {});

  /// The guest with this token; nullopt: there is none, or the session is over.
  std::optional<Guest> find(const std::string& token, Time now) const;
  /// Whether the session of this number exists and is not over.
  bool is_valid(std::uint64_t guest, Time now) const;
  void end_session(std::uint64_t guest);
  /// How many sessions there are.
  std::size_t count() const { return sessions_.size(); }

 private:
  struct Session {
    std::array<unsigned char, k_token_bytes> token{};
    Guest guest;
  };
  struct Attempts {
    int wrong = 0;
    std::chrono::minutes next_wait = k_first_wait;
    std::optional<Time> locked_until;
    Time last;
  };
  std::string unique_name(const std::string& name) const;
  std::optional<Wait> wait_of(const Attempts& attempts, Time now) const;
  void count_wrong_pin(Attempts* attempts, int most, Time now);
  Attempts* attempts_of(const std::string& address, Time now);

  std::array<std::string, 3> pins_;
  std::vector<Session> sessions_;  // oldest first
  std::uint64_t last_number_ = 0;
  std::map<std::string, Attempts> attempts_;  // by address
  Attempts all_attempts_;
};

}  // namespace limn::remote
