#pragma once

#include "core/result.h"
#include "validate/check_run.h"

namespace limn::validate {

/// Each function computes some measures of a check (README.md says what they compare) and stores values and
/// images in `run`. Error: there is nothing to measure, such as no part in the image.

Status judge_texture(CheckRun& run);      ///< texture_mm
Status judge_parallax(CheckRun& run);     ///< parallax_mm
Status judge_shared(CheckRun& run);       ///< shared_mm
Status judge_shone(CheckRun& run);        ///< shone_...
Status judge_spill(CheckRun& run);        ///< spill_share
Status judge_drawn(CheckRun& run);        ///< drawn_...
Status judge_mask(CheckRun& run);         ///< mask_iou
Status judge_composite(CheckRun& run);    ///< composite_px
Status judge_edge(CheckRun& run);         ///< edge_...
Status judge_depth_order(CheckRun& run);  ///< depth_order_share
Status judge_seams(CheckRun& run);        ///< seam_step_...
Status judge_black(CheckRun& run);        ///< black_step_share
Status judge_refill(CheckRun& run);       ///< refill_...
Status judge_rerun(CheckRun& run);        ///< rerun_worst_255

}  // namespace limn::validate
