#include "exchange/mpcdi_rig.h"

#include <algorithm>

#include "core/log.h"

namespace limn::exchange {
namespace {

// A device name, also used as file name, that the rig does not have yet.
std::string name_of(std::string id, const Rig& rig) {
  std::replace_if(
      id.begin(), id.end(), [](char c) { return c == '/' || static_cast<unsigned char>(c) < ' '; }, '_');
  while (rig.find(id)) id += '_';
  return id;
}

}  // namespace

Result<Rig> mpcdi_rig(const Mpcdi& mpcdi, const std::string& file) {
  Rig rig;
  for (const MpcdiRegion& region : mpcdi.regions) {
    if (auto imager = imager_of(region)) {
      imager->name = name_of(region.id, rig);
      rig.projectors.push_back(*imager);
      if (!region.lens && !region.distortion.empty())
        log_warning("import: {}: its distortion map is ignored; the rig has the frustum's pinhole",
                    region.id);
    } else {
      log_warning("import: {}: left out of the rig", region.id);
    }
  }
  if (!rig.projectors.empty()) return rig;
  return error(
      "{}: expected a region with a frustum, a coordinateFrame and a plain lens for --out, found none.",
      file);
}

}  // namespace limn::exchange
