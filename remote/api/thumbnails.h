#pragma once

#include <map>
#include <memory>
#include <string>
#include <utility>

#include "core/result.h"
#include "scene/scene.h"

namespace limn::remote {

/// Each variant's image by itself, as PNG; drawn all at once when the first one of a scene is asked for, in
/// a GL context that goes again. Belongs to one thread, which must have no context of its own.
class Thumbnails {
 public:
  /// Error: no GL context, a scene that cannot be drawn, no such variant.
  Result<std::shared_ptr<const std::string>> png(const std::shared_ptr<const scene::Scene>& scene,
                                                 const std::string& slot,
                                                 const std::string& variant);

 private:
  Status draw(const scene::Scene& scene);

  std::shared_ptr<const scene::Scene> drawn_;
  std::map<std::pair<std::string, std::string>, std::shared_ptr<const std::string>> images_;
};

}  // namespace limn::remote
