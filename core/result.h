#pragma once

#include <fmt/format.h>

#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <variant>

namespace limn {

/// A problem that a person can fix. The message says where, what was expected, what was found, what to do.
struct Error {
  std::string message;
  bool wrong_usage = false;  ///< Whether the command line was wrong: exit code 2 instead of 1.
};

template <class... Args>
Error error(fmt::format_string<Args...> format, Args&&... args) {
  return Error{fmt::format(format, std::forward<Args>(args)...), false};
}

/// An error in the command line.
template <class... Args>
Error usage_error(fmt::format_string<Args...> format, Args&&... args) {
  return Error{fmt::format(format, std::forward<Args>(args)...), true};
}

/// A value, or the error that says why there is none.
template <class T>
class [[nodiscard]] Result {
 public:
  Result(T value) : state_(std::move(value)) {}      // NOLINT(google-explicit-constructor)
  Result(Error error) : state_(std::move(error)) {}  // NOLINT(google-explicit-constructor)

  bool ok() const { return std::holds_alternative<T>(state_); }
  explicit operator bool() const { return ok(); }

  /// The value. If there is none, that is a bug of the caller: throws std::logic_error with the error's
  /// message.
  T& value() & { return checked(), std::get<T>(state_); }
  const T& value() const& { return checked(), std::get<T>(state_); }
  T&& value() && { return checked(), std::get<T>(std::move(state_)); }
  T& operator*() & { return value(); }
  const T& operator*() const& { return value(); }
  T* operator->() { return &value(); }
  const T* operator->() const { return &value(); }

  const Error& error() const { return std::get<Error>(state_); }
  const std::string& message() const { return error().message; }

 private:
  void checked() const {
    if (!ok()) throw std::logic_error("value() of a failed Result: " + message());
  }
  std::variant<T, Error> state_;
};

/// Success or an error: the result of a function that returns no value but may fail.
class [[nodiscard]] Status {
 public:
  Status() = default;
  Status(Error error) : error_(std::move(error)) {}  // NOLINT(google-explicit-constructor)
  bool ok() const { return !error_; }
  explicit operator bool() const { return ok(); }
  const Error& error() const { return error_.value(); }
  const std::string& message() const { return error().message; }

 private:
  std::optional<Error> error_;
};

namespace detail {
[[noreturn]] void check_failed(const char* file, int line, const char* condition);
}  // namespace detail

}  // namespace limn

#define LIMN_CONCAT_(a, b) a##b
#define LIMN_CONCAT(a, b) LIMN_CONCAT_(a, b)

/// LIMN_TRY(auto rig, load_rig(folder)) declares `rig`, or returns the error from the enclosing function.
#define LIMN_TRY(declaration, expression)                                             \
  auto LIMN_CONCAT(result_, __LINE__) = (expression);                                 \
  if (!LIMN_CONCAT(result_, __LINE__)) return LIMN_CONCAT(result_, __LINE__).error(); \
  declaration = std::move(LIMN_CONCAT(result_, __LINE__)).value()

/// LIMN_TRY_STATUS(write_rig(rig, folder)) returns the error from the enclosing function, if any.
#define LIMN_TRY_STATUS(expression)                                                        \
  if (auto LIMN_CONCAT(status_, __LINE__) = (expression); !LIMN_CONCAT(status_, __LINE__)) \
  return LIMN_CONCAT(status_, __LINE__).error()

/// Checks what only a bug in Limn can violate; throws std::logic_error with file and line.
#define LIMN_CHECK(condition) \
  ((condition) ? void() : ::limn::detail::check_failed(__FILE__, __LINE__, #condition))
