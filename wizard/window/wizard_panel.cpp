#include "wizard/window/wizard_panel.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>

#include "wizard/capture/still_room.h"
#include "wizard/error_colormap.h"

namespace limn::wizard {
namespace {

using State = WizardState;

ImU32 colour_of(State state) {
  return state == State::done    ? gui::colour::k_good
         : state == State::runs  ? gui::colour::k_blue
         : state == State::fails ? gui::colour::k_bad
                                 : gui::colour::k_quiet;
}

ImU32 colour_of(calib::Verdict worth) {
  return worth == calib::Verdict::good     ? gui::colour::k_good
         : worth == calib::Verdict::usable ? gui::colour::k_warn
                                           : gui::colour::k_bad;
}

ImU32 colour_of_mm(double mm) {
  const auto [red, green, blue] = error_rgb(mm);
  return IM_COL32(red, green, blue, 255);
}

void paragraph(ImU32 colour, const std::string& text) {
  ImGui::PushStyleColor(ImGuiCol_Text, colour);
  ImGui::PushTextWrapPos(0);
  ImGui::TextUnformatted(text.c_str());
  ImGui::PopTextWrapPos();
  ImGui::PopStyleColor();
}

void gap(const gui::Gui& gui) { ImGui::Dummy({0, 0.35F * gui.em()}); }

void draw_steps(const gui::Gui& gui, const WizardView& view) {
  gui::heading(gui, "Calibration");
  gap(gui);
  static const std::array<const char*, k_wizard_steps> k_names = {
      "Devices", "Outputs", "Exposure and focus", "Display latency", "Board", "Solve",
      "Result",  "Scan",    "Alignment",          "Painting"};
  for (std::size_t i = 0; i < view.steps.size(); ++i) {
    const WizardView::Step& step = view.steps[i];
    const ImVec2 at = ImGui::GetCursorScreenPos();
    const float r = 0.3F * gui.em();
    ImDrawList& draw = *ImGui::GetWindowDrawList();
    const ImVec2 centre{at.x + r, at.y + 0.55F * gui.em()};
    if (step.state == State::waits)
      draw.AddCircle(centre, r, colour_of(step.state), 0, 2);
    else
      draw.AddCircleFilled(centre, r, colour_of(step.state));
    ImGui::Indent(1.3F * gui.em());
    paragraph(step.state == State::waits ? gui::colour::k_quiet : gui::colour::k_text, k_names[i]);
    if (!step.words.empty())
      paragraph(step.state == State::fails ? gui::colour::k_bad : gui::colour::k_quiet, step.words);
    ImGui::Unindent(1.3F * gui.em());
    ImGui::Dummy({0, 0.1F * gui.em()});
  }
}

// Draws the cells where boards were seen as a translucent layer, denser where they were seen more often.
void draw_cells(const SeenCells& seen, const gui::PlacedImage& placed, ImU32 colour) {
  if (seen.columns == 0 || seen.rows == 0) return;
  const float w = placed.size.x / static_cast<float>(seen.columns),
              h = placed.size.y / static_cast<float>(seen.rows);
  for (std::size_t i = 0; i < seen.counts.size(); ++i) {
    if (seen.counts[i] == 0) continue;
    const auto column = static_cast<float>(i % static_cast<std::size_t>(seen.columns)),
               row = static_cast<float>(i / static_cast<std::size_t>(seen.columns));
    const auto alpha = static_cast<ImU32>(std::min(150, 45 + 15 * seen.counts[i]));
    const ImVec2 at{placed.corner.x + column * w, placed.corner.y + row * h};
    ImGui::GetWindowDrawList()->AddRectFilled(at, {at.x + w, at.y + h},
                                              (colour & 0x00FFFFFFU) | alpha << IM_COL32_A_SHIFT);
  }
}

void outline(const std::vector<Eigen::Vector2d>& px, const gui::PlacedImage& placed, ImU32 colour) {
  std::vector<ImVec2> corners;
  for (const Eigen::Vector2d& corner : px) corners.push_back(placed.of(corner));
  ImGui::GetWindowDrawList()->AddPolyline(corners.data(), static_cast<int>(corners.size()), colour,
                                          ImDrawFlags_Closed, 3);
}

void draw_camera(
    gui::Gui& gui, const WizardView& view, const WizardView::Camera& camera, ImVec2 corner, ImVec2 size) {
  ImDrawList& draw = *ImGui::GetWindowDrawList();
  const float caption = 1.35F * gui.em();
  const ImVec2 inner{corner.x, corner.y + caption};
  const ImVec2 end{corner.x + size.x, corner.y + size.y};
  draw.AddText(
      corner, gui::colour::k_quiet,
      fmt::format("{} · covered by boards: {:.0f} %", camera.name, 100 * camera.seen.share()).c_str());
  draw.AddRectFilled(inner, end, IM_COL32(12, 13, 15, 255), 3);
  ImGui::PushClipRect(inner, end, true);
  const cv::Mat empty(camera.height, camera.width, CV_8UC1, cv::Scalar(12));
  const gui::PlacedImage placed =
      gui.image(camera.name, camera.image.empty() ? empty : camera.image, inner, {size.x, size.y - caption});
  draw_cells(camera.seen, placed, gui::colour::k_blue);
  if (!view.is_over && !camera.target.empty()) outline(camera.target, placed, gui::colour::k_warn);
  if (!view.is_over)
    for (const Eigen::Vector2d& px : camera.corners)
      draw.AddCircleFilled(placed.of(px), 2.5F, gui::colour::k_good);
  ImGui::PopClipRect();
}

// Draws the cameras' images side by side, as large as fits.
void draw_cameras(gui::Gui& gui, const WizardView& view, ImVec2 size) {
  if (view.cameras.empty()) return;
  const float space = 0.5F * gui.em();
  const auto count = static_cast<float>(view.cameras.size());
  const bool is_wide = size.x > size.y;
  const ImVec2 cell = is_wide ? ImVec2((size.x + space) / count - space, size.y)
                              : ImVec2(size.x, (size.y + space) / count - space);
  const ImVec2 at = ImGui::GetCursorScreenPos();
  for (std::size_t i = 0; i < view.cameras.size(); ++i) {
    const auto step = static_cast<float>(i) * ((is_wide ? cell.x : cell.y) + space);
    draw_camera(gui, view, view.cameras[i], is_wide ? ImVec2(at.x + step, at.y) : ImVec2(at.x, at.y + step),
                cell);
  }
  ImGui::SetCursorScreenPos({at.x, at.y + size.y});
}

void draw_projectors(const gui::Gui& gui, const WizardView& view, ImVec2 size) {
  if (view.projectors.empty()) return;
  const float space = 0.5F * gui.em(), caption = 1.35F * gui.em();
  const float width = (size.x + space) / static_cast<float>(view.projectors.size()) - space;
  const ImVec2 at = ImGui::GetCursorScreenPos();
  ImDrawList& draw = *ImGui::GetWindowDrawList();
  for (std::size_t i = 0; i < view.projectors.size(); ++i) {
    const WizardView::Projector& projector = view.projectors[i];
    const ImVec2 corner{at.x + static_cast<float>(i) * (width + space), at.y};
    draw.AddText(corner, gui::colour::k_quiet,
                 fmt::format("{} · {:.0f} %", projector.name, 100 * projector.seen.share()).c_str());
    const float scale = std::min(width / static_cast<float>(projector.width),
                                 (size.y - caption) / static_cast<float>(projector.height));
    const gui::PlacedImage placed{
        {corner.x, corner.y + caption},
        {scale * static_cast<float>(projector.width), scale * static_cast<float>(projector.height)},
        scale};
    draw.AddRectFilled(placed.corner, {placed.corner.x + placed.size.x, placed.corner.y + placed.size.y},
                       IM_COL32(12, 13, 15, 255), 3);
    draw_cells(projector.seen, placed, gui::colour::k_violet);
  }
  ImGui::SetCursorScreenPos({at.x, at.y + size.y});
}

// Draws a curve over the poses on a logarithmic scale, and its newest value as a number.
void draw_curve(const gui::Gui& gui,
                const std::string& name,
                const std::vector<std::optional<double>>& values,
                const std::string& unit,
                double limit,
                float height) {
  std::optional<double> last;
  double least = limit, most = limit;
  for (const auto& value : values) {
    if (!value || !std::isfinite(*value) || *value <= 0) continue;
    last = value;
    least = std::min(least, *value);
    most = std::max(most, *value);
  }
  ImGui::TextUnformatted(name.c_str());
  const std::string figure = last ? fmt::format("{:.2g} {}", *last, unit) : "no rig yet";
  ImGui::SameLine(ImGui::GetWindowContentRegionMax().x - ImGui::CalcTextSize(figure.c_str()).x);
  ImGui::PushStyleColor(ImGuiCol_Text, !last            ? gui::colour::k_quiet
                                       : *last <= limit ? gui::colour::k_good
                                                        : gui::colour::k_warn);
  ImGui::TextUnformatted(figure.c_str());
  ImGui::PopStyleColor();
  const ImVec2 at = ImGui::GetCursorScreenPos(), size{ImGui::GetContentRegionAvail().x, height};
  ImGui::Dummy(size);
  ImDrawList& draw = *ImGui::GetWindowDrawList();
  draw.AddRectFilled(at, {at.x + size.x, at.y + size.y}, gui::colour::k_ground, 3);
  const double low = std::log(least / 1.3), high = std::log(most * 1.3);
  const auto y_of = [&](double value) {
    return at.y + size.y * static_cast<float>(1 - (std::log(value) - low) / (high - low));
  };
  draw.AddLine({at.x, y_of(limit)}, {at.x + size.x, y_of(limit)}, gui::colour::k_line, 1);
  const float step = size.x / static_cast<float>(std::max<std::size_t>(9, values.size()));
  std::optional<ImVec2> before;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!values[i] || !std::isfinite(*values[i]) || *values[i] <= 0) continue;
    const ImVec2 point{at.x + step * (static_cast<float>(i) + 0.5F), y_of(*values[i])};
    if (before) draw.AddLine(*before, point, gui::colour::k_blue, 2);
    draw.AddCircleFilled(point, 4, gui::colour::k_blue);
    before = point;
  }
  // The label stands on the right while the curve is short, later on the left.
  const std::string words = fmt::format("good: {:g}", limit);
  const float width = ImGui::CalcTextSize(words.c_str()).x;
  gui::label_at({values.size() <= 5 ? at.x + size.x - width - 6 : at.x + 6,
                 std::clamp(y_of(limit) - gui.em() - 2, at.y + 1, at.y + size.y - gui.em() - 1)},
                gui::colour::k_quiet, words);
}

void draw_progress(const gui::Gui& gui, const WizardView& view) {
  std::vector<std::optional<double>> px, mm;
  for (const WizardView::Judged& judged : view.judged) {
    px.push_back(judged.held_out_px);
    mm.push_back(judged.predicted_mm);
  }
  const float height = 4.2F * gui.em();
  gui::heading(gui, fmt::format("After {} of {} poses", view.judged.size(), view.poses));
  draw_curve(gui, "held-out error", px, "px", calib::k_good_px, height);
  draw_curve(gui, "light error (95 %)", mm, "mm", calib::k_good_mm, height);
  if (!view.advice.empty()) paragraph(gui::colour::k_text, view.advice);
}

// Draws the histogram of each camera's grey levels under each projector's light.
void draw_light(const gui::Gui& gui, const WizardView& view) {
  if (view.light.empty()) return;
  gui::heading(gui, "Exposure");
  for (const ExposureReading& seen : view.light) {
    paragraph(gui::colour::k_quiet,
              seen.lit > 0 ? fmt::format("{}, light of {}: {:.1f} % saturated, edge blur {:.1f} px",
                                         seen.camera, seen.projector, 100 * seen.saturated, seen.blur_px)
                           : fmt::format("{} sees no light from {}", seen.camera, seen.projector));
    const ImVec2 at = ImGui::GetCursorScreenPos(), size{ImGui::GetContentRegionAvail().x, 3 * gui.em()};
    ImGui::Dummy(size);
    ImDrawList& draw = *ImGui::GetWindowDrawList();
    draw.AddRectFilled(at, {at.x + size.x, at.y + size.y}, gui::colour::k_ground, 3);
    constexpr std::size_t k_bars = 64;
    std::array<double, k_bars> bars{};
    for (std::size_t level = 0; level < seen.histogram.size(); ++level)
      bars[level * k_bars / 256] += seen.histogram[level];
    const double most = std::max(1.0, *std::max_element(bars.begin(), bars.end()));
    const float width = size.x / k_bars;
    for (std::size_t i = 0; i < k_bars; ++i) {
      const float x = at.x + width * static_cast<float>(i);
      const float height = (size.y - 4) * static_cast<float>(std::sqrt(bars[i] / most));
      draw.AddRectFilled({x, at.y + size.y - height}, {x + width - 1, at.y + size.y},
                         i + 1 == k_bars ? gui::colour::k_warn : gui::colour::k_blue);
    }
  }
}

void draw_faults(const gui::Gui& gui, const WizardView& view) {
  if (view.faults.empty() && view.to_do.empty()) return;
  gui::heading(gui, !view.faults.empty()                 ? "Problems to fix"
                    : view.worth == calib::Verdict::good ? "Possible improvements"
                                                         : "Advice");
  for (const calib::Fault& fault : view.faults) {
    std::string advice = fault.advice + ".";
    advice[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(advice[0])));
    paragraph(fault.severity == calib::Severity::note    ? gui::colour::k_text
              : fault.severity == calib::Severity::doubt ? gui::colour::k_warn
                                                         : gui::colour::k_bad,
              advice);
    paragraph(gui::colour::k_quiet, fault.evidence);
  }
  for (const std::string& sentence : view.to_do) paragraph(gui::colour::k_text, sentence);
}

// Draws light's predicted error over camera 0's image: the middle plane of each projector's map.
void draw_maps(gui::Gui& gui, const WizardView& view, ImVec2 size) {
  const float space = 0.5F * gui.em(), caption = 1.35F * gui.em();
  const float width = (size.x + space) / static_cast<float>(view.maps.size()) - space;
  const ImVec2 at = ImGui::GetCursorScreenPos();
  ImDrawList& draw = *ImGui::GetWindowDrawList();
  for (std::size_t i = 0; i < view.maps.size(); ++i) {
    const calib::ErrorMap& map = view.maps[i];
    if (map.planes.empty() || map.columns < 1 || map.rows < 1) continue;
    const calib::ErrorMap::Plane& plane = map.planes[map.planes.size() / 2];
    const ImVec2 corner{at.x + static_cast<float>(i) * (width + space), at.y};
    const std::string words = fmt::format("{} at {:.2f} m · at most {:.2f} mm",
                                          view.projectors[static_cast<std::size_t>(map.projector)].name,
                                          plane.depth_m, map.worst_mm());
    draw.AddText(corner, gui::colour::k_quiet, words.c_str());
    const float cell =
        std::min(width / static_cast<float>(map.columns), (size.y - caption) / static_cast<float>(map.rows));
    for (std::size_t j = 0; j < plane.p95_mm.size(); ++j) {
      const auto column = static_cast<float>(j % static_cast<std::size_t>(map.columns)),
                 row = static_cast<float>(j / static_cast<std::size_t>(map.columns));
      const ImVec2 from{corner.x + column * cell, corner.y + caption + row * cell};
      const double mm = plane.p95_mm[j];
      draw.AddRectFilled(from, {from.x + cell - 1, from.y + cell - 1},
                         std::isfinite(mm) ? colour_of_mm(mm) : IM_COL32(12, 13, 15, 255));
    }
  }
  ImGui::SetCursorScreenPos({at.x, at.y + size.y});
}

void draw_images_taken(const gui::Gui& gui, const WizardView& view) {
  if (view.images_of == 0) return;
  ImGui::PushStyleColor(ImGuiCol_PlotHistogram, gui::colour::k_blue);
  ImGui::ProgressBar(static_cast<float>(view.images) / static_cast<float>(view.images_of),
                     {-1, 0.4F * gui.em()}, "");
  ImGui::PopStyleColor();
}

// Draws what to do next, in large letters above the images.
void draw_task(const gui::Gui& gui, const WizardView& view) {
  if (view.is_over) {
    const bool has_rig = view.failure.empty();
    ImGui::PushStyleColor(ImGuiCol_Text, has_rig ? colour_of(view.worth) : gui::colour::k_bad);
    gui::heading(gui, has_rig ? fmt::format("The rig is {}", calib::to_text(view.worth)) : "No rig was made");
    ImGui::PopStyleColor();
    paragraph(gui::colour::k_text, has_rig ? view.verdict : view.failure);
    const WizardView::Step& painted = view.steps[static_cast<std::size_t>(WizardStep::paint)];
    if (painted.state == State::done) paragraph(gui::colour::k_text, "The prototype: " + painted.words + ".");
    return;
  }
  if (view.is_leaving) {
    gui::heading(gui, "Leaving");
    paragraph(gui::colour::k_quiet, "The captured images are kept; the same command continues from there.");
    return;
  }
  if (view.has_rig) {
    gui::heading(gui, view.awaits_prototype ? "Put the prototype in its working position"
                                            : "Do not move the prototype: it is being scanned");
    if (view.awaits_prototype)
      paragraph(gui::colour::k_quiet,
                fmt::format("Remove the board. The scan starts when nothing has moved for {:.0f} s.",
                            StillRoom::k_rest_s));
    draw_images_taken(gui, view);
    return;
  }
  if (view.place.empty()) {
    gui::heading(gui, "Preparing");
    paragraph(gui::colour::k_quiet, "The devices are checked before the first pose.");
    return;
  }
  const auto is_checked = [&](WizardStep step) {
    return view.steps.at(static_cast<std::size_t>(step)).state == State::runs;
  };
  const bool is_checking = is_checked(WizardStep::outputs) || is_checked(WizardStep::latency);
  gui::heading(gui, fmt::format("Pose {} of {}: {}", view.pose + 1, view.poses,
                                is_checking         ? "hold the board still while the devices are checked"
                                : view.is_capturing ? "hold the board still"
                                                    : "evaluating the images"));
  paragraph(gui::colour::k_text, "Board: " + view.place);
  if (view.is_capturing) draw_images_taken(gui, view);
}

WizardWish draw_buttons(const gui::Gui& gui, const WizardView& view) {
  WizardWish wish = WizardWish::none;
  const ImVec2 size{0, 1.9F * gui.em()};
  if (view.is_over) {
    if (ImGui::Button("Close", {8 * gui.em(), size.y})) wish = WizardWish::leave;
    return wish;
  }
  const float space = ImGui::GetStyle().ItemSpacing.x;
  const ImVec2 one{std::min(10 * gui.em(), (ImGui::GetContentRegionAvail().x - 3 * space) / 4), size.y};
  const auto button = [&](const char* name, bool is_possible, const char* what, WizardWish wanted) {
    ImGui::BeginDisabled(!is_possible);
    if (ImGui::Button(name, one)) wish = wanted;
    ImGui::EndDisabled();
    if (ImGui::IsItemHovered()) ImGui::SetTooltip("%s", what);
  };
  if (view.has_rig) {
    button("Scan now", view.awaits_prototype, "The prototype is in place: start the scan", WizardWish::scan);
    ImGui::SameLine();
    button("Skip", view.awaits_prototype, "Finish without a scan; the rig is saved", WizardWish::skip);
    return wish;
  }
  button("Check again", view.is_capturing,
         "Check outputs, exposure and latency again, then capture this pose again", WizardWish::check);
  ImGui::SameLine();
  button("Repeat pose", view.is_capturing, "Capture this pose again", WizardWish::repeat);
  ImGui::SameLine();
  button("Finish", !view.judged.empty(), "Solve with the poses captured so far", WizardWish::finish);
  ImGui::SameLine();
  button("Leave", true, "Stop; the captured images are kept, and the next run continues from there",
         WizardWish::leave);
  return wish;
}

}  // namespace

WizardWish draw_wizard(gui::Gui& gui, const WizardView& view, BoardSizeInput* size) {
  const ImVec2 room = ImGui::GetContentRegionAvail();
  const float space = ImGui::GetStyle().ItemSpacing.x;
  const float left = std::clamp(0.17F * room.x, 11 * gui.em(), 15 * gui.em()),
              right = std::clamp(0.24F * room.x, 14 * gui.em(), 21 * gui.em()),
              middle = room.x - left - right - 2 * space;
  const ImVec2 at = ImGui::GetCursorPos();
  ImGui::BeginChild("steps", {left, room.y}, false, ImGuiWindowFlags_AlwaysUseWindowPadding);
  draw_steps(gui, view);
  ImGui::EndChild();

  ImGui::SetCursorPos({at.x + left + space, at.y});
  ImGui::BeginChild("middle", {middle, room.y}, false, ImGuiWindowFlags_NoBackground);
  draw_task(gui, view);
  gap(gui);
  const float foot = 1.9F * gui.em() + space;
  const ImVec2 rest{ImGui::GetContentRegionAvail().x, ImGui::GetContentRegionAvail().y - foot};
  const float low = std::floor(0.24F * rest.y);
  draw_cameras(gui, view, {rest.x, rest.y - low - space});
  ImGui::Dummy({0, 0});
  if (view.has_rig && !view.maps.empty())
    draw_maps(gui, view, {rest.x, low});
  else
    draw_projectors(gui, view, {rest.x, low});
  ImGui::SetCursorPosY(room.y - 1.9F * gui.em());
  const WizardWish wish = draw_buttons(gui, view);
  ImGui::EndChild();

  ImGui::SetCursorPos({at.x + left + middle + 2 * space, at.y});
  ImGui::BeginChild("right", {right, room.y}, false, ImGuiWindowFlags_AlwaysUseWindowPadding);
  draw_progress(gui, view);
  gap(gui);
  if (view.judged.empty()) draw_light(gui, view);
  draw_faults(gui, view);
  if (view.asks_for_size && !view.has_rig && !view.is_over) {
    gap(gui);
    draw_board_size(gui, view.board, size);
  }
  ImGui::EndChild();
  return wish;
}

}  // namespace limn::wizard
