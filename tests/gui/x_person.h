#pragma once

#include <X11/Xatom.h>
#include <X11/Xlib.h>
#include <X11/keysym.h>

#include <string>

#undef Status
#undef None
#undef Bool

namespace limn::test {

/// Somebody at an X display: presses keys in a window, moves the pointer, clicks, closes it.
class XPerson {
 public:
  XPerson() : display_(XOpenDisplay(nullptr)) {}
  XPerson(const XPerson&) = delete;
  XPerson& operator=(const XPerson&) = delete;
  ~XPerson() {
    if (display_) XCloseDisplay(display_);
  }

  /// Whether a window of that title is there; it is the one that the rest goes to.
  bool finds(const std::string& title) {
    Window root = 0, parent = 0, *children = nullptr;
    unsigned count = 0;
    window_ = 0;
    if (!display_ || !XQueryTree(display_, DefaultRootWindow(display_), &root, &parent, &children, &count))
      return false;
    for (unsigned i = 0; i < count; ++i) {
      char* name = nullptr;
      if (!XFetchName(display_, children[i], &name) || !name) continue;
      if (name == title) window_ = children[i];
      XFree(name);
    }
    if (children) XFree(children);
    return window_ != 0;
  }

  void press(KeySym key) {
    for (const bool is_down : {true, false}) {
      XEvent event{};
      event.xkey = {.type = is_down ? KeyPress : KeyRelease,
                    .serial = 0,
                    .send_event = True,
                    .display = display_,
                    .window = window_,
                    .root = DefaultRootWindow(display_),
                    .subwindow = 0,
                    .time = ++time_,
                    .x = 1,
                    .y = 1,
                    .x_root = 1,
                    .y_root = 1,
                    .state = 0,
                    .keycode = XKeysymToKeycode(display_, key),
                    .same_screen = True};
      send(&event, is_down ? KeyPressMask : KeyReleaseMask);
    }
  }

  void move(int x, int y) {
    XWarpPointer(display_, 0, window_, 0, 0, 0, 0, x, y);
    XFlush(display_);
  }

  void button(int x, int y, bool is_down) {
    XEvent event{};
    event.xbutton = {.type = is_down ? ButtonPress : ButtonRelease,
                     .serial = 0,
                     .send_event = True,
                     .display = display_,
                     .window = window_,
                     .root = DefaultRootWindow(display_),
                     .subwindow = 0,
                     .time = ++time_,
                     .x = x,
                     .y = y,
                     .x_root = x,
                     .y_root = y,
                     .state = 0,
                     .button = Button1,
                     .same_screen = True};
    send(&event, is_down ? ButtonPressMask : ButtonReleaseMask);
  }

  /// As the cross of its frame does.
  void close() {
    XEvent event{};
    event.xclient.type = ClientMessage;
    event.xclient.window = window_;
    event.xclient.message_type = XInternAtom(display_, "WM_PROTOCOLS", False);
    event.xclient.format = 32;
    event.xclient.data.l[0] = static_cast<long>(XInternAtom(display_, "WM_DELETE_WINDOW", False));
    send(&event, NoEventMask);
  }

 private:
  void send(XEvent* event, long mask) {
    XSendEvent(display_, window_, False, mask, event);
    XFlush(display_);
  }
  Display* display_;
  Window window_ = 0;
  Time time_ = 1000;
};

}  // namespace limn::test
