#include "projector/pass.h"

#include <algorithm>
#include <utility>

namespace limn::projector {

Pass::Pass(Program program, const Description& description) : program_(std::move(program)) {
  for (const Resource resource : description.reads) accesses_.push_back({resource, GL_READ_ONLY});
  for (const Resource resource : description.writes) {
    const auto read = std::find_if(accesses_.begin(), accesses_.end(),
                                   [&](const Access& access) { return access.resource == resource; });
    if (read == accesses_.end())
      accesses_.push_back({resource, GL_WRITE_ONLY});
    else
      read->how = GL_READ_WRITE;
  }
}

void Pass::use(const Resources& resources) const {
  for (const Access& access : accesses_) {
    const Bindable* resource = resources.find(access.resource);
    LIMN_CHECK(resource != nullptr);
    resource->bind({access.resource, access.how, program_});
  }
  program_.use();
}

Result<ComputePass> ComputePass::link(const Description& description) {
  LIMN_TRY(Program program, Program::link_compute(description.shader, description.defines));
  return ComputePass(std::move(program), description);
}

void ComputePass::run_over_rects(std::span<const cv::Rect> places, const Resources& resources) const {
  use(resources);
  for (const cv::Rect& place : places) {
    program().set("u_first", place.x, place.y);
    program().set("u_end", place.x + place.width, place.y + place.height);
    glDispatchCompute(static_cast<GLuint>(place.width + 15) / 16, static_cast<GLuint>(place.height + 3) / 4,
                      1);
  }
  glMemoryBarrier(GL_ALL_BARRIER_BITS);
}

void ComputePass::run_over_list(const PixelList& pixels, const Resources& resources) const {
  use(resources);
  pixels.dispatch();
  glMemoryBarrier(GL_ALL_BARRIER_BITS);
}

Result<FullscreenPass> FullscreenPass::link(const Description& description) {
  LIMN_TRY(Program program, Program::link("fullscreen.vert", description.shader, description.defines));
  return FullscreenPass(std::move(program), description);
}

void FullscreenPass::draw(const Canvas& into,
                          std::span<const cv::Rect> places,
                          const Resources& resources) const {
  glBindFramebuffer(GL_FRAMEBUFFER, *into.framebuffer);
  glViewport(0, 0, into.width, into.height);
  glDisable(GL_DEPTH_TEST);
  glDisable(GL_BLEND);
  glDisable(GL_CULL_FACE);
  glDisable(GL_SCISSOR_TEST);
  const GLfloat black[4] = {0, 0, 0, 0};
  glClearNamedFramebufferfv(*into.framebuffer, GL_COLOR, 0, black);
  glEnable(GL_SCISSOR_TEST);
  glBindVertexArray(*vertex_array_);
  use(resources);
  for (const cv::Rect& place : places) {
    glScissor(place.x, place.y, place.width, place.height);
    glDrawArrays(GL_TRIANGLES, 0, 3);
  }
  glDisable(GL_SCISSOR_TEST);
}

void FullscreenPass::draw(const Canvas& into, const Resources& resources) const {
  const cv::Rect whole(0, 0, into.width, into.height);
  draw(into, {&whole, 1}, resources);
}

}  // namespace limn::projector
