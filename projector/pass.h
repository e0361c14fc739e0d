#pragma once

#include <opencv2/core/types.hpp>
#include <span>
#include <string>
#include <vector>

#include "core/result.h"
#include "projector/canvas.h"
#include "projector/pixel_list.h"
#include "projector/resources.h"
#include "projector/shader.h"

namespace limn::projector {

/// A step of drawing: one program with all that it reads and writes. When it runs it binds these and nothing
/// else, so that it needs nothing of what ran before it but the contents.
class Pass {
 public:
  struct Description {
    std::string shader;  ///< a file in shaders/
    Defines defines = {};
    std::vector<Resource> reads = {};
    std::vector<Resource> writes = {};
  };
  /// For values of its own, such as the number of samples.
  const Program& program() const { return program_; }
  /// Binds what it reads and writes, all of which `resources` must have, and makes its program the current
  /// one.
  void use(const Resources& resources) const;

 protected:
  Pass() = default;
  Pass(Program program, const Description& description);

 private:
  struct Access {
    Resource resource;
    GLenum how;  // GL_READ_ONLY, GL_WRITE_ONLY or GL_READ_WRITE
  };
  Program program_;
  std::vector<Access> accesses_;
};

/// A compute shader, over rectangles of an image or over listed pixels.
class ComputePass : public Pass {
 public:
  ComputePass() = default;
  static Result<ComputePass> link(const Description& description);

  /// Over rectangles, 16 x 4 pixels a group, which are u_first ... u_end to the shader.
  void look_through(std::span<const cv::Rect> places, const Resources& resources) const;
  /// Over listed pixels, 64 a group (shaders/listed.glsl).
  void work_through(const PixelList& pixels, const Resources& resources) const;

 private:
  using Pass::Pass;
};

/// A fragment shader that draws each pixel of a canvas.
class FullscreenPass : public Pass {
 public:
  FullscreenPass() = default;
  static Result<FullscreenPass> link(const Description& description);

  /// Black outside of `places`.
  void draw(const Canvas& into, std::span<const cv::Rect> places, const Resources& resources) const;
  void draw(const Canvas& into, const Resources& resources) const;

 private:
  FullscreenPass(Program program, const Description& description)
      : Pass(std::move(program), description), vertex_array_(make_vertex_array()) {}
  GlName vertex_array_;  // without attributes, for whole.vert
};

}  // namespace limn::projector
