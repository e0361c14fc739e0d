#include "core/program_library.h"

LIMN_LIBRARY_VERSION("0.0.1")

extern "C" __attribute__((visibility("default"))) int limn_answer();
extern "C" __attribute__((visibility("default"))) int limn_answer() { return 42; }
