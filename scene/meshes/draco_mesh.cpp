#include "scene/meshes/draco_mesh.h"

#include "scene/meshes/reader_library.h"

namespace limn::scene {

Result<DracoMesh> decode_draco(std::string_view bytes, const std::map<std::string, std::size_t>& ids) {
  using Decode = void(std::string_view, const std::map<std::string, std::size_t>&, Result<DracoMesh>*);
  LIMN_TRY(void* function, library_function(k_reader_library, "limn_decode_draco"));
  Result<DracoMesh> mesh = DracoMesh{};
  reinterpret_cast<Decode*>(function)(bytes, ids, &mesh);
  return mesh;
}

}  // namespace limn::scene
