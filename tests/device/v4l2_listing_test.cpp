#include "device/v4l2_listing.h"

#include <gtest/gtest.h>
#include <linux/videodev2.h>

#include <cerrno>
#include <cstring>

namespace limn::device {
namespace {

// Fails an ioctl as the kernel does.
int fails() {
  errno = EINVAL;
  return -1;
}

// A driver with one format of two sizes, and three controls, one of them switched off.
int driver(unsigned long request, void* argument) {
  if (request == VIDIOC_ENUM_FMT) {
    auto* const format = static_cast<v4l2_fmtdesc*>(argument);
    format->pixelformat = V4L2_PIX_FMT_MJPEG;
    return format->index == 0 ? 0 : fails();
  }
  if (request == VIDIOC_ENUM_FRAMESIZES) {
    auto* const size = static_cast<v4l2_frmsizeenum*>(argument);
    size->type = V4L2_FRMSIZE_TYPE_DISCRETE;
    size->discrete = size->index == 0 ? v4l2_frmsize_discrete{640, 480} : v4l2_frmsize_discrete{1920, 1080};
    return size->index < 2 ? 0 : fails();
  }
  if (request == VIDIOC_ENUM_FRAMEINTERVALS) {
    auto* const interval = static_cast<v4l2_frmivalenum*>(argument);
    interval->type = V4L2_FRMIVAL_TYPE_DISCRETE;
    interval->discrete = {1, interval->width == 640 ? 60u : 30u};
    return interval->index == 0 ? 0 : fails();
  }
  if (request == VIDIOC_QUERYCTRL) {
    auto* const query = static_cast<v4l2_queryctrl*>(argument);
    const unsigned last = query->id & ~V4L2_CTRL_FLAG_NEXT_CTRL;
    if (last >= 3) return fails();
    *query = {};
    query->id = last + 1;
    query->type = V4L2_CTRL_TYPE_INTEGER;
    query->maximum = 100;
    query->default_value = 7;
    query->flags = query->id == 2 ? V4L2_CTRL_FLAG_DISABLED : 0;
    std::strcpy(reinterpret_cast<char*>(query->name), query->id == 1 ? "Gain" : "Focus");
    return 0;
  }
  if (request == VIDIOC_G_CTRL) {
    auto* const control = static_cast<v4l2_control*>(argument);
    control->value = 10 * static_cast<int>(control->id);
    return 0;
  }
  return fails();
}

TEST(V4l2Listing, HasModesWithRatesAndControlsWithValues) {
  int closed = 0;
  V4l2System system;
  system.open = [](const std::string&) { return 5; };
  system.close = [&](int) { ++closed; };
  system.ioctl = [](int, unsigned long request, void* argument) { return driver(request, argument); };
  const auto listing = v4l2_listing("/dev/video0", system);
  ASSERT_TRUE(listing) << listing.message();
  ASSERT_EQ(listing->modes.size(), 2u);
  EXPECT_EQ(listing->modes[0].format, "MJPG");
  EXPECT_EQ(listing->modes[0].rates, std::vector<double>{60});
  EXPECT_EQ(listing->modes[1].width, 1920);
  EXPECT_EQ(listing->modes[1].rates, std::vector<double>{30});
  ASSERT_EQ(listing->controls.size(), 2u);
  EXPECT_EQ(listing->controls[0].name, "Gain");
  EXPECT_EQ(listing->controls[0].value, 10);
  EXPECT_EQ(listing->controls[1].value, 30);
  EXPECT_EQ(listing->controls[1].default_value, 7);
  EXPECT_EQ(closed, 1);
}

TEST(V4l2Listing, SaysThatThereIsNoCamera) {
  V4l2System system;
  system.open = [](const std::string&) { return errno = ENOENT, -1; };
  const auto listing = v4l2_listing("/dev/video9", system);
  ASSERT_FALSE(listing);
  EXPECT_NE(listing.message().find("/dev/video9: expected a camera, found: No such file"), std::string::npos)
      << listing.message();
}

}  // namespace
}  // namespace limn::device
