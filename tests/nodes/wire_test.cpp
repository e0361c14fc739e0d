// Messages to structs of limn_room.idl and back, and what hostile structs become. (room_link_test sends
// them.)

#include <gtest/gtest.h>

#include <limits>

#include "limn_room.h"
#include "nodes/from_wire.h"
#include "nodes/to_wire.h"
#include "tests/nodes/random_messages.h"

namespace limn::nodes {
namespace {

const Sender k_sender{"alpha", 0xfedcba9876543210};

TEST(Wire, EveryMessageComesBackToTheBit) {
  for (std::size_t kind = 0; kind < k_topics; ++kind)
    for (std::uint64_t seed = 0; seed < 200; ++seed) {
      const Message message = test::random_message(kind, seed, "beta");
      const WireSample sample = to_wire(message, k_sender);
      EXPECT_EQ(static_cast<std::size_t>(sample.topic), kind);
      const auto back = from_wire(sample.topic, sample.sample.get(), Stamp(std::chrono::seconds(5)));
      ASSERT_TRUE(back) << "kind " << kind << ", seed " << seed << ": " << back.message();
      EXPECT_EQ(test::to_text(back->message), test::to_text(message)) << "kind " << kind << ", seed " << seed;
      EXPECT_EQ(back->from, k_sender);
      EXPECT_EQ(back->arrived_at, Stamp(std::chrono::seconds(5)));
    }
}

TEST(Wire, RandomMessagesDiffer) {
  EXPECT_NE(test::to_text(test::random_message(2, 1, "beta")),
            test::to_text(test::random_message(2, 2, "beta")));
}

// A moment as it comes from another machine, changed by `change`. The error's message, or "accepted".
std::string verdict(const std::function<void(limn_v1_Moment*)>& change) {
  Moment moment = test::moment_of_size(2000, 1);
  moment.frame.on_surface = {projector::GridOverlay{}};
  moment.frame.arriving = {cv::Mat(4, 4, CV_8UC1, cv::Scalar(9))};
  const Message message = moment;
  const WireSample sample = to_wire(message, k_sender);
  limn_v1_Moment wire = *static_cast<const limn_v1_Moment*>(sample.sample.get());
  change(&wire);
  const auto back = from_wire(Topic::moment, &wire, {});
  return back ? "accepted" : back.message();
}

TEST(Wire, HostileMomentsAreRefused) {
  EXPECT_EQ(verdict([](limn_v1_Moment* /*wire*/) {}), "accepted");
  const auto expect_refused = [](const std::string& field,
                                 const std::function<void(limn_v1_Moment*)>& change) {
    const std::string found = verdict(change);
    EXPECT_EQ(found.rfind(field, 0), 0u) << found;
  };
  constexpr double k_nan = std::numeric_limits<double>::quiet_NaN();
  constexpr double k_infinity = std::numeric_limits<double>::infinity();
  std::string bad_name = "../../etc", no_name, long_name(2000, 'a'), model = "LENSMODEL_NONE";
  expect_refused("node", [&](auto* wire) { wire->node = bad_name.data(); });
  expect_refused("node", [&](auto* wire) { wire->node = no_name.data(); });
  expect_refused("node", [&](auto* wire) { wire->node = nullptr; });
  expect_refused("track.tracking", [](auto* wire) { wire->tracks._buffer[0].tracking = 3; });
  expect_refused("track:",
                 [=](auto* wire) { wire->tracks._buffer[0].world_from_body.translation[1] = k_nan; });
  expect_refused("track:", [](auto* wire) { wire->tracks._buffer[0].world_from_body.rotation[0] = 0; });
  expect_refused("track.covariance",
                 [=](auto* wire) { wire->tracks._buffer[0].covariance[20] = k_infinity; });
  expect_refused("track.body", [&](auto* wire) { wire->tracks._buffer[0].body = long_name.data(); });
  expect_refused("viewer.size", [](auto* wire) { wire->viewer.size.width = -1; });
  expect_refused("viewer.size", [](auto* wire) { wire->viewer.size.height = 1 << 20; });
  expect_refused("viewer.spectrum", [](auto* wire) { wire->viewer.spectrum = 2; });
  expect_refused("lens", [&](auto* wire) { wire->viewer.lens.model = model.data(); });
  expect_refused("", [](auto* wire) { wire->viewer.lens.values._length = 3; });
  expect_refused("overlay",
                 [](auto* wire) { wire->on_surface._buffer[0]._d = static_cast<limn_v1_OverlayKind>(7); });
  expect_refused("expected an image", [](auto* wire) {
    wire->arriving._buffer[0].size = {1 << 20, 1 << 20};
  });
  expect_refused("expected an image", [](auto* wire) { wire->arriving._buffer[0].channels = 200; });
  expect_refused("expected the pixels", [](auto* wire) { wire->arriving._buffer[0].packed._length = 1; });
  expect_refused("frame.arriving", [](auto* wire) {  // an image with colours
    wire->arriving._buffer[0].channels = 3;
    wire->arriving._buffer[0].size = {1, 1};
    static std::array<std::uint8_t, 4> pixel = {2, 1, 2, 3};
    wire->arriving._buffer[0].packed = {4, 4, pixel.data(), false};
  });
}

// Its lower triangle travels.
TEST(Wire, ACovarianceArrivesSymmetric) {
  Message message = Moment();
  auto& moment = std::get<Moment>(message);
  moment.frame.viewer = viewer_imager(Pose(), 64, 48, 40);
  moment.frame.tracks.resize(1);
  Matrix6d& sent = moment.frame.tracks[0].covariance;
  sent = Matrix6d::Random();
  const WireSample sample = to_wire(message, k_sender);
  const auto received = from_wire(sample.topic, sample.sample.get(), {});
  ASSERT_TRUE(received) << received.message();
  const Matrix6d arrived = std::get<Moment>(received->message).frame.tracks.at(0).covariance;
  EXPECT_EQ(arrived, arrived.transpose());
  EXPECT_EQ(arrived, Matrix6d(sent.selfadjointView<Eigen::Lower>()));
}

TEST(Wire, HostileOrdersAreRefused) {
  Order order;
  order.to = "beta";
  const Message message = order;
  const WireSample sample = to_wire(message, k_sender);
  const auto found = [&sample](const std::function<void(limn_v1_Order*)>& change) {
    limn_v1_Order wire = *static_cast<const limn_v1_Order*>(sample.sample.get());
    change(&wire);
    return from_wire(Topic::order, &wire, {}).ok();
  };
  std::string bad_name = "a/b";
  EXPECT_TRUE(found([](auto* /*wire*/) {}));
  EXPECT_TRUE(found([](auto* wire) { wire->what = 4; }));
  EXPECT_FALSE(found([](auto* wire) { wire->what = 5; }));
  EXPECT_FALSE(found([&](auto* wire) { wire->to = bad_name.data(); }));
}

// Detections as they come from a node, changed by `change`. The error's message, or "accepted".
std::string verdict_on(const std::function<void(limn_v1_Detections*)>& change) {
  Detections detections;
  detections.found.camera = "camera0";
  tracker::Detection marker;
  marker.marker = {"aruco_4x4_50", "3"};
  marker.corners_px.fill({10, 20});
  marker.corner_covariance.fill(Eigen::Matrix2d{{0.01, 0.002}, {0.002, 0.02}});
  detections.found.detections = {marker};
  tracker::Ball ball;
  ball.half_angle = 0.1;
  ball.centre_covariance = marker.corner_covariance[0];
  ball.radius_px = 5;
  ball.half_angle_stddev = 1e-3;
  detections.found.balls = {ball};
  detections.found.controls = {{.forward = 2}};
  const Message message = detections;
  const WireSample sample = to_wire(message, k_sender);
  limn_v1_Detections wire = *static_cast<const limn_v1_Detections*>(sample.sample.get());
  change(&wire);
  const auto back = from_wire(Topic::detections, &wire, {});
  return back ? "accepted" : back.message();
}

TEST(Wire, HostileDetectionsAreRefused) {
  constexpr double k_nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(verdict_on([](limn_v1_Detections* /*wire*/) {}), "accepted");
  const auto expect_refused = [](const std::string& field,
                                 const std::function<void(limn_v1_Detections*)>& change) {
    const std::string found = verdict_on(change);
    EXPECT_EQ(found.rfind(field, 0), 0u) << found;
  };
  const auto corner = [](limn_v1_Detections* wire) -> limn_v1_Corner& {
    return wire->markers._buffer[0].corners[2];
  };
  expect_refused("marker.corners", [&](auto* wire) { corner(wire).px[1] = k_nan; });
  expect_refused("marker.corners", [&](auto* wire) { corner(wire).px[0] = 1e9; });
  expect_refused("marker.covariance", [&](auto* wire) { corner(wire).covariance[0] = k_nan; });
  expect_refused("marker.covariance", [&](auto* wire) { corner(wire).covariance[3] = -0.02; });
  expect_refused("marker.covariance", [&](auto* wire) {  // indefinite
    corner(wire).covariance[1] = corner(wire).covariance[2] = 0.5;
  });
  expect_refused("marker.covariance", [&](auto* wire) { corner(wire).covariance[1] = 0.003; });
  expect_refused("marker.score", [](auto* wire) { wire->markers._buffer[0].score = 2; });
  expect_refused("ball.d_centre", [](auto* wire) { wire->balls._buffer[0].d_centre.xyz[0] = 1; });
  expect_refused("ball.half_angle:", [=](auto* wire) { wire->balls._buffer[0].half_angle = k_nan; });
  expect_refused("ball.covariance", [](auto* wire) { wire->balls._buffer[0].covariance[0] = 0; });
  expect_refused("ball.radius_px", [](auto* wire) { wire->balls._buffer[0].radius_px = -1; });
  expect_refused("controls.forward", [](auto* wire) {
    wire->controls._buffer[0].forward = std::numeric_limits<std::int32_t>::min();
  });
  std::vector<limn_v1_Gestures> many(5000);
  expect_refused("controls", [&](auto* wire) {
    wire->controls._buffer = many.data();
    wire->controls._length = static_cast<std::uint32_t>(many.size());
  });
}

TEST(Wire, FilesOutsideOfTheSessionAreRefused) {
  const auto is_accepted = [](const std::string& path, const std::string& digest) {
    nodes::Setup setup;
    setup.files = {{path, digest, 5}};
    const Message message = setup;
    const WireSample sample = to_wire(message, k_sender);
    return from_wire(sample.topic, sample.sample.get(), {}).ok();
  };
  const std::string digest(64, 'a');
  EXPECT_TRUE(is_accepted("rig/rig.json", digest));
  for (const char* path : {"", "/etc/passwd", "../rig.json", "rig/../../rig.json", ".."})
    EXPECT_FALSE(is_accepted(path, digest)) << path;
  EXPECT_FALSE(is_accepted("rig/rig.json", "aa"));
  EXPECT_FALSE(is_accepted("rig/rig.json", std::string(64, 'x')));
}

}  // namespace
}  // namespace limn::nodes
