#pragma once

#include <array>
#include <string>

#include "gui/gui.h"
#include "session/operator_view.h"

namespace limn::apps {

/// The operator's window, drawn: OperatorView -> ImGui -> what the person asked for. Holds only what belongs
/// to looking: which image is large, a name half typed.
class OperatorPanel {
 public:
  /// Within a frame of `gui`.
  OperatorAsked draw(Gui& gui, const OperatorView& view);
  /// Asks whether the session is to end; asked again, goes on.
  void ask_to_end() { asks_to_end_ = !asks_to_end_; }

 private:
  void draw_bar(const Gui& gui, const OperatorView& view);
  void draw_images(Gui& gui, const OperatorView& view, ImVec2 size);
  bool draw_image(Gui& gui,
                  const OperatorView::Image& image,
                  const OperatorView& view,
                  ImVec2 corner,
                  ImVec2 size,
                  bool is_large);
  void draw_remote(Gui& gui, const OperatorView& view, ImVec2 size);
  void draw_viewers(const Gui& gui, const OperatorView& view);
  void draw_slots(const Gui& gui, const OperatorView& view);
  void draw_material(const Gui& gui, const std::string& slot, const scene::MaterialOverride& now);
  void draw_looks(const Gui& gui, const OperatorView& view);
  void draw_light(const Gui& gui, const scene::ShowState& show_state);
  void draw_comparison(const Gui& gui, const scene::ShowState& show_state);
  void draw_question(const Gui& gui);
  void ask(scene::ActionId action, const std::string& slot = "", const std::string& value = "") {
    asked_.edits.push_back(scene::make_edit(action, slot, value));
  }

  OperatorAsked asked_;
  std::string large_;  // an image's name; empty: the first
  std::array<char, 65> look_{};
  std::array<float, 5> light_ = {30, 45, 0.65F, 0.35F, 0.15F};  // as last asked for, in the action's order
  bool asks_to_end_ = false;
  bool shows_remote_ = false;
  std::size_t entrance_ = 1;  // whose code is shown
};

}  // namespace limn::apps
