// A session in a room without a devices file.
#include "nodes/room_devices.h"

#include <gtest/gtest.h>

#include "tests/nodes/memory_room.h"

namespace limn::nodes {
namespace {

Machine node(const std::string& name,
             std::vector<OfferedDevice> monitors,
             std::vector<OfferedDevice> cameras = {}) {
  Machine out;
  out.sender.node = name;
  out.offer.monitors = std::move(monitors);
  out.offer.monitors.push_back({"offscreen", {}});
  out.offer.cameras = std::move(cameras);
  return out;
}

Rig rig_of(const std::vector<cv::Size>& projectors, int cameras = 1) {
  Rig rig;
  for (const cv::Size& size : projectors) {
    Imager& projector = rig.projectors.emplace_back();
    projector.name = fmt::format("projector{}", rig.projectors.size() - 1);
    projector.width = size.width;
    projector.height = size.height;
  }
  for (int i = 0; i < cameras; ++i) rig.cameras.emplace_back().name = fmt::format("camera{}", i);
  return rig;
}

const cv::Size k_small(1280, 800), k_large(1920, 1200);
const OfferedDevice k_camera{"v4l2:/dev/video0", {}};

TEST(RoomDevices, AreThoseThatNodesOfferIfThereIsOneReading) {
  const std::vector<Machine> machines = {node("left", {{"HDMI-1", k_small}, {"eDP-1", {1366, 768}}}),
                                         node("right", {{"DP-2", k_large}}, {k_camera})};
  const auto devices = offered_devices(machines, rig_of({k_large, k_small}));
  ASSERT_TRUE(devices) << devices.message();
  ASSERT_EQ(devices->displays.size(), 2u);
  EXPECT_EQ(devices->displays[0].name, "projector0");
  EXPECT_EQ(devices->displays[0].host, "right");
  EXPECT_EQ(devices->displays[0].monitor, "DP-2");
  EXPECT_EQ(devices->displays[0].size, k_large);
  EXPECT_EQ(devices->displays[1].host, "left");
  ASSERT_EQ(devices->cameras.size(), 1u);
  EXPECT_EQ(devices->cameras[0].name, "camera0");
  EXPECT_EQ(devices->cameras[0].host, "right");
  EXPECT_EQ(devices->cameras[0].source, "v4l2:/dev/video0");
}

TEST(RoomDevices, AreListedIfThereIsNoneOrMoreThanOneReading) {
  const auto why = [](const std::vector<Machine>& machines, const Rig& rig) {
    const auto devices = offered_devices(machines, rig);
    return devices ? std::string("accepted") : devices.message();
  };
  const auto has = [](const std::string& text, const std::string& part) {
    return text.find(part) != std::string::npos;
  };
  std::vector<Machine> machines = {node("left", {{"HDMI-1", k_small}}, {k_camera}),
                                   node("right", {{"DP-2", k_small}})};
  std::string found = why(machines, rig_of({k_small}));
  EXPECT_TRUE(has(found, "projector0 (1280x800): HDMI-1 at left, DP-2 at right;")) << found;
  machines.pop_back();
  EXPECT_EQ(why(machines, rig_of({k_small})), "accepted");
  found = why(machines, rig_of({k_small, k_small}));  // one monitor for both
  EXPECT_TRUE(has(found, "projector1 (1280x800): HDMI-1 at left;")) << found;
  found = why(machines, rig_of({k_large}));
  EXPECT_TRUE(has(found, "projector0 (1920x1200): nothing;")) << found;
  EXPECT_TRUE(has(found, "devices file")) << found;
  EXPECT_TRUE(has(why(machines, rig_of({k_small}, 2)), "camera1")) << found;
  machines[0].offer.protocol = k_protocol + 1;
  EXPECT_TRUE(has(why(machines, rig_of({k_small})), "nothing"));
  machines[0].offer.protocol = k_protocol;
  machines[0].offer.is_host = true;
  EXPECT_TRUE(has(why(machines, rig_of({k_small})), "nothing"));
}

TEST(RoomDevices, AreWaitedFor) {
  test::MemoryRoom memory;
  Room host(std::make_unique<test::MemoryLink>(&memory, "host"));
  ASSERT_TRUE(host.offer({.is_host = true}));
  EXPECT_FALSE(wait_for_devices(host, rig_of({k_small}), 0.1));
  Room left(std::make_unique<test::MemoryLink>(&memory, "left"));
  ASSERT_TRUE(left.offer({.monitors = {{"HDMI-1", k_small}}, .cameras = {k_camera}}));
  EXPECT_TRUE(wait_for_devices(host, rig_of({k_small}), 5));
}

}  // namespace
}  // namespace limn::nodes
