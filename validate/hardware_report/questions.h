#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn::validate {

/// Whether a person has pressed Ctrl-C (or the program was asked to end) during an Interruption that exists.
bool is_interrupted();

/// While it exists, SIGINT and SIGTERM do not end the program: they make is_interrupted() true, and end a
/// wait for an answer.
class Interruption {
 public:
  Interruption();
  ~Interruption();
  Interruption(const Interruption&) = delete;
  Interruption& operator=(const Interruption&) = delete;

  /// Handles the signals again after others have changed that. `was_interrupted`: a signal came meanwhile.
  void take_back(bool was_interrupted);
};

/// Questions to the person in front of the terminal. Each has a default.
class Questions {
 public:
  /// `answers`: a file descriptor with a line for each answer. Without it: the standard input if that is a
  /// terminal, else the defaults are taken.
  explicit Questions(std::optional<int> answers = std::nullopt);

  bool has_person() const { return answers_.has_value(); }
  /// The answer; to an empty line, or when there are no more answers, `present`. Error: interrupted.
  Result<std::string> ask(const std::string& question, const std::string& present);
  /// As ask(), until the answer is one of these.
  Result<std::string> choose(const std::string& question,
                             const std::vector<std::string>& choices,
                             const std::string& present);

 private:
  Result<std::optional<std::string>> line();

  std::optional<int> answers_;
  std::string unread_;
};

}  // namespace limn::validate
