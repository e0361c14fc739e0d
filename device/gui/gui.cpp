#include "device/gui/gui.h"

#include <backends/imgui_impl_opengl3.h>
#include <epoxy/gl.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "core/result.h"
#include "core/screen_encoding.h"

namespace limn::gui {
namespace {

constexpr float k_text_px = 19, k_heading_px = 22;
constexpr const char* k_font = "/usr/share/fonts/truetype/dejavu/DejaVuSans.ttf";
constexpr const char* k_bold_font = "/usr/share/fonts/truetype/dejavu/DejaVuSans-Bold.ttf";
// Latin, dashes and dots, arrows, geometric shapes, ticks.
constexpr std::array<ImWchar, 11> k_glyphs = {0x20,   0x17F,  0x2010, 0x2026, 0x2190, 0x2193,
                                              0x25A0, 0x25FF, 0x2713, 0x2717, 0};
constexpr int k_enter = 257, k_keypad_enter = 335;  // one key for ImGui
// GLFW's key codes of the keys that ImGui uses (versions 1.86 and 1.90 number its keys differently).
constexpr std::array<std::pair<int, int>, 21> k_keys = {
    {{ImGuiKey_Tab, 258},      {ImGuiKey_LeftArrow, 263}, {ImGuiKey_RightArrow, 262},
     {ImGuiKey_UpArrow, 265},  {ImGuiKey_DownArrow, 264}, {ImGuiKey_PageUp, 266},
     {ImGuiKey_PageDown, 267}, {ImGuiKey_Home, 268},      {ImGuiKey_End, 269},
     {ImGuiKey_Insert, 260},   {ImGuiKey_Delete, 261},    {ImGuiKey_Backspace, 259},
     {ImGuiKey_Space, 32},     {ImGuiKey_Enter, k_enter}, {ImGuiKey_Escape, 256},
     {ImGuiKey_A, 'A'},        {ImGuiKey_C, 'C'},         {ImGuiKey_V, 'V'},
     {ImGuiKey_X, 'X'},        {ImGuiKey_Y, 'Y'},         {ImGuiKey_Z, 'Z'}}};
constexpr int k_shift = 340, k_control = 341, k_right_shift = 344, k_right_control = 345;
constexpr int k_key_codes = 512;  // ImGui's own keys begin there in version 1.90

ImFont* font(const char* file, float pixels) {
  ImFontAtlas& atlas = *ImGui::GetIO().Fonts;
  if (std::filesystem::exists(file)) return atlas.AddFontFromFileTTF(file, pixels, nullptr, k_glyphs.data());
  ImFontConfig plain;
  plain.SizePixels = pixels;
  return atlas.AddFontDefault(&plain);
}

ImVec4 of(ImU32 colour) { return ImGui::ColorConvertU32ToFloat4(colour); }

void set_theme(float scale) {
  ImGui::StyleColorsDark();
  ImGuiStyle& style = ImGui::GetStyle();
  style.WindowPadding = style.FramePadding = {10, 6};
  style.ItemSpacing = {10, 7};
  style.WindowRounding = style.ChildRounding = style.FrameRounding = style.PopupRounding = 4;
  style.WindowBorderSize = 0;
  style.ScrollbarSize = 14;
  style.DisabledAlpha = 0.45F;
  style.ScaleAllSizes(scale);
  ImVec4* c = style.Colors;
  c[ImGuiCol_Text] = of(colour::k_text);
  c[ImGuiCol_TextDisabled] = of(colour::k_quiet);
  c[ImGuiCol_WindowBg] = of(colour::k_ground);
  c[ImGuiCol_ChildBg] = c[ImGuiCol_PopupBg] = of(colour::k_panel);
  c[ImGuiCol_Border] = c[ImGuiCol_Separator] = of(colour::k_line);
  c[ImGuiCol_FrameBg] = c[ImGuiCol_Button] = of(IM_COL32(47, 52, 61, 255));
  c[ImGuiCol_FrameBgHovered] = c[ImGuiCol_ButtonHovered] = of(IM_COL32(66, 73, 86, 255));
  c[ImGuiCol_FrameBgActive] = c[ImGuiCol_ButtonActive] = of(IM_COL32(84, 96, 116, 255));
  c[ImGuiCol_Header] = of(IM_COL32(52, 72, 104, 255));
  c[ImGuiCol_HeaderHovered] = of(IM_COL32(66, 73, 86, 255));
  c[ImGuiCol_HeaderActive] = of(IM_COL32(84, 96, 116, 255));
  c[ImGuiCol_ScrollbarBg] = of(IM_COL32(0, 0, 0, 0));
}

}  // namespace

ImVec2 PlacedImage::of(const Eigen::Vector2d& px) const {
  return {corner.x + scale * static_cast<float>(px.x() + 0.5),
          corner.y + scale * static_cast<float>(px.y() + 0.5)};
}

Gui::Gui(float scale) : em_(std::round(k_text_px * scale)), context_(ImGui::CreateContext()) {
  ImGui::SetCurrentContext(context_);
  ImGuiIO& io = ImGui::GetIO();
  io.IniFilename = io.LogFilename = nullptr;
  for (const auto& [key, code] : k_keys) io.KeyMap[key] = code;
  font(k_font, em_);
  heading_ = font(k_bold_font, std::round(k_heading_px * scale));
  set_theme(scale);
  LIMN_CHECK(ImGui_ImplOpenGL3_Init("#version 450 core"));
}

Gui::~Gui() {
  ImGui::SetCurrentContext(context_);
  for (const auto& [name, texture] : textures_) glDeleteTextures(1, &texture.id);
  ImGui_ImplOpenGL3_Shutdown();
  ImGui::DestroyContext(context_);
}

void Gui::feed(cv::Size pixels, double seconds, const device::WindowInput& input) {
  constexpr float k_nowhere = -std::numeric_limits<float>::max();
  ImGuiIO& io = ImGui::GetIO();
  io.DisplaySize = {static_cast<float>(pixels.width), static_cast<float>(pixels.height)};
  io.DeltaTime = static_cast<float>(std::max(1e-4, seconds));
  const bool is_inside = input.pointer.x >= 0 && input.pointer.y >= 0;
  io.MousePos = is_inside ? ImVec2(input.pointer.x, input.pointer.y) : ImVec2(k_nowhere, k_nowhere);
  for (std::size_t i = 0; i < input.buttons.size(); ++i) io.MouseDown[i] = input.buttons[i];
  io.MouseWheel = input.wheel;
  // A key that was released in the same frame as it was pressed is reported as released in the next frame.
  for (const int code : released_) io.KeysDown[code] = false;
  released_.clear();
  for (const device::WindowInput::Key& key : input.keys) {
    if (key.code < 0 || key.code >= k_key_codes) continue;
    const int code = key.code == k_keypad_enter ? k_enter : key.code;
    if (key.is_down)
      io.KeysDown[code] = true;
    else
      released_.push_back(code);
  }
  io.KeyShift = io.KeysDown[k_shift] || io.KeysDown[k_right_shift];
  io.KeyCtrl = io.KeysDown[k_control] || io.KeysDown[k_right_control];
  for (const unsigned character : input.characters) io.AddInputCharacter(character);
}

void Gui::frame(cv::Size pixels,
                double seconds,
                const device::WindowInput& input,
                const std::function<void()>& widgets) {
  ImGui::SetCurrentContext(context_);
  ImGui_ImplOpenGL3_NewFrame();
  feed(pixels, seconds, input);
  ImGui::NewFrame();
  ImGui::SetNextWindowPos({0, 0});
  ImGui::SetNextWindowSize(ImGui::GetIO().DisplaySize);
  ImGui::Begin("Limn", nullptr,
               ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoSavedSettings |
                   ImGuiWindowFlags_NoBringToFrontOnFocus | ImGuiWindowFlags_NoScrollWithMouse);
  widgets();
  ImGui::End();
  ImGui::Render();
  glViewport(0, 0, pixels.width, pixels.height);
  glClearColor(0, 0, 0, 1);
  glClear(GL_COLOR_BUFFER_BIT);
  ImGui_ImplOpenGL3_RenderDrawData(ImGui::GetDrawData());
  is_typing_ = ImGui::GetIO().WantTextInput;
}

bool Gui::is_typing() const { return is_typing_; }

PlacedImage Gui::image(
    const std::string& name, const cv::Mat& image, ImVec2 corner, ImVec2 size, bool is_linear) {
  if (image.empty() || size.x < 2 || size.y < 2) return {corner, {0, 0}, 0};
  const float scale =
      std::min(size.x / static_cast<float>(image.cols), size.y / static_cast<float>(image.rows));
  PlacedImage placed{{0, 0},
                     {std::floor(scale * static_cast<float>(image.cols)),
                      std::floor(scale * static_cast<float>(image.rows))},
                     scale};
  placed.corner = {std::floor(corner.x + (size.x - placed.size.x) / 2),
                   std::floor(corner.y + (size.y - placed.size.y) / 2)};
  cv::Mat shown = image;
  if (scale < 1)
    cv::resize(image, shown,
               {std::max(1, static_cast<int>(placed.size.x)), std::max(1, static_cast<int>(placed.size.y))},
               0, 0, cv::INTER_AREA);
  if (is_linear) shown = srgb_image(shown);
  if (!shown.isContinuous()) shown = shown.clone();
  Texture& texture = textures_[name];
  if (texture.size != shown.size()) {
    glDeleteTextures(1, &texture.id);
    glCreateTextures(GL_TEXTURE_2D, 1, &texture.id);
    glTextureStorage2D(texture.id, 1, GL_RGBA8, shown.cols, shown.rows);
    glTextureParameteri(texture.id, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
    glTextureParameteri(texture.id, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
    texture.size = shown.size();
  }
  const bool is_grey = shown.channels() == 1;
  const std::array<GLint, 4> grey = {GL_RED, GL_RED, GL_RED, GL_ONE},
                             bgr = {GL_RED, GL_GREEN, GL_BLUE, GL_ONE};
  glTextureParameteriv(texture.id, GL_TEXTURE_SWIZZLE_RGBA, (is_grey ? grey : bgr).data());
  glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
  glTextureSubImage2D(texture.id, 0, 0, 0, shown.cols, shown.rows, is_grey ? GL_RED : GL_BGR,
                      GL_UNSIGNED_BYTE, shown.data);
  ImGui::GetWindowDrawList()->AddImage(reinterpret_cast<ImTextureID>(static_cast<std::uintptr_t>(texture.id)),
                                       placed.corner,
                                       {placed.corner.x + placed.size.x, placed.corner.y + placed.size.y});
  return placed;
}

void text_within(float width, ImU32 colour, const std::string& text) {
  std::string shown = text;
  const auto is_wide = [&] { return ImGui::CalcTextSize(shown.c_str()).x > width; };
  if (is_wide()) {
    std::size_t length = text.size();
    do {
      do --length;
      while (length > 0 &&
             (static_cast<unsigned char>(text[length]) & 0xC0) == 0x80);  // cut only between characters
      shown = text.substr(0, length) + "…";
    } while (length > 0 && is_wide());
  }
  ImGui::PushStyleColor(ImGuiCol_Text, colour);
  ImGui::TextUnformatted(shown.c_str());
  ImGui::PopStyleColor();
  if (shown != text && ImGui::IsItemHovered()) {
    ImGui::BeginTooltip();
    ImGui::PushTextWrapPos(30 * ImGui::GetFontSize());
    ImGui::TextUnformatted(text.c_str());
    ImGui::PopTextWrapPos();
    ImGui::EndTooltip();
  }
}

void heading(const Gui& gui, const std::string& text) {
  ImGui::PushFont(gui.heading());
  ImGui::TextUnformatted(text.c_str());
  ImGui::PopFont();
}

bool toggle(const std::string& label, bool is_on, ImU32 lit, ImVec2 size) {
  if (is_on) {
    for (const ImGuiCol part : {ImGuiCol_Button, ImGuiCol_ButtonHovered, ImGuiCol_ButtonActive})
      ImGui::PushStyleColor(part, lit);
    ImGui::PushStyleColor(ImGuiCol_Text, colour::k_ground);
  }
  const bool is_pressed = ImGui::Button(label.c_str(), size);
  if (is_on) ImGui::PopStyleColor(4);
  return is_pressed;
}

void label_at(ImVec2 corner, ImU32 colour, const std::string& text) {
  const ImVec2 size = ImGui::CalcTextSize(text.c_str());
  ImDrawList& draw = *ImGui::GetWindowDrawList();
  draw.AddRectFilled({corner.x - 3, corner.y - 1}, {corner.x + size.x + 3, corner.y + size.y + 1},
                     IM_COL32(0, 0, 0, 170), 3);
  draw.AddText(corner, colour, text.c_str());
}

}  // namespace limn::gui
