#include "sim/trace.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <opencv2/core.hpp>

#include "sim/directions.h"
#include "sim/ray_scene.h"
#include "sim/texture.h"

namespace limn::sim {
namespace {

// Samples of a pixel on an edge: the edge's position is then known to 1/64 px.
constexpr int k_edge_samples = 32;
constexpr float k_same_albedo = 0.02F;  // samples of one pixel that differ by less count as one surface
constexpr float k_same_normal = 0.99F;  // cosine, about 8°
constexpr float k_same_depth = 1e-3F;   // m, departure from a plane within one pixel
constexpr int k_lamp_points = 12;       // spread evenly over a lamp's disc

// The surface that one ray hits.
struct Surface {
  int object = -1;
  float distance = 0;
  Eigen::Vector3f p = Eigen::Vector3f::Constant(std::numeric_limits<float>::quiet_NaN());
  Eigen::Vector3f n = Eigen::Vector3f::Zero();       // shading normal towards the camera
  Eigen::Vector3f n_face = Eigen::Vector3f::Zero();  // geometric normal towards the camera
  Eigen::Vector3f albedo = Eigen::Vector3f::Zero();
};

struct LampPoint {
  Eigen::Vector3d p_world;
  double illuminance_at_1m;
};

std::vector<LampPoint> points_of(const Lamp& lamp) {
  if (lamp.radius_m <= 0) return {{lamp.p_world, lamp.illuminance_at_1m}};
  std::vector<LampPoint> points;
  constexpr double k_golden_angle = 2.399963229728653;  // sunflower pattern: equal areas, no rows
  for (int k = 0; k < k_lamp_points; ++k) {
    const double radius = lamp.radius_m * std::sqrt((k + 0.5) / k_lamp_points), angle = k * k_golden_angle;
    points.push_back({lamp.p_world + radius * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0),
                      lamp.illuminance_at_1m / k_lamp_points});
  }
  return points;
}

std::vector<MeshInstance> placed(const std::vector<Object>& objects) {
  std::vector<MeshInstance> meshes;
  for (const Object& object : objects) meshes.push_back({object.mesh.get(), object.world_from_object});
  return meshes;
}

// The state while one camera's view is traced.
class Tracer {
 public:
  Tracer(const World& world, int camera)
      : world_(world),
        imager_(world.rig.cameras.at(static_cast<std::size_t>(camera))),
        scene_(placed(world.objects)),
        directions_(imager_),
        p_camera_(imager_.imager_from_world.inverse().translation) {
    for (const Lamp& lamp : world.room.lamps)
      for (const LampPoint& point : points_of(lamp)) lamps_.push_back(point);
    for (const Imager& projector : world.rig.projectors)
      p_projectors_.push_back(projector.imager_from_world.inverse().translation);
    samples_.camera = camera;
    samples_.width = imager_.width;
    samples_.height = imager_.height;
  }

  Samples run() {
    first_samples();
    mark_shadow_edges();
    refine_edges();
    complete();
    return std::move(samples_);
  }

 private:
  struct Group {
    Surface first;
    float count = 0;
    Eigen::Vector3f p = Eigen::Vector3f::Zero(), n = Eigen::Vector3f::Zero(),
                    albedo = Eigen::Vector3f::Zero();
    float room_light = 0;
    std::vector<float> reached;
  };
  struct Refined {
    std::int32_t pixel;
    std::vector<Group> groups;
  };

  std::size_t pixel_count() const {
    return static_cast<std::size_t>(imager_.width) * static_cast<std::size_t>(imager_.height);
  }

  Surface surface(const Hit& hit, const Eigen::Vector3f& d) const {
    Surface s;
    if (hit.object < 0) return s;
    const Object& object = world_.objects[static_cast<std::size_t>(hit.object)];
    s.object = hit.object;
    s.distance = static_cast<float>(hit.distance);
    s.p = (p_camera_ + hit.distance * d.cast<double>()).cast<float>();
    s.n_face = scene_.face_normal(hit).cast<float>();
    s.n = scene_.shading_normal(hit).cast<float>();
    const bool back = s.n_face.dot(d) > 0;
    if (back) s.n_face = -s.n_face, s.n = -s.n;
    s.albedo = object.albedo.cast<float>();
    if (object.by_material)
      s.albedo = material_albedo(*object.mesh, hit.triangle, scene_.uv(hit), scene_.colour(hit));
    else if (!object.texture.empty() && !(back && object.sharp_texture)) {
      const Eigen::Vector3f share = textured(object.texture, scene_.uv(hit), object.sharp_texture);
      const auto ink = static_cast<float>(object.ink_albedo);
      s.albedo = (s.albedo.array() - ink) * share.array() + ink;
    }
    return s;
  }

  std::vector<Surface> surfaces(std::span<const Eigen::Vector3f> d) const {
    std::vector<Hit> hits(d.size());
    scene_.first_hits(p_camera_, d, hits);
    std::vector<Surface> found(d.size());
    for (std::size_t i = 0; i < d.size(); ++i) found[i] = surface(hits[i], d[i]);
    return found;
  }

  static bool agree(const Surface& a, const Surface& b) {
    if (a.object != b.object) return false;
    if (a.object < 0) return true;
    return (a.albedo - b.albedo).cwiseAbs().maxCoeff() < k_same_albedo && a.n.dot(b.n) > k_same_normal;
  }
  static bool is_smooth(const Surface& centre, const std::array<const Surface*, 4>& corners) {
    float depth = 0;
    for (const Surface* corner : corners) {
      if (!agree(centre, *corner)) return false;
      depth += corner->distance / 4;
    }
    return std::abs(depth - centre.distance) < k_same_depth;
  }

  // Whether the light is on the side of the surface that the camera sees.
  static bool faces(const Surface& s, const Eigen::Vector3d& p_light) {
    return s.n_face.dot(p_light.cast<float>() - s.p) > 0;
  }

  std::vector<std::uint8_t> reached_from(const Eigen::Vector3d& p_light,
                                         std::span<const Surface> surfaces) const {
    std::vector<Eigen::Vector3f> points;
    for (const Surface& s : surfaces)  // NaN points cost no traversal
      points.push_back(s.object >= 0 && faces(s, p_light) ? s.p : Eigen::Vector3f::Constant(NAN));
    std::vector<std::uint8_t> result(surfaces.size());
    scene_.reached(p_light, points, result);
    for (std::size_t i = 0; i < points.size(); ++i)
      result[i] = result[i] != 0 && points[i].allFinite() ? 1 : 0;
    return result;
  }

  float lamp_light(const LampPoint& lamp, const Surface& s) const {
    const Eigen::Vector3f towards = lamp.p_world.cast<float>() - s.p;
    const float d2 = towards.squaredNorm();
    return static_cast<float>(lamp.illuminance_at_1m) * std::max(0.0F, s.n.dot(towards) / std::sqrt(d2)) / d2;
  }
  float ambient_light(const Surface& s) const {
    return s.object < 0 ? 0
                        // More light from above.
                        : static_cast<float>(world_.room.ambient) * (0.75F + 0.25F * s.n.z());
  }

  void first_samples() {
    const std::size_t count = pixel_count();
    surfaces_.resize(count);
    edge_.assign(count, 0);
    room_.assign(count, 0);
    reached_.assign(world_.rig.projectors.size(), std::vector<std::uint8_t>(count, 0));
    constexpr int k_strip = 16;  // rows of a strip; the corner row between strips is traced twice
    cv::parallel_for_({0, (imager_.height + k_strip - 1) / k_strip}, [&](const cv::Range& strips) {
      for (int strip = strips.start; strip < strips.end; ++strip)
        trace_rows(strip * k_strip, std::min(imager_.height, (strip + 1) * k_strip));
    });
  }

  std::vector<Surface> corner_row(int row) const {
    std::vector<Eigen::Vector3f> d(static_cast<std::size_t>(imager_.width) + 1);
    directions_.row(-0.5, row - 0.5, d);
    return surfaces(d);
  }

  void trace_rows(int begin, int end) {
    const auto width = static_cast<std::size_t>(imager_.width);
    std::vector<Eigen::Vector3f> d(width);
    std::vector<Surface> above = corner_row(begin);
    for (int row = begin; row < end; ++row) {
      const std::vector<Surface> below = corner_row(row + 1);
      directions_.row(0, row, d);
      const std::vector<Surface> centres = surfaces(d);
      const std::size_t at = static_cast<std::size_t>(row) * width;
      for (std::size_t i = 0; i < width; ++i) {
        surfaces_[at + i] = centres[i];
        edge_[at + i] = is_smooth(centres[i], {&above[i], &above[i + 1], &below[i], &below[i + 1]}) ? 0 : 1;
      }
      light_row(centres, at);
      above = below;
    }
  }

  void light_row(std::span<const Surface> row, std::size_t at) {
    for (std::size_t k = 0; k < reached_.size(); ++k) {
      const std::vector<std::uint8_t> result = reached_from(p_projectors_[k], row);
      std::copy(result.begin(), result.end(), reached_[k].begin() + static_cast<std::ptrdiff_t>(at));
    }
    for (std::size_t i = 0; i < row.size(); ++i) room_[at + i] = ambient_light(row[i]);
    for (const LampPoint& lamp : lamps_) {
      const std::vector<std::uint8_t> result = reached_from(lamp.p_world, row);
      for (std::size_t i = 0; i < row.size(); ++i)
        if (result[i] != 0) room_[at + i] += lamp_light(lamp, row[i]);
    }
  }

  // Where a projector's light ends between two pixels, both are marked as edges.
  void mark_shadow_edges() {
    const int width = imager_.width, height = imager_.height;
    for (const auto& reached : reached_)
      for (int row = 0; row < height; ++row)
        for (int column = 0; column < width; ++column) {
          const auto i = static_cast<std::size_t>(row) * static_cast<std::size_t>(width) +
                         static_cast<std::size_t>(column);
          if (column + 1 < width && reached[i] != reached[i + 1]) edge_[i] = edge_[i + 1] = 1;
          const std::size_t below = i + static_cast<std::size_t>(width);
          if (row + 1 < height && reached[i] != reached[below]) edge_[i] = edge_[below] = 1;
        }
  }

  void refine_edges() {
    for (std::size_t i = 0; i < edge_.size(); ++i)
      if (edge_[i] != 0) refined_.push_back({static_cast<std::int32_t>(i), {}});
    constexpr int k_chunk = 256;
    const int count = static_cast<int>(refined_.size());
    cv::parallel_for_({0, (count + k_chunk - 1) / k_chunk}, [&](const cv::Range& chunks) {
      for (int chunk = chunks.start; chunk < chunks.end; ++chunk)
        for (int i = chunk * k_chunk; i < std::min(count, (chunk + 1) * k_chunk); ++i)
          refined_[static_cast<std::size_t>(i)].groups = refine(refined_[static_cast<std::size_t>(i)].pixel);
    });
  }

  // Sample k of a (0,2)-sequence (van der Corput, Sobol): each of 32 columns and 32 rows of the pixel gets
  // one sample.
  static Eigen::Vector2d sub_sample(unsigned k) {
    double x = 0, y = 0;
    for (unsigned bit = 0; bit < 5; ++bit)
      if ((k >> bit & 1U) != 0) x += 0.5 / (1U << bit);
    unsigned sobol = 0;
    for (unsigned v = 1U << 31, i = k; i != 0; i >>= 1U, v ^= v >> 1U)
      if ((i & 1U) != 0) sobol ^= v;
    y = static_cast<double>(sobol) / 4294967296.0;
    constexpr double k_centred = 0.5 / k_edge_samples - 0.5;
    return {x + k_centred, y + k_centred};
  }

  std::vector<Group> refine(std::int32_t pixel) const {
    const Eigen::Vector2d px(pixel % imager_.width, pixel / imager_.width);
    std::array<Eigen::Vector3f, k_edge_samples> d;
    for (unsigned k = 0; k < k_edge_samples; ++k) {
      const Eigen::Vector2d at = px + sub_sample(k);
      d[k] = directions_.at(at.x(), at.y());
    }
    const std::vector<Surface> found = surfaces(d);
    std::vector<std::vector<std::uint8_t>> reached_by;
    for (const Eigen::Vector3d& p_projector : p_projectors_)
      reached_by.push_back(reached_from(p_projector, found));
    std::vector<float> room(found.size());
    for (std::size_t k = 0; k < found.size(); ++k) room[k] = ambient_light(found[k]);
    for (const LampPoint& lamp : lamps_) {
      const std::vector<std::uint8_t> result = reached_from(lamp.p_world, found);
      for (std::size_t k = 0; k < found.size(); ++k)
        if (result[k] != 0) room[k] += lamp_light(lamp, found[k]);
    }
    std::vector<Group> groups;
    for (std::size_t k = 0; k < found.size(); ++k) {
      Group& group = group_of(groups, found[k]);
      group.count += 1;
      group.p += found[k].p;
      group.n += found[k].n;
      group.albedo += found[k].albedo;
      group.room_light += room[k];
      for (std::size_t j = 0; j < reached_by.size(); ++j)
        group.reached[j] += static_cast<float>(reached_by[j][k]);
    }
    return groups;
  }

  Group& group_of(std::vector<Group>& groups, const Surface& s) const {
    for (Group& group : groups)
      if (agree(group.first, s) && std::abs(group.first.distance - s.distance) < 2 * k_same_depth)
        return group;
    Group group;
    group.first = s;
    group.reached.assign(p_projectors_.size(), 0);
    groups.push_back(std::move(group));
    return groups.back();
  }

  void complete() {
    std::size_t count = pixel_count();
    for (const Refined& r : refined_) count += r.groups.size() - 1;
    resize(count);
    for (std::size_t i = 0; i < pixel_count(); ++i)
      if (edge_[i] == 0) put(i, static_cast<std::int32_t>(i), surfaces_[i], room_[i]);
    std::size_t next = pixel_count();
    for (const Refined& r : refined_)
      for (std::size_t g = 0; g < r.groups.size(); ++g)
        put(g == 0 ? static_cast<std::size_t>(r.pixel) : next++, r.pixel, r.groups[g]);
    cv::parallel_for_({0, static_cast<int>((count + 4095) / 4096)}, [&](const cv::Range& chunks) {
      for (auto i = static_cast<std::size_t>(chunks.start) * 4096;
           i < std::min(count, static_cast<std::size_t>(chunks.end) * 4096); ++i)
        view(i);
    });
  }

  void resize(std::size_t count) {
    samples_.pixel.resize(count);
    samples_.weight.resize(count);
    samples_.object.resize(count);
    samples_.p_world.resize(count);
    samples_.n_world.resize(count);
    samples_.albedo.resize(count);
    samples_.grey.resize(count);
    samples_.room_light.resize(count);
    samples_.projectors.assign(p_projectors_.size(), std::vector<ProjectorView>(count));
  }

  void put(std::size_t i, std::int32_t pixel, const Surface& s, float room_light) {
    samples_.pixel[i] = pixel;
    samples_.weight[i] = 1;
    samples_.object[i] = static_cast<std::int16_t>(s.object);
    samples_.p_world[i] = s.p;
    samples_.n_world[i] = s.n;
    samples_.albedo[i] = s.albedo;
    samples_.grey[i] = s.albedo.mean();
    samples_.room_light[i] = room_light;
    for (std::size_t k = 0; k < reached_.size(); ++k)
      samples_.projectors[k][i].gain = reached_[k][static_cast<std::size_t>(pixel)];
  }
  void put(std::size_t i, std::int32_t pixel, const Group& group) {
    Surface mean = group.first;
    mean.p = group.p / group.count;
    mean.n = group.n.normalized();
    mean.albedo = group.albedo / group.count;
    put(i, pixel, mean, group.room_light / group.count);
    samples_.weight[i] = group.count / k_edge_samples;
    samples_.grey[i] *= samples_.weight[i];
    for (std::size_t k = 0; k < group.reached.size(); ++k)
      samples_.projectors[k][i].gain = group.reached[k] / group.count;
  }

  // Computes how the projectors light a sample, by their true lenses.
  void view(std::size_t i) {
    if (samples_.object[i] < 0) return;
    const Eigen::Vector3d p = samples_.p_world[i].cast<double>();
    for (std::size_t k = 0; k < p_projectors_.size(); ++k) {
      ProjectorView& view = samples_.projectors[k][i];
      if (view.gain <= 0) continue;
      const Imager& projector = world_.rig.projectors[k];
      const Eigen::Vector3d p_projector = projector.imager_from_world * p;
      const auto px = p_projector.z() > 0 ? projector.lens.project(p_projector) : std::nullopt;
      if (!px || px->x() < -1 || px->y() < -1 || px->x() > projector.width || px->y() > projector.height) {
        view.gain = 0;
        continue;
      }
      const Eigen::Vector3d towards = p_projectors_[k] - p;
      view.u = static_cast<float>(px->x());
      view.v = static_cast<float>(px->y());
      view.depth = static_cast<float>(p_projector.z());
      const float cosine = std::max(0.0F, samples_.n_world[i].dot(towards.normalized().cast<float>()));
      // Until here, gain was the unshadowed share.
      view.gain *= cosine / static_cast<float>(towards.squaredNorm());
    }
  }

  const World& world_;
  const Imager& imager_;
  RayScene scene_;
  Directions directions_;
  Eigen::Vector3d p_camera_;
  std::vector<LampPoint> lamps_;
  std::vector<Eigen::Vector3d> p_projectors_;
  std::vector<Surface> surfaces_;  // at pixel centres
  std::vector<std::uint8_t> edge_;
  std::vector<float> room_;
  std::vector<std::vector<std::uint8_t>> reached_;  // for each projector, at pixel centres
  std::vector<Refined> refined_;
  Samples samples_;
};

}  // namespace

Samples trace(const World& world, int camera) { return Tracer(world, camera).run(); }

}  // namespace limn::sim
