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
  const EGLenum api_before = eglQueryAPI();
  eglBindAPI(EGL_OPENGL_API);
  if (eglMakeCurrent(wanted.display, wanted.draw_surface, wanted.read_surface, wanted.context)) return true;
  eglBindAPI(api_before);
  return false;
}

void restore_egl_current(const EglCurrent& before) {
  if (before.api == 0) return;
  eglBindAPI(EGL_OPENGL_API);  // whose context is released; those of OpenGL and OpenGL ES replace each other
  const EGLDisplay display = before.context ? before.display : eglGetCurrentDisplay();
  if (display != EGL_NO_DISPLAY)
    eglMakeCurrent(display, before.draw_surface, before.read_surface, before.context);
  eglBindAPI(before.api);
}

}  // namespace limn::device
