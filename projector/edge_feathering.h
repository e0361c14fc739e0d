#pragma once

#include <opencv2/core/types.hpp>
#include <vector>

#include "core/result.h"
#include "projector/gl.h"
#include "projector/pass.h"
#include "projector/pinhole_view.h"
#include "projector/pixel_list.h"

namespace limn::projector {

/// Feathering weights: how much of its light each projector keeps near silhouettes of the prototype and near
/// its shadows on itself. Where another projector also lights the surface, that one takes over before this
/// one's light ends. The edges are found as depth discontinuities in the projector's depth buffer, in blocks
/// of 8 x 8 texels.
class EdgeFeathering {
 public:
  /// For `projectors` depth images of at most width x height texels.
  static Result<EdgeFeathering> create(int projectors, int width, int height);

  /// Finds the depth discontinuities of one projector; `depth` is the depth buffer of its triangle ids.
  void find(int projector, const GlName& depth, const PinholeView& pinhole);
  /// Computes the weights, after `find` has been called for all projectors. `seen` holds the scene and the
  /// viewpoints.
  void feather(const Resources& seen);
  /// The weights: one layer for each projector, one texel for each block; 0 at an edge, 1 away from edges.
  const GlName& fade() const { return kept_; }

 private:
  ComputePass where_, find_, handed_, rows_, fade_;
  GlName jumps_, marks_, along_rows_, kept_;
  std::vector<cv::Size> blocks_;    // number of blocks in each projector's image
  PixelList may_jump_;              // blocks that may contain a discontinuity
  std::vector<PixelList> jumping_;  // blocks with a discontinuity, for each projector
};

}  // namespace limn::projector
