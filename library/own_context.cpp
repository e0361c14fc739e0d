#include "library/own_context.h"

#include "library/convert.h"

namespace limn::LIMN_VERSIONED {
namespace {

// Makes what was current before current again; nothing is where it is empty.
void restore(const limn::device::EglCurrent& before, void* own_display) {
  limn::device::EglCurrent wanted = before;
  if (!before.context) wanted.display = own_display;
  limn::device::make_egl_current(wanted);
  limn::device::bind_egl_api(before);
}

}  // namespace

OwnContext::OwnContext() {
  const limn::device::EglCurrent before = limn::device::egl_current();
  try {
    context_.emplace(value_of(limn::device::GlContext::create()));
    handles_ = limn::device::egl_current();
  } catch (...) {
    restore(before, limn::device::egl_current().display);
    throw;
  }
  restore(before, handles_.display);
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
  if (context_) restore(before_, context_->handles_.display);
}

}  // namespace limn::LIMN_VERSIONED
