#include "sim/trace.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <opencv2/core.hpp>
#include <type_traits>
#include <utility>

#include "sim/directions.h"
#include "sim/ray_scene.h"
#include "sim/texture.h"
#include "sim/view_tiles.h"

namespace limn::sim {
namespace {

constexpr float k_same_albedo = 0.02F;  // samples of one pixel that differ by less count as one surface
constexpr float k_same_normal = 0.99F;  // cosine, about 8°
constexpr float k_same_depth = 1e-3F;   // m, departure from a plane within one pixel
constexpr int k_tile = 8;               // side of a tile, px: tiles are traced again as a whole
// After changes that affect more than this share of the tiles, everything is traced again.
constexpr double k_most_affected = 0.6;

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

std::vector<LampPoint> points_of(const Lamp& lamp, int count) {
  if (lamp.radius_m <= 0 || count == 1) return {{lamp.p_world, lamp.illuminance_at_1m}};
  std::vector<LampPoint> points;
  constexpr double k_golden_angle = 2.399963229728653;  // sunflower pattern: equal areas, no rows
  for (int k = 0; k < count; ++k) {
    const double radius = lamp.radius_m * std::sqrt((k + 0.5) / count), angle = k * k_golden_angle;
    points.push_back({lamp.p_world + radius * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0),
                      lamp.illuminance_at_1m / count});
  }
  return points;
}

// The ball around an object's bounding box.
Ball ball_of(const Object& object) {
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3f& p : object.mesh->positions) box.extend(p.cast<double>());
  if (box.isEmpty()) return {};
  return {(object.world_from_object * box.center()).cast<float>(),
          0.5F * static_cast<float>(box.diagonal().norm())};
}

bool is_same_imager(const Imager& a, const Imager& b) {
  return a.name == b.name && a.width == b.width && a.height == b.height && a.lens.model == b.lens.model &&
         a.lens.values == b.lens.values && is_same(a.imager_from_world, b.imager_from_world) &&
         a.sees == b.sees;
}

bool is_same_lamp(const Lamp& a, const Lamp& b) {
  return a.p_world == b.p_world && a.illuminance_at_1m == b.illuminance_at_1m && a.radius_m == b.radius_m;
}

// Whether both objects are the same but for their poses.
bool is_same_thing(const Object& a, const Object& b) {
  return a.name == b.name && a.mesh == b.mesh && a.albedo == b.albedo && a.ink_albedo == b.ink_albedo &&
         a.texture.data == b.texture.data && a.sharp_texture == b.sharp_texture &&
         a.retroreflection == b.retroreflection && a.by_material == b.by_material;
}

std::vector<MeshInstance> placed(const std::vector<Object>& objects) {
  std::vector<MeshInstance> meshes;
  for (const Object& object : objects) meshes.push_back({object.mesh.get(), object.world_from_object});
  return meshes;
}

// Traces one camera's view, and keeps what it has found.
class Tracer {
 public:
  Tracer(const World& world, int camera, const TraceEffort& effort, bool moves)
      : world_(&world),
        imager_(world.rig.cameras.at(static_cast<std::size_t>(camera))),
        effort_(effort),
        scene_(placed(world.objects), moves),
        directions_(imager_),
        p_camera_(imager_.imager_from_world.inverse().translation) {
    if (imager_.sees == Spectrum::infrared) {
      lamps_.push_back({p_camera_, 1});  // the lamp around its lens
    } else {
      for (const Lamp& lamp : world.room.lamps)
        for (const LampPoint& point : points_of(lamp, effort.lamp_points)) lamps_.push_back(point);
    }
    for (const Imager& projector : world.rig.projectors)
      p_projectors_.push_back(projector.imager_from_world.inverse().translation);
    samples_.camera = camera;
    samples_.width = imager_.width;
    samples_.height = imager_.height;
    surfaces_.resize(pixel_count());
    is_rough_.assign(pixel_count(), 0);
    is_edge_.assign(pixel_count(), 0);
    room_.assign(pixel_count(), 0);
    reached_.assign(p_projectors_.size(), std::vector<std::uint8_t>(pixel_count(), 0));
  }

  void trace_all() {
    constexpr int k_strip = 16;  // rows of a strip; the corner row between strips is traced twice
    std::vector<cv::Rect> strips;
    for (int row = 0; row < imager_.height; row += k_strip)
      strips.emplace_back(0, row, imager_.width, std::min(k_strip, imager_.height - row));
    trace_blocks(strips);
    refined_ = refined(strips);
    complete();
  }

  /// Traces again what these objects' new poses can affect.
  void move(std::span<const std::size_t> objects, std::span<const Ball> from_and_to) {
    std::vector<Pose> poses;
    for (const std::size_t i : objects) poses.push_back(world_->objects[i].world_from_object);
    scene_.move(objects, poses);
    if (tiles_.size() == 0) make_tiles();
    const std::vector<std::uint8_t> affected = tiles_.affected(from_and_to, light_balls());
    const auto count = std::count(affected.begin(), affected.end(), 1);
    if (static_cast<double>(count) > k_most_affected * static_cast<double>(tiles_.size())) {
      trace_all();
      tiles_ = {};
      return;
    }
    const std::vector<cv::Rect> blocks = blocks_of(affected);
    trace_blocks(blocks);
    replace(blocks, refined(blocks));
    set_tiles(tiles_.with_neighbours(affected));
  }

  // To be called before move(): the world is borrowed.
  void set_world(const World& world) {
    world_ = &world;
    traced_pixels_ = 0;
  }
  const Samples& samples() const { return samples_; }
  std::size_t traced_pixels() const { return traced_pixels_; }
  Samples take_samples() { return std::move(samples_); }

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
    const Object& object = world_->objects[static_cast<std::size_t>(hit.object)];
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

  // Whether a projector's light reaches the surfaces; a camera for infrared light does not see it.
  std::vector<std::uint8_t> projector_reaches(std::size_t projector,
                                              std::span<const Surface> surfaces) const {
    if (imager_.sees == Spectrum::infrared) return std::vector<std::uint8_t>(surfaces.size(), 0);
    return reached_from(p_projectors_[projector], surfaces);
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
    const double returned = world_->objects[static_cast<std::size_t>(s.object)].retroreflection;
    if (imager_.sees == Spectrum::infrared && returned > 0) return static_cast<float>(returned) / d2;
    return static_cast<float>(lamp.illuminance_at_1m) * std::max(0.0F, s.n.dot(towards) / std::sqrt(d2)) / d2;
  }
  float ambient_light(const Surface& s) const {
    return s.object < 0 || imager_.sees == Spectrum::infrared
               ? 0
               // More light from above.
               : static_cast<float>(world_->room.ambient) * (0.75F + 0.25F * s.n.z());
  }

  // Traces the pixel centres and corners of these blocks, and finds their edges.
  void trace_blocks(std::span<const cv::Rect> blocks) {
    traced_pixels_ = 0;
    for (const cv::Rect& block : blocks) traced_pixels_ += static_cast<std::size_t>(block.area());
    const cv::Range all(0, static_cast<int>(blocks.size()));
    cv::parallel_for_(all, [&](const cv::Range& range) {
      for (int i = range.start; i < range.end; ++i) trace_block(blocks[static_cast<std::size_t>(i)]);
    });
    cv::parallel_for_(all, [&](const cv::Range& range) {
      for (int i = range.start; i < range.end; ++i) find_edges(blocks[static_cast<std::size_t>(i)]);
    });
  }

  std::vector<Surface> corner_row(const cv::Rect& block, int row) const {
    std::vector<Eigen::Vector3f> d(static_cast<std::size_t>(block.width) + 1);
    directions_.row(block.x - 0.5, row - 0.5, d);
    return surfaces(d);
  }

  void trace_block(const cv::Rect& block) {
    const auto width = static_cast<std::size_t>(block.width);
    std::vector<Eigen::Vector3f> d(width);
    std::vector<Surface> above = corner_row(block, block.y);
    for (int row = block.y; row < block.y + block.height; ++row) {
      std::vector<Surface> below = corner_row(block, row + 1);
      directions_.row(block.x, row, d);
      const std::vector<Surface> centres = surfaces(d);
      const std::size_t at = index_of(block.x, row);
      for (std::size_t i = 0; i < width; ++i) {
        surfaces_[at + i] = centres[i];
        is_rough_[at + i] =
            is_smooth(centres[i], {&above[i], &above[i + 1], &below[i], &below[i + 1]}) ? 0 : 1;
      }
      light_row(centres, at);
      above = std::move(below);
    }
  }

  void light_row(std::span<const Surface> row, std::size_t at) {
    for (std::size_t k = 0; k < reached_.size(); ++k) {
      const std::vector<std::uint8_t> result = projector_reaches(k, row);
      std::copy(result.begin(), result.end(), reached_[k].begin() + static_cast<std::ptrdiff_t>(at));
    }
    for (std::size_t i = 0; i < row.size(); ++i) room_[at + i] = ambient_light(row[i]);
    for (const LampPoint& lamp : lamps_) {
      const std::vector<std::uint8_t> result = reached_from(lamp.p_world, row);
      for (std::size_t i = 0; i < row.size(); ++i)
        if (result[i] != 0) room_[at + i] += lamp_light(lamp, row[i]);
    }
  }

  // Edges are where the corners see something else than the centre, and on both sides of where a projector's
  // light ends.
  void find_edges(const cv::Rect& block) {
    for (int row = block.y; row < block.y + block.height; ++row)
      for (int column = block.x; column < block.x + block.width; ++column) {
        const std::size_t i = index_of(column, row);
        is_edge_[i] = is_rough_[i] != 0 || is_at_shadow_edge(column, row) ? 1 : 0;
      }
  }

  bool is_at_shadow_edge(int column, int row) const {
    const std::size_t i = index_of(column, row);
    const auto width = static_cast<std::size_t>(imager_.width);
    return std::any_of(reached_.begin(), reached_.end(), [&](const std::vector<std::uint8_t>& reached) {
      return (column > 0 && reached[i] != reached[i - 1]) ||
             (column + 1 < imager_.width && reached[i] != reached[i + 1]) ||
             (row > 0 && reached[i] != reached[i - width]) ||
             (row + 1 < imager_.height && reached[i] != reached[i + width]);
    });
  }

  // The pixels on edges in these blocks, in the order of pixels.
  std::vector<Refined> refined(std::span<const cv::Rect> blocks) const {
    std::vector<Refined> out;
    for (const cv::Rect& block : blocks)
      for (int row = block.y; row < block.y + block.height; ++row)
        for (std::size_t i = index_of(block.x, row);
             i < index_of(block.x, row) + static_cast<std::size_t>(block.width); ++i)
          if (is_edge_[i] != 0) out.push_back({static_cast<std::int32_t>(i), {}});
    std::sort(out.begin(), out.end(), [](const Refined& a, const Refined& b) { return a.pixel < b.pixel; });
    constexpr int k_chunk = 256;
    const int count = static_cast<int>(out.size());
    cv::parallel_for_({0, (count + k_chunk - 1) / k_chunk}, [&](const cv::Range& chunks) {
      for (int chunk = chunks.start; chunk < chunks.end; ++chunk)
        for (int i = chunk * k_chunk; i < std::min(count, (chunk + 1) * k_chunk); ++i)
          out[static_cast<std::size_t>(i)].groups = refine(out[static_cast<std::size_t>(i)].pixel);
    });
    return out;
  }

  // Sample k of a (0,2)-sequence (van der Corput, Sobol): of n samples (a power of two), each of n columns
  // and n rows of the pixel gets one.
  Eigen::Vector2d sub_sample(unsigned k) const {
    double x = 0, y = 0;
    for (unsigned bit = 0; bit < 5; ++bit)
      if ((k >> bit & 1U) != 0) x += 0.5 / (1U << bit);
    unsigned sobol = 0;
    for (unsigned v = 1U << 31, i = k; i != 0; i >>= 1U, v ^= v >> 1U)
      if ((i & 1U) != 0) sobol ^= v;
    y = static_cast<double>(sobol) / 4294967296.0;
    const double centred = 0.5 / effort_.edge_samples - 0.5;
    return {x + centred, y + centred};
  }

  std::vector<Group> refine(std::int32_t pixel) const {
    const Eigen::Vector2d px(pixel % imager_.width, pixel / imager_.width);
    std::vector<Eigen::Vector3f> d(static_cast<std::size_t>(effort_.edge_samples));
    for (unsigned k = 0; k < d.size(); ++k) {
      const Eigen::Vector2d at = px + sub_sample(k);
      d[k] = directions_.at(at.x(), at.y());
    }
    const std::vector<Surface> found = surfaces(d);
    std::vector<std::vector<std::uint8_t>> reached_by;
    for (std::size_t k = 0; k < p_projectors_.size(); ++k) reached_by.push_back(projector_reaches(k, found));
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
      if (is_edge_[i] == 0) put(i, static_cast<std::int32_t>(i), surfaces_[i], room_[i]);
    std::size_t next = pixel_count();
    for (const Refined& r : refined_) {
      put(static_cast<std::size_t>(r.pixel), r.pixel, r.groups[0]);
      for (std::size_t g = 1; g < r.groups.size(); ++g) put(next++, r.pixel, r.groups[g]);
    }
    refined_ = {};
    in_chunks(count, [&](std::size_t i) { view(i); });
  }

  template <class Do>
  static void in_chunks(std::size_t count, const Do& work) {
    constexpr std::size_t k_chunk = 4096;
    cv::parallel_for_({0, static_cast<int>((count + k_chunk - 1) / k_chunk)}, [&](const cv::Range& chunks) {
      for (auto i = static_cast<std::size_t>(chunks.start) * k_chunk;
           i < std::min(count, static_cast<std::size_t>(chunks.end) * k_chunk); ++i)
        work(i);
    });
  }

  // Replaces the samples of these blocks.
  void replace(std::span<const cv::Rect> blocks, std::span<const Refined> edges) {
    std::vector<std::size_t> changed;
    std::vector<std::uint8_t> is_in_blocks(pixel_count(), 0);
    for (const cv::Rect& block : blocks)
      for (int row = block.y; row < block.y + block.height; ++row)
        for (std::size_t i = index_of(block.x, row);
             i < index_of(block.x, row) + static_cast<std::size_t>(block.width); ++i) {
          is_in_blocks[i] = 1;
          changed.push_back(i);
        }
    make_room(is_in_blocks, edges, &changed);
    for (const std::size_t i : changed)
      if (i < pixel_count() && is_edge_[i] == 0) put(i, static_cast<std::int32_t>(i), surfaces_[i], room_[i]);
    std::size_t next = pixel_count();
    for (const Refined& r : edges) {
      put(static_cast<std::size_t>(r.pixel), r.pixel, r.groups[0]);
      while (next < samples_.size() && samples_.pixel[next] < r.pixel) ++next;
      for (std::size_t g = 1; g < r.groups.size(); ++g) put(next++, r.pixel, r.groups[g]);
    }
    in_chunks(changed.size(), [&](std::size_t k) { view(changed[k]); });
  }

  // Removes the further samples of pixels in blocks, and makes room for those of `edges`: their pixel is set,
  // the rest is not, and their indices are added to `changed`.
  void make_room(std::span<const std::uint8_t> is_in_blocks,
                 std::span<const Refined> edges,
                 std::vector<std::size_t>* changed) {
    std::vector<std::int32_t> pixels;     // those of the further samples
    std::vector<std::ptrdiff_t> sources;  // where each was; -1: new
    auto edge = edges.begin();
    const auto add_edges_before = [&](std::int32_t pixel) {
      for (; edge != edges.end() && edge->pixel < pixel; ++edge)
        for (std::size_t g = 1; g < edge->groups.size(); ++g) {
          changed->push_back(pixel_count() + pixels.size());
          pixels.push_back(edge->pixel);
          sources.push_back(-1);
        }
    };
    for (std::size_t i = pixel_count(); i < samples_.size(); ++i) {
      if (is_in_blocks[static_cast<std::size_t>(samples_.pixel[i])] != 0) continue;
      add_edges_before(samples_.pixel[i]);
      pixels.push_back(samples_.pixel[i]);
      sources.push_back(static_cast<std::ptrdiff_t>(i));
    }
    add_edges_before(static_cast<std::int32_t>(pixel_count()));
    const auto reorder = [&](auto& values) {
      std::remove_reference_t<decltype(values)> tail(pixels.size());
      for (std::size_t k = 0; k < pixels.size(); ++k)
        if (sources[k] >= 0) tail[k] = values[static_cast<std::size_t>(sources[k])];
      values.resize(pixel_count());
      values.insert(values.end(), tail.begin(), tail.end());
    };
    for_each_array(reorder);
    std::copy(pixels.begin(), pixels.end(),
              samples_.pixel.begin() + static_cast<std::ptrdiff_t>(pixel_count()));
  }

  template <class Do>
  void for_each_array(const Do& work) {
    work(samples_.pixel);
    work(samples_.weight);
    work(samples_.object);
    work(samples_.p_world);
    work(samples_.n_world);
    work(samples_.albedo);
    work(samples_.grey);
    work(samples_.room_light);
    for (auto& views : samples_.projectors) work(views);
  }

  void resize(std::size_t count) {
    samples_.projectors.resize(p_projectors_.size());
    for_each_array([count](auto& values) { values.resize(count); });
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
    samples_.weight[i] = group.count / static_cast<float>(effort_.edge_samples);
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
      const Imager& projector = world_->rig.projectors[k];
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

  std::size_t index_of(int column, int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(imager_.width) +
           static_cast<std::size_t>(column);
  }

  void make_tiles() {
    tiles_ = ViewTiles({imager_.width, imager_.height}, p_camera_, directions_);
    set_tiles(std::vector<std::uint8_t>(tiles_.size(), 1));
  }

  void set_tiles(std::span<const std::uint8_t> wanted) {
    for (std::size_t i = 0; i < wanted.size(); ++i)
      if (wanted[i] != 0)
        tiles_.set_surfaces(i, [&](int pixel) { return surfaces_[static_cast<std::size_t>(pixel)].p; });
  }

  std::vector<Ball> light_balls() const {
    std::vector<Ball> balls;
    for (const Eigen::Vector3d& p : p_projectors_) balls.push_back({p.cast<float>(), 0});
    for (const Lamp& lamp : world_->room.lamps)
      balls.push_back({lamp.p_world.cast<float>(), static_cast<float>(lamp.radius_m)});
    return balls;
  }

  // The marked tiles; neighbours in a row are one block.
  std::vector<cv::Rect> blocks_of(std::span<const std::uint8_t> marked) const {
    std::vector<cv::Rect> blocks;
    for (std::size_t i = 0; i < marked.size(); ++i) {
      if (marked[i] == 0) continue;
      const cv::Rect tile = tiles_.pixels(i);
      if (!blocks.empty() && blocks.back().y == tile.y && blocks.back().x + blocks.back().width == tile.x)
        blocks.back().width += tile.width;
      else
        blocks.push_back(tile);
    }
    return blocks;
  }

  const World* world_;
  Imager imager_;
  TraceEffort effort_;
  RayScene scene_;
  Directions directions_;
  Eigen::Vector3d p_camera_;
  std::vector<LampPoint> lamps_;
  std::vector<Eigen::Vector3d> p_projectors_;
  std::vector<Surface> surfaces_;       // at pixel centres
  std::vector<std::uint8_t> is_rough_;  // whether a pixel's corners see something else than its centre
  std::vector<std::uint8_t> is_edge_;
  std::vector<float> room_;
  std::vector<std::vector<std::uint8_t>> reached_;  // for each projector, at pixel centres
  std::vector<Refined> refined_;
  ViewTiles tiles_;  // made when they are needed
  std::size_t traced_pixels_ = 0;
  Samples samples_;
};

}  // namespace

Samples trace(const World& world, int camera, const TraceEffort& effort) {
  Tracer tracer(world, camera, effort, false);
  tracer.trace_all();
  return tracer.take_samples();
}

struct ViewTracer::Impl {
  Impl(const World& world_in, int camera, const TraceEffort& effort_in)
      : rig(world_in.rig),
        room(world_in.room),
        objects(world_in.objects),
        effort(effort_in),
        tracer(world_in, camera, effort_in, true) {
    for (const Object& object : objects) balls.push_back(ball_of(object));
    tracer.trace_all();
  }

  // Whether the world differs from the one that was traced by the poses of its objects alone.
  bool is_same_but_for_poses(const World& world, const TraceEffort& now) const {
    const auto same_imagers = [](const std::vector<Imager>& a, const std::vector<Imager>& b) {
      return std::equal(a.begin(), a.end(), b.begin(), b.end(), is_same_imager);
    };
    return now == effort && same_imagers(rig.cameras, world.rig.cameras) &&
           same_imagers(rig.projectors, world.rig.projectors) && room.ambient == world.room.ambient &&
           std::equal(room.lamps.begin(), room.lamps.end(), world.room.lamps.begin(), world.room.lamps.end(),
                      is_same_lamp) &&
           std::equal(objects.begin(), objects.end(), world.objects.begin(), world.objects.end(),
                      is_same_thing);
  }

  void follow(const World& world) {
    tracer.set_world(world);
    std::vector<std::size_t> moved;
    std::vector<Ball> from_and_to;
    for (std::size_t i = 0; i < objects.size(); ++i) {
      Pose& before = objects[i].world_from_object;
      const Pose& now = world.objects[i].world_from_object;
      if (is_same(before, now)) continue;
      moved.push_back(i);
      from_and_to.push_back(balls[i]);
      balls[i].centre = (now * (before.inverse() * balls[i].centre.cast<double>())).cast<float>();
      from_and_to.push_back(balls[i]);
      before = now;
    }
    if (!moved.empty()) tracer.move(moved, from_and_to);
  }

  Rig rig;
  Room room;
  std::vector<Object> objects;
  TraceEffort effort;
  std::vector<Ball> balls;  // around the objects
  Tracer tracer;
};

ViewTracer::ViewTracer(int camera) : camera_(camera) {}
ViewTracer::~ViewTracer() = default;
ViewTracer::ViewTracer(ViewTracer&&) noexcept = default;
ViewTracer& ViewTracer::operator=(ViewTracer&&) noexcept = default;

const Samples& ViewTracer::samples(const World& world, const TraceEffort& effort) {
  if (impl_ && impl_->is_same_but_for_poses(world, effort))
    impl_->follow(world);
  else
    impl_ = std::make_unique<Impl>(world, camera_, effort);
  return impl_->tracer.samples();
}

std::size_t ViewTracer::traced_pixels() const { return impl_ ? impl_->tracer.traced_pixels() : 0; }

}  // namespace limn::sim
