#include "device/v4l2_camera.h"

#include <fcntl.h>
#include <linux/videodev2.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <utility>

#include "device/jpeg.h"
#include "device/retry.h"

namespace limn::device {
namespace {

using Clock = std::chrono::steady_clock;

constexpr unsigned k_buffers = 4;       // one being filled, one waiting, one being read, one spare
constexpr double k_oldest_stamp_s = 1;  // an older stamp cannot belong to a frame that has just arrived

// An open device with its ioctls; closed by the destructor.
class Device {
 public:
  Device(const V4l2System* system, int fd) : system_(system), fd_(fd) {}
  Device(Device&& other) noexcept : system_(other.system_), fd_(std::exchange(other.fd_, -1)) {}
  Device& operator=(Device&&) = delete;
  ~Device() {
    if (fd_ >= 0) system_->close(fd_);
  }

  /// Makes an ioctl; returns 0 or the errno.
  template <class Argument>
  int ask(unsigned long request, Argument* argument) const {
    return system_->ioctl(fd_, request, argument) == 0 ? 0 : errno;
  }
  const V4l2System& system() const { return *system_; }
  int fd() const { return fd_; }

 private:
  const V4l2System* system_;
  int fd_;
};

std::string advice_for(int problem) {
  switch (problem) {
    case ENOENT:
      return "Plug the camera in; ls /dev/video* shows what is there.";
    case EACCES:
      return "Add the user to the group video, then log in again.";
    case EBUSY:
      return "Close the other program that uses it.";
    case ENODEV:
      return "Plug it in again.";
    case ENOSPC:
      return "Its USB controller has no bandwidth left: use another port or a smaller size.";
    default:
      return "Unplug it and plug it in again.";
  }
}

Error refused(const char* what, int problem) {
  return error("{} fails: {}. {}", what, std::strerror(problem), advice_for(problem));
}

Result<Device> open_device(const std::string& path, const V4l2System& system) {
  const int fd = system.open(path);
  if (fd < 0) return refused("opening it", errno);
  return Device(&system, fd);
}

Result<v4l2_capability> capability(const Device& device) {
  v4l2_capability found{};
  if (const int problem = device.ask(VIDIOC_QUERYCAP, &found))
    return refused("asking for its capabilities", problem);
  return found;
}

bool captures_video(const v4l2_capability& found) {
  const std::uint32_t able =
      found.capabilities & V4L2_CAP_DEVICE_CAPS ? found.device_caps : found.capabilities;
  return able & V4L2_CAP_VIDEO_CAPTURE && able & V4L2_CAP_STREAMING;
}

std::vector<std::uint32_t> formats(const Device& device) {
  std::vector<std::uint32_t> found;
  for (std::uint32_t index = 0; index < 256; ++index) {
    v4l2_fmtdesc format{};
    format.index = index;
    format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    if (device.ask(VIDIOC_ENUM_FMT, &format) != 0) break;
    found.push_back(format.pixelformat);
  }
  return found;
}

// The first supported format that the device has.
Result<std::uint32_t> chosen_format(const Device& device, bool grey) {
  std::vector<std::uint32_t> ours = {V4L2_PIX_FMT_MJPEG, V4L2_PIX_FMT_YUYV, V4L2_PIX_FMT_GREY};
  if (grey) std::rotate(ours.begin(), ours.end() - 1, ours.end());
  const auto theirs = formats(device);
  for (const std::uint32_t format : ours)
    if (std::find(theirs.begin(), theirs.end(), format) != theirs.end()) return format;
  std::string list;
  for (const std::uint32_t format : theirs) list += fmt::format(" {}", fourcc(format));
  return error("expected a camera with MJPG, YUYV or GREY, found{}. Use another camera.",
               list.empty() ? " none" : list);
}

std::string format_text(const v4l2_pix_format& format) {
  return fmt::format("{} {}x{}", fourcc(format.pixelformat), format.width, format.height);
}

bool same(const v4l2_pix_format& a, const v4l2_pix_format& b) {
  return a.pixelformat == b.pixelformat && a.width == b.width && a.height == b.height;
}

// Sets the format. The driver's answer and the format read back must both be the requested one.
Result<v4l2_pix_format> set_format(const Device& device, std::uint32_t pixel_format, cv::Size size) {
  v4l2_format format{};
  format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  if (const int problem = device.ask(VIDIOC_G_FMT, &format)) return refused("asking for its format", problem);
  v4l2_pix_format& pixels = format.fmt.pix;
  pixels.pixelformat = pixel_format;
  pixels.bytesperline = 0;
  pixels.sizeimage = 0;
  pixels.field = V4L2_FIELD_NONE;
  if (!size.empty()) {
    pixels.width = static_cast<std::uint32_t>(size.width);
    pixels.height = static_cast<std::uint32_t>(size.height);
  }
  const v4l2_pix_format asked = pixels;
  if (const int problem = device.ask(VIDIOC_S_FMT, &format)) return refused("setting its format", problem);
  if (!same(asked, pixels))
    return error("expected the format {}, the driver offers {}. Use a size that the camera supports.",
                 format_text(asked), format_text(pixels));
  if (const int problem = device.ask(VIDIOC_G_FMT, &format))
    return refused("reading its format back", problem);
  if (!same(asked, pixels))
    return error("the driver took {}, then says {}. It cannot be trusted: use another camera or kernel.",
                 format_text(asked), format_text(pixels));
  return pixels;
}

// A control that can be locked: its automatic mode is switched off, then its value is set and read back.
struct Lock {
  SensorSetting name;
  std::uint32_t automatism;
  int off;
  std::uint32_t value;
  double steps_per_unit;
};

constexpr Lock k_exposure = {SensorSetting::exposure_ms, V4L2_CID_EXPOSURE_AUTO, V4L2_EXPOSURE_MANUAL,
                             V4L2_CID_EXPOSURE_ABSOLUTE, 10};
constexpr Lock k_gain = {SensorSetting::gain, V4L2_CID_AUTOGAIN, 0, V4L2_CID_GAIN, 1};
constexpr Lock k_white_balance = {SensorSetting::white_balance_k, V4L2_CID_AUTO_WHITE_BALANCE, 0,
                                  V4L2_CID_WHITE_BALANCE_TEMPERATURE, 1};

std::string range_of(const Device& device, const Lock& lock) {
  v4l2_queryctrl range{};
  range.id = lock.value;
  if (device.ask(VIDIOC_QUERYCTRL, &range) != 0) return "The camera has no such control: remove the key.";
  return fmt::format("It takes {:g} to {:g} in steps of {:g}.", range.minimum / lock.steps_per_unit,
                     range.maximum / lock.steps_per_unit, range.step / lock.steps_per_unit);
}

CameraSetting locked(const Device& device, const Lock& lock, double asked) {
  CameraSetting setting{lock.name, asked, std::nullopt, ""};
  const std::string name = to_text(lock.name);
  v4l2_control automatism{lock.automatism, lock.off};
  const bool has_automatism = device.ask(VIDIOC_S_CTRL, &automatism) != EINVAL;
  v4l2_control control{lock.value, static_cast<int>(std::lround(asked * lock.steps_per_unit))};
  if (const int problem = device.ask(VIDIOC_S_CTRL, &control)) {
    setting.problem =
        fmt::format("{} is refused ({}). {}", name, std::strerror(problem), range_of(device, lock));
    return setting;
  }
  if (device.ask(VIDIOC_G_CTRL, &control) == 0) setting.found = control.value / lock.steps_per_unit;
  const double half_step = 0.5001 / lock.steps_per_unit;
  if (!setting.found) {
    setting.problem = fmt::format("{} cannot be read back.", name);
  } else if (std::abs(*setting.found - asked) > half_step) {
    setting.problem = fmt::format("{}: asked for {:g}, the driver says {:g}. {}", name, asked, *setting.found,
                                  range_of(device, lock));
  } else if (has_automatism && device.ask(VIDIOC_G_CTRL, &automatism) == 0 && automatism.value != lock.off) {
    setting.problem = fmt::format("{}: the camera's own control of it stays on.", name);
  }
  return setting;
}

std::vector<CameraSetting> locked(const Device& device, const SensorSettings& wanted) {
  std::vector<CameraSetting> settings;
  if (wanted.exposure_ms) {
    v4l2_control steady{V4L2_CID_EXPOSURE_AUTO_PRIORITY, 0};  // a long exposure must not lower the frame rate
    device.ask(VIDIOC_S_CTRL, &steady);
    settings.push_back(locked(device, k_exposure, *wanted.exposure_ms));
  }
  if (wanted.gain) settings.push_back(locked(device, k_gain, *wanted.gain));
  if (wanted.white_balance_k) settings.push_back(locked(device, k_white_balance, *wanted.white_balance_k));
  return settings;
}

// The buffers that the driver fills.
class Buffers {
 public:
  explicit Buffers(const V4l2System* system) : system_(system) {}
  Buffers(Buffers&& other) noexcept : system_(other.system_), maps_(std::exchange(other.maps_, {})) {}
  Buffers& operator=(Buffers&&) = delete;
  ~Buffers() {
    for (const auto& map : maps_) system_->unmap(map.data, map.size);
  }
  struct Map {
    std::uint8_t* data;
    std::size_t size;
  };
  void add(void* data, std::size_t size) { maps_.push_back({static_cast<std::uint8_t*>(data), size}); }
  const std::vector<Map>& maps() const { return maps_; }

 private:
  const V4l2System* system_;
  std::vector<Map> maps_;
};

v4l2_buffer buffer_at(std::uint32_t index) {
  v4l2_buffer buffer{};
  buffer.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  buffer.memory = V4L2_MEMORY_MMAP;
  buffer.index = index;
  return buffer;
}

// Number of bytes of a raw frame; 1 for a compressed one.
std::size_t least_bytes(const v4l2_pix_format& format) {
  if (format.pixelformat == V4L2_PIX_FMT_MJPEG) return 1;
  const std::size_t row = format.width * (format.pixelformat == V4L2_PIX_FMT_YUYV ? 2u : 1u);
  return std::max<std::size_t>(format.bytesperline, row) * (format.height - 1) + row;
}

Result<Buffers> start_streaming(const Device& device, const v4l2_pix_format& format) {
  v4l2_requestbuffers request{};
  request.count = k_buffers;
  request.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  request.memory = V4L2_MEMORY_MMAP;
  if (const int problem = device.ask(VIDIOC_REQBUFS, &request)) return refused("asking for buffers", problem);
  if (request.count < 2)
    return error("expected {} buffers, the driver gives {}. Restart the machine.", k_buffers, request.count);
  Buffers buffers(&device.system());
  for (std::uint32_t index = 0; index < request.count; ++index) {
    v4l2_buffer buffer = buffer_at(index);
    if (const int problem = device.ask(VIDIOC_QUERYBUF, &buffer))
      return refused("asking for a buffer", problem);
    if (buffer.length < least_bytes(format))
      return error("expected buffers of at least {} bytes for {}, the driver gives {}. Use another size.",
                   least_bytes(format), format_text(format), buffer.length);
    void* memory = device.system().map(device.fd(), buffer.length, static_cast<long>(buffer.m.offset));
    if (!memory) return refused("mapping a buffer", errno);
    buffers.add(memory, buffer.length);
    if (const int problem = device.ask(VIDIOC_QBUF, &buffer)) return refused("queueing a buffer", problem);
  }
  int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  if (const int problem = device.ask(VIDIOC_STREAMON, &type)) return refused("starting it", problem);
  return buffers;
}

struct Session {
  Device device;
  v4l2_pix_format format;
  std::vector<CameraSetting> settings;
  Buffers buffers;
};

Result<Session> begun(const std::string& path,
                      const V4l2System& system,
                      const V4l2CameraOptions& options,
                      cv::Size size) {
  LIMN_TRY(Device device, open_device(path, system));
  LIMN_TRY(const v4l2_capability able, capability(device));
  if (!captures_video(able))
    return error(
        "expected a camera, found a device that gives no images. Use another one of its devices (limn doctor "
        "lists them).");
  LIMN_TRY(const std::uint32_t wanted, chosen_format(device, options.grey));
  LIMN_TRY(const v4l2_pix_format format, set_format(device, wanted, size));
  std::vector<CameraSetting> settings = locked(device, options.sensor);
  LIMN_TRY(Buffers buffers, start_streaming(device, format));
  return Session{std::move(device), format, std::move(settings), std::move(buffers)};
}

cv::Mat from_yuyv(const cv::Mat& yuyv, bool grey) {
  cv::Mat image;
  if (grey) cv::extractChannel(yuyv, image, 0);
  if (!grey) cv::cvtColor(yuyv, image, cv::COLOR_YUV2BGR_YUYV);
  return image;
}

// Decodes a frame, without name and stamp.
Result<Frame> decoded(const Buffers::Map& map, std::size_t bytes, const v4l2_pix_format& format, bool grey) {
  const cv::Size size(static_cast<int>(format.width), static_cast<int>(format.height));
  if (bytes > map.size || bytes < least_bytes(format))
    return error("expected a frame of at least {} bytes ({}), found {}.", least_bytes(format),
                 format_text(format), bytes);
  if (format.pixelformat == V4L2_PIX_FMT_MJPEG)
    return decode_frame({reinterpret_cast<const char*>(map.data), bytes}, {.grey = grey, .size = size});
  const bool yuyv = format.pixelformat == V4L2_PIX_FMT_YUYV;
  const std::size_t row = std::max<std::size_t>(format.bytesperline, format.width * (yuyv ? 2u : 1u));
  const cv::Mat raw(size, yuyv ? CV_8UC2 : CV_8UC1, map.data, row);
  Frame frame;
  frame.image = yuyv ? from_yuyv(raw, grey) : raw.clone();
  return frame;
}

}  // namespace

std::string fourcc(std::uint32_t format) {
  std::string text;
  for (int shift = 0; shift < 32; shift += 8) {
    const char c = static_cast<char>(format >> shift & 0x7f);
    text += c >= ' ' && c <= '~' ? c : '?';
  }
  return text;
}

V4l2System V4l2System::kernel() {
  return {
      .open = [](const std::string& path) { return ::open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC); },
      .close = [](int fd) { ::close(fd); },
      .ioctl =
          [](int fd, unsigned long request, void* argument) {
            int result = 0;
            do result = ::ioctl(fd, request, argument);
            while (result != 0 && errno == EINTR);
            return result;
          },
      .map = [](int fd, std::size_t length, long offset) -> void* {
        void* memory = mmap(nullptr, length, PROT_READ | PROT_WRITE, MAP_SHARED, fd, offset);
        return memory == MAP_FAILED ? nullptr : memory;
      },
      .unmap = [](void* memory, std::size_t length) { munmap(memory, length); },
      .wait =
          [](int fd, double seconds) {
            pollfd wanted{fd, POLLIN, 0};
            int ready = 0;
            do ready = poll(&wanted, 1, static_cast<int>(std::ceil(1000 * seconds)));
            while (ready < 0 && errno == EINTR);
            return ready > 0;
          },
  };
}

struct V4l2Camera::Impl {
  std::string path;
  V4l2CameraOptions options;
  V4l2System system;
  cv::Size size;  // the requested size, or the first frame's
  Retry retry;
  std::optional<Session> session;
  Stamp last_stamp;
  bool received = false;  // a frame came since next() was called
  long openings = 0, dropped = 0, damaged = 0, odd_stamps = 0;

  Status dequeue(v4l2_buffer* buffer, bool* got);
  Status drop(v4l2_buffer* buffer);
  Result<std::optional<v4l2_buffer>> newest(Stamp deadline);
  Stamp stamp_of(const v4l2_buffer& buffer);
  Result<std::optional<Frame>> grabbed(Stamp deadline);
  Result<Frame> next();
};

// Gets a filled buffer from the driver; `got` is false when none is ready.
Status V4l2Camera::Impl::dequeue(v4l2_buffer* buffer, bool* got) {
  *buffer = buffer_at(0);
  const int problem = session->device.ask(VIDIOC_DQBUF, buffer);
  *got = problem == 0;
  if (problem != 0 && problem != EAGAIN) return refused("taking a frame", problem);
  if (*got && buffer->index >= session->buffers.maps().size())
    return error("the driver names buffer {}, but there are only {}.", buffer->index,
                 session->buffers.maps().size());
  return {};
}

// Gives a buffer back to the driver unread.
Status V4l2Camera::Impl::drop(v4l2_buffer* buffer) {
  ++dropped;
  if (const int problem = session->device.ask(VIDIOC_QBUF, buffer))
    return refused("queueing a buffer", problem);
  return {};
}

// The newest filled buffer; older ones are given back unread. If all buffers are full, newer frames were
// lost, so all are given back and the next frame is awaited.
Result<std::optional<v4l2_buffer>> V4l2Camera::Impl::newest(Stamp deadline) {
  for (;;) {
    const double left_s = std::max(0.0, seconds_between(Clock::now(), deadline));
    std::optional<v4l2_buffer> kept;
    if (!system.wait(session->device.fd(), left_s)) {
      if (received) return kept;
      return error("it sends no frame. {}", advice_for(0));
    }
    std::size_t filled = 0;
    do {
      v4l2_buffer buffer{};
      bool got = false;
      LIMN_TRY_STATUS(dequeue(&buffer, &got));
      if (!got) break;
      if (kept) {
        LIMN_TRY_STATUS(drop(&*kept));
      }
      kept = buffer;
      received = true;
      ++filled;
    } while (system.wait(session->device.fd(), 0));
    if (filled < session->buffers.maps().size() || Clock::now() >= deadline) return kept;
    LIMN_TRY_STATUS(drop(&*kept));
  }
}

Stamp V4l2Camera::Impl::stamp_of(const v4l2_buffer& buffer) {
  const Stamp now = Clock::now();
  const Stamp stamp(std::chrono::seconds(buffer.timestamp.tv_sec) +
                    std::chrono::microseconds(buffer.timestamp.tv_usec));
  const double age_s = seconds_between(stamp, now);
  const bool monotonic = (buffer.flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) == V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
  if (!monotonic || age_s < 0 || age_s > k_oldest_stamp_s || stamp <= last_stamp) {
    ++odd_stamps;
    return now;
  }
  last_stamp = stamp;
  double half_exposure_s = 0;
  for (const CameraSetting& setting : session->settings)
    if (setting.name == SensorSetting::exposure_ms && setting.found) half_exposure_s = *setting.found / 2000;
  const bool at_start = (buffer.flags & V4L2_BUF_FLAG_TSTAMP_SRC_MASK) == V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
  return shifted(stamp, at_start ? half_exposure_s : -half_exposure_s);
}

// The newest frame; none when it was damaged. Error: the session has failed.
Result<std::optional<Frame>> V4l2Camera::Impl::grabbed(Stamp deadline) {
  LIMN_TRY(std::optional<v4l2_buffer> buffer, newest(deadline));
  if (!buffer) return std::optional<Frame>();
  std::optional<Frame> frame;
  if (buffer->flags & V4L2_BUF_FLAG_ERROR) {
    ++damaged;
    retry.note("the driver marks its frames as damaged. Try another cable or port.");
  } else {
    const Stamp captured_at = stamp_of(*buffer);
    auto fresh =
        decoded(session->buffers.maps()[buffer->index], buffer->bytesused, session->format, options.grey);
    if (fresh) {
      frame = std::move(*fresh);
      frame->camera = options.name;
      frame->captured_at = captured_at;
    } else {
      ++damaged;
      retry.note(fresh.message());
    }
  }
  if (const int problem = session->device.ask(VIDIOC_QBUF, &*buffer))
    return refused("queueing a buffer", problem);
  return frame;
}

Result<Frame> V4l2Camera::Impl::next() {
  const Stamp deadline = shifted(Clock::now(), options.limit_s);
  received = false;
  while (Clock::now() < deadline) {
    if (!session) {
      if (!retry.wait(deadline)) break;
      auto fresh = begun(path, system, options, size);
      if (!fresh) {
        retry.note_failure(fresh.message());
        continue;
      }
      session.emplace(std::move(*fresh));
      size = cv::Size(static_cast<int>(session->format.width), static_cast<int>(session->format.height));
      ++openings;
    }
    auto frame = grabbed(deadline);
    if (frame && *frame) {
      retry.note_success();
      return std::move(**frame);
    }
    if (!frame) {
      session.reset();
      retry.note_failure(frame.message());
    }
  }
  return error("{} ({}): expected an image within {:g} s, found none: {}", options.name, path,
               options.limit_s, retry.problem());
}

V4l2Camera::V4l2Camera(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
V4l2Camera::V4l2Camera(V4l2Camera&&) noexcept = default;
V4l2Camera& V4l2Camera::operator=(V4l2Camera&&) noexcept = default;
V4l2Camera::~V4l2Camera() = default;

Result<V4l2Camera> V4l2Camera::open(const std::string& path,
                                    const V4l2CameraOptions& options,
                                    const V4l2System& system) {
  auto impl = std::make_unique<Impl>();
  impl->path = path;
  impl->options = options;
  impl->system = system;
  impl->size = options.size;
  LIMN_TRY(const Frame first, impl->next());
  return V4l2Camera(std::move(impl));
}

const std::string& V4l2Camera::name() const { return impl_->options.name; }
cv::Size V4l2Camera::size() const { return impl_->size; }
Result<Frame> V4l2Camera::next() { return impl_->next(); }

std::string V4l2Camera::description() const {
  const std::string format = impl_->session ? format_text(impl_->session->format) : "lost";
  return fmt::format(
      "V4L2, {}; opened {} times, {} frames skipped for newer ones, {} damaged, {} with an impossible stamp",
      format, impl_->openings, impl_->dropped, impl_->damaged, impl_->odd_stamps);
}

std::vector<CameraSetting> V4l2Camera::settings() const {
  return impl_->session ? impl_->session->settings : std::vector<CameraSetting>{};
}

std::vector<V4l2Device> v4l2_cameras(const V4l2System& system) {
  std::vector<V4l2Device> cameras;
  for (int number = 0; number < 64; ++number) {
    V4l2Device found{fmt::format("/dev/video{}", number), "", ""};
    const int fd = system.open(found.path);
    if (fd < 0 && errno == ENOENT) continue;
    if (fd < 0) {
      found.problem = refused("opening it", errno).message;
      cameras.push_back(found);
      continue;
    }
    const Device device(&system, fd);
    const auto able = capability(device);
    if (!able) found.problem = able.message();
    if (able && !captures_video(*able)) continue;
    if (able) found.card = reinterpret_cast<const char*>(able->card);
    cameras.push_back(found);
  }
  return cameras;
}

}  // namespace limn::device
