#include "nodes/engine.h"

#include "nodes/engine_library.h"

namespace limn::nodes {

Result<std::unique_ptr<Engine>> make_engine(const EngineOptions& options, EngineEvents* events) {
  LIMN_TRY(void* function, engine_function(k_make_engine));
  std::string problem;
  std::unique_ptr<Engine> engine(reinterpret_cast<MakeEngine*>(function)(options, events, &problem));
  if (!engine) return Error{problem};
  return engine;
}

}  // namespace limn::nodes
