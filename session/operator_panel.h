#pragma once

#include <array>
#include <string>

#include "device/gui/gui.h"
#include "session/operator_view.h"

namespace limn::session {

/// Draws the operator's window: OperatorView -> ImGui -> what the operator requests. Keeps only the state of
/// the window itself, such as the large image's name and a half-typed look name.
class OperatorPanel {
 public:
  /// To be called within a frame of `gui`.
  OperatorAsked draw(gui::Gui& gui, const OperatorView& view);
  /// Whether it shows the screen's image: it does not while the remote's codes take its place.
  bool shows_screen() const { return !shows_remote_; }
  /// Opens the question whether to end the session; called again, closes it.
  void ask_to_end() { asks_to_end_ = !asks_to_end_; }

 private:
  void draw_bar(const gui::Gui& gui, const OperatorView& view);
  void draw_images(gui::Gui& gui, const OperatorView& view, ImVec2 size);
  bool draw_image(gui::Gui& gui,
                  const OperatorView::Image& image,
                  const OperatorView& view,
                  ImVec2 corner,
                  ImVec2 size,
                  bool is_large);
  void draw_remote(gui::Gui& gui, const OperatorView& view, ImVec2 size);
  void draw_viewers(const gui::Gui& gui, const OperatorView& view);
  void draw_slots(const gui::Gui& gui, const OperatorView& view);
  void draw_material(const gui::Gui& gui, const std::string& slot, const scene::MaterialOverride& now);
  void draw_looks(const gui::Gui& gui, const OperatorView& view);
  void draw_light(const gui::Gui& gui, const scene::ShowState& show_state);
  void draw_comparison(const gui::Gui& gui, const scene::ShowState& show_state);
  void draw_question(const gui::Gui& gui);
  void ask(scene::ActionId action, const std::string& slot = "", const std::string& value = "") {
    asked_.edits.push_back(scene::make_edit(action, slot, value));
  }

  OperatorAsked asked_;
  std::string large_;  // the large image's name; empty: the first
  std::array<char, 65> look_{};
  std::array<float, 5> light_ = {30, 45, 0.65F, 0.35F, 0.15F};  // as last requested, in the action's order
  bool asks_to_end_ = false;
  bool shows_remote_ = false;
  std::size_t entrance_ = 1;  // index of the role whose code is shown
};

}  // namespace limn::session
