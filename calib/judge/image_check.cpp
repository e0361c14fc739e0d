#include "calib/judge/image_check.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <functional>
#include <map>
#include <optional>

#include "core/file.h"
#include "core/image_io.h"

namespace limn::calib {
namespace {

namespace fs = std::filesystem;

// Levels of white above black; sums of darker pixels are too uncertain in 8 bits.
constexpr int k_lit = 20;
constexpr double k_off = 0.35;  // error of a sum, in units of white minus black: noise and gamma stay below
constexpr double k_many = 0.1;  // share of the illuminated pixels; blurred edges are fewer
constexpr int k_step = 3;       // every n-th pixel both ways is checked

// Identifies a series or one of its images.
struct Place {
  size_t pose = 0, projector = 0, camera = 0;
};

const std::vector<fs::path>& series_of(const CaptureSet& captures, const Place& at) {
  return captures.poses[at.pose].images[at.projector][at.camera];
}

std::vector<Place> all_series(const CaptureSet& captures) {
  std::vector<Place> all;
  for (size_t pose = 0; pose < captures.poses.size(); ++pose) {
    for (size_t projector = 0; projector < captures.projectors.size(); ++projector) {
      for (size_t camera = 0; camera < captures.cameras.size(); ++camera)
        if (captures.cameras[camera].sees == Spectrum::visible)  // others see the same in each image
          all.push_back({pose, projector, camera});
    }
  }
  return all;
}

struct Header {
  bool is_png = false, is_whole = true;
  std::uintmax_t bytes = 0;
  int width = 0, height = 0;
};

// A PNG's size is in bytes 16 to 23, its last chunk is IEND.
Header header_of(const fs::path& path) {
  Header header;
  std::error_code problem;
  header.bytes = fs::file_size(path, problem);
  if (problem) header.bytes = 0;
  std::ifstream file(path, std::ios::binary);
  std::array<char, 24> start{};
  file.read(start.data(), start.size());
  if (!file || std::string(start.data(), 8) != "\x89PNG\r\n\x1a\n") return header;
  header.is_png = true;
  const auto number = [&](size_t at) {
    std::uint32_t v = 0;
    for (size_t i = at; i < at + 4; ++i) v = v << 8 | static_cast<unsigned char>(start[i]);
    return static_cast<int>(std::min<std::uint32_t>(v, 1U << 30));
  };
  header.width = number(16);
  header.height = number(20);
  std::array<char, 64> end{};
  const auto tail = static_cast<std::streamoff>(std::min<std::uintmax_t>(header.bytes, end.size()));
  file.seekg(-tail, std::ios::end);
  file.read(end.data(), tail);
  header.is_whole =
      std::string(end.data(), static_cast<size_t>(file.gcount())).find("IEND") != std::string::npos;
  return header;
}

Status check_header(const CaptureSet& captures, const Place& at, const fs::path& path, const Header& header) {
  const CapturedDevice& camera = captures.cameras[at.camera];
  const std::string& pose = captures.poses[at.pose].name;
  if (!header.is_png) return {};  // JPEG or damaged: reported where it is read
  if (header.width != camera.width || header.height != camera.height) {
    const auto& files = series_of(captures, at);
    const bool all = std::all_of(files.begin(), files.end(), [&](const fs::path& file) {
      const Header other = header_of(file);
      return other.width == header.width && other.height == header.height;
    });
    return error(
        "{}: expected {}x{} pixels, the size of {}, found {}x{}. {} Capture the pose again, or leave it "
        "out with --skip-poses {}.",
        path.string(), camera.width, camera.height, camera.name, header.width, header.height,
        all ? "All other images of this series are like that: they come from another rig, or from another "
              "mode "
              "of the camera."
            : "Not all images of this series are like that.",
        pose);
  }
  // Bytes after the end do no harm: so the whole file is read only now.
  if (header.is_whole) return {};
  const auto content = read_file(path);
  if (content && content->rfind("IEND") != std::string::npos) return {};
  return error(
      "{}: expected a whole PNG image, found a truncated one ({} bytes). Copy or capture it again, or "
      "leave the pose out with --skip-poses {}.",
      path.string(), header.bytes, pose);
}

// Gives each image a number: equal numbers, equal bytes. A file whose length no other file has is not read.
class Contents {
 public:
  void add_file(const fs::path& path, std::uintmax_t bytes) { by_length_[bytes].push_back(path); }
  void compare() {
    for (const auto& [bytes, paths] : by_length_) {
      std::map<std::string, int> known;
      for (const fs::path& path : paths) {
        if (paths.size() == 1) {
          id_[path] = next_++;
          continue;
        }
        const auto content = read_file(path);
        const auto [at, is_new] = known.try_emplace(content ? *content : path.string(), next_);
        if (is_new) ++next_;
        id_[path] = at->second;
      }
    }
  }
  int id(const fs::path& path) const { return id_.at(path); }
  std::vector<int> ids(const std::vector<fs::path>& paths) const {
    std::vector<int> ids;
    for (const fs::path& path : paths) ids.push_back(id(path));
    return ids;
  }

 private:
  std::map<std::uintmax_t, std::vector<fs::path>> by_length_;
  std::map<fs::path, int> id_;
  int next_ = 0;
};

bool all_alike(const std::vector<int>& ids) {
  return std::all_of(ids.begin(), ids.end(), [&](int id) { return id == ids.front(); });
}

std::string folder_of(const CaptureSet& captures, const Place& at) {
  return series_of(captures, at).front().parent_path().string();
}

Status check_copied_series(const CaptureSet& captures, const Contents& contents) {
  std::map<std::vector<int>, Place> known;
  for (const Place& at : all_series(captures)) {
    const std::vector<int> ids = contents.ids(series_of(captures, at));
    if (all_alike(ids)) continue;  // no light of the projector is visible, and there is no noise
    const auto [first, is_new] = known.try_emplace(ids, at);
    if (is_new) continue;
    return error(
        "{}: contains the same images as {}, byte for byte; one is a copy of the other. Capture {} again, or "
        "leave it out with --skip-poses {}.",
        folder_of(captures, at), folder_of(captures, first->second), captures.poses[at.pose].name,
        captures.poses[at.pose].name);
  }
  return {};
}

// Whether an image and the others of its group add up to white and black, where there is light.
Result<bool> adds_up(const CaptureSet& captures, const Place& at, int index) {
  const Patterns& patterns = captures.patterns[at.projector];
  const CapturedDevice& camera = captures.cameras[at.camera];
  const auto& files = series_of(captures, at);
  LIMN_TRY(const int used_bits, find_used_bits(files[static_cast<size_t>(patterns.white())]));
  const auto image = [&](int i) -> Result<cv::Mat> {
    LIMN_TRY(const cv::Mat grey, read_grey_image(files[static_cast<size_t>(i)], used_bits));
    if (grey.cols != camera.width || grey.rows != camera.height)
      return error("{}: expected {}x{} pixels, found {}x{}.", files[static_cast<size_t>(i)].string(),
                   camera.width, camera.height, grey.cols, grey.rows);
    return grey;
  };
  LIMN_TRY(const cv::Mat white, image(patterns.white()));
  LIMN_TRY(const cv::Mat black, image(patterns.black()));
  const auto groups = patterns.groups();
  const auto group = std::find_if(groups.begin(), groups.end(), [&](const PatternGroup& g) {
    return index >= g.first && index < g.first + g.count;
  });
  if (group == groups.end()) return true;  // without an inverse this cannot be checked
  std::vector<cv::Mat> members;
  for (int i = group->first; i < group->first + group->count; ++i) {
    LIMN_TRY(const cv::Mat member, image(i));
    members.push_back(member);
  }
  int lit = 0, off = 0;
  for (int y = 0; y < white.rows; y += k_step) {
    for (int x = 0; x < white.cols; x += k_step) {
      const int range = white.at<uchar>(y, x) - black.at<uchar>(y, x);
      if (range < k_lit) continue;
      double sum = 0;
      for (const cv::Mat& member : members) sum += member.at<uchar>(y, x);
      sum *= 2.0 / group->count;
      ++lit;
      if (std::abs(sum - white.at<uchar>(y, x) - black.at<uchar>(y, x)) > k_off * range) ++off;
    }
  }
  if (lit == 0) return false;  // some images of the series differ, white and black do not
  return off <= k_many * lit;
}

struct CheckedImage {
  Place at;
  int index = 0;
};

// Finds the same bytes in two places: within one series, or at the same pattern of two series.
Status check_copied_images(const CaptureSet& captures, const Contents& contents) {
  std::map<int, std::vector<CheckedImage>> by_content;
  for (const Place& at : all_series(captures)) {
    const std::vector<int> ids = contents.ids(series_of(captures, at));
    if (all_alike(ids)) continue;
    for (size_t i = 0; i < ids.size(); ++i) by_content[ids[i]].push_back({at, static_cast<int>(i)});
  }
  for (const auto& [id, images] : by_content) {
    for (size_t i = 0; images.size() > 1 && i < images.size(); ++i) {
      LIMN_TRY(const bool sound, adds_up(captures, images[i].at, images[i].index));
      if (sound) continue;
      const auto path = [&](const CheckedImage& p) {
        return series_of(captures, p.at)[static_cast<size_t>(p.index)].string();
      };
      const std::string& pose = captures.poses[images[i].at.pose].name;
      return error(
          "{}: contains the same image as {}, byte for byte, where the patterns differ. Capture {} again, or "
          "leave it out with --skip-poses {}.",
          path(images[i]), path(images[i == 0 ? 1 : 0]), pose, pose);
    }
  }
  return {};
}

}  // namespace

Status check_images(const CaptureSet& captures) {
  Contents contents;
  for (const Place& at : all_series(captures)) {
    for (const fs::path& path : series_of(captures, at)) {
      const Header header = header_of(path);
      LIMN_TRY_STATUS(check_header(captures, at, path, header));
      contents.add_file(path, header.bytes);
    }
  }
  contents.compare();
  LIMN_TRY_STATUS(check_copied_series(captures, contents));
  return check_copied_images(captures, contents);
}

}  // namespace limn::calib
