#include "limn/rig.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <set>

#include "core/camera_files/imager_file.h"
#include "core/cameramodel.h"
#include "core/file.h"
#include "core/names.h"
#include "exchange/camera_writer.h"
#include "library/convert.h"

namespace limn::LIMN_VERSIONED {
namespace {

constexpr double k_none = std::numeric_limits<double>::quiet_NaN();

void check_lengths(std::size_t given, std::size_t results) {
  if (given != results)
    throw Error(fmt::format("expected memory for {} results, one for each point, found {}.", given, results));
}

std::vector<limn::Imager> rooms_of(std::span<const Imager> imagers) {
  std::vector<limn::Imager> list;
  for (const Imager& imager : imagers) list.push_back(to_room(imager));
  return list;
}

std::vector<Imager> public_of(const std::vector<limn::Imager>& imagers) {
  std::vector<Imager> list;
  for (const limn::Imager& imager : imagers) list.push_back(to_public(imager));
  return list;
}

void check_names(const limn::Rig& rig) {
  std::set<std::string> names;
  for (const auto* devices : {&rig.cameras, &rig.projectors})
    for (const limn::Imager& device : *devices)
      if (device.name.empty() || !names.insert(device.name).second)
        throw Error(fmt::format("rig: expected devices with names of their own, found '{}' {}.", device.name,
                                device.name.empty() ? "for one" : "twice"));
}

}  // namespace

Imager::Imager(std::shared_ptr<const Impl> impl) : impl_(std::move(impl)) {}

Imager::Imager(const ImagerParts& parts) {
  if (parts.width < 0 || parts.height < 0 || std::max(parts.width, parts.height) > limn::k_max_side)
    throw Error(fmt::format("imager '{}': expected a size of at most {} pixels a side, found {}x{}.",
                            parts.name, limn::k_max_side, parts.width, parts.height));
  limn::Imager imager{parts.name, parts.width, parts.height,
                      value_of(limn::Lens::create(parts.lens_model, parts.lens_values)),
                      to_room(parts.imager_from_world)};
  imager.sees = parts.sees_infrared ? limn::Spectrum::infrared : limn::Spectrum::visible;
  impl_ = std::make_shared<const Impl>(Impl{std::move(imager)});
}

Imager Imager::load(const std::filesystem::path& path) {
  return to_public(value_of(limn::load_imager(path)));
}

Imager Imager::pinhole(
    const std::string& name, int width, int height, double fov_deg, const Pose& imager_from_world) {
  if (!(fov_deg > 0 && fov_deg < 180) || width <= 0 || height <= 0 ||
      std::max(width, height) > limn::k_max_side)
    throw Error(
        fmt::format("imager '{}': expected a size of 1 to {} pixels a side and a field of view between 0 and "
                    "180 degrees, found "
                    "{}x{} and {}.",
                    name, limn::k_max_side, width, height, fov_deg));
  limn::Imager imager = limn::viewer_imager(limn::Pose(), width, height, fov_deg);
  imager.name = name;
  imager.imager_from_world = to_room(imager_from_world);
  return to_public(std::move(imager));
}

void Imager::save(const std::filesystem::path& path, CameraFile format) const {
  const limn::Imager& imager = impl_->imager;
  switch (format) {
    case CameraFile::mrcal:
      return throw_error(limn::save_cameramodel(imager, path));
    case CameraFile::opencv:
      return throw_error(limn::write_file(path, value_of(limn::exchange::opencv_camera_text(imager))));
    case CameraFile::ros:
      return throw_error(limn::write_file(path, value_of(limn::exchange::ros_camera_text(imager))));
  }
  throw Error("camera file: expected mrcal, opencv or ros, found another number.");
}

const std::string& Imager::name() const { return impl_->imager.name; }
int Imager::width() const { return impl_->imager.width; }
int Imager::height() const { return impl_->imager.height; }

ImagerParts Imager::parts() const {
  const limn::Imager& imager = impl_->imager;
  return {.name = imager.name,
          .width = imager.width,
          .height = imager.height,
          .lens_model = imager.lens.model.name(),
          .lens_values = imager.lens.values,
          .imager_from_world = to_public(imager.imager_from_world),
          .sees_infrared = imager.sees == limn::Spectrum::infrared};
}

Pose Imager::imager_from_world() const { return to_public(impl_->imager.imager_from_world); }

Imager Imager::placed(const Pose& imager_from_world) const {
  limn::Imager imager = impl_->imager;
  imager.imager_from_world = to_room(imager_from_world);
  return to_public(std::move(imager));
}

std::optional<Point2> Imager::project(const Point3& p_world) const {
  const auto px = impl_->imager.project(to_room(p_world));
  return px ? std::optional(to_public(*px)) : std::nullopt;
}

std::optional<Ray> Imager::unproject(const Point2& px) const {
  const auto ray = impl_->imager.ray(to_room(px));
  return ray ? std::optional(Ray{to_public(ray->p_origin), to_public(ray->d)}) : std::nullopt;
}

void Imager::project(std::span<const Point3> p_world, std::span<Point2> px) const {
  check_lengths(p_world.size(), px.size());
  for (std::size_t i = 0; i < px.size(); ++i) px[i] = project(p_world[i]).value_or(Point2{k_none, k_none});
}

void Imager::unproject(std::span<const Point2> px, std::span<Point3> d_world) const {
  check_lengths(px.size(), d_world.size());
  for (std::size_t i = 0; i < px.size(); ++i) {
    const auto ray = unproject(px[i]);
    d_world[i] = ray ? ray->d : Point3{k_none, k_none, k_none};
  }
}

void save_kalibr(std::span<const Imager> cameras, const std::filesystem::path& path) {
  throw_error(limn::write_file(path, value_of(limn::exchange::kalibr_text(rooms_of(cameras)))));
}

Rig::Rig(std::shared_ptr<const Impl> impl) : impl_(std::move(impl)) {}

Rig::Rig(std::span<const Imager> cameras, std::span<const Imager> projectors) {
  limn::Rig rig;
  rig.cameras = rooms_of(cameras);
  rig.projectors = rooms_of(projectors);
  check_names(rig);
  impl_ = std::make_shared<const Impl>(Impl{std::move(rig)});
}

Rig Rig::load(const std::filesystem::path& path) {
  return Rig(std::make_shared<const Impl>(Impl{value_of(limn::load_rig(path))}));
}

void Rig::save(const std::filesystem::path& folder) const { throw_error(limn::save_rig(impl_->rig, folder)); }

std::vector<Imager> Rig::cameras() const { return public_of(impl_->rig.cameras); }
std::vector<Imager> Rig::projectors() const { return public_of(impl_->rig.projectors); }

Imager Rig::find(const std::string& name) const {
  if (const limn::Imager* imager = impl_->rig.find(name)) return to_public(*imager);
  throw Error(fmt::format("rig: expected a camera ({}) or a projector ({}), found '{}'.",
                          limn::joined_names(impl_->rig.cameras), limn::joined_names(impl_->rig.projectors),
                          name));
}

}  // namespace limn::LIMN_VERSIONED
