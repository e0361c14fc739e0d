#pragma once

#include <gtest/gtest.h>
#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstdlib>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "core/frame.h"

namespace limn::nodes {

inline constexpr auto k_longest = std::chrono::seconds(20);

// Puts this process into a domain of its own, which no room has, on the loopback.
class Ros : public testing::Test {
 protected:
  Ros() {
    ::setenv("ROS_DOMAIN_ID", std::to_string(domain).c_str(), 1);
    ::setenv("ROS_LOCALHOST_ONLY", "1", 1);
    ::unsetenv("CYCLONEDDS_URI");
  }
  const int domain = 100 + ::getpid() % 100;
};

// The program ros_peer. It leaves when this is destroyed.
class RosPeer {
 public:
  RosPeer(int domain, const char* what) {
    std::array<int, 2> in{}, out{};
    EXPECT_EQ(::pipe(in.data()) + ::pipe(out.data()), 0);
    process_ = ::fork();
    if (process_ == 0) {
      ::dup2(in[0], STDIN_FILENO);
      ::dup2(out[1], STDOUT_FILENO);
      for (const int handle : {in[0], in[1], out[0], out[1]}) ::close(handle);
      ::execl(LIMN_ROS_PEER, LIMN_ROS_PEER, std::to_string(domain).c_str(), what, nullptr);
      ::_exit(127);
    }
    ::close(in[0]);
    ::close(out[1]);
    input_ = in[1];
    output_ = out[0];
    EXPECT_TRUE(has_printed([](const std::string& line) { return line == "ready"; }));
  }
  ~RosPeer() {
    ::close(input_);
    ::close(output_);
    ::waitpid(process_, nullptr, 0);
  }
  RosPeer(const RosPeer&) = delete;
  RosPeer& operator=(const RosPeer&) = delete;

  // The lines that have come.
  std::vector<std::string> lines() {
    std::vector<std::string> out;
    pollfd at{output_, POLLIN, 0};
    std::array<char, 4096> bytes{};
    while (::poll(&at, 1, 0) > 0) {
      const auto count = ::read(output_, bytes.data(), bytes.size());
      if (count <= 0) break;
      text_.append(bytes.data(), static_cast<std::size_t>(count));
    }
    for (std::size_t end; (end = text_.find('\n')) != std::string::npos; text_.erase(0, end + 1))
      out.push_back(text_.substr(0, end));
    return out;
  }
  // Waits until a line is accepted.
  bool has_printed(const std::function<bool(const std::string&)>& accept) {
    for (const Stamp end = now() + k_longest; now() < end;) {
      for (const std::string& line : lines())
        if (accept(line)) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    return false;
  }

 private:
  int process_ = -1, input_ = -1, output_ = -1;
  std::string text_;
};

}  // namespace limn::nodes
