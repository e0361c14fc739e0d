// Writes the built-in door scene: write_door FOLDER. Run it after a change to sim/car_door.cpp and commit the
// files.

#include <cstdio>
#include <filesystem>

#include "core/file.h"
#include "sim/car_door.h"

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: write_door FOLDER\n");
    return 2;
  }
  for (const auto& [name, content] : limn::sim::car_door_files())
    if (const auto written = limn::write_file(std::filesystem::path(argv[1]) / name, content); !written) {
      std::fprintf(stderr, "%s\n", written.message().c_str());
      return 1;
    }
  for (const auto& [slot, pose] : limn::sim::car_door_slot_places())
    std::printf("%s: rotation_wxyz [%.9f, %.9f, %.9f, %.9f] translation_m [%.9f, %.9f, %.9f]\n", slot.c_str(),
                pose.rotation.w(), pose.rotation.x(), pose.rotation.y(), pose.rotation.z(),
                pose.translation.x(), pose.translation.y(), pose.translation.z());
  return 0;
}
