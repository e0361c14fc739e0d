#include "core/print.h"

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <iostream>
#include <system_error>

namespace limn {
namespace {

std::atomic<int> g_problem = 0;  // errno of the first failure

void note_failure() {
  int none = 0;
  g_problem.compare_exchange_strong(none, errno == 0 ? EIO : errno);
}

}  // namespace

void print_text(const std::string& text) {
  if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size()) note_failure();
}

Status flush_output() {
  std::cout.flush();
  if (std::fflush(stdout) != 0 || std::ferror(stdout) || !std::cout) note_failure();
  if (g_problem == 0) return {};
  return error("standard output: expected to write all results, found: {}. Direct it to another place.",
               std::generic_category().message(g_problem));
}

}  // namespace limn
