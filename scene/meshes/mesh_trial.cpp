#include "scene/meshes/mesh_trial.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstring>
#include <fstream>
#include <new>

#include "scene/meshes/mesh_content.h"
#include "scene/meshes/mesh_formats.h"

namespace limn::scene {

namespace fs = std::filesystem;

namespace {

constexpr double k_least_s = 0.9, k_bytes_a_second = 2e6;
constexpr double k_packed_bytes_a_second = 5e5;  // where a format may be compressed
constexpr rlim_t k_least_memory = rlim_t{1} << 30;
constexpr rlim_t k_memory_per_byte = 200;  // an ASCII vertex of 20 bytes becomes a few hundred
constexpr int k_no_memory = 3;             // exit code

#if defined(__SANITIZE_ADDRESS__)
constexpr bool k_limits_memory = false;  // The sanitizer reserves terabytes of address space.
#elif defined(__has_feature)
constexpr bool k_limits_memory = !__has_feature(address_sanitizer);
#else
constexpr bool k_limits_memory = true;
#endif

// Bytes that may be read for a mesh: a .gltf has its buffers in other files, beside it or in a folder there.
std::uintmax_t bytes_of(const fs::path& path) {
  constexpr int k_most_files = 10000;
  std::error_code none;
  std::uintmax_t bytes = 0;
  if (lower_extension(path) != ".gltf") return fs::file_size(path, none);
  fs::recursive_directory_iterator at(path.has_parent_path() ? path.parent_path() : fs::path("."), none);
  for (int i = 0; i < k_most_files && !none && at != fs::recursive_directory_iterator(); ++i) {
    std::error_code gone;
    if (at->is_regular_file(gone)) bytes += at->file_size(gone);
    if (at.depth() > 0) at.disable_recursion_pending();
    at.increment(none);
  }
  return bytes;
}

double seconds_for(const fs::path& path, std::uintmax_t bytes) {
  const std::string end = lower_extension(path);
  const bool is_packed = end == ".glb" || end == ".gltf" || end == ".3mf";
  return k_least_s + static_cast<double>(bytes) / (is_packed ? k_packed_bytes_a_second : k_bytes_a_second);
}

// The size of this process's address space, bytes.
rlim_t address_space() {
  std::ifstream in("/proc/self/statm");
  rlim_t pages = 0;
  in >> pages;
  return pages * static_cast<rlim_t>(sysconf(_SC_PAGESIZE));
}

void limit(int resource, rlim_t value) {
  const rlimit limits{value, value};
  setrlimit(static_cast<__rlimit_resource>(resource), &limits);
}

[[noreturn]] void read_in_child(const fs::path& path, rlim_t memory) {
  for (const int signal : {SIGABRT, SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGTERM}) std::signal(signal, SIG_DFL);
  limit(RLIMIT_CORE, 0);
  if (k_limits_memory) limit(RLIMIT_AS, memory);
  dup2(open("/dev/null", O_WRONLY | O_CLOEXEC), STDERR_FILENO);  // the libraries' asserts are not for people
  try {
    const auto content = read_mesh_content(path);
    _exit(!content && content.message().find("bad_alloc") != std::string::npos ? k_no_memory : 0);
  } catch (const std::bad_alloc&) {
    _exit(k_no_memory);
  } catch (...) {
    _exit(0);
  }
}

Error damaged(const fs::path& path, const std::string& what) {
  return error("{}: expected a whole mesh, found one on which the mesh reader {}. Export it again.",
               path.string(), what);
}

}  // namespace

Status try_mesh_reader(const fs::path& path) {
  const std::uintmax_t bytes = bytes_of(path);
  const rlim_t memory = address_space() + k_least_memory + k_memory_per_byte * static_cast<rlim_t>(bytes);
  const double seconds = seconds_for(path, bytes);
  int ends[2];  // The child's end is closed when the child has ended.
  if (pipe2(ends, O_CLOEXEC) != 0)
    return error("{}: cannot be tried: {}.", path.string(), std::strerror(errno));
  const pid_t child = fork();
  if (child < 0) {
    close(ends[0]);
    close(ends[1]);
    return error("{}: expected to start a process that reads it, found: {}.", path.string(),
                 std::strerror(errno));
  }
  if (child == 0) read_in_child(path, memory);
  close(ends[1]);
  pollfd end{ends[0], POLLIN, 0};
  int ready = 0;
  do {
    ready = poll(&end, 1, static_cast<int>(1e3 * seconds));
  } while (ready < 0 && errno == EINTR);
  close(ends[0]);
  if (ready <= 0) kill(child, SIGKILL);
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (ready <= 0) return damaged(path, "does not end");
  if (WIFSIGNALED(status)) return damaged(path, "crashes");
  if (WEXITSTATUS(status) == k_no_memory)
    return damaged(path, "needs far more memory than its size can justify");
  return {};
}

}  // namespace limn::scene
