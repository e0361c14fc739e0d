#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn::exchange {

/// A new value for the key `curve` of an entry of `lines`.
struct ReplacedCurve {
  std::size_t line = 0;  ///< Index in `lines`.
  std::string value;     ///< JSON.
};

/// The text of a scene.json with other curves, and with more entries (JSON) at the end of `lines`, which is
/// added if it is absent. All else stays as it is, also comments and line breaks. `where` names the text in
/// messages. Errors: no JSON object; an entry without a curve.
Result<std::string> with_lines(const std::string& text,
                               const std::vector<ReplacedCurve>& replaced,
                               const std::vector<std::string>& added,
                               const std::string& where);

}  // namespace limn::exchange
