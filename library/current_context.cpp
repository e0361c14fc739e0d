#include "library/current_context.h"

#include <dlfcn.h>
#include <epoxy/egl.h>

#include "library/convert.h"

namespace limn::LIMN_VERSIONED {
namespace {

CurrentContext current_context() {
  return {eglGetCurrentDisplay(), eglGetCurrentContext(), eglGetCurrentSurface(EGL_DRAW),
          eglGetCurrentSurface(EGL_READ)};
}

bool make_current(const CurrentContext& wanted) {
  eglBindAPI(EGL_OPENGL_API);
  return eglMakeCurrent(wanted[0], wanted[2], wanted[3], wanted[1]) == EGL_TRUE;
}

// Makes `before` current again; nothing is current where it was empty.
void restore(const CurrentContext& before, void* own_display) {
  if (before[1] == EGL_NO_CONTEXT)
    make_current({own_display, EGL_NO_CONTEXT, EGL_NO_SURFACE, EGL_NO_SURFACE});
  else
    make_current(before);
}

}  // namespace

OwnContext::OwnContext() {
  // epoxy ends the process when the library is missing; the error of create() says so.
  const bool has_egl = dlopen("libEGL.so.1", RTLD_LAZY | RTLD_GLOBAL) != nullptr;
  const CurrentContext before = has_egl ? current_context() : CurrentContext{};
  context_.emplace(value_of(limn::device::GlContext::create()));
  handles_ = current_context();
  restore(before, handles_[0]);
}

OwnContext::Scope::Scope(const OwnContext* context) : context_(context) {
  if (!context_) return;
  before_ = current_context();
  if (!make_current(context_->handles_))
    throw Error(
        "renderer: expected that this thread can use the renderer's OpenGL context, but EGL refuses it. Is "
        "another thread drawing with this renderer, or is a context of GLX current on this thread? Then draw "
        "from a thread of its own, or give the renderer your context (GlContext::current).");
}

OwnContext::Scope::~Scope() {
  if (context_) restore(before_, context_->handles_[0]);
}

}  // namespace limn::LIMN_VERSIONED
