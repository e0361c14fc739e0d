#pragma once

#include "core/result.h"
#include "projector/gl.h"
#include "projector/shader.h"
#include "projector/twin.h"

namespace limn::projector {

/// How much of its light each projector keeps beside the edges of the prototype and of its shadows on itself,
/// so that others take over there before light ends: found in its picture of ids' depth, in blocks of 8 x 8
/// texels.
class SoftEdges {
 public:
  /// For `projectors` pictures of up to width x height texels.
  static Result<SoftEdges> create(int projectors, int width, int height);

  /// Looks through the depth picture that a projector's ids were drawn with.
  void find(int projector, const GlName& depth, const Twin& twin);
  /// Binds a layer a projector: 0 at an edge ... 1 away from edges, a texel a block.
  void bind(const Program& program, int unit) const;

 private:
  Program jumps_, rows_, fade_;
  GlName marks_, along_rows_, kept_;
};

}  // namespace limn::projector
