#include "scene/files/cad_program.h"

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <sstream>
#include <thread>

#include "core/data_folder.h"
#include "core/log.h"
#include "core/utf8.h"

extern char** environ;

namespace limn::scene {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr const char *k_program = "limn-cad", *k_variable = "LIMN_CAD";
constexpr int k_exit_wrong_file = 1, k_exit_no_memory = 3;  // limn-cad's exit codes
constexpr double k_own_share = 0.8;  // A file that needs so much of the time exceeds it by itself.
constexpr int k_priority = 10;       // a session's frames come first
constexpr std::size_t k_most_report = 256U << 20, k_most_messages = 16U << 10;  // bytes

Error not_installed(const fs::path& file, const std::string& found) {
  return error(
      "{}: expected the program {}, which reads STEP and IGES files, found {}. Install it (apt install {}), "
      "or "
      "name it in the environment variable {}.",
      file.string(), k_program, found, k_program, k_variable);
}

// The two ends of a pipe, closed at the end.
struct Pipe {
  std::array<int, 2> ends = {-1, -1};
  Pipe() {
    if (pipe2(ends.data(), O_CLOEXEC) != 0) ends = {-1, -1};
  }
  Pipe(const Pipe&) = delete;
  Pipe& operator=(const Pipe&) = delete;
  ~Pipe() {
    close_end(0);
    close_end(1);
  }
  void close_end(std::size_t end) {
    if (ends.at(end) >= 0) close(ends.at(end));
    ends.at(end) = -1;
  }
};

// limn-cad while it runs.
class CadProcess {
 public:
  CadProcess() = default;
  CadProcess(const CadProcess&) = delete;
  CadProcess& operator=(const CadProcess&) = delete;
  ~CadProcess() {
    if (process_ > 0) end_now();
  }

  // Error: errno of the failed start.
  std::optional<int> start(const fs::path& program, std::vector<std::string> words, const CadLimits& limits) {
    std::vector<char*> pointers;
    for (std::string& word : words) pointers.push_back(word.data());
    pointers.push_back(nullptr);
    posix_spawn_file_actions_t files;
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_adddup2(&files, output.ends[1], STDOUT_FILENO);
    posix_spawn_file_actions_adddup2(&files, messages.ends[1], STDERR_FILENO);
    const int failed = posix_spawn(&process_, program.c_str(), &files, nullptr, pointers.data(), environ);
    posix_spawn_file_actions_destroy(&files);
    if (failed != 0) {
      process_ = -1;
      return failed;
    }
    output.close_end(1);
    messages.close_end(1);
    const auto bytes = static_cast<rlim_t>(limits.memory_mb * 1024 * 1024);
    const rlimit memory{bytes, bytes};
    prlimit(process_, RLIMIT_AS, &memory, nullptr);
    setpriority(PRIO_PROCESS, static_cast<id_t>(process_), k_priority);
    return std::nullopt;
  }

  // Processor time so far.
  double processor_seconds() const {
    clockid_t clock{};
    timespec used{};
    if (clock_getcpuclockid(process_, &clock) != 0 || clock_gettime(clock, &used) != 0) return 0;
    return static_cast<double>(used.tv_sec) + 1e-9 * static_cast<double>(used.tv_nsec);
  }

  int end_now() {
    kill(process_, SIGKILL);
    return wait_for_end();
  }

  bool has_ended(int* status) {
    const pid_t found = waitpid(process_, status, WNOHANG);
    if (found == 0 || (found < 0 && errno == EINTR)) return false;
    process_ = -1;
    return true;
  }

  int wait_for_end() {
    int status = 0;
    while (waitpid(process_, &status, 0) < 0 && errno == EINTR) {
    }
    process_ = -1;
    return status;
  }

  Pipe output, messages;

 private:
  pid_t process_ = -1;
};

// Reads what is there. False: the other end is closed.
bool read_some(int from, std::string* text) {
  std::array<char, 65536> bytes{};
  const ssize_t count = read(from, bytes.data(), bytes.size());
  if (count > 0) text->append(bytes.data(), static_cast<std::size_t>(count));
  return count > 0 || (count < 0 && (errno == EINTR || errno == EAGAIN));
}

// limn-cad's output: lines of progress, then the report.
class ProgressOutput {
 public:
  explicit ProgressOutput(const fs::path& file)
      : shown_("reading " + as_utf8(file.filename().string()), 100) {}

  // Takes whole lines of progress out of `text`. Whether there was one.
  bool take_progress(std::string* text) {
    bool moved = false;
    for (std::size_t end = 0;
         text->starts_with("progress ") && (end = text->find('\n')) != std::string::npos;) {
      shown_.step(std::atoi(text->c_str() + std::strlen("progress ")));
      text->erase(0, end + 1);
      moved = true;
    }
    return moved;
  }

 private:
  Progress shown_;
};

// The last line that limn-cad wrote to standard error, without its name and without control characters.
std::string last_message(const std::string& messages) {
  std::istringstream lines(as_utf8(messages));
  std::string last;
  for (std::string line; std::getline(lines, line);) {
    std::erase_if(line, [](unsigned char c) { return c < 0x20 || c == 0x7F; });
    if (!line.empty()) last = line;
  }
  const std::string name = std::string(k_program) + ": ";
  return last.starts_with(name) ? last.substr(name.size()) : last;
}

// What to do about a file that exceeds a limit, which `option` of `limn import cad` raises.
std::string remedy(const char* option) {
  return fmt::format(
      "Allow more and write it as a mesh once (limn import cad FILE {} --out FILE.glb), or a larger chord "
      "error (--chord-mm 0.5). An assembly of very many nested places must be exported in pieces.",
      option);
}

Error exceeded_time(const fs::path& file, const CadLimits& limits, bool was_silent) {
  return error(
      "{}: expected a CAD file that is read within {:.3g} s{}, found one on which limn-cad does not end. {}",
      file.string(), was_silent ? limits.silent_seconds : limits.seconds, was_silent ? " at each step" : "",
      remedy("--minutes 60"));
}

Error exceeded_memory(const fs::path& file, const CadLimits& limits) {
  return error(
      "{}: expected a CAD file that can be read in {:.0f} MB of memory, found one that needs more. {}",
      file.string(), limits.memory_mb, remedy("--memory-gb 8"));
}

bool is_crash(int signal) {
  return signal == SIGSEGV || signal == SIGABRT || signal == SIGBUS || signal == SIGFPE || signal == SIGILL;
}

CadRun ended(const fs::path& file,
             int status,
             const std::string& output,
             const std::string& messages,
             const CadLimits& limits) {
  if (WIFSIGNALED(status) && is_crash(WTERMSIG(status)))
    return {error("{}: expected a whole CAD file, found one on which limn-cad crashes ({}). Export it again.",
                  file.string(), strsignal(WTERMSIG(status))),
            true};
  if (WIFSIGNALED(status))
    return {
        error("{}: expected that limn-cad reads it to its end, found it ended from outside ({}). Try again.",
              file.string(), strsignal(WTERMSIG(status)))};
  const int code = WEXITSTATUS(status);
  if (code == 0) return {output};
  if (code == k_exit_no_memory) return {exceeded_memory(file, limits), true};
  const std::string message = last_message(messages);
  if (message.empty())
    return {error("{}: expected that limn-cad reads it, found exit code {} and no message.", file.string(),
                  code)};
  return {Error{message}, code == k_exit_wrong_file};
}

}  // namespace

Result<fs::path> limn_cad_for(const fs::path& file) {
  std::error_code none;
  if (const char* chosen = std::getenv(k_variable); chosen && *chosen) {
    if (fs::is_regular_file(chosen, none) && access(chosen, X_OK) == 0) return fs::path(chosen);
    return not_installed(file, fmt::format("no program '{}'", chosen));
  }
  if (const fs::path own = private_library(k_program); fs::is_regular_file(own, none)) return own;
  const char* path = std::getenv("PATH");
  std::istringstream folders(path ? path : "");
  for (std::string folder; std::getline(folders, folder, ':');)
    if (const fs::path there = fs::path(folder) / k_program; fs::is_regular_file(there, none)) return there;
  return not_installed(file, "none beside limn or on PATH");
}

CadRun try_limn_cad(const fs::path& file,
                    const std::vector<std::string>& arguments,
                    const CadLimits& limits,
                    const std::stop_token& stop) {
  const auto found = limn_cad_for(file);
  if (!found) return {found.error()};
  const fs::path& program = *found;
  std::vector<std::string> words = {program.string(), file.string(), "--json",
                                    "--progress",     "--memory-mb", fmt::format("{}", limits.memory_mb)};
  words.insert(words.end(), arguments.begin(), arguments.end());
  CadProcess child;
  if (const auto failed = child.start(program, words, limits))
    return {error("{}: expected that the program {} starts, found '{}': {}. Try again, or install it again.",
                  file.string(), k_program, program.string(), std::strerror(*failed))};
  ProgressOutput shown(file);
  std::string output, messages;
  const auto begun = Clock::now();
  auto moved = begun;
  double used_at_move = 0;
  const auto seconds_since = [](Clock::time_point then) {
    return std::chrono::duration<double>(Clock::now() - then).count();
  };
  std::array<pollfd, 2> ends = {pollfd{child.output.ends[0], POLLIN, 0},
                                pollfd{child.messages.ends[0], POLLIN, 0}};
  while (ends[0].fd >= 0 || ends[1].fd >= 0) {
    constexpr int k_look_every_ms = 100;
    if (poll(ends.data(), ends.size(), k_look_every_ms) < 0) ends[0].revents = ends[1].revents = 0;
    if (ends[0].revents != 0 && !read_some(ends[0].fd, &output)) ends[0].fd = -1;
    if (ends[1].revents != 0 && !read_some(ends[1].fd, &messages)) ends[1].fd = -1;
    if (shown.take_progress(&output)) {
      moved = Clock::now();
      used_at_move = child.processor_seconds();
    }
    if (messages.size() > k_most_messages) messages.erase(0, messages.size() - k_most_messages);
    const bool was_silent = seconds_since(moved) > limits.silent_seconds;
    if (was_silent || seconds_since(begun) > limits.seconds) {
      // On a busy machine, or a disk that waits, the time was not the file's.
      const double used = child.processor_seconds() - (was_silent ? used_at_move : 0);
      const double allowed = was_silent ? limits.silent_seconds : limits.seconds;
      return {exceeded_time(file, limits, was_silent), used > k_own_share * allowed};
    }
    if (output.size() > k_most_report) return {exceeded_memory(file, limits), true};
    if (stop.stop_requested())
      return {error("{}: expected time to read it, found the session's end.", file.string())};
  }
  int status = 0;
  while (!child.has_ended(&status)) {  // a program may close its output and go on
    if (seconds_since(begun) > limits.seconds) return {exceeded_time(file, limits, false)};
    if (stop.stop_requested())
      return {error("{}: expected time to read it, found the session's end.", file.string())};
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return ended(file, status, output, messages, limits);
}

Result<std::string> run_limn_cad(const fs::path& file,
                                 const std::vector<std::string>& arguments,
                                 const CadLimits& limits,
                                 const std::stop_token& stop) {
  return try_limn_cad(file, arguments, limits, stop).report;
}

}  // namespace limn::scene
