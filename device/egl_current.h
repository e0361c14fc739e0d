#pragma once

namespace limn::device {

/// What is current on a thread for EGL; null pointers where nothing is.
struct EglCurrent {
  void* display = nullptr;
  void* context = nullptr;
  void* draw_surface = nullptr;
  void* read_surface = nullptr;
  unsigned api = 0;  ///< the bound API; 0: no EGL
};

/// What is current on the calling thread; nothing on a machine without EGL.
EglCurrent egl_current();

/// Makes a context current on the calling thread; with a display and no context nothing is current then.
/// False where EGL refuses: the context is current on another thread, or this thread has a context of GLX.
/// If it succeeds, the API of OpenGL is bound, on which eglCreateContext and others act.
bool make_egl_current(const EglCurrent& wanted);

/// Makes current again what egl_current() said before, with its API; nothing is current where nothing was.
/// Nothing happens on a machine without EGL.
void restore_egl_current(const EglCurrent& before);

}  // namespace limn::device
