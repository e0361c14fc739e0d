#include <malloc.h>

#include <csignal>

#include "apps/command_line.h"

namespace {

// Images are allocated and freed with each frame. If freed memory went back to the system, it would be
// requested again page by page, which costs a live session 5 % of its time.
void keep_freed_memory() {
  constexpr int k_mib = 1 << 20;
  mallopt(M_MMAP_THRESHOLD, 32 * k_mib);
  mallopt(M_TRIM_THRESHOLD, 256 * k_mib);
}

}  // namespace

int main(int argc, char** argv) {
  std::signal(SIGXFSZ, SIG_IGN);  // Exceeding a file-size limit becomes an error of write(), with a message.
  keep_freed_memory();
  return limn::apps::run_command_line(argc, argv);
}
