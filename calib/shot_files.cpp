#include "calib/shot_files.h"

#include <algorithm>
#include <array>
#include <map>
#include <optional>
#include <regex>

#include "core/image_io.h"
#include "core/names.h"

namespace limn::calib {
namespace {

namespace fs = std::filesystem;

bool is_digit(char c) { return c >= '0' && c <= '9'; }

// The value of the digits of `text` from `at` on, without leading zeros, as text; `at` moves behind them.
std::string number_at(const std::string& text, size_t* at) {
  const size_t from = *at;
  while (*at < text.size() && is_digit(text[*at])) ++*at;
  const size_t first = std::min(text.find_first_not_of('0', from), *at);
  return text.substr(first, *at - first);
}

// Matches a whole name; the texts that the wildcards stand for are added to `parts`.
bool match(const char* pattern, const char* text, std::vector<std::string>* parts) {
  if (*pattern == '\0') return *text == '\0';
  if (*pattern != '*') {
    if (*text == '\0' || (*pattern != '?' && *pattern != *text)) return false;
    if (*pattern == '?') parts->emplace_back(1, *text);
    if (match(pattern + 1, text + 1, parts)) return true;
    if (*pattern == '?') parts->pop_back();
    return false;
  }
  for (size_t length = 0;; ++length) {
    parts->emplace_back(text, length);
    if (match(pattern + 1, text + length, parts)) return true;
    parts->pop_back();
    if (text[length] == '\0') return false;
  }
}

bool matches(const std::string& pattern, const std::string& name) {
  std::vector<std::string> parts;
  return match(pattern.c_str(), name.c_str(), &parts);
}

std::vector<std::string> separated(const std::string& text, char separator) {
  std::vector<std::string> parts(1);
  for (const char c : text) {
    if (c == separator)
      parts.emplace_back();
    else
      parts.back() += c;
  }
  return parts;
}

// A file with what the pattern's wildcards stand for, without the name's ending.
struct Shot {
  fs::path path;
  std::string variable;
};

// The images that match a pattern, which may begin with directories'.
std::vector<Shot> shots_in(const fs::path& folder, const std::string& pattern) {
  if (const size_t slash = pattern.find('/'); slash != std::string::npos) {
    std::vector<Shot> all;
    for (const std::string& name : names_in(folder, pattern.substr(0, slash), true)) {
      const auto some = shots_in(folder / name, pattern.substr(slash + 1));
      all.insert(all.end(), some.begin(), some.end());
    }
    return all;
  }
  std::vector<Shot> shots;
  for (const std::string& name : names_in(folder, pattern, false)) {
    if (!is_image_name(name)) continue;
    std::vector<std::string> parts;
    match(pattern.c_str(), name.c_str(), &parts);
    std::string variable;
    for (const std::string& part : parts) variable += (variable.empty() ? "" : "_") + part;
    if (is_image_name(variable)) variable = fs::path(variable).stem().string();
    shots.push_back({folder / name, variable});
  }
  return shots;
}

// A camera of the images, by its pattern or by a word in the names.
struct CameraShots {
  std::string name;
  std::vector<Shot> shots;
};

// Splits images by a word that names a camera; one part where there are not two or more such words.
std::vector<CameraShots> split_by_camera_word(std::vector<Shot> shots) {
  static const std::regex k_word("(^|[^A-Za-z])(cam(era)?[ _-]?[0-9]+(?![0-9])|left|right)(?![A-Za-z])",
                                 std::regex::icase);
  struct NaturalLess {
    bool operator()(const std::string& a, const std::string& b) const { return natural_less(a, b); }
  };
  std::map<std::string, std::vector<Shot>, NaturalLess> by_word;
  for (const Shot& shot : shots) {
    std::smatch found;
    if (!std::regex_search(shot.variable, found, k_word)) return {{"camera0", std::move(shots)}};
    Shot without = shot;
    without.variable = std::string(found.prefix()) + found[1].str() + std::string(found.suffix());
    by_word[found[2]].push_back(std::move(without));
  }
  if (by_word.size() < 2) return {{"camera0", std::move(shots)}};
  std::vector<CameraShots> cameras;
  for (auto& [word, some] : by_word)
    cameras.push_back({fmt::format("camera{}", cameras.size()), std::move(some)});
  return cameras;
}

// The cameras' images in one folder. `pattern`: as ShotPlaces::shots.
std::vector<CameraShots> cameras_in(const fs::path& folder, const std::string& pattern) {
  const std::vector<std::string> patterns = separated(pattern, ',');
  std::vector<CameraShots> cameras;
  for (const std::string& entry : patterns) {
    const size_t equals = entry.find('=');
    const std::string name =
        equals == std::string::npos ? fmt::format("camera{}", cameras.size()) : entry.substr(0, equals);
    const std::string own = equals == std::string::npos ? entry : entry.substr(equals + 1);
    cameras.push_back({name, shots_in(folder, own)});
  }
  const bool is_named = patterns[0].find('=') != std::string::npos;
  if (cameras.size() == 1 && !is_named) return split_by_camera_word(std::move(cameras[0].shots));
  return cameras;
}

// The parts of a text that are numbers: begin and length.
std::vector<std::pair<size_t, size_t>> numbers_of(const std::string& text) {
  std::vector<std::pair<size_t, size_t>> numbers;
  for (size_t i = 0; i < text.size();) {
    const size_t from = i;
    if (is_digit(text[i])) {
      number_at(text, &i);
      numbers.emplace_back(from, i - from);
    } else {
      ++i;
    }
  }
  return numbers;
}

// Images of one pose, by the text without the image's number.
struct NamedPose {
  std::string name;
  std::vector<fs::path> files;
};

// Groups images by their names without one number, the `back`th from the end; nullopt when a name has fewer
// numbers.
std::optional<std::vector<NamedPose>> grouped(const std::vector<Shot>& shots, size_t back) {
  struct Numbered {
    std::string rest, number;
    const Shot* shot;
  };
  std::vector<Numbered> all;
  for (const Shot& shot : shots) {
    const auto numbers = numbers_of(shot.variable);
    if (numbers.size() <= back) return std::nullopt;
    const auto [from, length] = numbers[numbers.size() - 1 - back];
    all.push_back({shot.variable.substr(0, from) + '#' + shot.variable.substr(from + length),
                   shot.variable.substr(from, length), &shot});
  }
  std::stable_sort(all.begin(), all.end(), [](const Numbered& a, const Numbered& b) {
    return a.rest != b.rest ? natural_less(a.rest, b.rest) : natural_less(a.number, b.number);
  });
  std::vector<NamedPose> poses;
  for (const Numbered& one : all) {
    if (poses.empty() || poses.back().name != one.rest) poses.push_back({one.rest, {}});
    poses.back().files.push_back(one.shot->path);
  }
  return poses;
}

// The name of a pose without the place of the image's number and without separators at its ends.
std::string trimmed(std::string rest) {
  if (const size_t hash = rest.find('#'); hash != std::string::npos) rest.erase(hash, 1);
  const auto is_separator = [](char c) { return c == '_' || c == '-' || c == ' ' || c == '.'; };
  while (!rest.empty() && is_separator(rest.back())) rest.pop_back();
  while (!rest.empty() && is_separator(rest.front())) rest.erase(rest.begin());
  return rest.empty() ? "pose0" : rest;
}

// Cuts one long series into poses of a possible number of images.
std::vector<NamedPose> cut(NamedPose all, const std::function<bool(int)>& is_possible) {
  const int total = static_cast<int>(all.files.size());
  for (int poses = 1; poses <= total; ++poses) {
    if (total % poses != 0 || !is_possible(total / poses)) continue;
    std::vector<NamedPose> parts;
    const auto size = static_cast<std::ptrdiff_t>(total / poses);
    for (std::ptrdiff_t i = 0; i < poses; ++i)
      parts.push_back({poses == 1 ? all.name : fmt::format("pose{}", i),
                       {all.files.begin() + i * size, all.files.begin() + (i + 1) * size}});
    return parts;
  }
  return {std::move(all)};
}

// The poses of one camera in a flat folder.
std::vector<NamedPose> poses_of(const std::vector<Shot>& shots, const std::function<bool(int)>& is_possible) {
  constexpr size_t k_most_numbers = 4;
  std::optional<std::vector<NamedPose>> plain;
  for (size_t back = 0; back < k_most_numbers; ++back) {
    auto poses = grouped(shots, back);
    if (!poses) break;
    if (!plain) plain = poses;
    const bool all_possible = std::all_of(poses->begin(), poses->end(), [&](const NamedPose& pose) {
      return pose.files.size() == poses->front().files.size() &&
             is_possible(static_cast<int>(pose.files.size()));
    });
    if (all_possible) return *poses;
  }
  if (!plain) return {};
  return plain->size() == 1 ? cut(std::move(plain->front()), is_possible) : *std::move(plain);
}

// The pose folders, each once.
std::vector<std::string> folders_of(const ShotPlaces& places) {
  std::vector<std::string> folders;
  for (const std::string& pattern : separated(places.poses, ',')) {
    for (const std::string& name : names_in(places.folder, pattern, true))
      if (std::find(folders.begin(), folders.end(), name) == folders.end()) folders.push_back(name);
  }
  return folders;
}

Result<ShotFiles> flat_shots(const ShotPlaces& places, const std::function<bool(int)>& is_possible) {
  ShotFiles found;
  std::vector<std::vector<NamedPose>> poses;
  for (CameraShots& camera : cameras_in(places.folder, places.shots)) {
    if (camera.shots.empty())
      return error("{}: expected images '{}' of {}, found none. Check --shots and --poses.",
                   places.folder.string(), places.shots, camera.name);
    poses.push_back(poses_of(camera.shots, is_possible));
    if (poses.back().empty())
      return error("{}: expected a number in the name of every image, found none in {}. Check --shots.",
                   places.folder.string(), camera.shots.front().path.filename().string());
    found.cameras.push_back(std::move(camera.name));
  }
  for (size_t i = 0; i < poses[0].size(); ++i) {
    ShotPose pose{trimmed(poses[0][i].name), {}};
    for (size_t camera = 0; camera < poses.size(); ++camera) {
      const auto at = std::find_if(poses[camera].begin(), poses[camera].end(),
                                   [&](const NamedPose& other) { return trimmed(other.name) == pose.name; });
      if (at == poses[camera].end() || poses[camera].size() != poses[0].size())
        return error(
            "{}: expected the same poses of all cameras, found {} of {} and {} of {}; {} is pose '{}' of {} "
            "alone. Check --shots.",
            places.folder.string(), poses[0].size(), found.cameras[0], poses[camera].size(),
            found.cameras[camera], poses[0][i].files[0].filename().string(), pose.name, found.cameras[0]);
      pose.files.push_back(at->files);
    }
    found.poses.push_back(std::move(pose));
  }
  return found;
}

Result<ShotFiles> shots_of_folders(const ShotPlaces& places, const std::vector<std::string>& folders) {
  ShotFiles found;
  for (const std::string& name : folders) {
    const std::vector<CameraShots> cameras = cameras_in(places.folder / name, places.shots);
    ShotPose pose{name, {}};
    std::vector<std::string> names;
    for (const CameraShots& camera : cameras) {
      names.push_back(camera.name);
      pose.files.emplace_back();
      for (const Shot& shot : camera.shots) pose.files.back().push_back(shot.path);
    }
    if (found.cameras.empty()) found.cameras = names;
    if (found.cameras != names)
      return error("{}: expected images of {} cameras, as in {}, found {}. Check --shots.",
                   (places.folder / name).string(), found.cameras.size(), folders[0], names.size());
    found.poses.push_back(std::move(pose));
  }
  return found;
}

// The only camera's or each camera's photographs, one for each pose: where they are in one folder.
std::vector<CameraShots> photographs_in(const ShotPlaces& places) {
  std::vector<CameraShots> cameras = cameras_in(places.folder, places.shots);
  const bool has_none = std::all_of(cameras.begin(), cameras.end(),
                                    [](const CameraShots& camera) { return camera.shots.empty(); });
  if (!has_none || places.shots.find(',') != std::string::npos) return cameras;
  cameras.clear();
  for (const std::string& name : names_in(places.folder, "*", true)) {  // a folder for each camera
    auto shots = shots_in(places.folder / name, places.shots);
    if (!shots.empty()) cameras.push_back({name, std::move(shots)});
  }
  return cameras;
}

Status leave_out(const ShotPlaces& places, std::vector<ShotPose>* poses) {
  for (const std::string& name : places.skip) {
    const auto found =
        std::find_if(poses->begin(), poses->end(), [&](const ShotPose& pose) { return pose.name == name; });
    if (found == poses->end())
      return error("--skip-poses: there is no pose '{}' in {}. Poses: {}.", name, places.folder.string(),
                   joined_names(*poses));
    poses->erase(found);
  }
  return {};
}

}  // namespace

bool natural_less(const std::string& a, const std::string& b) {
  size_t i = 0, j = 0;
  while (i < a.size() && j < b.size()) {
    if (is_digit(a[i]) && is_digit(b[j])) {
      const std::string x = number_at(a, &i), y = number_at(b, &j);
      if (x.size() != y.size()) return x.size() < y.size();
      if (x != y) return x < y;
    } else {
      if (a[i] != b[j]) return a[i] < b[j];
      ++i;
      ++j;
    }
  }
  if ((i < a.size()) != (j < b.size())) return j < b.size();
  return a < b;  // numbers that differ in leading zeros only
}

std::vector<std::string> names_in(const fs::path& folder, const std::string& pattern, bool directories) {
  std::vector<std::string> names;
  std::error_code problem, ignored;
  for (fs::directory_iterator entry(folder, problem), end; !problem && entry != end;
       entry.increment(problem)) {
    std::string name = entry->path().filename().string();
    if (entry->is_directory(ignored) == directories && matches(pattern, name))
      names.push_back(std::move(name));
  }
  std::sort(names.begin(), names.end(), natural_less);
  return names;
}

Result<ShotFiles> find_shots(const ShotPlaces& places, const std::function<bool(int)>& is_possible) {
  std::error_code ignored;
  if (!fs::is_directory(places.folder, ignored))
    return error("{}: expected a folder of captures, found none.", places.folder.string());
  const std::vector<std::string> folders = folders_of(places);
  bool is_flat = folders.empty();
  for (const CameraShots& camera :
       is_flat ? cameras_in(places.folder, places.shots) : std::vector<CameraShots>())
    is_flat = is_flat && !camera.shots.empty();
  if (folders.empty() && !is_flat)
    return error(
        "{}: expected pose directories '{}' or images '{}', found none. Capture some board poses first, or "
        "check --poses and --shots.",
        places.folder.string(), places.poses, places.shots);
  LIMN_TRY(ShotFiles found, is_flat ? flat_shots(places, is_possible) : shots_of_folders(places, folders));
  LIMN_TRY_STATUS(leave_out(places, &found.poses));
  if (found.poses.empty()) return error("{}: all poses are skipped.", places.folder.string());
  return found;
}

Result<ShotFiles> find_photographs(const ShotPlaces& places) {
  std::error_code ignored;
  if (!fs::is_directory(places.folder, ignored))
    return error("{}: expected a folder of photographs, found none.", places.folder.string());
  std::vector<std::string> folders = folders_of(places);
  if (!folders.empty()) {
    LIMN_TRY(ShotFiles found, shots_of_folders(places, folders));
    LIMN_TRY_STATUS(leave_out(places, &found.poses));
    return found;
  }
  ShotFiles found;
  for (const CameraShots& camera : photographs_in(places)) {
    if (camera.shots.empty())
      return error("{}: expected photographs '{}' of {}, found none. Check --shots.", places.folder.string(),
                   places.shots, camera.name);
    for (const Shot& shot : camera.shots) {
      const std::string name = shot.variable.empty() ? shot.path.stem().string() : trimmed(shot.variable);
      auto pose = std::find_if(found.poses.begin(), found.poses.end(),
                               [&](const ShotPose& other) { return other.name == name; });
      if (pose == found.poses.end()) pose = found.poses.insert(pose, ShotPose{name, {}});
      pose->files.resize(found.cameras.size() + 1);
      pose->files.back().push_back(shot.path);
    }
    found.cameras.push_back(camera.name);
  }
  for (ShotPose& pose : found.poses) pose.files.resize(found.cameras.size());
  if (found.poses.empty())
    return error("{}: expected photographs '{}', found none. Check --shots.", places.folder.string(),
                 places.shots);
  std::sort(found.poses.begin(), found.poses.end(),
            [](const ShotPose& a, const ShotPose& b) { return natural_less(a.name, b.name); });
  LIMN_TRY_STATUS(leave_out(places, &found.poses));
  return found;
}

}  // namespace limn::calib
