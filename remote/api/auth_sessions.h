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

/// How many bytes of a token are random.
constexpr std::size_t k_token_bytes = 32;
/// How long a guest's session lasts, and how many there are at once: the oldest goes for one more.
constexpr std::chrono::hours k_session_life{12};
constexpr std::size_t k_max_sessions = 256;
/// Wrong PINs after which nobody is paired for a while: from one address, and from all.
constexpr int k_max_wrong_pins = 10, k_max_wrong_pins_of_all = 100;
/// That while: every time twice as long, up to the second.
constexpr std::chrono::minutes k_first_wait{1}, k_longest_wait{16};
/// An address that tried nothing wrong for so long begins anew; so many are remembered.
constexpr std::chrono::minutes k_attempts_kept_for{60};
constexpr std::size_t k_max_addresses = 1024;

/// Who may come in: three PINs, one a role, drawn anew for every Guests; sessions of those who were paired.
/// Belongs to one thread; moments are the caller's, so that hours can pass in a test.
class AuthSessions {
 public:
  using Time = std::chrono::steady_clock::time_point;

  struct Guest {
    std::uint64_t number = 0;  ///< of this session; never used again
    std::string name;
    Role role = Role::look;
    Time until;
  };
  struct Paired {
    std::string token;  ///< 256 random bits, hexadecimal: what a session is known by
    Guest guest;
  };
  struct WrongPin {};
  struct Wait {
    std::chrono::seconds left;
  };

  AuthSessions();

  /// Of six digits, one a role; all different.
  const std::array<std::string, 3>& pins() const { return pins_; }
  const std::string& pin(Role role) const { return pins_[static_cast<std::size_t>(role)]; }

  /// A session for whoever knows a PIN. `address`: a numeric IP address; those of an IPv6 network (/64) count
  /// as one. While it is to wait nothing is compared, so a right PIN says no more than a wrong one. Somebody
  /// of the same name is told apart: "Ann (2)". `replaced`: who asks has that session already, which ends.
  std::variant<Paired, WrongPin, Wait> pair(const std::string& pin,
                                            const std::string& name,
                                            const std::string& address,
                                            Time now,
                                            const std::optional<Guest>& replaced = {});

  /// Whose token it is; nullopt: nobody's, or the session is over.
  std::optional<Guest> find(const std::string& token, Time now) const;
  bool is_valid(std::uint64_t guest, Time now) const;
  void end_session(std::uint64_t guest);
  std::size_t count() const { return sessions_.size(); }

 private:
  struct Session {
    std::array<unsigned char, k_token_bytes> token;
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
