#pragma once

// Put before a function of plain loops: it is compiled for AVX-512, AVX2 and the portable baseline, and the
// version is chosen when the program is loaded (an ifunc; only GCC makes one of all three).
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define LIMN_SIMD __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else
#define LIMN_SIMD
#endif
