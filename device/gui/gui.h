#pragma once

#include <imgui.h>

#include <Eigen/Core>
#include <functional>
#include <map>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "device/window.h"

namespace limn::gui {

/// Colours with fixed meanings, on a dark background.
namespace colour {
constexpr ImU32 k_text = IM_COL32(232, 230, 225, 255), k_quiet = IM_COL32(169, 166, 159, 255),
                k_line = IM_COL32(60, 65, 74, 255), k_panel = IM_COL32(27, 30, 36, 255),
                k_ground = IM_COL32(20, 22, 26, 255), k_good = IM_COL32(110, 211, 120, 255),
                k_warn = IM_COL32(245, 182, 66, 255), k_bad = IM_COL32(255, 107, 97, 255),
                k_blue = IM_COL32(127, 180, 255, 255), k_violet = IM_COL32(190, 140, 255, 255);
}  // namespace colour

/// An image as it is placed in a window.
struct PlacedImage {
  ImVec2 corner, size;
  float scale = 1;  ///< Window pixels for each image pixel.
  /// The position in the window of a point of the image (pixel centres at integers).
  ImVec2 of(const Eigen::Vector2d& px) const;
};

/// Dear ImGui with Limn's theme. Its GL context must be current at every call, also at creation and
/// destruction.
class Gui {
 public:
  /// `scale`: 1 on ordinary displays, 2 where pixels are half as large.
  explicit Gui(float scale);
  Gui(const Gui&) = delete;
  Gui& operator=(const Gui&) = delete;
  ~Gui();

  /// Draws a frame over the whole bound framebuffer: `widgets` calls ImGui's functions in one borderless
  /// ImGui window of that size. `seconds` is the time since the last frame.
  void frame(cv::Size pixels,
             double seconds,
             const device::WindowInput& input,
             const std::function<void()>& widgets);

  /// Whether the keys of the last frame went into a text field.
  bool is_typing() const;

  /// Shows an 8-bit grey or BGR image, centred and as large as fits. `name` keeps its texture from frame to
  /// frame. `is_linear`: its values are proportional to light and not yet sRGB-encoded.
  PlacedImage image(
      const std::string& name, const cv::Mat& image, ImVec2 corner, ImVec2 size, bool is_linear = false);

  float em() const { return em_; }  ///< Height of the text in pixels.
  ImFont* heading() const { return heading_; }

 private:
  struct Texture {
    unsigned id = 0;
    cv::Size size;
  };
  void feed(cv::Size pixels, double seconds, const device::WindowInput& input);
  float em_ = 0;
  ImGuiContext* context_ = nullptr;
  ImFont* heading_ = nullptr;
  bool is_typing_ = false;
  std::vector<int> released_;  // keys released in the last frame
  std::map<std::string, Texture> textures_;
};

/// A line of text in a colour, cut with … if it is too wide; then a tooltip shows the whole text.
void text_within(float width, ImU32 colour, const std::string& text);

/// The heading of a group.
void heading(const Gui& gui, const std::string& text);

/// A button that has the colour `lit` while its switch is on.
bool toggle(const std::string& label, bool is_on, ImU32 lit, ImVec2 size);

/// Text drawn over an image, on a background of its own.
void label_at(ImVec2 corner, ImU32 colour, const std::string& text);

}  // namespace limn::gui
