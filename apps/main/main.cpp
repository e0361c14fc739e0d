#include <csignal>

#include "apps/command_line.h"

int main(int argc, char** argv) {
  std::signal(SIGXFSZ, SIG_IGN);  // a file-size limit is then an error of write(), with a message
  return limn::apps::run_command_line(argc, argv);
}
