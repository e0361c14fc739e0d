#include "device/video_camera.h"

#include <algorithm>
#include <chrono>
#include <optional>
#include <vector>

#include "core/image_io.h"
#include "device/address.h"
#include "device/retry.h"
#include "device/socket.h"
#include "device/video_clock.h"
#include "device/video_reader.h"

namespace limn::device {
namespace {

using Clock = std::chrono::steady_clock;

// s; a frame read this much after its arrival waited unread, so there is a newer one.
constexpr double k_old_s = 0.05;

}  // namespace

struct VideoCamera::Impl {
  VideoCameraOptions options;
  std::string source;              // path or address
  std::optional<Address> address;  // only for a stream
  std::unique_ptr<VideoReader> video;
  cv::Size size;
  Retry retry;
  VideoClock clock;
  long frames = 0, connections = 0, dropped = 0;

  Status connect(Stamp deadline);
  Status catch_up(Stamp deadline);
  Result<cv::Mat> retrieve();
  Result<Frame> next_of_file();
  Result<Frame> next_of_stream();
  Result<Frame> grab_newest(Stamp deadline);
};

// Decodes the last grabbed frame.
Result<cv::Mat> VideoCamera::Impl::retrieve() {
  cv::Mat image;
  if (!video->retrieve(&image) || image.empty() || image.depth() != CV_8U)
    return error("expected an 8-bit frame, found one that cannot be decoded.");
  if (!size.empty() && image.size() != size)
    return error("expected {}x{} as in the first frame, found {}x{}. Reset the camera's size or start again.",
                 size.width, size.height, image.cols, image.rows);
  return options.grey ? to_grey(image) : image;
}

Result<Frame> VideoCamera::Impl::next_of_file() {
  if (!video->grab()) return error("{}: all {} frames of {} have been played.", options.name, frames, source);
  ++frames;
  auto image = retrieve();
  if (!image) return error("{}: frame {}: {}", source, frames - 1, image.message());
  return Frame{options.name, *image, shifted(Stamp{}, video->position_s())};
}

// OpenCV gives no reason for a failure, so the host's connection is tested first.
Status VideoCamera::Impl::connect(Stamp deadline) {
  LIMN_TRY_STATUS(Socket::connect(address->host, address->port, deadline));
  const int left_ms = std::max(1, static_cast<int>(1000 * seconds_between(Clock::now(), deadline)));
  if (!video->open(source, {left_ms, static_cast<int>(1000 * options.limit_s)}))
    return error(
        "no video within the limit. Check the path, the name and password, and that it sends H.264 or "
        "MJPEG.");
  ++connections;
  return catch_up(deadline);
}

// Skips the frames that FFmpeg buffered while it detected the format: they come faster than they were sent.
Status VideoCamera::Impl::catch_up(Stamp deadline) {
  clock = {};
  std::optional<double> last_sent_s;
  Stamp last_read = Clock::now();
  const Stamp enough = shifted(last_read, 0.5 * seconds_between(last_read, deadline));
  while (last_read < enough) {
    if (!video->grab()) return error("the stream ended at its start.");
    const double sent_s = video->position_s();
    const Stamp read_at = Clock::now();
    clock.stamp(sent_s, read_at);
    const bool waited = last_sent_s && sent_s > *last_sent_s &&
                        seconds_between(last_read, read_at) >= 0.5 * (sent_s - *last_sent_s);
    if (waited) return {};
    last_sent_s = sent_s;
    last_read = read_at;
  }
  return {};  // the sender's times are unusable: stamps are the times of reading
}

// The newest frame of an open stream.
Result<Frame> VideoCamera::Impl::grab_newest(Stamp deadline) {
  for (;;) {
    if (!video->grab()) return error("the stream ended or was silent.");
    const Stamp now = Clock::now();
    const Stamp arrived_at = clock.stamp(video->position_s(), now);
    if (seconds_between(arrived_at, now) > k_old_s && now < deadline) {
      ++dropped;
      continue;
    }
    LIMN_TRY(const cv::Mat image, retrieve());
    return Frame{options.name, image, arrived_at};
  }
}

Result<Frame> VideoCamera::Impl::next_of_stream() {
  const Stamp deadline = shifted(Clock::now(), options.limit_s);
  while (Clock::now() < deadline) {
    if (!video->is_open()) {
      if (!retry.wait(deadline)) break;
      if (const Status done = connect(deadline); !done) {
        video->close();
        retry.note_failure(done.message());
      }
      continue;
    }
    auto frame = grab_newest(deadline);
    if (frame) {
      retry.note_success();
      ++frames;
      return frame;
    }
    video->close();
    retry.note_failure(frame.message());
  }
  return error("{} ({}): expected an image within {:g} s, found none: {}", options.name, address->shown,
               options.limit_s, retry.problem());
}

VideoCamera::VideoCamera(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
VideoCamera::VideoCamera(VideoCamera&&) noexcept = default;
VideoCamera& VideoCamera::operator=(VideoCamera&&) noexcept = default;
VideoCamera::~VideoCamera() = default;

Result<VideoCamera> VideoCamera::open_file(const std::filesystem::path& path,
                                           const VideoCameraOptions& options) {
  auto impl = std::make_unique<Impl>();
  impl->options = options;
  impl->source = path.string();
  std::error_code problem;
  if (!std::filesystem::is_regular_file(path, problem))
    return error("{}: expected a video file, found no file. Check the path.", path.string());
  LIMN_TRY(impl->video, make_video_reader());
  if (impl->video->open(path.string(), {}) && impl->next_of_file()) {
    impl->size = impl->video->size();
    impl->frames = 0;
    if (impl->video->open(path.string(), {})) return VideoCamera(std::move(impl));
  }
  return error("{}: expected a video, found none that can be decoded. Save it as H.264 or MJPEG.",
               path.string());
}

Result<VideoCamera> VideoCamera::open_rtsp(const std::string& url, const VideoCameraOptions& options) {
  auto impl = std::make_unique<Impl>();
  impl->options = options;
  impl->source = url;
  LIMN_TRY(impl->address, parse_address(url, "rtsp", "554"));
  LIMN_TRY(impl->video, make_video_reader());
  LIMN_TRY(const Frame first, impl->next_of_stream());
  impl->size = first.image.size();
  return VideoCamera(std::move(impl));
}

const std::string& VideoCamera::name() const { return impl_->options.name; }
cv::Size VideoCamera::size() const { return impl_->size; }
bool VideoCamera::is_finite() const { return !impl_->address; }
Result<Frame> VideoCamera::next() { return impl_->address ? impl_->next_of_stream() : impl_->next_of_file(); }

std::string VideoCamera::description() const {
  if (is_finite()) return fmt::format("video file, {}x{}", impl_->size.width, impl_->size.height);
  return fmt::format("RTSP, {}x{}; {} connections, {} frames skipped for newer ones", impl_->size.width,
                     impl_->size.height, impl_->connections, impl_->dropped);
}

}  // namespace limn::device
