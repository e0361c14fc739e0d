#include "device/egl_current.h"

#include <dlfcn.h>
#include <epoxy/egl.h>

namespace limn::device {

EglCurrent egl_current() {
  // epoxy ends the process when the library is missing.
  if (!dlopen("libEGL.so.1", RTLD_LAZY | RTLD_GLOBAL)) return {};
  return {eglGetCurrentDisplay(), eglGetCurrentContext(), eglGetCurrentSurface(EGL_DRAW),
          eglGetCurrentSurface(EGL_READ)};
}

bool make_egl_current(const EglCurrent& wanted) {
  eglBindAPI(EGL_OPENGL_API);
  return eglMakeCurrent(wanted.display, wanted.draw_surface, wanted.read_surface, wanted.context) == EGL_TRUE;
}

}  // namespace limn::device
