#pragma once

#include <optional>
#include <string>

#include "device/egl_current.h"
#include "device/gl_context.h"
#include "limn/export.h"

namespace limn::LIMN_VERSIONED {

/// An OpenGL context of the library's own. It is current only while the library draws, so that a thread keeps
/// the context that its program uses, and any thread may draw.
class OwnContext {
 public:
  /// Leaves the thread's current context as it is. Throws Error without OpenGL 4.5.
  OwnContext();

  /// The context is current as long as this exists, then what was current before.
  class Scope {
   public:
    /// Nothing happens without a context. Throws Error if another thread is drawing, or if EGL refuses this
    /// thread.
    explicit Scope(const OwnContext* context);
    ~Scope();
    Scope(const Scope&) = delete;
    Scope& operator=(const Scope&) = delete;

   private:
    const OwnContext* context_;
    limn::device::EglCurrent before_ = {};
  };

  /// As in device::GlContext.
  const std::string& description() const { return context_->description(); }

 private:
  std::optional<limn::device::GlContext> context_;
  limn::device::EglCurrent handles_ = {};
};

}  // namespace limn::LIMN_VERSIONED
