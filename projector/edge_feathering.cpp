#include "projector/edge_feathering.h"

#include <cstddef>

namespace limn::projector {
namespace {

constexpr int k_block = 8;  // as in shaders/blocks.glsl

int blocks_of(int texels) { return (texels + k_block - 1) / k_block; }

void run(const Program& program, cv::Size blocks) {
  constexpr int k_group = 8;
  program.set("u_blocks", blocks.width, blocks.height);
  program.use();
  glDispatchCompute(static_cast<GLuint>(blocks.width + k_group - 1) / k_group,
                    static_cast<GLuint>(blocks.height + k_group - 1) / k_group, 1);
  glMemoryBarrier(GL_SHADER_IMAGE_ACCESS_BARRIER_BIT | GL_TEXTURE_FETCH_BARRIER_BIT);
}

}  // namespace

Result<EdgeFeathering> EdgeFeathering::create(int projectors, int width, int height) {
  EdgeFeathering edges;
  LIMN_TRY(edges.where_, Program::link_compute("jumps_where.comp"));
  LIMN_TRY(edges.find_, Program::link_compute("jumps.comp"));
  LIMN_TRY(edges.handed_, Program::link_compute("jump_handed.comp"));
  LIMN_TRY(edges.rows_, Program::link_compute("jump_rows.comp"));
  LIMN_TRY(edges.fade_, Program::link_compute("jump_fade.comp"));
  const int columns = blocks_of(width), rows = blocks_of(height);
  edges.blocks_.resize(static_cast<std::size_t>(projectors));
  edges.jumping_.resize(static_cast<std::size_t>(projectors));
  edges.jumps_ = make_texture(GL_TEXTURE_2D_ARRAY, GL_RGBA32F, columns, rows, projectors);
  edges.marks_ = make_texture(GL_TEXTURE_2D, GL_R8, columns, rows);
  edges.along_rows_ = make_texture(GL_TEXTURE_2D, GL_R8, columns, rows);
  edges.kept_ = make_texture(GL_TEXTURE_2D_ARRAY, GL_R16F, columns, rows, projectors);
  glTextureParameteri(*edges.kept_, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
  glTextureParameteri(*edges.kept_, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
  return edges;
}

void EdgeFeathering::find(int projector, const GlName& depth, const PinholeView& pinhole) {
  cv::Size& blocks = blocks_[static_cast<std::size_t>(projector)];
  blocks = {blocks_of(pinhole.width), blocks_of(pinhole.height)};
  for (const Program* program : {&where_, &find_}) {
    program->bind("s_depth", 0, depth);
    program->set("u_last", pinhole.width - 1, pinhole.height - 1);
    program->set("u_near", static_cast<float>(k_near));
    program->set("u_focal", static_cast<float>(pinhole.focal));
  }
  may_jump_.start(blocks.area());
  may_jump_.bind();
  const cv::Rect all({0, 0}, blocks);
  look_through(where_, {&all, 1});
  const float none[] = {-1, -1, -1, -1};
  glClearTexSubImage(*jumps_, 0, 0, 0, projector, blocks.width, blocks.height, 1, GL_RGBA, GL_FLOAT, none);
  glBindImageTexture(0, *jumps_, 0, GL_FALSE, projector, GL_WRITE_ONLY, GL_RGBA32F);
  PixelList& jumping = jumping_[static_cast<std::size_t>(projector)];
  jumping.start(blocks.area());
  jumping.bind_as_rest();
  may_jump_.work_through(find_);
}

void EdgeFeathering::feather(const std::function<void(const Program&)>& bind_sights) {
  constexpr int k_jumps_unit = 8;
  bind_sights(handed_);
  handed_.bind("s_jumps", k_jumps_unit, jumps_);
  for (std::size_t i = 0; i < blocks_.size(); ++i) {
    const int projector = static_cast<int>(i);
    handed_.set("u_projector", projector);
    glClearTexImage(*marks_, 0, GL_RED, GL_FLOAT, nullptr);
    glBindImageTexture(0, *marks_, 0, GL_FALSE, 0, GL_WRITE_ONLY, GL_R8);
    jumping_[i].work_through(handed_);
    glBindImageTexture(0, *marks_, 0, GL_FALSE, 0, GL_READ_ONLY, GL_R8);
    glBindImageTexture(1, *along_rows_, 0, GL_FALSE, 0, GL_WRITE_ONLY, GL_R8);
    run(rows_, blocks_[i]);
    glBindImageTexture(0, *along_rows_, 0, GL_FALSE, 0, GL_READ_ONLY, GL_R8);
    glBindImageTexture(1, *kept_, 0, GL_FALSE, projector, GL_WRITE_ONLY, GL_R16F);
    run(fade_, blocks_[i]);
  }
}

void EdgeFeathering::bind(const Program& program, int unit) const { program.bind("s_kept", unit, kept_); }

}  // namespace limn::projector
