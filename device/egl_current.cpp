#include "device/egl_current.h"

#include <dlfcn.h>
#include <epoxy/egl.h>

namespace limn::device {

EglCurrent egl_current() {
  // epoxy ends the process when the library is missing.
  if (!dlopen("libEGL.so.1", RTLD_LAZY | RTLD_GLOBAL)) return {};
  return {eglGetCurrentDisplay(), eglGetCurrentContext(), eglGetCurrentSurface(EGL_DRAW),
          eglGetCurrentSurface(EGL_READ), eglQueryAPI()};
}

bool make_egl_current(const EglCurrent& wanted) {
  // Each API has a current context of its own.
  eglBindAPI(wanted.context && wanted.api != 0 ? wanted.api : EGL_OPENGL_API);
  return eglMakeCurrent(wanted.display, wanted.draw_surface, wanted.read_surface, wanted.context) == EGL_TRUE;
}

void bind_egl_api(const EglCurrent& before) {
  if (before.api != 0) eglBindAPI(before.api);
}

}  // namespace limn::device
