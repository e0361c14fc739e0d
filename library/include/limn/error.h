#pragma once

// What functions throw, how long calls report where they are, and notes for people.
#include <functional>
#include <stdexcept>
#include <string>

#include "limn/export.h"

namespace limn::LIMN_VERSIONED {

/// What a person can correct: a file, an option, a machine without OpenGL. The message says where, what was
/// expected, what was found and what to do; it is the message of the program `limn`. Every function may throw
/// it, and std::bad_alloc. Any other exception is a bug in Limn. Objects keep the state that they had before
/// the call.
///
///     try {
///       const limn::Rig rig = limn::Rig::load("rig");
///     } catch (const limn::Error& error) {
///       std::cerr << error.what() << std::endl;
///     }
class LIMN_API Error : public std::runtime_error {
 public:
  explicit Error(const std::string& message);
  Error(const Error&) noexcept;
  ~Error() override;
};

/// A long call was stopped by its progress function. Nothing was written.
class LIMN_API Stopped : public Error {
 public:
  explicit Stopped(const std::string& message);
  Stopped(const Stopped&) noexcept;
  ~Stopped() override;
};

/// How far a long call is.
struct Progress {
  std::string stage = {};  ///< one word, such as `decode`
  int done = 0;            ///< steps of the stage that are done
  int total = 0;           ///< all steps of the stage; 0: not known
};

/// Is called when a stage begins and after its steps, by one thread at a time, perhaps another one than the
/// caller's. Returns false to stop: the call then throws Stopped, at latest when the stage ends. It must not
/// throw.
///
///     options.progress = [&](const limn::Progress& progress) {
///       bar.show(progress.stage, progress.done, progress.total);
///       return !cancelled;
///     };
using ReportProgress = std::function<bool(const Progress&)>;

/// Sets who gets the notes and warnings that the program prints to stderr, for example that the unit of a
/// mesh was guessed. Without one (the default, or an empty function) the library is silent. Several threads
/// may call it at once, also one whose call began before it was replaced. It must not throw.
LIMN_API void set_log(std::function<void(bool is_warning, const std::string& line)> log);

}  // namespace limn::LIMN_VERSIONED
