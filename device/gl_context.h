#pragma once

#include <memory>
#include <string>

#include "core/result.h"

namespace limn::device {

/// A desktop OpenGL 4.5 core context without a window, through EGL: hardware devices first, then software
/// ones, then Mesa without a surface. Current on the calling thread from creation on; what it owns in GL must
/// be destroyed before it.
class GlContext {
 public:
  /// Error when the machine has no EGL, or none that gives OpenGL 4.5; it says what was tried. `apart`: where
  /// software draws, by other threads than for contexts that are not, of the calling thread's priority, so
  /// that neither waits for the other's drawing.
  static Result<GlContext> create(bool own_threads = false);
  GlContext(GlContext&&) noexcept;
  GlContext& operator=(GlContext&&) noexcept;
  ~GlContext();

  /// Makes it current on the calling thread again, after a window's.
  void make_current() const;
  /// Whether the driver has given the context up (a GPU reset, its driver replaced). Then nothing is drawn
  /// any more; calls stay harmless. Let go of what lives in it, then of it, and create another. Must be
  /// current; always false where the driver cannot tell (is_robust).
  bool is_lost() const;
  /// Whether the driver promised to tell.
  bool is_robust() const;
  /// GL_RENDERER and GL_VERSION, for reports: "llvmpipe (LLVM 15.0.6, 256 bits), 4.5 (Core Profile)
  /// Mesa 22.3.6".
  const std::string& description() const;

 private:
  struct Impl;
  explicit GlContext(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace limn::device
