#include "projector/occlusion_maps.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "projector/bindings.h"

namespace limn::projector {
namespace {

constexpr int k_occlusion_side = 256;  // texels of a projector's map

// The map as a layer stores it: CV_32FC1, 0 ... 1.
cv::Mat as_layer(const cv::Mat& map) {
  cv::Mat layer(k_occlusion_side, k_occlusion_side, CV_32F, cv::Scalar(1));
  if (map.empty()) return layer;
  map.convertTo(layer, CV_32F, map.depth() == CV_8U ? 1.0 / 255 : 1.0);
  const bool finer = std::max(map.cols, map.rows) > k_occlusion_side;
  cv::resize(layer, layer, {k_occlusion_side, k_occlusion_side}, 0, 0,
             finer ? cv::INTER_AREA : cv::INTER_LINEAR);
  return cv::max(0.0, cv::min(1.0, layer));
}

}  // namespace

OcclusionMaps::OcclusionMaps(std::size_t projectors) : maps_(projectors) {
  layers_ = make_texture(GL_TEXTURE_2D_ARRAY, GL_R16F, k_occlusion_side, k_occlusion_side,
                         static_cast<int>(std::max<std::size_t>(1, projectors)));
  for (const GLenum filter : {GL_TEXTURE_MIN_FILTER, GL_TEXTURE_MAG_FILTER})
    glTextureParameteri(*layers_, filter, GL_LINEAR);
  for (std::size_t i = 0; i < projectors; ++i) set(i, {});
}

bool OcclusionMaps::set(std::size_t projector, const cv::Mat& map) {
  LIMN_CHECK(map.empty() || map.type() == CV_32FC1 || map.type() == CV_8UC1);
  const cv::Mat layer = as_layer(map);
  cv::Mat& known = maps_.at(projector);
  if (!known.empty() && cv::norm(known, layer, cv::NORM_INF) == 0) return false;
  known = layer;
  ++changes_;
  glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
  glTextureSubImage3D(*layers_, 0, 0, 0, static_cast<GLint>(projector), layer.cols, layer.rows, 1, GL_RED,
                      GL_FLOAT, layer.data);
  return true;
}

void OcclusionMaps::bind(const Use&) const { glBindTextureUnit(k_occlusion_unit, *layers_); }

}  // namespace limn::projector
