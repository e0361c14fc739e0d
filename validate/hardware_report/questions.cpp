#include "validate/hardware_report/questions.h"

#include <fmt/ranges.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>

#include "core/print.h"

namespace limn::validate {
namespace {

std::atomic<bool> g_is_interrupted = false;
void interrupt(int) { g_is_interrupted = true; }

constexpr std::array<int, 2> k_signals = {SIGINT, SIGTERM};
std::array<struct sigaction, 2> g_before{};

// Without SA_RESTART, so that a wait for an answer ends.
void handle_signals(std::array<struct sigaction, 2>* before) {
  struct sigaction handling {};
  handling.sa_handler = interrupt;
  sigemptyset(&handling.sa_mask);
  for (std::size_t i = 0; i < k_signals.size(); ++i)
    sigaction(k_signals[i], &handling, before ? &(*before)[i] : nullptr);
}

}  // namespace

bool is_interrupted() { return g_is_interrupted; }

Interruption::Interruption() {
  g_is_interrupted = false;
  handle_signals(&g_before);
}

Interruption::~Interruption() {
  for (std::size_t i = 0; i < k_signals.size(); ++i) sigaction(k_signals[i], &g_before[i], nullptr);
  g_is_interrupted = false;
}

void Interruption::take_back(bool was_interrupted) {
  if (was_interrupted) g_is_interrupted = true;
  handle_signals(nullptr);
}

Questions::Questions(std::optional<int> answers) : answers_(answers) {
  if (!answers_ && isatty(STDIN_FILENO)) answers_ = STDIN_FILENO;
}

// A line without its end; nullopt: there are no more.
Result<std::optional<std::string>> Questions::line() {
  constexpr int k_wait_ms = 100;  // the signal may come to another thread, whose waits it ends
  for (;;) {
    if (const std::size_t end = unread_.find('\n'); end != std::string::npos) {
      std::string line = unread_.substr(0, end);
      unread_.erase(0, end + 1);
      return std::optional(std::move(line));
    }
    if (is_interrupted()) return error("interrupted at a question.");
    pollfd waiting{.fd = *answers_, .events = POLLIN, .revents = 0};
    if (poll(&waiting, 1, k_wait_ms) <= 0) continue;
    std::array<char, 256> bytes{};
    const ssize_t count = read(*answers_, bytes.data(), bytes.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return std::optional<std::string>();
    unread_.append(bytes.data(), static_cast<std::size_t>(count));
  }
}

Result<std::string> Questions::ask(const std::string& question, const std::string& present) {
  if (is_interrupted()) return error("interrupted at a question.");
  print_out("{} [{}] ", question, present);
  std::fflush(stdout);
  if (answers_) {
    LIMN_TRY(const std::optional<std::string> answer, line());
    if (answer && !answer->empty()) return *answer;
    if (answer) return present;
    answers_.reset();
  }
  print_out("\n");
  return present;
}

Result<std::string> Questions::choose(const std::string& question,
                                      const std::vector<std::string>& choices,
                                      const std::string& present) {
  for (;;) {
    LIMN_TRY(const std::string answer, ask(question, present));
    if (std::ranges::find(choices, answer) != choices.end()) return answer;
    print_out("Expected one of {}, found {}.\n", fmt::join(choices, ", "), answer);
  }
}

}  // namespace limn::validate
