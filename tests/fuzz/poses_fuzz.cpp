// POSES.json of a scene.
#include "scene/posed_scene.h"
#include "scene/scene.h"
#include "tests/fuzz/fuzz_file.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace limn;
  static const auto scene =
      scene::load_scene(std::filesystem::path(LIMN_SOURCE_DIR) / "config/scenes/door").value();
  const auto file = test::fuzzed_file(bytes, size, "poses.json");
  const auto posed = scene::load_poses(file, scene);
  test::check_read(posed, file);
  if (!posed) return 0;
  LIMN_CHECK(!posed->world_from_prototype || posed->world_from_prototype->is_finite());
  for (const scene::PosedPart& part : posed->parts) LIMN_CHECK(part.world_from_part.is_finite());
  return 0;
}
