#pragma once

namespace limn::device {

/// What is current on a thread for EGL; null pointers where nothing is.
struct EglCurrent {
  void* display = nullptr;
  void* context = nullptr;
  void* draw_surface = nullptr;
  void* read_surface = nullptr;
  unsigned api = 0;  ///< the bound API, of which this is current; 0: none
};

/// What is current on the calling thread; nothing on a machine without EGL.
EglCurrent egl_current();

/// Makes a context current on the calling thread; with a display and no context nothing is current then.
/// False where EGL refuses: the context is current on another thread, or this thread has a context of GLX.
/// The API of OpenGL is bound then.
bool make_egl_current(const EglCurrent& wanted);

/// Binds the API that was bound: eglCreateContext and others act on the bound one.
void bind_egl_api(const EglCurrent& before);

}  // namespace limn::device
