#include "session/operator_panel.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "core/photometric_response.h"
#include "scene/command_text.h"

namespace limn::session {
namespace {

using scene::ActionId;

// Limits of a small image: share of the height and of the width of the area for images.
constexpr float k_small_share = 0.32F, k_most_small = 0.25F;
constexpr float k_most_split_mm = 2000;  // limit for dragging the line
constexpr double k_plain = 0.8;          // assumed colour of a part without an override, linear
constexpr std::size_t k_points = 300;    // frames in the plot

// Labels for the values of Screen, in their order.
const char* const k_screens[] = {"camera + what light cannot show",
                                 "camera + whole parts",
                                 "camera only",
                                 "as the viewer sees it",
                                 "stereo",
                                 "nothing"};

float cell_height(const gui::Gui& gui) { return 1.35F * gui.em(); }

ImU32 colour_of(const std::optional<Track>& track) {
  if (!track) return gui::colour::k_quiet;
  return track->tracking == TrackingState::measured       ? gui::colour::k_good
         : track->tracking == TrackingState::extrapolated ? gui::colour::k_warn
                                                          : gui::colour::k_bad;
}

std::string words_of(const std::optional<Track>& track) {
  if (!track) return "not seen yet";
  return track->tracking == TrackingState::measured       ? "tracked"
         : track->tracking == TrackingState::extrapolated ? "extrapolated"
                                                          : "lost";
}

void dot(const gui::Gui& gui, ImU32 colour) {
  const ImVec2 at = ImGui::GetCursorScreenPos();
  const float r = 0.28F * gui.em();
  ImGui::GetWindowDrawList()->AddCircleFilled({at.x + r, at.y + 0.55F * gui.em()}, r, colour);
  ImGui::Dummy({2 * r, gui.em()});
  ImGui::SameLine(0, 0.5F * gui.em());
}

// Draws text at the right end of the line.
void right_text(ImU32 colour, const std::string& text) {
  const float width = ImGui::CalcTextSize(text.c_str()).x;
  ImGui::SameLine(std::max(ImGui::GetCursorPosX(), ImGui::GetWindowContentRegionMax().x - width));
  ImGui::PushStyleColor(ImGuiCol_Text, colour);
  ImGui::TextUnformatted(text.c_str());
  ImGui::PopStyleColor();
}

// A small button after the line's text; highlighted when something was chosen with it.
bool small_button(const gui::Gui& gui, const char* name, bool is_lit) {
  ImGui::SameLine(0, 0.8F * gui.em());
  ImGui::PushStyleColor(ImGuiCol_Text, is_lit ? gui::colour::k_blue : gui::colour::k_quiet);
  const bool is_clicked = ImGui::SmallButton(name);
  ImGui::PopStyleColor();
  return is_clicked;
}

double latency_ms(const ShownFrame& frame) {
  return 1e3 * seconds_between(frame.captured_at, frame.shown_at);
}

// The frames of the last second.
std::vector<ShownFrame> last_second(const std::vector<ShownFrame>& recent) {
  std::vector<ShownFrame> out;
  for (const ShownFrame& frame : recent)
    if (seconds_between(frame.shown_at, recent.back().shown_at) <= 1) out.push_back(frame);
  return out;
}

double mean(const std::vector<ShownFrame>& frames, double (*value)(const ShownFrame&)) {
  double sum = 0;
  int count = 0;
  for (const ShownFrame& frame : frames) {
    const double one = value(frame);
    if (one < 0) continue;
    sum += one;
    ++count;
  }
  return count > 0 ? sum / count : -1;
}

double per_second(const std::vector<ShownFrame>& frames) {
  if (frames.size() < 2) return 0;
  const double seconds = seconds_between(frames.front().shown_at, frames.back().shown_at);
  return seconds > 0 ? static_cast<double>(frames.size() - 1) / seconds : 0;
}

std::string clock_of(double seconds) {
  const int whole = static_cast<int>(std::max(0.0, seconds));
  return whole >= 3600 ? fmt::format("{}:{:02}:{:02}", whole / 3600, whole / 60 % 60, whole % 60)
                       : fmt::format("{}:{:02}", whole / 60, whole % 60);
}

// The end of a scale for a value: 1, 2 or 5 times a power of ten.
double round_above(double value) {
  const double power = std::pow(10, std::floor(std::log10(std::max(1e-9, value))));
  for (const double step : {1.0, 2.0, 5.0})
    if (step * power >= value) return step * power;
  return 10 * power;
}

void draw_plot(const std::vector<ShownFrame>& recent, ImVec2 size) {
  const ImVec2 at = ImGui::GetCursorScreenPos();
  ImGui::Dummy(size);
  ImDrawList& draw = *ImGui::GetWindowDrawList();
  draw.AddRectFilled(at, {at.x + size.x, at.y + size.y}, gui::colour::k_ground, 3);
  if (recent.size() < 2) return;
  const std::size_t begin = recent.size() > k_points ? recent.size() - k_points : 0;
  double most = 0;
  for (std::size_t i = begin; i < recent.size(); ++i) most = std::max(most, latency_ms(recent[i]));
  const double top = round_above(1.05 * std::max(1.0, most));
  const float text = ImGui::GetFontSize(), foot = 6, step = size.x / static_cast<float>(k_points - 1);
  const float height = size.y - text - foot - 4;
  const auto place = [&](std::size_t i, double ms) {
    return ImVec2(at.x + size.x - step * static_cast<float>(recent.size() - 1 - i),
                  at.y + text + 4 + height * static_cast<float>(1 - ms / top));
  };
  draw.AddLine({at.x, at.y + text + 4}, {at.x + size.x, at.y + text + 4}, gui::colour::k_line);
  std::vector<ImVec2> line;
  for (std::size_t i = begin; i < recent.size(); ++i) {
    line.push_back(place(i, latency_ms(recent[i])));
    const float x = line.back().x;
    if (recent[i].lost > 0)
      draw.AddRectFilled({x - step, at.y + size.y - foot}, {x, at.y + size.y}, gui::colour::k_bad);
    if (recent[i].missed > 0)
      draw.AddLine({x, at.y + size.y - foot - 8}, {x, at.y + size.y - foot}, gui::colour::k_warn, 2);
  }
  draw.AddPolyline(line.data(), static_cast<int>(line.size()), gui::colour::k_blue, 0, 2);
  draw.AddText({at.x + 6, at.y + 1}, gui::colour::k_quiet, fmt::format("{:.0f} ms", top).c_str());
}

// The times of the stages, and a plot of the latency.
void draw_telemetry(const gui::Gui& gui, const OperatorView& view) {
  gui::heading(gui, "Latency, camera to light");
  if (view.recent.empty()) {
    ImGui::TextDisabled("no frame shown yet");
    return;
  }
  const std::vector<ShownFrame> second = last_second(view.recent);
  int missed = 0, lost = 0;
  for (const ShownFrame& frame : view.recent) {
    missed += frame.missed;
    lost += frame.lost > 0;
  }
  right_text(gui::colour::k_text, fmt::format("{:.0f} ms", mean(second, latency_ms)));
  const float lines = 2 * ImGui::GetTextLineHeightWithSpacing();
  const ImVec2 room = ImGui::GetContentRegionAvail();
  draw_plot(view.recent, {room.x, std::max(2 * gui.em(), room.y - lines)});
  std::string stages;
  const std::pair<const char*, double (*)(const ShownFrame&)> all[] = {
      {"detect", [](const ShownFrame& f) { return f.detect_ms; }},
      {"pose", [](const ShownFrame& f) { return f.filter_ms; }},
      {"paint", [](const ShownFrame& f) { return f.paint_ms; }},
      {"screen", [](const ShownFrame& f) { return f.screen_ms; }},
      {"record", [](const ShownFrame& f) { return f.record_ms; }}};
  for (const auto& [name, value] : all)
    if (const double ms = mean(second, value); ms >= 0)
      stages += fmt::format("{}{} {:.1f}", stages.empty() ? "" : " · ", name, ms);
  gui::text_within(room.x, gui::colour::k_quiet, stages + " ms");
  gui::text_within(
      room.x, missed + lost > 0 ? gui::colour::k_warn : gui::colour::k_quiet,
      fmt::format("{} frames missed · bodies lost in {} of {}", missed, lost, view.recent.size()));
}

void draw_notices(const gui::Gui& gui, const OperatorView& view) {
  gui::heading(gui, "Messages");
  ImGui::BeginChild("lines");
  for (auto notice = view.notices.rbegin(); notice != view.notices.rend(); ++notice) {
    ImGui::TextDisabled("%s", clock_of(notice->at_s).c_str());
    ImGui::SameLine(3.6F * gui.em());
    ImGui::PushTextWrapPos(0);
    ImGui::TextUnformatted(notice->text.c_str());
    ImGui::PopTextWrapPos();
  }
  if (view.notices.empty()) ImGui::TextDisabled("none");
  ImGui::EndChild();
}

void draw_devices(const gui::Gui& gui, const OperatorView& view) {
  gui::heading(gui, "Devices");
  for (const OperatorView::Device& device : view.devices) {
    dot(gui, device.state.works ? gui::colour::k_good : gui::colour::k_bad);
    ImGui::TextUnformatted(device.state.name.c_str());
    right_text(device.state.works ? gui::colour::k_quiet : gui::colour::k_bad,
               !device.state.works ? "gone"
               : device.per_second ? fmt::format("{:.0f} /s", *device.per_second)
                                   : "works");
    if (device.state.works || device.state.why.empty()) continue;
    ImGui::Indent(1.06F * gui.em());
    ImGui::PushTextWrapPos(0);
    ImGui::TextDisabled("%s", device.state.why.c_str());
    ImGui::PopTextWrapPos();
    ImGui::Unindent(1.06F * gui.em());
  }
}

void draw_bodies(const gui::Gui& gui, const OperatorView& view) {
  gui::heading(gui, "Markers");
  for (const OperatorView::Body& body : view.bodies) {
    dot(gui, colour_of(body.track));
    const std::string state = words_of(body.track);
    const float room = ImGui::GetContentRegionAvail().x - ImGui::CalcTextSize(state.c_str()).x - gui.em();
    gui::text_within(room, gui::colour::k_text, body.name);
    if (ImGui::IsItemHovered()) ImGui::SetTooltip("%s", body.markers.c_str());
    right_text(colour_of(body.track), state);
    if (!body.track || body.track->tracking != TrackingState::measured) continue;
    ImGui::Indent(1.06F * gui.em());
    ImGui::TextDisabled("%s", fmt::format("{} marker{}, {:.2f} px", body.track->marker_count,
                                          body.track->marker_count == 1 ? "" : "s", body.track->rms_px)
                                  .c_str());
    ImGui::Unindent(1.06F * gui.em());
  }
}

const OperatorView::Device* device_of(const OperatorView& view, const std::string& name) {
  for (const OperatorView::Device& device : view.devices)
    if (device.state.name == name) return &device;
  return nullptr;
}

}  // namespace

void OperatorPanel::draw_bar(const gui::Gui& gui, const OperatorView& view) {
  const scene::ShowState& show_state = view.show_state;
  const ImVec2 size{0, 1.9F * gui.em()};
  if (gui::toggle("Blackout", show_state.blackout, gui::colour::k_warn, size)) ask(ActionId::blackout);
  ImGui::SameLine();
  if (gui::toggle("Freeze", show_state.frozen, gui::colour::k_warn, size)) ask(ActionId::freeze);
  ImGui::SameLine();
  if (gui::toggle("Marker rings", show_state.marker_states, gui::colour::k_blue, size))
    ask(ActionId::marker_states);
  ImGui::SameLine();
  if (gui::toggle("Grid", show_state.grid, gui::colour::k_blue, size)) ask(ActionId::grid);
  if (view.has_prototype) {
    ImGui::SameLine();
    const std::string& progress = view.deviation_progress;
    if (!progress.empty()) {
      ImGui::AlignTextToFramePadding();
      ImGui::TextUnformatted(("Scan: " + progress).c_str());
    } else if (gui::toggle("Deviation", show_state.deviation.is_shown, gui::colour::k_blue, size)) {
      ask(ActionId::deviation, "", "toggle");
    }
    if (progress.empty() && ImGui::IsItemHovered())
      ImGui::SetTooltip("%s",
                        show_state.deviation.layer
                            ? "Shows or hides how far the prototype is from its CAD."
                            : "Scans the prototype (20 s at most) and shows how far it is from its CAD.");
  }
  if (!view.recalibration_progress.empty()) {
    ImGui::SameLine();
    ImGui::AlignTextToFramePadding();
    ImGui::TextUnformatted(("Repair: " + view.recalibration_progress).c_str());
  } else if (!view.moved.empty()) {
    ImGui::SameLine();
    if (gui::toggle("Repair " + view.moved, true, gui::colour::k_bad, size)) ask(ActionId::repair);
    if (ImGui::IsItemHovered())
      ImGui::SetTooltip("%s",
                        "This device has moved. A repair shows patterns on the prototype for about 15 s.");
  }
  if (view.remote) {
    ImGui::SameLine();
    if (gui::toggle("Remote", shows_remote_, gui::colour::k_blue, size)) shows_remote_ = !shows_remote_;
  }
  ImGui::SameLine(0, 1.5F * gui.em());
  ImGui::PushStyleVar(ImGuiStyleVar_FramePadding, {10, 0.45F * gui.em()});
  ImGui::AlignTextToFramePadding();
  ImGui::TextDisabled("Screen");
  ImGui::SameLine();
  const float room = ImGui::GetContentRegionAvail().x - 9 * gui.em();
  ImGui::SetNextItemWidth(std::clamp(room, 6 * gui.em(), 19 * gui.em()));
  if (ImGui::BeginCombo("##screen", k_screens[static_cast<std::size_t>(show_state.screen)])) {
    for (std::size_t i = 0; i < scene::screen_names().size(); ++i)
      if (ImGui::Selectable(k_screens[i], static_cast<std::size_t>(show_state.screen) == i))
        ask(ActionId::screen, "", scene::screen_names()[i]);
    ImGui::EndCombo();
  }
  ImGui::AlignTextToFramePadding();
  right_text(gui::colour::k_quiet,
             view.recent.empty()
                 ? clock_of(view.at_s)
                 : fmt::format("{:.0f} /s   {}", per_second(last_second(view.recent)), clock_of(view.at_s)));
  ImGui::PopStyleVar();
}

// Returns true when the image was clicked.
bool OperatorPanel::draw_image(gui::Gui& gui,
                               const OperatorView::Image& image,
                               const OperatorView& view,
                               ImVec2 corner,
                               ImVec2 size,
                               bool is_large) {
  const float caption = cell_height(gui);
  const OperatorView::Device* device = device_of(view, image.name);
  const bool is_gone = device && !device->state.works;
  ImDrawList& draw = *ImGui::GetWindowDrawList();
  const ImVec2 inner_corner{corner.x, corner.y + caption}, inner{size.x, size.y - caption};
  std::string words = image.name;
  if (is_large && !image.found.empty())
    words += fmt::format(" · {} marker{}", image.found.size(), image.found.size() == 1 ? "" : "s");
  if (is_gone) words += " · gone";
  ImGui::PushClipRect(corner, {corner.x + size.x, corner.y + size.y}, true);
  draw.AddText({corner.x + 2, corner.y}, is_gone ? gui::colour::k_bad : gui::colour::k_quiet, words.c_str());
  draw.AddRectFilled(inner_corner, {corner.x + size.x, corner.y + size.y}, IM_COL32(12, 13, 15, 255), 3);
  const std::string texture = image.name + (is_large ? " large" : "");
  const gui::PlacedImage placed = gui.image(texture, image.image, inner_corner, inner, image.is_linear);
  for (const OperatorView::Found& found : image.found) {
    std::array<ImVec2, 4> corners;
    for (std::size_t i = 0; i < 4; ++i) corners[i] = placed.of(found.corners_px[i]);
    draw.AddPolyline(corners.data(), 4, gui::colour::k_good, ImDrawFlags_Closed, 2);
    if (is_large) gui::label_at(corners[1], gui::colour::k_good, found.marker);
  }
  if (is_gone)
    draw.AddRectFilled(inner_corner, {corner.x + size.x, corner.y + size.y}, IM_COL32(20, 22, 26, 170));
  if (image.image.empty())
    gui::label_at({inner_corner.x + 10, inner_corner.y + 8}, gui::colour::k_quiet, "no image yet");
  ImGui::PopClipRect();
  ImGui::SetCursorScreenPos(inner_corner);
  return ImGui::InvisibleButton(texture.c_str(), {std::max(1.F, inner.x), std::max(1.F, inner.y)});
}

// Draws one image large and all of them small below; a click on a small one makes it the large one.
void OperatorPanel::draw_images(gui::Gui& gui, const OperatorView& view, ImVec2 size) {
  std::vector<const OperatorView::Image*> all;
  for (const OperatorView::Image& image : view.cameras) all.push_back(&image);
  if (view.show_state.screen != scene::Screen::off) all.push_back(&view.screen);
  for (const OperatorView::Image& image : view.projectors) all.push_back(&image);
  if (all.empty()) return;
  const auto chosen = std::find_if(all.begin(), all.end(), [&](const auto* p) { return p->name == large_; });
  const OperatorView::Image& large = chosen == all.end() ? *all.front() : **chosen;
  const ImVec2 corner = ImGui::GetCursorScreenPos();
  const float gap = 0.5F * gui.em(), count = static_cast<float>(all.size());
  const float width = std::floor(std::min((size.x + gap) / count - gap, k_most_small * size.x));
  const float height = std::floor(std::min(k_small_share * size.y, 0.66F * width + cell_height(gui)));
  draw_image(gui, large, view, corner, {size.x, size.y - height - gap}, true);
  for (std::size_t i = 0; i < all.size(); ++i) {
    const ImVec2 at{corner.x + static_cast<float>(i) * (width + gap), corner.y + size.y - height};
    if (draw_image(gui, *all[i], view, at, {width, height}, false)) large_ = all[i]->name;
    if (all[i] == &large)
      ImGui::GetWindowDrawList()->AddRect({at.x - 2, at.y + cell_height(gui) - 2},
                                          {at.x + width + 2, at.y + height + 2}, gui::colour::k_blue, 3, 0,
                                          2);
  }
}

// Draws, in place of the images, the QR code for a phone's camera, and the address and PIN to type.
void OperatorPanel::draw_remote(gui::Gui& gui, const OperatorView& view, ImVec2 size) {
  const OperatorView::Remote& remote = *view.remote;
  if (remote.entrances.empty()) return;
  const OperatorView::Remote::Entrance& chosen =
      remote.entrances[std::min(entrance_, remote.entrances.size() - 1)];
  const ImVec2 at = ImGui::GetCursorPos(), corner = ImGui::GetCursorScreenPos();
  const float gap = 1.5F * gui.em(), column = 20 * gui.em();
  const float side = std::max(1.0F, std::min(size.y, size.x - column - gap));
  if (!chosen.code.empty()) gui.image("code of " + name_of(chosen.role), chosen.code, corner, {side, side});
  ImGui::SetCursorPos({at.x + side + gap, at.y});
  ImGui::BeginChild("remote", {size.x - side - gap, size.y}, false, ImGuiWindowFlags_AlwaysUseWindowPadding);
  gui::heading(gui, "Remote");
  ImGui::PushFont(gui.heading());
  ImGui::TextUnformatted(remote.url.c_str());
  ImGui::PopFont();
  ImGui::TextDisabled("The code pairs with the highlighted role.");
  ImGui::Dummy({0, 0.4F * gui.em()});
  for (std::size_t i = 0; i < remote.entrances.size(); ++i)
    if (gui::toggle(fmt::format("{}   {}", remote.entrances[i].pin, name_of(remote.entrances[i].role)),
                    &remote.entrances[i] == &chosen, gui::colour::k_blue, {12 * gui.em(), 1.9F * gui.em()}))
      entrance_ = i;
  if (!view.projectors.empty()) {
    ImGui::Dummy({0, 0.4F * gui.em()});
    ImGui::TextDisabled("Project the code for 60 s with");
    for (const OperatorView::Image& projector : view.projectors)
      if (gui::toggle(projector.name, projector.name == remote.projector, gui::colour::k_warn,
                      {12 * gui.em(), 1.9F * gui.em()}))
        asked_.code = {projector.name, chosen.role};
  }
  draw_viewers(gui, view);
  for (const std::string& glasses : remote.glasses) ImGui::TextUnformatted(glasses.c_str());
  const std::pair<const char*, const std::string&> fingerprints[] = {
      {"SHA-256 of the certificate", remote.fingerprint},
      {"SHA-256 of /limn.crt", remote.authority_fingerprint}};
  for (const auto& [what, fingerprint] : fingerprints) {
    if (fingerprint.empty()) continue;
    ImGui::Dummy({0, 0.4F * gui.em()});
    ImGui::TextDisabled("%s", what);
    constexpr std::size_t k_line = 36;  // twelve bytes
    for (std::size_t i = 0; i < fingerprint.size(); i += k_line)
      ImGui::TextUnformatted(fingerprint.substr(i, k_line - 1).c_str());
  }
  ImGui::EndChild();
}

// Lets the operator choose the viewpoint for `view` parts: the scene's own viewer or a guest's tablet.
void OperatorPanel::draw_viewers(const gui::Gui& gui, const OperatorView& view) {
  const std::string& chosen = view.show_state.viewer;
  std::vector<std::string> all = view.windows;
  if (!chosen.empty() && std::find(all.begin(), all.end(), chosen) == all.end()) all.push_back(chosen);
  ImGui::Dummy({0, 0.8F * gui.em()});
  gui::heading(gui, "Viewpoint for the parts");
  if (all.empty()) ImGui::TextDisabled("the scene's own viewer: no tablet view is open");
  if (all.empty()) return;
  const ImVec2 size{18 * gui.em(), 1.9F * gui.em()};
  if (gui::toggle("the scene's own viewer", chosen.empty(), gui::colour::k_blue, size)) ask(ActionId::viewer);
  for (const std::string& guest : all) {
    ImGui::PushID(guest.c_str());
    if (gui::toggle(guest + "'s tablet", guest == chosen, gui::colour::k_blue, size))
      ask(ActionId::viewer, "", guest);
    ImGui::PopID();
    if (guest != chosen || guest == view.follows) continue;
    ImGui::TextDisabled("sees no markers; the scene's own viewer is used");
  }
}

void OperatorPanel::draw_slots(const gui::Gui& gui, const OperatorView& view) {
  gui::heading(gui, "Parts");
  const ImVec2 arrow{1.9F * gui.em(), 1.7F * gui.em()};
  for (std::size_t i = 0; i < view.slots.size(); ++i) {
    const OperatorView::Slot& slot = view.slots[i];
    ImGui::PushID(slot.name.c_str());
    const std::string& shown = view.show_state.slots[i].variant;
    gui::text_within(ImGui::GetContentRegionAvail().x - 6 * gui.em(),
                     slot.is_chosen ? gui::colour::k_blue : gui::colour::k_quiet,
                     slot.is_chosen && view.slots.size() > 1 ? slot.name + "  (keys)" : slot.name);
    draw_material(gui, slot.name, view.show_state.slots[i].material);
    if (ImGui::Button("◀", arrow)) ask(ActionId::previous_variant, slot.name);
    ImGui::SameLine(0, 4);
    const float room = ImGui::GetContentRegionAvail().x - arrow.x - 4;
    ImGui::SetNextItemWidth(room);
    ImGui::PushStyleVar(ImGuiStyleVar_FramePadding, {10, 0.35F * gui.em()});
    const std::size_t at = static_cast<std::size_t>(
        std::find(slot.variants.begin(), slot.variants.end(), shown) - slot.variants.begin());
    if (ImGui::BeginCombo("##variant", fmt::format("{}   {}/{}", shown, at + 1, slot.variants.size()).c_str(),
                          ImGuiComboFlags_NoArrowButton)) {
      for (const std::string& variant : slot.variants)
        if (ImGui::Selectable(variant.c_str(), variant == shown))
          ask(ActionId::choose_variant, slot.name, variant);
      ImGui::EndCombo();
    }
    ImGui::PopStyleVar();
    ImGui::SameLine(0, 4);
    if (ImGui::Button("▶", arrow)) ask(ActionId::next_variant, slot.name);
    if (slot.is_held && ImGui::Button("follow the marker again", {-1, 0})) ask(ActionId::release, slot.name);
    if (!view.waiting.empty() &&
        ImGui::Button(fmt::format("pair with {}", view.waiting.back()).c_str(), {-1, 0}))
      ask(ActionId::pair, slot.name, view.waiting.back());
    if (const auto& carrier = view.show_state.slots[i].marker)
      if (ImGui::Button(fmt::format("unpair {}", carrier->text()).c_str(), {-1, 0}))
        ask(ActionId::unpair, slot.name);
    ImGui::PopID();
  }
  if (view.slots.empty()) ImGui::TextDisabled("the scene has no slots");
}

// A popup for a part's colour, metalness and roughness.
void OperatorPanel::draw_material(const gui::Gui& gui,
                                  const std::string& slot,
                                  const scene::MaterialOverride& now) {
  if (small_button(gui, "material", !now.is_none())) ImGui::OpenPopup("material");
  if (!ImGui::BeginPopup("material")) return;
  scene::MaterialOverride wanted = now;
  const Eigen::Vector3d linear = now.base_colour.value_or(Eigen::Vector3d::Constant(k_plain));
  Eigen::Vector3f rgb = linear.unaryExpr([](double light) { return srgb_from_linear(light); }).cast<float>();
  auto metallic = static_cast<float>(now.metallic.value_or(0)),
       roughness = static_cast<float>(now.roughness.value_or(1));
  if (ImGui::ColorEdit3("colour", rgb.data()))
    wanted.base_colour =
        rgb.cast<double>().unaryExpr([](double s) { return linear_from_srgb(std::clamp(s, 0.0, 1.0)); });
  if (ImGui::SliderFloat("metal", &metallic, 0, 1, "%.2f")) wanted.metallic = std::clamp(metallic, 0.F, 1.F);
  if (ImGui::SliderFloat("rough", &roughness, 0, 1, "%.2f"))
    wanted.roughness = std::clamp(roughness, 0.F, 1.F);
  if (wanted != now) ask(ActionId::material, slot, scene::format_material_override(wanted));
  if (ImGui::Button("reset to the file", {-1, 0})) ask(ActionId::material, slot);
  ImGui::EndPopup();
}

// A popup for the light that parts are shaded by.
void OperatorPanel::draw_light(const gui::Gui& gui, const scene::ShowState& show_state) {
  if (small_button(gui, "light", show_state.light.has_value())) ImGui::OpenPopup("light");
  const auto numbers = show_state.light
                           ? scene::room_light_numbers(*show_state.light, show_state.d_front_world)
                           : std::nullopt;
  if (numbers && !ImGui::IsAnyItemActive())
    std::transform(numbers->begin(), numbers->end(), light_.begin(),
                   [](double number) { return static_cast<float>(number); });
  if (!ImGui::BeginPopup("light")) return;
  bool is_changed = ImGui::SliderFloat("right", &light_[0], -180, 180, "%.0f deg");
  is_changed |= ImGui::SliderFloat("up", &light_[1], -90, 90, "%.0f deg");
  is_changed |= ImGui::SliderFloat("lamp", &light_[2], 0, 2, "%.2f");
  is_changed |= ImGui::SliderFloat("above", &light_[3], 0, 2, "%.2f");
  is_changed |= ImGui::SliderFloat("below", &light_[4], 0, 2, "%.2f");
  if (is_changed)
    ask(ActionId::light, "",
        fmt::format("{:.0f} {:.0f} {:.2f} {:.2f} {:.2f}", light_[0], light_[1], light_[2], light_[3],
                    light_[4]));
  if (ImGui::Button("reset to the scene", {-1, 0})) ask(ActionId::light);
  ImGui::EndPopup();
}

void OperatorPanel::draw_looks(const gui::Gui& gui, const OperatorView& view) {
  gui::heading(gui, "Looks");
  draw_light(gui, view.show_state);
  const float save = 4 * gui.em();
  ImGui::SetNextItemWidth(ImGui::GetContentRegionAvail().x - save - ImGui::GetStyle().ItemSpacing.x);
  const bool is_entered = ImGui::InputTextWithHint("##name", "name of a new look", look_.data(), look_.size(),
                                                   ImGuiInputTextFlags_EnterReturnsTrue);
  ImGui::SameLine();
  if (ImGui::Button("Save", {save, 0}) || is_entered) {
    ask(ActionId::save_look, "", look_.data());
    look_.fill('\0');
  }
  draw_comparison(gui, view.show_state);
  for (const scene::Look& look : view.show_state.looks) {
    ImGui::PushID(look.name.c_str());
    const float cross = 1.6F * gui.em();
    const float room = ImGui::GetContentRegionAvail().x - cross - 4;
    if (gui::toggle(look.name, look.name == view.show_state.look, gui::colour::k_blue, {room, 0}))
      ask(ActionId::restore_look, "", look.name);
    ImGui::SameLine(0, 4);
    if (ImGui::Button("x", {cross, 0})) ImGui::OpenPopup("delete");
    if (ImGui::BeginPopup("delete")) {
      if (ImGui::Button(fmt::format("Delete {}", look.name).c_str())) {
        ask(ActionId::delete_look, "", look.name);
        ImGui::CloseCurrentPopup();
      }
      ImGui::EndPopup();
    }
    ImGui::PopID();
  }
  if (const auto& gone = view.show_state.deleted_look)
    if (ImGui::Button(fmt::format("undelete {}", gone->name).c_str(), {-1, 0})) ask(ActionId::undelete_look);
}

// Controls that compare with the previous look: in its place, or left of a line.
void OperatorPanel::draw_comparison(const gui::Gui& gui, const scene::ShowState& show_state) {
  if (show_state.other_look.empty()) return;
  const float room = ImGui::GetContentRegionAvail().x, gap = ImGui::GetStyle().ItemSpacing.x;
  const ImVec2 half{0.5F * (room - gap), 1.9F * gui.em()};
  if (ImGui::Button(fmt::format("A/B: {}", show_state.other_look).c_str(), half)) ask(ActionId::flip);
  ImGui::SameLine();
  if (gui::toggle("Side by side", show_state.split, gui::colour::k_blue, half)) ask(ActionId::split);
  if (!show_state.split) return;
  float mm = static_cast<float>(show_state.split_mm);
  ImGui::SetNextItemWidth(-1);
  if (ImGui::DragFloat("##split", &mm, 2, -k_most_split_mm, k_most_split_mm, "line at %.0f mm"))
    ask(ActionId::split_at, "", fmt::format("{:.1f}", mm));
}

// Asks whether to end the session: a stray Escape from a clicker must not end it.
void OperatorPanel::draw_question(const gui::Gui& gui) {
  constexpr const char* k_name = "End the session?";
  if (asks_to_end_ && !ImGui::IsPopupOpen(k_name)) ImGui::OpenPopup(k_name);
  const ImVec2 size = ImGui::GetIO().DisplaySize;
  ImGui::SetNextWindowPos({size.x / 2, size.y / 2}, ImGuiCond_Always, {0.5F, 0.5F});
  if (!ImGui::BeginPopupModal(k_name, nullptr, ImGuiWindowFlags_AlwaysAutoResize | ImGuiWindowFlags_NoMove))
    return;
  ImGui::TextUnformatted("The projectors will go dark. Everything is saved.");
  ImGui::Dummy({0, 0.3F * gui.em()});
  const ImVec2 button{8 * gui.em(), 1.9F * gui.em()};
  if (ImGui::Button("End", button)) asked_.ends = true;
  ImGui::SameLine();
  if (ImGui::Button("Go on", button)) asks_to_end_ = false;
  if (!asks_to_end_) ImGui::CloseCurrentPopup();
  ImGui::EndPopup();
}

OperatorAsked OperatorPanel::draw(gui::Gui& gui, const OperatorView& view) {
  asked_ = {};
  draw_bar(gui, view);
  ImGui::Dummy({0, 0.1F * gui.em()});
  const ImVec2 room = ImGui::GetContentRegionAvail();
  const float gap = ImGui::GetStyle().ItemSpacing.x;
  const float column = std::clamp(0.25F * room.x, 15 * gui.em(), 22 * gui.em());
  const float foot = std::clamp(0.24F * room.y, 7 * gui.em(), 13 * gui.em());
  const float left = room.x - column - gap;
  const ImVec2 at = ImGui::GetCursorPos();
  const ImVec2 middle{left, room.y - foot - gap};
  if (shows_remote_ && view.remote)
    draw_remote(gui, view, middle);
  else
    draw_images(gui, view, middle);
  ImGui::SetCursorPos({at.x, at.y + room.y - foot});
  ImGui::BeginChild("telemetry", {std::floor(0.5F * (left - gap)), foot}, false,
                    ImGuiWindowFlags_AlwaysUseWindowPadding | ImGuiWindowFlags_NoScrollbar);
  draw_telemetry(gui, view);
  ImGui::EndChild();
  ImGui::SetCursorPos({at.x + std::floor(0.5F * (left + gap)), at.y + room.y - foot});
  ImGui::BeginChild("messages", {std::floor(0.5F * (left - gap)), foot}, false,
                    ImGuiWindowFlags_AlwaysUseWindowPadding | ImGuiWindowFlags_NoScrollbar);
  draw_notices(gui, view);
  ImGui::EndChild();
  ImGui::SetCursorPos({at.x + left + gap, at.y});
  ImGui::BeginChild("column", {column, room.y}, false, ImGuiWindowFlags_AlwaysUseWindowPadding);
  draw_slots(gui, view);
  ImGui::Dummy({0, 0.4F * gui.em()});
  draw_looks(gui, view);
  ImGui::Dummy({0, 0.4F * gui.em()});
  draw_bodies(gui, view);
  ImGui::Dummy({0, 0.4F * gui.em()});
  draw_devices(gui, view);
  ImGui::EndChild();
  draw_question(gui);
  return asked_;
}

}  // namespace limn::session
