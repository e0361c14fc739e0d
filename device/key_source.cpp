#include "device/key_source.h"

#include <fcntl.h>
#include <linux/input.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <optional>
#include <utility>

namespace limn::device {
namespace {

constexpr std::chrono::seconds k_retry{1};

// GLFW's codes: letters are upper-case ASCII, other keys start at 256.
std::optional<int> code_of(int key) {
  static constexpr std::pair<int, int> k_codes[] = {
      {KEY_RIGHT, 262},    {KEY_LEFT, 263}, {KEY_DOWN, 264},  {KEY_UP, 265},  {KEY_PAGEUP, 266},
      {KEY_PAGEDOWN, 267}, {KEY_TAB, 258},  {KEY_ENTER, 257}, {KEY_ESC, 256}, {KEY_SPACE, ' '},
      {KEY_DOT, '.'},      {KEY_A, 'A'},    {KEY_B, 'B'},     {KEY_C, 'C'},   {KEY_D, 'D'},
      {KEY_E, 'E'},        {KEY_F, 'F'},    {KEY_G, 'G'},     {KEY_H, 'H'},   {KEY_I, 'I'},
      {KEY_J, 'J'},        {KEY_K, 'K'},    {KEY_L, 'L'},     {KEY_M, 'M'},   {KEY_N, 'N'},
      {KEY_O, 'O'},        {KEY_P, 'P'},    {KEY_Q, 'Q'},     {KEY_R, 'R'},   {KEY_S, 'S'},
      {KEY_T, 'T'},        {KEY_U, 'U'},    {KEY_V, 'V'},     {KEY_W, 'W'},   {KEY_X, 'X'},
      {KEY_Y, 'Y'},        {KEY_Z, 'Z'}};
  for (const auto& [linux_code, glfw_code] : k_codes)
    if (linux_code == key) return glfw_code;
  return std::nullopt;
}

Result<int> open_keys(const KeysConfig& config) {
  const int file = ::open(config.path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  if (file < 0) {
    const char* advice = errno == EACCES ? "Add yourself to the group `input`."
                                         : "ls /dev/input/by-id lists what is plugged in.";
    return error("{}: {}: expected an input device, found: {}. {}", config.name, config.path.string(),
                 std::strerror(errno), advice);
  }
  // Without this the focused window gets the keys, too. It fails harmlessly for a file that is not a device.
  ::ioctl(file, EVIOCGRAB, 1);
  return file;
}

}  // namespace

Result<KeySource> KeySource::open(const KeysConfig& config) {
  LIMN_TRY(const int file, open_keys(config));
  return KeySource(config, file);
}

KeySource::KeySource(KeySource&& other) noexcept
    : config_(std::move(other.config_)),
      file_(std::exchange(other.file_, -1)),
      why_gone_(std::move(other.why_gone_)),
      tried_at_(other.tried_at_) {}

KeySource::~KeySource() { close(); }

void KeySource::close() {
  if (file_ >= 0) ::close(std::exchange(file_, -1));
}

Result<std::vector<int>> KeySource::poll_pressed_keys() {
  const auto now = std::chrono::steady_clock::now();
  if (file_ < 0) {
    if (now - tried_at_ < k_retry) return error("{}", why_gone_);
    tried_at_ = now;
    const Result<int> again = open_keys(config_);
    if (!again) {
      why_gone_ = again.message();
      return again.error();
    }
    file_ = *again;
  }
  std::vector<int> keys;
  input_event event;
  for (;;) {
    const ssize_t got = ::read(file_, &event, sizeof event);
    if (got < 0 && errno == EINTR) continue;
    if (got == 0 || (got < 0 && errno == EAGAIN)) return keys;
    if (got != sizeof event) {
      why_gone_ = fmt::format("{}: {}: it is gone ({}). Plug it in again.", config_.name,
                              config_.path.string(), got < 0 ? std::strerror(errno) : "half an event");
      close();
      tried_at_ = now;
      return error("{}", why_gone_);
    }
    constexpr int k_down = 1;  // 0 is a release, 2 a repetition
    if (event.type != EV_KEY || event.value != k_down) continue;
    if (const auto code = code_of(event.code)) keys.push_back(*code);
  }
}

}  // namespace limn::device
