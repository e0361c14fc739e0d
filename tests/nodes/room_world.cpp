// The world of a room, for tests between programs: shows what one camera sees of the light that X servers'
// screens show, as a network camera does (MJPEG over HTTP).
//
//   room_world PLAN PORT SCREEN...
//
// PLAN: a limn.plan/1 file; its world has one projector for each SCREEN, which is the file of an `Xvfb
// -fbdir`. The true rig is written beside the world, to truth/. Commands by standard input: "board K" holds
// the board in the plan's pose K; "prototype" removes it and puts the prototype in its place; "nudge
// PROJECTOR X Y Z" turns a projector (degrees). It ends with its input.
#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <iostream>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <span>
#include <sstream>
#include <thread>

#include "core/frame.h"
#include "core/rig.h"
#include "device/jpeg.h"
#include "sim/virtual_rig.h"
#include "tests/device/mjpeg_answer.h"
#include "tracker/marker_image.h"
#include "wizard/capture/capture_plan.h"
#include "wizard/capture/virtual_capture.h"

namespace limn {
namespace {

constexpr auto k_frame = std::chrono::milliseconds(50);
constexpr auto k_settling =
    std::chrono::milliseconds(4);  // between two looks at a screen that may be changing
constexpr int k_jpeg_quality = 98;

// The file of a screen (XWD), which the X server keeps up to date.
class Screen {
 public:
  explicit Screen(const char* path) {
    const int file = ::open(path, O_RDONLY | O_CLOEXEC);
    struct stat found {};
    LIMN_CHECK(file >= 0 && ::fstat(file, &found) == 0 && found.st_size > 100);
    void* const at = ::mmap(nullptr, static_cast<std::size_t>(found.st_size), PROT_READ, MAP_SHARED, file, 0);
    LIMN_CHECK(at != MAP_FAILED);
    ::close(file);
    bytes_ = static_cast<const unsigned char*>(at);
    LIMN_CHECK(number(1) == 7 && number(11) == 32);  // XWD of version 7, 32 bits a pixel
    pixels_ = bytes_ + number(0) + 12 * number(19);  // after the header and the colours
  }
  cv::Mat image() const {
    const cv::Mat shown(static_cast<int>(number(5)), static_cast<int>(number(4)), CV_8UC4,
                        const_cast<unsigned char*>(pixels_), number(12));
    cv::Mat out;
    cv::cvtColor(shown, out, cv::COLOR_BGRA2BGR);
    return out;
  }

 private:
  std::uint32_t number(int index) const {
    const unsigned char* const at = bytes_ + 4 * index;
    return std::uint32_t{at[0]} << 24 | std::uint32_t{at[1]} << 16 | std::uint32_t{at[2]} << 8 | at[3];
  }
  const unsigned char* bytes_ = nullptr;
  const unsigned char* pixels_ = nullptr;
};

// Sends images to whoever connects.
class Server {
 public:
  explicit Server(int port) : socket_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    const int yes = 1;
    ::setsockopt(socket_, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    sockaddr_in at{};
    at.sin_family = AF_INET;
    at.sin_port = htons(static_cast<std::uint16_t>(port));
    LIMN_CHECK(::bind(socket_, reinterpret_cast<const sockaddr*>(&at), sizeof at) == 0 &&
               ::listen(socket_, 4) == 0);
  }
  void send_image(const std::string& jpeg) {
    pollfd waiting{socket_, POLLIN, 0};
    while (::poll(&waiting, 1, 0) > 0) {
      guests_.push_back(::accept4(socket_, nullptr, nullptr, SOCK_CLOEXEC));
      send_text(guests_.back(), test::k_mjpeg_answer);
    }
    const std::string part = test::mjpeg_part(jpeg);
    std::erase_if(guests_, [&](int guest) {
      const bool is_there = send_text(guest, part);
      if (!is_there) ::close(guest);
      return !is_there;
    });
  }

 private:
  static bool send_text(int guest, std::string_view text) {
    while (!text.empty()) {
      const ssize_t sent = ::send(guest, text.data(), text.size(), MSG_NOSIGNAL);
      if (sent <= 0) return false;
      text.remove_prefix(static_cast<std::size_t>(sent));
    }
    return true;
  }
  int socket_;
  std::vector<int> guests_;
};

void obey(const std::string& line, const wizard::Plan& plan, sim::VirtualRig* rig) {
  std::istringstream words(line);
  std::string what, name;
  words >> what;
  if (what == "board") {
    std::size_t pose = 0;
    words >> pose;
    rig->place(wizard::board_object(plan.board, plan.world_from_board.at(pose)));
  } else if (what == "prototype") {
    rig->remove("board");
    rig->restore_prototype();
  } else if (what == "nudge") {
    Eigen::Vector3d degrees;
    words >> name >> degrees.x() >> degrees.y() >> degrees.z();
    for (Imager& projector : rig->edit().rig.projectors)
      if (projector.name == name)
        projector.imager_from_world =
            Pose(exp_rotation(degrees * std::numbers::pi / 180), {0, 0, 0}) * projector.imager_from_world;
    LIMN_CHECK(save_rig(rig->world().rig, plan.world.parent_path() / "truth").ok());
  }
  std::printf("did %s\n", line.c_str());
  std::fflush(stdout);
}

// False: the input has ended.
bool obey_input(const wizard::Plan& plan, sim::VirtualRig* rig) {
  pollfd input{STDIN_FILENO, POLLIN, 0};
  std::string line;
  while (::poll(&input, 1, 0) > 0) {
    if (!std::getline(std::cin, line)) return false;
    obey(line, plan, rig);
  }
  return true;
}

bool is_equal(const cv::Mat& a, const cv::Mat& b) { return cv::norm(a, b, cv::NORM_INF) == 0; }

// What a screen shows when it is not just changing.
cv::Mat settled_image(const Screen& screen) {
  cv::Mat image = screen.image();
  while (true) {
    std::this_thread::sleep_for(k_settling);
    const cv::Mat again = screen.image();
    if (is_equal(image, again)) return image;
    image = again;
  }
}

int run(const wizard::Plan& plan, int port, const std::vector<Screen>& screens) {
  sim::VirtualRig rig(sim::load_world(plan.world, tracker::marker_image).value(),
                      {.display_delay_s = 0, .camera_delay_s = 0, .grab_waits_for_light = false});
  LIMN_CHECK(rig.world().rig.projectors.size() == screens.size());
  rig.remove_prototype();
  obey("board 0", plan, &rig);
  LIMN_CHECK(save_rig(rig.world().rig, plan.world.parent_path() / "truth").ok());
  Server server(port);
  std::vector<cv::Mat> shown(screens.size());
  for (Stamp next = now(); obey_input(plan, &rig); next = std::max(next + k_frame, now())) {
    std::this_thread::sleep_until(next);
    for (std::size_t i = 0; i < screens.size(); ++i) {
      shown[i] = settled_image(screens[i]);
      LIMN_CHECK(rig.projector(static_cast<int>(i)).show(shown[i]).ok());
    }
    const cv::Mat seen = rig.camera(0).next()->image;
    const std::vector<std::uint8_t> jpeg = device::encode_jpeg(seen, k_jpeg_quality);
    // An image counts as exposed when it arrives. One that has become wrong while it was computed is left
    // out.
    const bool is_true = std::equal(
        screens.begin(), screens.end(), shown.begin(),
        [](const Screen& screen, const cv::Mat& image) { return is_equal(screen.image(), image); });
    if (is_true) server.send_image({jpeg.begin(), jpeg.end()});
  }
  return 0;
}

}  // namespace
}  // namespace limn

int main(int count, char** words) {
  if (count < 4) return 2;
  const auto plan = limn::wizard::load_plan(words[1]);
  if (!plan) {
    std::fprintf(stderr, "%s\n", plan.message().c_str());
    return 1;
  }
  return limn::run(*plan, std::atoi(words[2]), std::vector<limn::Screen>(words + 3, words + count));
}
