#pragma once

#include <string>

#include "core/imager.h"
#include "core/result.h"

namespace limn {

/// Whether the text is a CAHVOR file: lines of KEY = NUMBERS with C, A, H and V.
bool is_cahvor(const std::string& text);

/// Reads a CAHV or CAHVOR file of JPL (Yakimovsky and Cunningham, 1978) as LENSMODEL_PINHOLE or
/// LENSMODEL_CAHVOR, with its pose. Error: vectors that are no camera's, or a CAHVORE model.
Result<Imager> read_cahvor(const std::string& text);

}  // namespace limn
