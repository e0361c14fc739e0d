#include "device/gl_context.h"

#include <dlfcn.h>
#include <epoxy/egl.h>
#include <epoxy/gl.h>

#include <algorithm>
#include <cstring>
#include <vector>

namespace limn::device {

struct GlContext::Impl {
  EGLDisplay display = EGL_NO_DISPLAY;
  EGLContext context = EGL_NO_CONTEXT;
  std::string description;
  bool is_robust = false, is_lost = false;

  // The display stays initialised: it belongs to the whole process, and other contexts may use it.
  ~Impl() {
    if (context == EGL_NO_CONTEXT) return;
    if (eglGetCurrentContext() == context) {
      eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    }
    eglDestroyContext(display, context);
  }
};

namespace {

constexpr const char* k_advice =
    "Install a driver (Debian: libegl1 and libgl1-mesa-dri for software rendering).";

bool has_word(const char* list, const char* word) {
  if (!list) return false;
  const std::size_t length = std::strlen(word);
  for (const char* at = std::strstr(list, word); at; at = std::strstr(at + 1, word)) {
    if ((at == list || at[-1] == ' ') && (at[length] == ' ' || at[length] == '\0')) return true;
  }
  return false;
}

// EGL displays to try: hardware devices, software devices, then Mesa without a surface. With `own_threads`
// the last comes before the software devices: Mesa's software renderer has separate threads for each EGL
// display.
std::vector<EGLDisplay> candidate_displays(bool own_threads) {
  std::vector<EGLDisplay> displays;
  std::ptrdiff_t hardware = 0;
  const char* client = eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS);
  if (has_word(client, "EGL_EXT_device_enumeration") || has_word(client, "EGL_EXT_device_base")) {
    EGLint count = 0;
    eglQueryDevicesEXT(0, nullptr, &count);
    std::vector<EGLDeviceEXT> devices(static_cast<std::size_t>(std::max(count, 0)));
    if (count > 0) eglQueryDevicesEXT(count, devices.data(), &count);
    const auto software = std::stable_partition(devices.begin(), devices.end(), [](EGLDeviceEXT device) {
      return !has_word(eglQueryDeviceStringEXT(device, EGL_EXTENSIONS), "EGL_MESA_device_software");
    });
    hardware = software - devices.begin();
    for (const EGLDeviceEXT device : devices) {
      displays.push_back(eglGetPlatformDisplayEXT(EGL_PLATFORM_DEVICE_EXT, device, nullptr));
    }
  }
  if (has_word(client, "EGL_MESA_platform_surfaceless")) {
    displays.insert(own_threads ? displays.begin() + hardware : displays.end(),
                    eglGetPlatformDisplayEXT(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr));
  }
  std::erase(displays, EGL_NO_DISPLAY);
  return displays;
}

// Creates a context that reports its loss if the driver supports that, else an ordinary one.
EGLContext create_context(EGLDisplay display, bool* is_robust) {
  EGLint major = 0, minor = 0;
  if (!eglInitialize(display, &major, &minor) || !eglBindAPI(EGL_OPENGL_API)) return EGL_NO_CONTEXT;
  const EGLint config_wanted[] = {EGL_SURFACE_TYPE, 0, EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT, EGL_NONE};
  EGLConfig config = nullptr;
  EGLint count = 0;
  if (!eglChooseConfig(display, config_wanted, &config, 1, &count) || count < 1) return EGL_NO_CONTEXT;
  std::vector<EGLint> wanted = {EGL_CONTEXT_MAJOR_VERSION,       4,
                                EGL_CONTEXT_MINOR_VERSION,       5,
                                EGL_CONTEXT_OPENGL_PROFILE_MASK, EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT};
  std::vector<EGLint> robust = wanted;
  robust.insert(robust.end(), {EGL_CONTEXT_OPENGL_RESET_NOTIFICATION_STRATEGY, EGL_LOSE_CONTEXT_ON_RESET});
  for (std::vector<EGLint>* attributes : {&robust, &wanted}) {
    attributes->push_back(EGL_NONE);
    const EGLContext context = eglCreateContext(display, config, EGL_NO_CONTEXT, attributes->data());
    *is_robust = context != EGL_NO_CONTEXT && attributes == &robust;
    if (context != EGL_NO_CONTEXT) return context;
  }
  return EGL_NO_CONTEXT;
}

}  // namespace

// epoxy ends the process when the library is missing.
Status check_egl() {
  if (dlopen("libEGL.so.1", RTLD_LAZY | RTLD_GLOBAL)) return {};
  return error("OpenGL: expected the library libEGL.so.1, found none. {}", k_advice);
}

GlContext::GlContext(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
GlContext::GlContext(GlContext&&) noexcept = default;
GlContext& GlContext::operator=(GlContext&&) noexcept = default;
GlContext::~GlContext() = default;

Result<GlContext> GlContext::create(bool own_threads) {
  LIMN_TRY_STATUS(check_egl());
  const std::vector<EGLDisplay> displays = candidate_displays(own_threads);
  for (const EGLDisplay display : displays) {
    auto impl = std::make_unique<Impl>();
    impl->display = display;
    impl->context = create_context(display, &impl->is_robust);
    if (impl->context == EGL_NO_CONTEXT) continue;
    if (!eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, impl->context)) continue;
    impl->description = fmt::format("{}, {}", reinterpret_cast<const char*>(glGetString(GL_RENDERER)),
                                    reinterpret_cast<const char*>(glGetString(GL_VERSION)));
    return GlContext(std::move(impl));
  }
  return error(
      "OpenGL: expected an EGL device with desktop OpenGL 4.5, found {} EGL displays, none of which has it. "
      "{}",
      displays.size(), k_advice);
}

void GlContext::make_current() const {
  eglBindAPI(EGL_OPENGL_API);
  LIMN_CHECK(eglMakeCurrent(impl_->display, EGL_NO_SURFACE, EGL_NO_SURFACE, impl_->context));
}

bool GlContext::is_lost() const {
  if (glGetGraphicsResetStatus() != GL_NO_ERROR)
    impl_->is_lost = true;  // reported only until the reset ends, so it is stored
  return impl_->is_lost;
}

bool GlContext::is_robust() const { return impl_->is_robust; }

const std::string& GlContext::description() const { return impl_->description; }

}  // namespace limn::device
