#pragma once

#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>

namespace limn::test {

/// How long a soak test runs (s of its own clock): LIMN_SOAK_S, but at least `least_s`; `usual_s` if it is
/// not set.
inline double soak_s(double least_s, double usual_s) {
  const char* wanted = std::getenv("LIMN_SOAK_S");
  return wanted ? std::max(least_s, std::strtod(wanted, nullptr)) : usual_s;
}

/// The memory of this process that is in RAM (MiB).
inline double resident_mib() {
  std::ifstream file("/proc/self/statm");
  double all = 0, resident = 0;
  file >> all >> resident;
  return resident * static_cast<double>(::sysconf(_SC_PAGESIZE)) / (1 << 20);
}

}  // namespace limn::test
