#include "projector/pixel_list.h"

#include <cstdint>

namespace limn::projector {
namespace {

constexpr GLuint k_listed_binding = 6,
                 k_rest_binding = 5;  // of buffers, as in shaders/listed.glsl and rest.glsl

}  // namespace

void PixelList::start(int pixels) {
  if (room_ < pixels) {
    buffer_ = make_buffer(nullptr, sizeof(std::uint32_t) * (static_cast<std::size_t>(pixels) + 4));
    room_ = pixels;
  }
  const std::uint32_t head[] = {0, 0, 1, 1};
  glNamedBufferSubData(*buffer_, 0, sizeof(head), head);
}

void PixelList::bind() const { glBindBufferBase(GL_SHADER_STORAGE_BUFFER, k_listed_binding, *buffer_); }

void PixelList::bind_as_rest() const { glBindBufferBase(GL_SHADER_STORAGE_BUFFER, k_rest_binding, *buffer_); }

void PixelList::work_through(const Program& program) const {
  constexpr GLintptr k_groups = sizeof(std::uint32_t);  // after the count
  bind();
  glBindBuffer(GL_DISPATCH_INDIRECT_BUFFER, *buffer_);
  program.use();
  glDispatchComputeIndirect(k_groups);
  glMemoryBarrier(GL_ALL_BARRIER_BITS);
}

void clear_light(const GlName& light, cv::Size size, std::span<const cv::Rect> places) {
  const cv::Rect whole({0, 0}, size);
  for (const cv::Rect& place : places) {
    const cv::Rect around = whole & cv::Rect(place.x - 1, place.y - 1, place.width + 2, place.height + 2);
    glClearTexSubImage(*light, 0, around.x, around.y, 0, around.width, around.height, 1, GL_RGBA, GL_FLOAT,
                       nullptr);
  }
}

void look_through(const Program& program, std::span<const cv::Rect> places) {
  program.use();
  for (const cv::Rect& place : places) {
    program.set("u_first", place.x, place.y);
    program.set("u_end", place.x + place.width, place.y + place.height);
    glDispatchCompute(static_cast<GLuint>(place.width + 15) / 16, static_cast<GLuint>(place.height + 3) / 4,
                      1);
  }
  glMemoryBarrier(GL_ALL_BARRIER_BITS);
}

}  // namespace limn::projector
