#include "projector/compensation.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "core/median.h"

namespace limn::projector {
namespace {

constexpr double k_too_dim = 0.2;               // share of the surface that may be too dim for the level
constexpr std::size_t k_most_triangles = 4000;  // triangles that are sampled for the level
// Least light of a projector's white, as a share of the camera's full scale.
constexpr float k_least_light = 0.004F;
constexpr int k_edge_px = 2;  // margin: pixels beside shadows and silhouettes see two surfaces

// r, g, b of a map's pixel; for a grey camera three times its value.
Eigen::Vector3f colour_at(const cv::Mat& map, int row, int column) {
  if (map.channels() == 1) return Eigen::Vector3f::Constant(map.at<float>(row, column));
  const auto& bgr = map.at<cv::Vec3f>(row, column);
  return {bgr[2], bgr[1], bgr[0]};
}

// Columns: the colours that the camera sees for red, green and blue. For a grey camera: a diagonal matrix of
// their sum.
Eigen::Matrix3f mixing_at(const ColourMixing& mixing, int row, int column) {
  const Eigen::Vector3f red = colour_at(mixing.red, row, column),
                        green = colour_at(mixing.green, row, column),
                        blue = colour_at(mixing.blue, row, column);
  Eigen::Matrix3f m;
  if (mixing.red.channels() == 1) return (red + green + blue).asDiagonal();
  m << red, green, blue;
  return m;
}

cv::Vec4f known(const Eigen::Vector3f& v) { return {v.x(), v.y(), v.z(), 1}; }

// Mask of where the projector lights the surface, without a margin at the edges of its light.
cv::Mat well_illuminated(const cv::Mat& irradiance) {
  cv::Mat illuminated = irradiance > 0;
  cv::erode(illuminated, illuminated, cv::Mat(), {-1, -1}, k_edge_px, cv::BORDER_CONSTANT, cv::Scalar(0));
  return illuminated;
}

// Extends known values into unknown pixels around them, far enough to fill the margin of well_illuminated.
void spread(cv::Mat* layer) {
  for (int i = 0; i < 2 * k_edge_px; ++i) {
    cv::Mat around;
    cv::blur(*layer, around, {3, 3});
    for (int row = 0; row < layer->rows; ++row)
      for (int column = 0; column < layer->cols; ++column) {
        const auto& mean = around.at<cv::Vec4f>(row, column);
        auto& pixel = layer->at<cv::Vec4f>(row, column);
        if (pixel[3] == 0 && mean[3] > 0) pixel = mean * (1 / mean[3]);
      }
  }
}

// Irradiance of an unshadowed point, computed from geometry; 0 where the projector does not reach.
double irradiance_at(const Imager& projector,
                     const Vignetting& vignetting,
                     const Eigen::Vector3d& p_world,
                     const Eigen::Vector3d& n_world) {
  const Eigen::Vector3d to_projector = projector.imager_from_world.inverse().translation - p_world;
  const double cosine = n_world.dot(to_projector.normalized());
  const auto px = projector.project(p_world);
  if (cosine <= 0 || !px || !projector.contains(*px)) return 0;
  return cosine / to_projector.squaredNorm() * vignetting.gain(*px, projector.width, projector.height);
}

// The albedo image as linear r, g, b.
cv::Mat linear_albedo(const scene::Prototype& prototype) {
  cv::Mat linear(prototype.albedo_image.size(), CV_32FC3);
  for (int row = 0; row < linear.rows; ++row)
    for (int column = 0; column < linear.cols; ++column)
      for (int c = 0; c < 3; ++c)
        linear.at<cv::Vec3f>(row, column)[c] = static_cast<float>(
            linear_from_srgb(prototype.albedo_image.at<cv::Vec3b>(row, column)[2 - c] / 255.0));
  return linear;
}

Vignetting vignetting_of(const Rig& rig, const Imager& projector) {
  for (const ProjectorResponse& response : rig.responses)
    if (response.projector == projector.name && response.vignetting) return *response.vignetting;
  return {};
}

}  // namespace

Status check_fits(const MeasuredSurface& surface, const Rig& rig) {
  const Imager& camera = surface.camera;
  if (surface.mixings.size() != rig.projectors.size()) {
    return error(
        "colour mixing: expected one for each of the rig's {} projectors, found {}. Measure the response of "
        "all projectors.",
        rig.projectors.size(), surface.mixings.size());
  }
  for (std::size_t i = 0; i < surface.mixings.size(); ++i) {
    const ColourMixing& mixing = surface.mixings[i];
    if (mixing.projector != rig.projectors[i].name || mixing.camera != camera.name) {
      return error("colour mixing {} of the rig: expected {} seen by {}, found {} seen by {}.", i,
                   rig.projectors[i].name, camera.name, mixing.projector, mixing.camera);
    }
    if (mixing.red.cols != camera.width || mixing.red.rows != camera.height) {
      return error(
          "colour mixing of {}: expected maps of the size of {}'s images, {}x{}, found {}x{}. Measure the "
          "response again.",
          mixing.projector, camera.name, camera.width, camera.height, mixing.red.cols, mixing.red.rows);
    }
  }
  return {};
}

Result<SurfaceMixing> surface_mixing(const MeasuredSurface& surface, std::span<const cv::Mat> irradiance) {
  const std::size_t count = surface.mixings.size();
  const cv::Size size(surface.camera.width, surface.camera.height);
  SurfaceMixing out;
  for (std::size_t i = 0; i < 3 * count + 1; ++i) out.layers.emplace_back(size, CV_32FC4, cv::Scalar::all(0));
  std::vector<cv::Mat> illuminated;
  for (const cv::Mat& image : irradiance) illuminated.push_back(well_illuminated(image));
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  std::size_t measured = 0;
  std::vector<Eigen::Vector3f> whites;  // light of each pixel with all projectors at white
  for (int row = 0; row < size.height; ++row)
    for (int column = 0; column < size.width; ++column) {
      Eigen::Vector3f white = Eigen::Vector3f::Zero();
      Eigen::Vector3f offset = Eigen::Vector3f::Zero();
      int projectors = 0;
      for (std::size_t i = 0; i < count; ++i) {
        if (!illuminated[i].at<uchar>(row, column)) continue;
        const Eigen::Matrix3f mixing = mixing_at(surface.mixings[i], row, column);
        const Eigen::Vector3f by_this = mixing.rowwise().sum();
        if (!mixing.allFinite() || !(by_this.minCoeff() > k_least_light)) continue;
        const Eigen::Matrix3f at_one = mixing / irradiance[i].at<float>(row, column);
        for (int c = 0; c < 3; ++c)
          out.layers[3 * i + static_cast<std::size_t>(c)].at<cv::Vec4f>(row, column) = known(at_one.col(c));
        sum += at_one.cast<double>();
        ++measured;
        white += by_this;
        offset += colour_at(surface.mixings[i].offset, row, column);
        ++projectors;
      }
      if (projectors == 0) continue;
      offset /= static_cast<float>(projectors);
      out.layers.back().at<cv::Vec4f>(row, column) = known(offset);
      whites.push_back(white + offset);
    }
  if (measured == 0) {
    return error(
        "colour mixing of camera {}: expected pixels that see projected light on the prototype, found none "
        "where light is predicted from the rig and the prototype's pose. Measure the response again with the "
        "prototype in place.",
        surface.camera.name);
  }
  for (cv::Mat& layer : out.layers) spread(&layer);
  out.mean = (sum / static_cast<double>(measured)).cast<float>();
  const Eigen::Vector3f mean_white = out.mean.rowwise().sum();
  std::vector<double> levels;
  for (const Eigen::Vector3f& white : whites)
    levels.push_back((white.array() / mean_white.array()).minCoeff());
  out.level = quantile(std::move(levels), k_too_dim);
  return out;
}

double geometric_level(const scene::Prototype& prototype, const Rig& rig, const Pose& world_from_prototype) {
  const scene::Mesh& mesh = prototype.mesh;
  const cv::Mat albedo = relative_albedo(prototype);
  const std::size_t stride = std::max<std::size_t>(1, mesh.triangles.size() / k_most_triangles);
  std::vector<double> levels;
  for (std::size_t t = 0; t < mesh.triangles.size(); t += stride) {
    std::array<Eigen::Vector3d, 3> p;
    Eigen::Vector2f uv(0, 0);
    for (std::size_t k = 0; k < 3; ++k) {
      p[k] = world_from_prototype * mesh.positions[mesh.triangles[t][k]].cast<double>();
      if (!mesh.uvs.empty()) uv += mesh.uvs[mesh.triangles[t][k]] / 3;
    }
    const Eigen::Vector3d n = (p[1] - p[0]).cross(p[2] - p[0]).normalized();
    const Eigen::Vector3d middle = (p[0] + p[1] + p[2]) / 3;
    double irradiance = 0;  // the larger of the two faces': meshes need not be closed
    for (const Eigen::Vector3d& face : {n, Eigen::Vector3d(-n)}) {
      double sum = 0;
      for (const Imager& projector : rig.projectors)
        sum += irradiance_at(projector, vignetting_of(rig, projector), middle, face);
      irradiance = std::max(irradiance, sum);
    }
    if (!(irradiance > 0)) continue;
    const auto texel = [](float at, int size) {
      return std::clamp(static_cast<int>((at - std::floor(at)) * static_cast<float>(size)), 0, size - 1);
    };
    const auto& rgb = albedo.at<cv::Vec3f>(texel(1 - uv.y(), albedo.rows), texel(uv.x(), albedo.cols));
    levels.push_back(irradiance * std::min({rgb[0], rgb[1], rgb[2]}));
  }
  return std::max(1e-6, quantile(std::move(levels), k_too_dim, 1.0));
}

cv::Mat relative_albedo(const scene::Prototype& prototype) {
  if (prototype.albedo_image.empty()) return {1, 1, CV_32FC3, cv::Scalar::all(1)};
  return linear_albedo(prototype) / std::max(1e-3, mean_albedo_of(prototype));
}

double mean_albedo_of(const scene::Prototype& prototype) {
  if (prototype.albedo_image.empty()) return prototype.albedo;
  const cv::Scalar mean = cv::mean(linear_albedo(prototype));
  return (mean[0] + mean[1] + mean[2]) / 3;
}

}  // namespace limn::projector
