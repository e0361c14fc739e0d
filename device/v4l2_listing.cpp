#include "device/v4l2_listing.h"

#include <linux/videodev2.h>

#include <cerrno>
#include <system_error>

namespace limn::device {
namespace {

constexpr unsigned k_most = 256;  // entries in each list; a driver that never ends its list is not followed

class Lister {
 public:
  Lister(const V4l2System& system, int fd) : system_(system), fd_(fd) {}

  V4l2Listing listed() const {
    V4l2Listing out;
    for (unsigned i = 0; i < k_most; ++i) {
      v4l2_fmtdesc format{};
      format.index = i;
      format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
      if (!answers(VIDIOC_ENUM_FMT, &format)) break;
      add_sizes(format.pixelformat, &out.modes);
    }
    out.controls = controls();
    return out;
  }

 private:
  template <class Argument>
  bool answers(unsigned long request, Argument* argument) const {
    return system_.ioctl(fd_, request, argument) == 0;
  }

  void add_sizes(std::uint32_t format, std::vector<V4l2Mode>* modes) const {
    for (unsigned i = 0; i < k_most; ++i) {
      v4l2_frmsizeenum size{};
      size.index = i;
      size.pixel_format = format;
      if (!answers(VIDIOC_ENUM_FRAMESIZES, &size) || size.type != V4L2_FRMSIZE_TYPE_DISCRETE) return;
      modes->push_back({fourcc(format), static_cast<int>(size.discrete.width),
                        static_cast<int>(size.discrete.height),
                        rates(format, size.discrete.width, size.discrete.height)});
    }
  }

  std::vector<double> rates(std::uint32_t format, std::uint32_t width, std::uint32_t height) const {
    std::vector<double> out;
    for (unsigned i = 0; i < k_most; ++i) {
      v4l2_frmivalenum interval{};
      interval.index = i;
      interval.pixel_format = format;
      interval.width = width;
      interval.height = height;
      if (!answers(VIDIOC_ENUM_FRAMEINTERVALS, &interval) || interval.type != V4L2_FRMIVAL_TYPE_DISCRETE)
        break;
      if (interval.discrete.numerator > 0)
        out.push_back(static_cast<double>(interval.discrete.denominator) / interval.discrete.numerator);
    }
    return out;
  }

  std::vector<V4l2Control> controls() const {
    std::vector<V4l2Control> out;
    v4l2_queryctrl query{};
    query.id = V4L2_CTRL_FLAG_NEXT_CTRL;
    for (unsigned i = 0; i < k_most && answers(VIDIOC_QUERYCTRL, &query); ++i) {
      const bool is_number = query.type == V4L2_CTRL_TYPE_INTEGER || query.type == V4L2_CTRL_TYPE_BOOLEAN ||
                             query.type == V4L2_CTRL_TYPE_MENU;
      v4l2_control control{};
      control.id = query.id;
      if (is_number && !(query.flags & V4L2_CTRL_FLAG_DISABLED) && answers(VIDIOC_G_CTRL, &control))
        out.push_back({reinterpret_cast<const char*>(query.name), control.value, query.minimum, query.maximum,
                       query.default_value});
      query.id |= V4L2_CTRL_FLAG_NEXT_CTRL;
    }
    return out;
  }

  const V4l2System& system_;
  int fd_;
};

}  // namespace

Result<V4l2Listing> v4l2_listing(const std::string& path, const V4l2System& system) {
  const int fd = system.open(path);
  if (fd < 0)
    return error("{}: expected a camera, found: {}. Check the cable and whether another program uses it.",
                 path, std::generic_category().message(errno));
  V4l2Listing out = Lister(system, fd).listed();
  system.close(fd);
  return out;
}

}  // namespace limn::device
