#pragma once

#include <Eigen/Geometry>
#include <string>

#include "core/result.h"

namespace limn::scene {

/// What somebody asks of the comparison of the prototype with its CAD (action `deviation`).
struct DeviationRequest {
  enum class What {
    scan,       ///< "scan", or nothing: scans and compares anew.
    on,         ///< "on": shows the result.
    off,        ///< "off": hides it.
    toggle,     ///< "toggle": either; without a result as `scan`.
    hold,       ///< "hold on": later scans keep the alignment.
    release,    ///< "hold off": they are aligned anew.
    fit_box,    ///< "fit X Y Z X Y Z": aligns on the part of the scan in a box of the prototype's frame, mm.
    fit_all,    ///< "fit off": aligns on the whole scan.
    tolerance,  ///< "tolerance MM"
    report      ///< "report": writes the result as files.
  };
  What what = What::scan;
  Eigen::AlignedBox3d box = {};  ///< With fit_box: prototype's frame, m.
  double tolerance_m = 0;        ///< With `tolerance`.
};

/// Reads the text of a request. Error: it says what was expected; `action` is the name in it.
Result<DeviationRequest> parse_deviation_request(const std::string& action, const std::string& text);

}  // namespace limn::scene
