#include "projector/brdf_lut.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace limn::projector {
namespace {

constexpr int k_nodes = 32;        // as in shaders/shading.glsl
constexpr int k_samples = 512;     // samples for each node; 16 times as many change no level in renderer_test
constexpr double k_horizon = 0.3;  // height at which all light counts as light from above
constexpr double k_least_roughness = 0.03, k_least_cosine = 1e-3, k_most_cosine = 0.999;

// The share of light from above in the light from a direction of this height (sine of its elevation, -1 … 1).
double share_from_above(double height) {
  const double t = std::clamp((height / k_horizon + 1) / 2, 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

// Value i of the van der Corput sequence: any number of first values is spread evenly over 0 … 1.
double spread(unsigned i) {
  double sum = 0;
  for (double digit = 0.5; i > 0; i >>= 1, digit /= 2) sum += (i & 1) * digit;
  return sum;
}

// Calls `use` with half vectors around z that are distributed as GGX.
template <class Use>
void for_each_half_vector(double roughness, const Use& use) {
  const double a2 = std::pow(roughness, 4);
  for (int i = 0; i < k_samples; ++i) {
    const double share = spread(static_cast<unsigned>(i));
    const double angle = 2 * std::numbers::pi * (i + 0.5) / k_samples;
    const double z = std::sqrt((1 - share) / (1 + (a2 - 1) * share)), ring = std::sqrt(1 - z * z);
    use(Eigen::Vector3d(ring * std::cos(angle), ring * std::sin(angle), z));
  }
}

// What is reflected of uniform light from everywhere.
struct SpecularTerms {
  double f0 = 0, f90 = 0;  // factors of the colour at normal incidence and of white
  double aside = 0;        // mean direction, from the normal (0) to the mirror direction (1)
};

SpecularTerms specular_terms(double cosine, double roughness) {
  const Eigen::Vector3d d_view(std::sqrt(1 - cosine * cosine), 0, cosine);
  const double a2 = std::pow(roughness, 4);
  SpecularTerms sum;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for_each_half_vector(roughness, [&](const Eigen::Vector3d& h) {
    const double vh = d_view.dot(h);
    const Eigen::Vector3d l = 2 * vh * h - d_view;
    if (l.z() <= 0 || vh <= 0) return;
    const double visible = l.z() * std::sqrt(cosine * cosine * (1 - a2) + a2) +
                           cosine * std::sqrt(l.z() * l.z() * (1 - a2) + a2);
    const double light = 2 * l.z() * vh / (visible * h.z() * k_samples), schlick = std::pow(1 - vh, 5);
    sum.f0 += light * (1 - schlick);
    sum.f90 += light * schlick;
    mean += light * l;
  });
  const double tangent = -mean.x() / mean.z();
  sum.aside = std::clamp(tangent / (d_view.x() + tangent * (1 - cosine)), 0.0, 1.0);
  return sum;
}

// The share of light from above in the reflection lobe around a direction of this height; the lobe is that of
// normal incidence.
double specular_from_above(double height, double roughness) {
  const double level = std::sqrt(std::max(0.0, 1 - height * height)), a2 = std::pow(roughness, 4);
  double above = 0, all = 0;
  for_each_half_vector(roughness, [&](const Eigen::Vector3d& h) {
    const Eigen::Vector3d l = 2 * h.z() * h - Eigen::Vector3d::UnitZ();
    if (l.z() <= 0) return;
    const double light = l.z() / (l.z() + std::sqrt(l.z() * l.z() * (1 - a2) + a2));
    above += light * share_from_above(l.z() * height + l.x() * level);
    all += light;
  });
  return above / all;
}

cv::Mat made() {
  cv::Mat table(k_nodes, k_nodes, CV_32FC4);
  for (int row = 0; row < k_nodes; ++row) {
    const double roughness = std::max(k_least_roughness, 1.0 * row / (k_nodes - 1));
    for (int column = 0; column < k_nodes; ++column) {
      const double x = 1.0 * column / (k_nodes - 1);
      const SpecularTerms share = specular_terms(std::clamp(x, k_least_cosine, k_most_cosine), roughness);
      table.at<cv::Vec4f>(row, column) =
          cv::Vec4d(share.f0, share.f90, specular_from_above(2 * x - 1, roughness), share.aside);
    }
  }
  return table;
}

}  // namespace

const cv::Mat& brdf_lut() {
  static const cv::Mat table = made();
  return table;
}

}  // namespace limn::projector
