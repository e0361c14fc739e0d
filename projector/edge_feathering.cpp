#include "projector/edge_feathering.h"

#include <cstddef>

#include "projector/bindings.h"

namespace limn::projector {
namespace {

constexpr int k_block = 8;  // as in shaders/blocks.glsl

int blocks_of(int texels) { return (texels + k_block - 1) / k_block; }

// The depth buffer that ids were drawn with.
class DepthOfIds final : public Bindable {
 public:
  DepthOfIds(const GlName& depth, const PinholeView& pinhole) : depth_(depth), pinhole_(pinhole) {}
  void bind(const Use& use) const override {
    glBindTextureUnit(k_depth_unit, *depth_);
    use.program.set("u_last", pinhole_.width - 1, pinhole_.height - 1);
    use.program.set("u_near", static_cast<float>(k_near));
    use.program.set("u_focal", static_cast<float>(pinhole_.focal));
  }

 private:
  const GlName& depth_;
  const PinholeView& pinhole_;
};

// Runs a pass over all blocks, in work groups of 8 x 8 blocks.
void run(const ComputePass& pass, cv::Size blocks, const Resources& resources) {
  constexpr int k_group = 8;
  pass.program().set("u_blocks", blocks.width, blocks.height);
  pass.use(resources);
  glDispatchCompute(static_cast<GLuint>(blocks.width + k_group - 1) / k_group,
                    static_cast<GLuint>(blocks.height + k_group - 1) / k_group, 1);
  glMemoryBarrier(GL_SHADER_IMAGE_ACCESS_BARRIER_BIT | GL_TEXTURE_FETCH_BARRIER_BIT);
}

}  // namespace

Result<EdgeFeathering> EdgeFeathering::create(int projectors, int width, int height) {
  using enum Resource;
  EdgeFeathering edges;
  LIMN_TRY(
      edges.find_candidates_,
      ComputePass::link({.shader = "depth_edge_candidates.comp", .reads = {depth}, .writes = {work_list}}));
  LIMN_TRY(edges.find_edges_,
           ComputePass::link(
               {.shader = "depth_edges.comp", .reads = {depth}, .writes = {depth_edges, deferred_list}}));
  LIMN_TRY(edges.mark_handover_, ComputePass::link({.shader = "depth_edge_handover.comp",
                                                    .reads = {scene, viewpoints, projector, all_depth_edges},
                                                    .writes = {edge_marks}}));
  LIMN_TRY(
      edges.rows_,
      ComputePass::link({.shader = "depth_edge_rows.comp", .reads = {edge_marks}, .writes = {edge_rows}}));
  LIMN_TRY(edges.fade_, ComputePass::link(
                            {.shader = "depth_edge_fade.comp", .reads = {edge_rows}, .writes = {edge_fade}}));
  const int columns = blocks_of(width), rows = blocks_of(height);
  edges.blocks_.resize(static_cast<std::size_t>(projectors));
  edges.edge_blocks_.resize(static_cast<std::size_t>(projectors));
  edges.depth_edges_ = make_texture(GL_TEXTURE_2D_ARRAY, GL_RGBA32F, columns, rows, projectors);
  edges.marks_ = make_texture(GL_TEXTURE_2D, GL_R8, columns, rows);
  edges.along_rows_ = make_texture(GL_TEXTURE_2D, GL_R8, columns, rows);
  edges.weights_ = make_texture(GL_TEXTURE_2D_ARRAY, GL_R16F, columns, rows, projectors);
  glTextureParameteri(*edges.weights_, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
  glTextureParameteri(*edges.weights_, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
  return edges;
}

void EdgeFeathering::find_edges(int projector, const GlName& depth, const PinholeView& pinhole) {
  cv::Size& blocks = blocks_[static_cast<std::size_t>(projector)];
  blocks = {blocks_of(pinhole.width), blocks_of(pinhole.height)};
  PixelList& edge_blocks = edge_blocks_[static_cast<std::size_t>(projector)];
  candidate_blocks_.start(blocks.area());
  const DepthOfIds depth_of_ids(depth, pinhole);
  const ImageAt depth_edges(k_depth_edges_image, depth_edges_, GL_RGBA32F, projector);
  const Resources resources = Resources()
                                  .with(Resource::depth, depth_of_ids)
                                  .with(Resource::depth_edges, depth_edges)
                                  .with(Resource::work_list, candidate_blocks_)
                                  .with(Resource::deferred_list, edge_blocks);
  const cv::Rect all({0, 0}, blocks);
  find_candidates_.run_over_rects({&all, 1}, resources);
  const float none[] = {-1, -1, -1, -1};
  glClearTexSubImage(*depth_edges_, 0, 0, 0, projector, blocks.width, blocks.height, 1, GL_RGBA, GL_FLOAT,
                     none);
  edge_blocks.start(blocks.area());
  find_edges_.run_over_list(candidate_blocks_, resources);
}

void EdgeFeathering::feather(const Resources& scene_resources) {
  const TextureAt all_depth_edges(k_depth_edges_unit, depth_edges_);
  const ImageAt marks(k_edge_marks_image, marks_, GL_R8), along_rows(k_edge_rows_image, along_rows_, GL_R8);
  for (std::size_t i = 0; i < blocks_.size(); ++i) {
    const ProjectorIndex projector(i);
    const ImageAt weights(k_edge_fade_image, weights_, GL_R16F, static_cast<int>(i));
    const Resources resources = scene_resources.with(Resource::all_depth_edges, all_depth_edges)
                                    .with(Resource::projector, projector)
                                    .with(Resource::edge_marks, marks)
                                    .with(Resource::edge_rows, along_rows)
                                    .with(Resource::edge_fade, weights);
    glClearTexImage(*marks_, 0, GL_RED, GL_FLOAT, nullptr);
    mark_handover_.run_over_list(edge_blocks_[i], resources);
    run(rows_, blocks_[i], resources);
    run(fade_, blocks_[i], resources);
  }
}

}  // namespace limn::projector
