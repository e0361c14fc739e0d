// Writes the meshes of config/scenes/finishes: write_finishes FOLDER. Run it after a change to
// sim/finish_panel.cpp and commit the files.

#include <cstdio>
#include <filesystem>

#include "core/file.h"
#include "sim/finish_panel.h"

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: write_finishes FOLDER\n");
    return 2;
  }
  for (const auto& [name, content] : limn::sim::finish_panel_files()) {
    if (const auto done = limn::write_file(std::filesystem::path(argv[1]) / name, content); !done) {
      std::fprintf(stderr, "%s\n", done.message().c_str());
      return 1;
    }
  }
  return 0;
}
