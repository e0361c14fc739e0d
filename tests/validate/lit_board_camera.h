#pragma once

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <opencv2/core.hpp>
#include <opencv2/core/eigen.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <thread>
#include <vector>

#include "core/image_io.h"
#include "device/display.h"
#include "device/offscreen_display.h"
#include "tests/calib/photographed_board.h"
#include "tests/device/loopback_server.h"
#include "tests/device/mjpeg_answer.h"

namespace limn::test {

/// An MJPEG camera on the loopback address that photographs a board in the light of a projector.
class LitBoardCamera {
 public:
  /// The camera adds `comment` to each image. The projector has this size.
  LitBoardCamera(const calib::Board& board, cv::Size projector, const std::string& comment)
      : comment_(comment),
        light_(projector, CV_8U, cv::Scalar(0)),
        server_([this](LoopbackClient& client) { serve(client); }) {
    const calib::BoardSheet sheet = calib::draw_board(board, {.square_px = 64});
    const double ppm = sheet.pixels_per_metre;
    const cv::Matx33d board_from_sheet(1 / ppm, 0, -sheet.px_board_origin.x() / ppm, 0, 1 / ppm,
                                       -sheet.px_board_origin.y() / ppm, 0, 0, 1);
    const cv::Matx33d camera_lens(700, 0, 319.5, 0, 700, 239.5, 0, 0, 1);
    const cv::Matx33d projector_lens(1.2 * projector.width, 0, 0.5 * (projector.width - 1), 0,
                                     1.2 * projector.width, 0.5 * (projector.height - 1), 0, 0, 1);
    const Pose projector_from_camera =
        Pose(exp_rotation({0, 0.3, 0}), {0, 0, 0}) * Pose(Eigen::Quaterniond::Identity(), {-0.15, 0, 0});
    for (int i = 0; i < 3; ++i) {
      const Pose camera_from_board = tilted_board(board, i, 0.5);
      const cv::Matx33d camera_from_plane = camera_lens * plane(camera_from_board);
      Placement placement;
      cv::warpPerspective(sheet.image, placement.paper, camera_from_plane * board_from_sheet, {640, 480},
                          cv::INTER_AREA, cv::BORDER_CONSTANT, cv::Scalar(90));
      placement.camera_from_projector =
          camera_from_plane * (projector_lens * plane(projector_from_camera * camera_from_board)).inv();
      placements_.push_back(std::move(placement));
    }
  }

  int port() const { return server_.port(); }
  void hold(int placement) {
    const std::scoped_lock lock(mutex_);
    placement_ = placement;
  }

  /// The projector. show() returns when the camera has sent images in the new light.
  std::unique_ptr<device::Display> projector(const std::string& name) {
    return std::make_unique<Projector>(this, name, light_.size());
  }

 private:
  struct Placement {
    cv::Mat paper;  // brightness in full light
    cv::Matx33d camera_from_projector;
  };

  class Projector final : public device::Display {
   public:
    Projector(LitBoardCamera* camera, std::string name, cv::Size size)
        : camera_(camera), name_(std::move(name)), size_(size) {}
    const std::string& name() const override { return name_; }
    cv::Size size() const override { return size_; }
    Result<Stamp> show(const cv::Mat& image) override {
      LIMN_TRY_STATUS(device::check_image(image, name_, size_));
      std::unique_lock lock(camera_->mutex_);
      camera_->light_ = to_grey(image).clone();
      const int until = camera_->sent_ + 3;  // one is being made, one may wait to be read
      camera_->has_sent_.wait_for(lock, std::chrono::milliseconds(500),
                                  [&] { return camera_->sent_ >= until; });
      return now();
    }

   private:
    LitBoardCamera* camera_;
    std::string name_;
    cv::Size size_;
  };

  // Takes points of the board's plane to the imager's plane z = 1.
  static cv::Matx33d plane(const Pose& imager_from_board) {
    const Eigen::Matrix3d turned = imager_from_board.rotation_matrix();
    const Eigen::Vector3d& at = imager_from_board.translation;
    return {turned(0, 0), turned(0, 1), at.x(),       turned(1, 0), turned(1, 1),
            at.y(),       turned(2, 0), turned(2, 1), at.z()};
  }

  cv::Mat image() {
    cv::Mat light, image;
    std::size_t placement = 0;
    {
      const std::scoped_lock lock(mutex_);
      light = light_;
      placement = static_cast<std::size_t>(placement_);
    }
    cv::Mat arrived;
    cv::warpPerspective(light, arrived, placements_[placement].camera_from_projector, {640, 480});
    arrived.convertTo(arrived, CV_8U, 0.8, 40);  // and the room's light
    cv::multiply(placements_[placement].paper, arrived, image, 0.9 / 255);
    return image;
  }

  void serve(LoopbackClient& client) {
    client.receive_until("\r\n\r\n");
    bool is_there = client.send(k_mjpeg_answer);
    while (is_there) {
      std::vector<uchar> bytes;
      cv::imencode(".jpg", image(), bytes, {cv::IMWRITE_JPEG_QUALITY, 95});
      std::string jpeg(bytes.begin(), bytes.end());
      const std::string segment =
          std::string("\xFF\xFE\0", 3) + static_cast<char>(comment_.size() + 2) + comment_;
      is_there = client.send(mjpeg_part(jpeg.substr(0, 2) + segment + jpeg.substr(2)));
      {
        const std::scoped_lock lock(mutex_);
        ++sent_;
      }
      has_sent_.notify_all();
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  }

  std::string comment_;
  std::vector<Placement> placements_;
  std::mutex mutex_;
  std::condition_variable has_sent_;
  cv::Mat light_;
  int placement_ = 0, sent_ = 0;
  LoopbackServer server_;
};

}  // namespace limn::test
