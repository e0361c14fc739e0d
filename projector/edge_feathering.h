#pragma once

#include <opencv2/core/types.hpp>
#include <vector>

#include "core/result.h"
#include "projector/gl.h"
#include "projector/pass.h"
#include "projector/pinhole_view.h"
#include "projector/pixel_list.h"

namespace limn::projector {

/// How much of its light each projector keeps beside the edges of the prototype and of its shadows on itself
/// where others go on, so that they take over there before light ends: found in its image of ids' depth, in
/// blocks of 8 x 8 texels.
class EdgeFeathering {
 public:
  /// For `projectors` images of up to width x height texels.
  static Result<EdgeFeathering> create(int projectors, int width, int height);

  /// Looks through the depth image that a projector's ids were drawn with.
  void find(int projector, const GlName& depth, const PinholeView& pinhole);
  /// Once that is done for all. `seen`: the scene and its viewpoints.
  void feather(const Resources& seen);
  /// A layer a projector: 0 at an edge ... 1 away from edges, a texel a block.
  const GlName& fade() const { return kept_; }

 private:
  ComputePass where_, find_, handed_, rows_, fade_;
  GlName jumps_, marks_, along_rows_, kept_;
  std::vector<cv::Size> blocks_;    // of each projector's image
  PixelList may_jump_;              // blocks
  std::vector<PixelList> jumping_;  // blocks of each projector's image
};

}  // namespace limn::projector
