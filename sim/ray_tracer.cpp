#include "sim/ray_tracer.h"

#include "core/program_library.h"

namespace limn::sim {

Result<std::unique_ptr<RayTracer>> make_ray_tracer(bool moves) {
  LIMN_TRY(void* function, library_function({.file = "liblimn_rays.so",
                                             .variable = "LIMN_RAYS",
                                             .purpose = "the ray tracer of the virtual rig",
                                             .build_package = "libembree-dev"},
                                            "limn_make_ray_tracer"));
  return std::unique_ptr<RayTracer>(reinterpret_cast<RayTracer* (*)(bool)>(function)(moves));
}

}  // namespace limn::sim
