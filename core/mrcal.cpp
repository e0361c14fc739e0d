#include "core/mrcal.h"

#include "core/program_library.h"

namespace limn {
namespace {

Result<const MrcalFunctions*> load() {
  LIMN_TRY(void* function, library_function({.file = "liblimn_mrcal.so",
                                             .variable = "LIMN_MRCAL",
                                             .purpose = "mrcal's lens models",
                                             .build_package = "libmrcal-dev"},
                                            "limn_mrcal_functions"));
  return reinterpret_cast<const MrcalFunctions* (*)()>(function)();
}

}  // namespace

Result<const MrcalFunctions*> mrcal_functions() {
  static const Result<const MrcalFunctions*> functions = load();
  return functions;
}

}  // namespace limn
