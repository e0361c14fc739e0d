// library_example_inputs FOLDER: writes what the examples and the tests in Python work on.
#include <exception>
#include <filesystem>

#include "core/print.h"
#include "tests/library/example_inputs.h"

int main(int count, char** words) try {
  if (count != 2) return 2;
  const std::filesystem::path folder = words[1];
  limn::test::write_example_video(folder / "video", 4);
  limn::test::write_example_photographs(folder / "photographs", 8);
  limn::test::write_example_scene(folder);
  std::filesystem::remove_all(folder / "scan");  // captures are not written over others
  limn::test::write_example_scan(folder / "scan");
  return 0;
} catch (const std::exception& error) {
  limn::print_out("{}\n", error.what());
  return 1;
}
