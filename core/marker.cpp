#include "core/marker.h"

namespace limn {

Result<MarkerName> MarkerName::parse(const std::string& text) {
  const auto colon = text.rfind(':');
  if (colon == std::string::npos || colon == 0 || colon + 1 == text.size()) {
    return error("marker name '{}': expected family:id such as apriltag_36h11:0 or artoolkit:hiro.patt.",
                 text);
  }
  return MarkerName{text.substr(0, colon), text.substr(colon + 1)};
}

}  // namespace limn
