#pragma once

#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>

#include "exchange/cad/cad_model.h"

namespace limn::cad {

/// The bytes of a binary glTF 2.0 file with these nodes in metres, in the frame of the CAD file. Nodes that
/// have the same mesh share it in the file. `extras` is kept in the file's "asset".
std::string encode_cad_glb(const CadModel& model,
                           std::span<const CadNode> nodes,
                           const nlohmann::ordered_json& extras);

}  // namespace limn::cad
