#include "validate/check_result.h"

#include <algorithm>
#include <limits>

namespace limn::validate {

double CheckReading::limit_share() const {
  const double used = limit.measure.least ? 1 - value : value,
               allowed = limit.measure.least ? 1 - limit.value : limit.value;
  if (good()) return allowed > 0 ? std::min(1.0, used / allowed) : 0;
  return allowed > 0 ? used / allowed : std::numeric_limits<double>::infinity();
}

bool CheckResult::good() const {
  return problem.empty() &&
         std::all_of(readings.begin(), readings.end(), [](const CheckReading& r) { return r.good(); });
}

}  // namespace limn::validate
