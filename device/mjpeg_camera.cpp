#include "device/mjpeg_camera.h"

#include <chrono>
#include <optional>
#include <utility>

#include "device/address.h"
#include "device/jpeg.h"
#include "device/mjpeg_stream.h"
#include "device/retry.h"
#include "device/socket.h"

namespace limn::device {
namespace {

using Clock = std::chrono::steady_clock;

constexpr double k_draining_s =
    0.1;  // longest reading of waiting bytes; then the newest image so far is used

std::string base64(const std::string& bytes) {
  static constexpr char k_digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  unsigned bits = 0;
  int count = 0;
  for (const char c : bytes) {
    bits = bits << 8 | static_cast<unsigned char>(c);
    for (count += 8; count >= 6; count -= 6) text += k_digits[bits >> (count - 6) & 63];
  }
  if (count > 0) text += k_digits[bits << (6 - count) & 63];
  while (text.size() % 4 != 0) text += '=';
  return text;
}

// The request uses HTTP/1.0, so that a server has no reason to send chunks.
std::string request(const Address& address) {
  std::string text = fmt::format("GET {} HTTP/1.0\r\nHost: {}:{}\r\nUser-Agent: limn\r\nAccept: */*\r\n",
                                 address.path, address.host, address.port);
  if (!address.login.empty()) text += fmt::format("Authorization: Basic {}\r\n", base64(address.login));
  return text + "\r\n";
}

struct Connection {
  Socket socket;
  MjpegStream stream;
};

}  // namespace

struct MjpegCamera::Impl {
  Address address;
  MjpegCameraOptions options;
  cv::Size size;
  std::optional<Connection> connection;
  Retry retry;
  std::string fault;  // why a connection ended since the last image; empty: none ended
  long connections = 0, dropped = 0, damaged = 0;

  Status connect(Stamp deadline);
  void disconnect(const std::string& why);
  Status read_waiting(bool* has_received);
  std::optional<Frame> decoded(MjpegPart part);
  Result<Frame> next();
};

Status MjpegCamera::Impl::connect(Stamp deadline) {
  LIMN_TRY(Socket socket, Socket::connect(address.host, address.port, deadline));
  LIMN_TRY_STATUS(socket.send(request(address)));
  connection.emplace(Connection{std::move(socket), MjpegStream(options.max_part_bytes)});
  ++connections;
  retry.note("the server is connected, but no complete image has arrived." +
             (fault.empty() ? "" : " Earlier fault: " + fault));
  return {};
}

void MjpegCamera::Impl::disconnect(const std::string& why) {
  if (connection) {
    dropped += connection->stream.dropped();
    fault = why;
    connection.reset();
  }
  retry.note_failure(why);
}

// Feeds everything that has arrived to the stream; sets `has_received` if there was anything.
Status MjpegCamera::Impl::read_waiting(bool* has_received) {
  const Stamp until = shifted(Clock::now(), k_draining_s);
  do {
    LIMN_TRY(const Socket::Received received, connection->socket.receive());
    if (received.bytes.empty()) return {};
    *has_received = true;
    LIMN_TRY_STATUS(connection->stream.feed(received.bytes, received.arrived_at));
  } while (Clock::now() < until);
  return {};
}

std::optional<Frame> MjpegCamera::Impl::decoded(MjpegPart part) {
  auto frame = decode_frame(std::move(part.jpeg), {.grey = options.grey, .size = size});
  if (!frame) {
    ++damaged;
    retry.note(frame.message());
    return std::nullopt;
  }
  retry.note_success();
  fault.clear();
  frame->camera = options.name;
  frame->captured_at = part.arrived_at;
  return std::move(*frame);
}

Result<Frame> MjpegCamera::Impl::next() {
  const Stamp deadline = shifted(Clock::now(), options.limit_s);
  bool has_received = false;
  while (Clock::now() < deadline) {
    if (!connection) {
      if (!retry.wait(deadline)) break;
      if (const Status done = connect(deadline); !done) disconnect(done.message());
      continue;
    }
    const Status read = read_waiting(&has_received);
    if (auto part = connection->stream.take_newest()) {
      if (auto frame = decoded(std::move(*part))) {
        if (!read) disconnect(read.message());
        return std::move(*frame);
      }
    }
    if (!read) {
      disconnect(read.message());
    } else if (!connection->socket.wait(deadline) && !has_received) {
      disconnect("the server is silent.");  // for example an unplugged cable
    }
  }
  return error("{} ({}): expected an image within {:g} s, found none: {}", options.name, address.shown,
               options.limit_s, retry.problem());
}

MjpegCamera::MjpegCamera(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
MjpegCamera::MjpegCamera(MjpegCamera&&) noexcept = default;
MjpegCamera& MjpegCamera::operator=(MjpegCamera&&) noexcept = default;
MjpegCamera::~MjpegCamera() = default;

Result<MjpegCamera> MjpegCamera::open(const std::string& url, const MjpegCameraOptions& options) {
  auto impl = std::make_unique<Impl>();
  impl->options = options;
  LIMN_TRY(impl->address, parse_address(url, "http", "80"));
  LIMN_TRY(const Frame first, impl->next());
  impl->size = first.image.size();
  return MjpegCamera(std::move(impl));
}

const std::string& MjpegCamera::name() const { return impl_->options.name; }
cv::Size MjpegCamera::size() const { return impl_->size; }
Result<Frame> MjpegCamera::next() { return impl_->next(); }

std::string MjpegCamera::description() const {
  const long dropped = impl_->dropped + (impl_->connection ? impl_->connection->stream.dropped() : 0);
  return fmt::format("MJPEG over HTTP, {}x{}; {} connections, {} images skipped for newer ones, {} damaged",
                     impl_->size.width, impl_->size.height, impl_->connections, dropped, impl_->damaged);
}

}  // namespace limn::device
