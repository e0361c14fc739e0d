#include <fmt/format.h>

#include <cmath>
#include <memory>
#include <opencv2/imgproc.hpp>

#include "core/image_io.h"
#include "core/log_sink.h"
#include "core/version.h"
#include "library/convert.h"
#include "limn/version.h"

namespace limn::LIMN_VERSIONED {

const char* version() {
  static const std::string text(limn::version());
  return text.c_str();
}

// ---- errors and notes ----

Error::Error(const std::string& message) : std::runtime_error(message) {}
Error::Error(const Error&) noexcept = default;
Error::~Error() = default;

Stopped::Stopped(const std::string& message) : Error(message) {}
Stopped::Stopped(const Stopped&) noexcept = default;
Stopped::~Stopped() = default;

namespace {

// The library is silent from its start.
[[maybe_unused]] const bool k_is_silent = [] {
  limn::set_log_level(limn::LogLevel::quiet);
  return true;
}();

}  // namespace

void set_log(std::function<void(bool is_warning, const std::string& line)> log) {
  limn::set_log_level(log ? limn::LogLevel::info : limn::LogLevel::quiet);
  if (!log) return limn::set_log_sink({});
  limn::set_log_sink([log = std::move(log)](limn::LogLevel level, const std::string& line) {
    log(level == limn::LogLevel::warning, line);
  });
}

// ---- poses ----

Point3 Pose::operator*(const Point3& p_b) const { return to_public(to_room(*this) * to_room(p_b)); }
Pose Pose::operator*(const Pose& b_from_c) const { return to_public(to_room(*this) * to_room(b_from_c)); }
Pose Pose::inverse() const { return to_public(to_room(*this).inverse()); }

std::array<double, 16> Pose::matrix() const {
  const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> rows = to_room(*this).matrix();
  std::array<double, 16> out = {};
  std::copy_n(rows.data(), out.size(), out.begin());
  return out;
}

Pose Pose::from_matrix(const std::array<double, 16>& rows) {
  const Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> m(rows.data());
  const Eigen::Matrix3d r = m.topLeftCorner<3, 3>();
  constexpr double k_tolerance = 1e-6;
  const bool is_rotation = (r * r.transpose()).isIdentity(k_tolerance) && r.determinant() > 0;
  if (!m.allFinite() || !is_rotation || m.row(3) != Eigen::RowVector4d(0, 0, 0, 1))
    throw Error(
        "pose: expected a 4 x 4 matrix with a rotation in its upper left 3 x 3 and 0 0 0 1 in its last row, "
        "found "
        "another one.");
  return to_public(limn::Pose(r, Eigen::Vector3d(m.topRightCorner<3, 1>())));
}

Pose looking_at(const Point3& p_eye, const Point3& p_target, const Point3& d_up) {
  return to_public(limn::looking_at(to_room(p_eye), to_room(p_target), to_room(d_up)));
}

// ---- images ----

Image read_image(const std::filesystem::path& path, PixelFormat format) {
  const bool is_grey = format == PixelFormat::grey;
  const cv::Mat read = value_of(is_grey ? limn::read_grey_image(path)
                                        : limn::read_image(path, {.used_bits = limn::k_found_in_image}));
  Image image{.pixels = {}, .width = read.cols, .height = read.rows, .format = format};
  image.pixels.resize(static_cast<std::size_t>(image.stride()) * static_cast<std::size_t>(image.height));
  cv::Mat pixels = mat_of(static_cast<ImageView>(image.view()));
  if (is_grey == (read.channels() == 1)) {
    if (format == PixelFormat::rgb)
      cv::cvtColor(read, pixels, cv::COLOR_BGR2RGB);
    else
      read.copyTo(pixels);
  } else {
    cv::cvtColor(read, pixels, cv::COLOR_GRAY2BGR);
  }
  return image;
}

void write_png(const std::filesystem::path& path, const ImageView& image) {
  throw_error(limn::write_png(path, bgr_or_grey_of(image)));
}

}  // namespace limn::LIMN_VERSIONED
