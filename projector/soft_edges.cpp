#include "projector/soft_edges.h"

namespace limn::projector {
namespace {

constexpr int k_block = 8;  // as in shaders/blocks.glsl

int blocks_of(int texels) { return (texels + k_block - 1) / k_block; }

}  // namespace

Result<SoftEdges> SoftEdges::create(int projectors, int width, int height) {
  SoftEdges edges;
  LIMN_TRY(edges.jumps_, Program::link_compute("jumps.comp"));
  LIMN_TRY(edges.rows_, Program::link_compute("jump_rows.comp"));
  LIMN_TRY(edges.fade_, Program::link_compute("jump_fade.comp"));
  const int columns = blocks_of(width), rows = blocks_of(height);
  edges.marks_ = make_texture(GL_TEXTURE_2D, GL_R8, columns, rows);
  edges.along_rows_ = make_texture(GL_TEXTURE_2D, GL_R8, columns, rows);
  edges.kept_ = make_texture(GL_TEXTURE_2D_ARRAY, GL_R16F, columns, rows, projectors);
  glTextureParameteri(*edges.kept_, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
  glTextureParameteri(*edges.kept_, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
  return edges;
}

void SoftEdges::find(int projector, const GlName& depth, const Twin& twin) {
  const int columns = blocks_of(twin.width), rows = blocks_of(twin.height);
  const auto over_blocks = [&](const Program& program) {
    constexpr int k_group = 8;
    program.set("u_blocks", columns, rows);
    program.use();
    glDispatchCompute(static_cast<GLuint>(columns + k_group - 1) / k_group,
                      static_cast<GLuint>(rows + k_group - 1) / k_group, 1);
    glMemoryBarrier(GL_SHADER_IMAGE_ACCESS_BARRIER_BIT | GL_TEXTURE_FETCH_BARRIER_BIT);
  };
  jumps_.bind("s_depth", 0, depth);
  jumps_.set("u_last", twin.width - 1, twin.height - 1);
  jumps_.set("u_near", static_cast<float>(k_near));
  jumps_.set("u_focal", static_cast<float>(twin.focal));
  glBindImageTexture(0, *marks_, 0, GL_FALSE, 0, GL_WRITE_ONLY, GL_R8);
  over_blocks(jumps_);
  glBindImageTexture(0, *marks_, 0, GL_FALSE, 0, GL_READ_ONLY, GL_R8);
  glBindImageTexture(1, *along_rows_, 0, GL_FALSE, 0, GL_WRITE_ONLY, GL_R8);
  over_blocks(rows_);
  glBindImageTexture(0, *along_rows_, 0, GL_FALSE, 0, GL_READ_ONLY, GL_R8);
  glBindImageTexture(1, *kept_, 0, GL_FALSE, projector, GL_WRITE_ONLY, GL_R16F);
  over_blocks(fade_);
}

void SoftEdges::bind(const Program& program, int unit) const { program.bind("s_kept", unit, kept_); }

}  // namespace limn::projector
