#include "wizard/window/board_size_input.h"

#include <fmt/format.h>
#include <imgui.h>

#include <algorithm>

#include "calib/board_print.h"

namespace limn::wizard {
namespace {

void wrapped(ImU32 colour, const std::string& text) {
  ImGui::PushStyleColor(ImGuiCol_Text, colour);
  ImGui::TextWrapped("%s", text.c_str());
  ImGui::PopStyleColor();
}

// A line with an arrow at both ends.
void draw_length(ImDrawList* draw, ImVec2 from, ImVec2 to, float head) {
  const ImU32 colour = gui::colour::k_warn;
  draw->AddLine(from, to, colour, 2);
  const ImVec2 along = from.x == to.x ? ImVec2(0, head) : ImVec2(head, 0), across(along.y / 2, along.x / 2);
  const auto tip = [&](ImVec2 at, float sign) {
    const ImVec2 base(at.x + sign * along.x, at.y + sign * along.y);
    draw->AddTriangleFilled(at, {base.x + across.x, base.y + across.y},
                            {base.x - across.x, base.y - across.y}, colour);
  };
  tip(from, 1);
  tip(to, -1);
}

// The board with its two lengths.
void draw_lengths(const gui::Gui& gui, const calib::Board& board) {
  const auto width = static_cast<float>(board.width_m()), height = static_cast<float>(board.height_m());
  const float margin = gui.em();
  const float room = std::min(ImGui::GetContentRegionAvail().x, 16 * gui.em()) - margin;
  const float scale = std::min(room / width, 8 * gui.em() / height);
  const ImVec2 at = ImGui::GetCursorScreenPos(), corner(at.x, at.y + margin);
  ImDrawList& draw = *ImGui::GetWindowDrawList();
  const auto place = [&](double x, double y) {
    return ImVec2(corner.x + scale * static_cast<float>(x), corner.y + scale * static_cast<float>(y));
  };
  draw.AddRectFilled(place(0, 0), place(width, height), IM_COL32(225, 225, 225, 255));
  const ImU32 ink = IM_COL32(40, 40, 40, 255);
  for (int row = 0; row < board.rows; ++row) {
    for (int column = 0; column < board.columns && !board.is_circles(); ++column) {
      if (board.is_black(column, row))
        draw.AddRectFilled(place(board.p_line(column), board.p_line(row)),
                           place(board.p_line(column + 1), board.p_line(row + 1)), ink);
    }
  }
  for (int id = 0; id < board.corner_count() && board.is_circles(); ++id)
    draw.AddCircleFilled(place(board.p_corner(id).x(), board.p_corner(id).y()),
                         0.25F * scale * static_cast<float>(board.square_m), ink);
  const Eigen::Vector3d first = board.p_corner(0), last = board.p_corner(board.corner_count() - 1);
  const float head = 0.5F * gui.em(), off = 0.5F * margin;
  const ImVec2 low = place(first.x(), first.y()), high = place(last.x(), last.y());
  const float above = corner.y - off, beside = corner.x + scale * width + off;
  draw_length(&draw, {low.x, above}, {high.x, above}, head);
  draw_length(&draw, {beside, low.y}, {beside, high.y}, head);
  for (const float x : {low.x, high.x}) draw.AddLine({x, above}, {x, low.y}, gui::colour::k_warn, 1);
  for (const float y : {low.y, high.y}) draw.AddLine({beside, y}, {high.x, y}, gui::colour::k_warn, 1);
  ImGui::Dummy({scale * width + margin, scale * height + margin});
}

}  // namespace

bool draw_board_size(gui::Gui& gui, const calib::Board& board, BoardSizeInput* input) {
  gui::heading(gui, "Size of the printed board");
  if (!input->taken.empty()) {
    wrapped(gui::colour::k_good, "The solve uses " + input->taken + ".");
    return false;
  }
  const Eigen::Vector2d mm = 1e3 * calib::nominal_lengths(board);
  wrapped(gui::colour::k_quiet,
          fmt::format(
              "Printers are off by a thousandth or two, and nothing else shows it. Measure from the first "
              "to the last {}, across and down ({:.1f} and {:.1f} mm by the board's text), with callipers "
              "(uncertainty 0.03 mm) or a ruler (0.1 mm).",
              board.is_circles() ? "circle's centre" : "inner corner", mm.x(), mm.y()));
  draw_lengths(gui, board);
  const std::string example = fmt::format("{:.1f}x{:.1f}mm:0.1", mm.x(), mm.y());
  ImGui::SetNextItemWidth(-5 * gui.em());
  bool is_entered = ImGui::InputTextWithHint("##board_size", example.c_str(), input->text.data(),
                                             input->text.size(), ImGuiInputTextFlags_EnterReturnsTrue);
  ImGui::SameLine();
  is_entered |= ImGui::Button("Use", {-1, 0});
  if (!input->problem.empty()) wrapped(gui::colour::k_bad, input->problem);
  if (!is_entered) return false;
  const std::string text = input->text.data();
  const auto measured = calib::parse_board_measured(text);
  const Status checked = measured ? calib::check_measured(board, *measured) : Status(measured.error());
  input->problem = checked ? "" : checked.message();
  if (!checked) return false;
  input->taken = text;
  return true;
}

}  // namespace limn::wizard
