#pragma once

// All of Limn's library. Frames, units and names: poses are `a_from_b`; metres, radians, seconds; pixel (0,
// 0) is the centre of the top-left pixel; other units are in the names. Errors are exceptions
// (limn/error.h). Objects that do not change may be used by several threads; others by one at a time.
#include "limn/bodies.h"
#include "limn/calibration.h"
#include "limn/error.h"
#include "limn/image.h"
#include "limn/markers.h"
#include "limn/pose.h"
#include "limn/renderer.h"
#include "limn/rig.h"
#include "limn/version.h"
