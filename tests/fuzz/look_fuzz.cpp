// Looks of a scene: looks/NAME.json.
#include "scene/scene.h"
#include "scene/show_state.h"
#include "tests/fuzz/fuzz_file.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace limn;
  static const auto scene =
      scene::load_scene(std::filesystem::path(LIMN_SOURCE_DIR) / "config/scenes/door").value();
  const auto file = test::fuzzed_file(bytes, size, "look.json");
  const auto look = scene::load_look(file, scene);
  test::check_read(look, file);
  if (look) static_cast<void>(scene::look_json(*look));
  return 0;
}
