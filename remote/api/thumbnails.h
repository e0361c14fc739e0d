#pragma once

#include <map>
#include <memory>
#include <string>
#include <utility>

#include "core/result.h"
#include "scene/scene.h"

namespace limn::remote {

/// An image of each variant by itself, as PNG. All are drawn when the first one of a scene is requested, in a
/// GL context that is destroyed afterwards. Belongs to one thread, which must have no current GL context.
class Thumbnails {
 public:
  /// The image of a variant. Errors: no GL context, a scene that cannot be drawn, no such variant.
  Result<std::shared_ptr<const std::string>> png(const std::shared_ptr<const scene::Scene>& scene,
                                                 const std::string& slot,
                                                 const std::string& variant);

 private:
  Status draw(const scene::Scene& scene);

  std::shared_ptr<const scene::Scene> drawn_;
  std::map<std::pair<std::string, std::string>, std::shared_ptr<const std::string>> images_;
};

}  // namespace limn::remote
