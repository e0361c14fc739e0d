#include <fcntl.h>
#include <malloc.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <initializer_list>
#include <new>

#include "apps/command_line.h"

namespace {

// Images are allocated and freed with each frame. If freed memory went back to the system, it would be
// requested again page by page, which costs a live session 5 % of its time.
void keep_freed_memory() {
  constexpr int k_mib = 1 << 20;
  mallopt(M_MMAP_THRESHOLD, 32 * k_mib);
  mallopt(M_TRIM_THRESHOLD, 256 * k_mib);
}

// A file that is opened while standard input, output or error is closed would get its number, and with it
// everything that is printed.
void open_closed_streams() {
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
    if (fcntl(stream, F_GETFD) < 0 && errno == EBADF) static_cast<void>(open("/dev/null", O_RDWR));
}

// Reports an exception that nothing caught, on any thread, and ends the program.
[[noreturn]] void end_on_uncaught_exception() {
  const char* problem = "this is a bug in Limn, please report it: an exception was not caught.";
  try {
    if (const auto exception = std::current_exception()) std::rethrow_exception(exception);
  } catch (const std::bad_alloc&) {
    problem = "expected enough memory for this work, found none left. Use smaller images.";
  } catch (...) {
  }
  std::fprintf(stderr, "limn: %s\n", problem);
  std::_Exit(1);
}

}  // namespace

int main(int argc, char** argv) {
  std::signal(SIGXFSZ, SIG_IGN);  // Exceeding a file-size limit becomes an error of write(), with a message.
  std::signal(SIGPIPE, SIG_IGN);  // So does a closed pipe.
  std::set_terminate(end_on_uncaught_exception);
  open_closed_streams();
  keep_freed_memory();
  return limn::apps::run_command_line(argc, argv);
}
