#include "projector/pixel_list.h"

#include <cstdint>

#include "projector/bindings.h"

namespace limn::projector {

void PixelList::start(int pixels) {
  if (room_ < pixels) {
    buffer_ = make_buffer(nullptr, sizeof(std::uint32_t) * (static_cast<std::size_t>(pixels) + 4));
    room_ = pixels;
  }
  const std::uint32_t head[] = {0, 0, 1, 1};
  glNamedBufferSubData(*buffer_, 0, sizeof(head), head);
}

void PixelList::bind(const Use& use) const {
  const int at = use.as == Resource::deferred_list ? k_deferred_list_buffer : k_work_list_buffer;
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, static_cast<GLuint>(at), *buffer_);
}

void PixelList::dispatch() const {
  constexpr GLintptr k_groups = sizeof(std::uint32_t);  // the group counts follow the pixel count
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, k_work_list_buffer, *buffer_);
  glBindBuffer(GL_DISPATCH_INDIRECT_BUFFER, *buffer_);
  glDispatchComputeIndirect(k_groups);
}

void clear_light(const GlName& light, cv::Size size, std::span<const cv::Rect> places, int around) {
  const cv::Rect whole({0, 0}, size);
  for (const cv::Rect& place : places) {
    const cv::Rect cleared = whole & cv::Rect(place.x - around, place.y - around, place.width + 2 * around,
                                              place.height + 2 * around);
    if (cleared.empty()) continue;
    glClearTexSubImage(*light, 0, cleared.x, cleared.y, 0, cleared.width, cleared.height, 1, GL_RGBA,
                       GL_FLOAT, nullptr);
  }
}

}  // namespace limn::projector
