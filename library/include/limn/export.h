#pragma once

/// Marks what the library exports; everything else in liblimn.so is hidden.
#define LIMN_API __attribute__((visibility("default")))

/// All names are in `limn`. The inline namespace inside it has the version in its name: a program that was
/// compiled for another 0.y does not start with this library ("undefined symbol"), instead of failing while
/// it runs.
#ifdef LIMN_BUILDS_LIBRARY
#define LIMN_VERSIONED v0_1
#else
#define LIMN_VERSIONED inline v0_1
#endif
