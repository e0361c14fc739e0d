#pragma once

#include <memory>
#include <string>

#include "core/result.h"

namespace limn::device {

/// Error with what to install: the library EGL is missing. Without it any call of EGL ends the process.
Status check_egl();

/// A desktop OpenGL 4.5 core context without a window, through EGL: hardware devices first, then software
/// ones, then Mesa without a surface. It is current on the calling thread after creation. GL objects in it
/// must be destroyed before it.
class GlContext {
 public:
  /// Error when the machine has no EGL or no OpenGL 4.5; it says what was tried. `own_threads` matters for
  /// software rendering only: the context then gets its own worker threads with the calling thread's
  /// priority, so that it and other contexts do not wait for each other.
  static Result<GlContext> create(bool own_threads = false);
  GlContext(GlContext&&) noexcept;
  GlContext& operator=(GlContext&&) noexcept;
  ~GlContext();

  /// Makes the context current on the calling thread again, after a window's context.
  void make_current() const;
  /// Whether the context is lost (GPU reset, driver replaced). Then nothing is drawn any more, but calls are
  /// harmless. Destroy its GL objects and then the context, and create another. The context must be current.
  /// Always false if the driver does not report a loss (is_robust).
  bool is_lost() const;
  /// Whether the driver reports the loss of the context.
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
