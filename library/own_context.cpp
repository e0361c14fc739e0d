#include "library/own_context.h"

#include "library/convert.h"

namespace limn::LIMN_VERSIONED {

OwnContext::OwnContext() {
  const limn::device::EglCurrent before = limn::device::egl_current();
  try {
    context_.emplace(value_of(limn::device::GlContext::create()));
    handles_ = limn::device::egl_current();
  } catch (...) {
    limn::device::restore_egl_current(before);
    throw;
  }
  limn::device::restore_egl_current(before);
}

OwnContext::Scope::Scope(const OwnContext* context) : context_(context) {
  if (!context_) return;
  before_ = limn::device::egl_current();
  if (!limn::device::make_egl_current(context_->handles_))
    throw Error(
        "renderer: expected that this thread can use the renderer's OpenGL context, but EGL refuses it. Is "
        "another thread drawing with this renderer, or is a context of GLX current on this thread? Then draw "
        "from a thread of its own, or give the renderer your context (GlContext::current).");
}

OwnContext::Scope::~Scope() {
  if (context_) limn::device::restore_egl_current(before_);
}

}  // namespace limn::LIMN_VERSIONED
