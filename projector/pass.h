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

/// One drawing step: a program with the list of resources that it reads and writes. When it runs, it binds
/// exactly these. It depends on earlier passes only through the contents of the resources.
class Pass {
 public:
  struct Description {
    std::string shader;  ///< a file in shaders/
    Defines defines = {};
    std::vector<Resource> reads = {};
    std::vector<Resource> writes = {};
  };
  /// The program, for setting uniforms that belong to no resource, such as the number of samples.
  const Program& program() const { return program_; }
  /// Binds what it reads and writes and makes its program current. `resources` must hold all of these.
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

  /// Runs over rectangles in work groups of 16 x 4 pixels. The shader gets each rectangle as u_first and
  /// u_end.
  void run_over_rects(std::span<const cv::Rect> places, const Resources& resources) const;
  /// Runs over a pixel list, 64 pixels in each work group (shaders/work_list.glsl).
  void run_over_list(const PixelList& pixels, const Resources& resources) const;

 private:
  using Pass::Pass;
};

/// A fragment shader that draws each pixel of a canvas.
class FullscreenPass : public Pass {
 public:
  FullscreenPass() = default;
  static Result<FullscreenPass> link(const Description& description);

  /// Draws within `places`; the rest becomes black.
  void draw(const Canvas& into, std::span<const cv::Rect> places, const Resources& resources) const;
  void draw(const Canvas& into, const Resources& resources) const;

 private:
  FullscreenPass(Program program, const Description& description)
      : Pass(std::move(program), description), vertex_array_(make_vertex_array()) {}
  GlName vertex_array_;  // without attributes, for fullscreen.vert
};

}  // namespace limn::projector
