#include "device/gui/gui_window.h"

#include <algorithm>
#include <utility>

namespace limn::gui {
namespace {

constexpr double k_period_s = 1 / 30.0, k_touched_s = 1 / 60.0;  // between images
constexpr double k_pause = 3;                                    // multiple of an image's drawing time

}  // namespace

Result<GuiWindow> GuiWindow::open(const device::Desktop& desktop,
                                  const std::string& title,
                                  int width,
                                  int height) {
  cv::Size most;  // the largest monitor
  for (const device::Monitor& monitor : desktop.monitors())
    if (monitor.size.area() > most.area()) most = monitor.size;
  const auto within = [](int wanted, int there) { return there > 0 ? std::min(wanted, there) : wanted; };
  LIMN_TRY(device::Window window, device::Window::open(desktop, {.title = title,
                                                                 .width = within(width, most.width),
                                                                 .height = within(height, most.height),
                                                                 .vsync = false,
                                                                 .escape_closes = false}));
  GuiWindow out(std::move(window));
  out.window_.in_context([&] { out.gui_ = std::make_unique<Gui>(out.window_.scale()); });
  return out;
}

GuiWindow& GuiWindow::operator=(GuiWindow&& other) noexcept {
  std::swap(window_, other.window_);
  std::swap(gui_, other.gui_);
  std::swap(input_, other.input_);
  std::swap(is_touched_, other.is_touched_);
  std::swap(drawn_at_, other.drawn_at_);
  std::swap(cost_s_, other.cost_s_);
  return *this;
}

GuiWindow::~GuiWindow() {
  if (gui_) window_.in_context([this] { gui_.reset(); });
}

std::vector<int> GuiWindow::pressed_keys() {
  const device::WindowInput now = window_.input();
  is_touched_ |= !now.keys.empty() || now.wheel != 0 || now.pointer != input_.pointer;
  input_.pointer = now.pointer;
  for (std::size_t i = 0; i < now.buttons.size(); ++i) {
    is_touched_ |= now.buttons[i] != input_.buttons[i];
    input_.buttons[i] |= now.buttons[i];
  }
  input_.wheel += now.wheel;
  input_.keys.insert(input_.keys.end(), now.keys.begin(), now.keys.end());
  input_.characters.insert(input_.characters.end(), now.characters.begin(), now.characters.end());
  std::vector<int> pressed;
  if (!gui_->is_typing())
    for (const device::WindowInput::Key& key : now.keys)
      if (key.is_down) pressed.push_back(key.code);
  return pressed;
}

bool GuiWindow::is_due(double also_s) const {
  if (window_.is_minimised()) return false;
  const double since_s = std::chrono::duration<double>(Clock::now() - drawn_at_).count();
  return since_s >= std::max(k_pause * (cost_s_ + also_s), is_touched_ ? k_touched_s : k_period_s);
}

void GuiWindow::draw(const std::function<void(Gui&)>& widgets) {
  const auto begun = Clock::now();
  const double since_s = std::chrono::duration<double>(begun - drawn_at_).count();
  window_.draw(
      [&](cv::Size pixels) { gui_->frame(pixels, std::min(since_s, 1.0), input_, [&] { widgets(*gui_); }); });
  input_ = {.pointer = input_.pointer};
  is_touched_ = false;
  drawn_at_ = Clock::now();
  cost_s_ = std::chrono::duration<double>(drawn_at_ - begun).count();
}

}  // namespace limn::gui
