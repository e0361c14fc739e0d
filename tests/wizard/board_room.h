#pragma once

#include <functional>
#include <memory>
#include <opencv2/core.hpp>
#include <string>

#include "sim/virtual_rig.h"
#include "tracker/marker_image.h"
#include "wizard/capture/capture_plan.h"
#include "wizard/capture/device_backend.h"
#include "wizard/capture/virtual_capture.h"

namespace limn::test {

/// A virtual room with one camera, one projector, and a person who carries the board to the next pose.
struct BoardRoom {
  wizard::Plan plan;
  sim::VirtualRig rig;
  Pose from, to;
  int steps_left = 0;            // until the board is there
  int moved = 0;                 // number of patterns shown while the board moved
  std::function<void()> person;  // acts before each frame; may be empty

  explicit BoardRoom(const wizard::Plan& wanted, double display_delay_s = 0.12)
      : plan(wanted),
        rig(sim::load_world(wanted.world, tracker::marker_image).value(),
            {.display_delay_s = display_delay_s, .frame_period_s = 0.1, .grab_waits_for_light = false}) {
    rig.remove_prototype();
    from = to = plan.world_from_board[0];
    from.translation.z() += 0.5;
  }
  void go(const Pose& place) {
    from = to;
    to = place;
    steps_left = k_steps;
  }
  void step() {
    if (person) person();
    if (steps_left == 0) return;
    const double share = 1 - 1.0 * --steps_left / k_steps;
    Pose now = to;
    now.translation = from.translation + share * (to.translation - from.translation);
    now.rotation = from.rotation.slerp(share, to.rotation);
    rig.place(wizard::board_object(plan.board, now));
  }
  wizard::DeviceBackend::Devices devices();
  static constexpr int k_steps = 4;
};

class BoardRoomCamera : public device::CameraSource {
 public:
  explicit BoardRoomCamera(BoardRoom* room) : room_(room) {}
  const std::string& name() const override { return room_->rig.camera(0).name(); }
  cv::Size size() const override { return room_->rig.camera(0).size(); }
  Result<Frame> next() override {
    room_->step();
    return room_->rig.camera(0).next();
  }

 private:
  BoardRoom* room_;
};

/// Its show() returns the moment of the call, not the moment when light appears.
class BoardRoomProjector : public device::Display {
 public:
  explicit BoardRoomProjector(BoardRoom* room) : room_(room) {}
  const std::string& name() const override { return room_->rig.projector(0).name(); }
  cv::Size size() const override { return room_->rig.projector(0).size(); }
  Result<Stamp> show(const cv::Mat& image) override {
    const Stamp at = room_->rig.now();
    double least = 0, most = 0;
    cv::minMaxLoc(image.reshape(1), &least, &most);
    room_->moved += least < most && room_->steps_left > 0;  // a pattern
    LIMN_TRY([[maybe_unused]] const Stamp lit_at, room_->rig.projector(0).show(image));
    return at;
  }

 private:
  BoardRoom* room_;
};

inline wizard::DeviceBackend::Devices BoardRoom::devices() {
  wizard::DeviceBackend::Devices all{.cameras = {},
                                     .projectors = {},
                                     .now = [this] { return rig.now(); },
                                     .wait = [this](double seconds) { rig.advance(seconds); }};
  all.cameras.push_back(std::make_unique<BoardRoomCamera>(this));
  all.projectors.push_back(std::make_unique<BoardRoomProjector>(this));
  return all;
}

}  // namespace limn::test
