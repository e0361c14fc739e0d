#pragma once

// mrcal's C interface, versions 2.2 to 2.4. All files of Limn include mrcal through this header, so that what
// differs between versions stands here.
// - The headers of 2.2 and 2.4 are C without `extern "C"`.
// - 2.2 declares mrcal's structs in mrcal.h, 2.4 in mrcal-types.h; mrcal.h includes that.

extern "C" {
#include <mrcal/mrcal.h>
}
