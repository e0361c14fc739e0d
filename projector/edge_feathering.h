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
  void find_edges(int projector, const GlName& depth, const PinholeView& pinhole);
  /// Computes the weights, after `find_edges` has been called for all projectors. `scene_resources` holds the
  /// scene and the viewpoints.
  void feather(const Resources& scene_resources);
  /// The weights: one layer for each projector, one texel for each block; 0 at an edge, 1 away from edges.
  const GlName& fade() const { return weights_; }

 private:
  ComputePass find_candidates_, find_edges_, mark_handover_, rows_, fade_;
  GlName depth_edges_, marks_, along_rows_, weights_;
  std::vector<cv::Size> blocks_;        // number of blocks in each projector's image
  PixelList candidate_blocks_;          // blocks that may contain a discontinuity
  std::vector<PixelList> edge_blocks_;  // blocks with a discontinuity, for each projector
};

}  // namespace limn::projector
