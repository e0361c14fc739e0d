#include "scene/meshes/read_with_assimp.h"

#include "scene/meshes/reader_library.h"

namespace limn::scene {

Result<MeshContent> read_with_assimp(const std::filesystem::path& path) {
  LIMN_TRY(void* function, library_function(k_reader_library, "limn_read_with_assimp"));
  Result<MeshContent> content = MeshContent{};
  reinterpret_cast<void (*)(const std::filesystem::path&, Result<MeshContent>*)>(function)(path, &content);
  return content;
}

}  // namespace limn::scene
