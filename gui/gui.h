#pragma once

#include <imgui.h>

#include <Eigen/Core>
#include <functional>
#include <map>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "device/window.h"

namespace limn::apps {

/// Colours that mean something, on dark ground.
namespace colour {
constexpr ImU32 k_text = IM_COL32(232, 230, 225, 255), k_quiet = IM_COL32(169, 166, 159, 255),
                k_line = IM_COL32(60, 65, 74, 255), k_panel = IM_COL32(27, 30, 36, 255),
                k_ground = IM_COL32(20, 22, 26, 255), k_good = IM_COL32(110, 211, 120, 255),
                k_warn = IM_COL32(245, 182, 66, 255), k_bad = IM_COL32(255, 107, 97, 255),
                k_blue = IM_COL32(127, 180, 255, 255), k_violet = IM_COL32(190, 140, 255, 255);
}  // namespace colour

/// An image as it lies in a window.
struct PlacedImage {
  ImVec2 corner, size;
  float scale = 1;  ///< window pixels an image's pixel
  /// Where a pixel of the image lies in the window (pixel centres at integers).
  ImVec2 of(const Eigen::Vector2d& px) const;
};

/// Dear ImGui with Limn's theme, in a GL context that is current at every call, creation and destruction
/// included.
class Gui {
 public:
  /// `scale`: 1 on ordinary displays, 2 where pixels are half as large.
  explicit Gui(float scale);
  Gui(const Gui&) = delete;
  Gui& operator=(const Gui&) = delete;
  ~Gui();

  /// A frame over all of the bound framebuffer: `widgets` calls ImGui's functions within one borderless
  /// ImGui window of that size. `seconds` since the last frame.
  void frame(cv::Size pixels,
             double seconds,
             const device::WindowInput& input,
             const std::function<void()>& widgets);

  /// Whether the keys of the last frame went into a text field.
  bool is_typing() const;

  /// Shows an 8-bit grey or BGR image as large as it fits into the place, centred; `name` keeps its texture
  /// from frame to frame. `is_linear`: its values are proportional to light, not yet encoded for the eye.
  PlacedImage image(
      const std::string& name, const cv::Mat& image, ImVec2 corner, ImVec2 size, bool is_linear = false);

  float em() const { return em_; }  ///< pixels of the text's height
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
  std::vector<int> released_;  // keys, let go in the last frame
  std::map<std::string, Texture> textures_;
};

/// A line of text in a colour, cut with … where the place ends; the whole text stands in a tooltip then.
void text_within(float width, ImU32 colour, const std::string& text);

/// A heading of a group.
void heading(const Gui& gui, const std::string& text);

/// A button that is lit in a colour while what it switches is on.
bool toggle(const std::string& label, bool is_on, ImU32 lit, ImVec2 size);

/// Text drawn at a place over an image, with ground behind it.
void label_at(ImVec2 corner, ImU32 colour, const std::string& text);

}  // namespace limn::apps
