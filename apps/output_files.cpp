#include "apps/output_files.h"

#include <sys/stat.h>

#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <utility>

namespace limn::apps {
namespace {

namespace fs = std::filesystem;

// Device and number of a file, which all its names and links share. Nullopt: no file, or no regular one.
using Identity = std::pair<dev_t, ino_t>;
std::optional<Identity> identity_of(const fs::path& path) {
  struct stat found {};
  if (::stat(path.c_str(), &found) != 0 || !S_ISREG(found.st_mode)) return std::nullopt;
  return Identity(found.st_dev, found.st_ino);
}

// Whether both paths lead to one file, which need not exist yet.
bool is_same_file(const fs::path& a, const fs::path& b) {
  if (const auto known = identity_of(a)) return known == identity_of(b);
  std::error_code problem;
  const fs::path one = fs::weakly_canonical(a, problem), other = fs::weakly_canonical(b, problem);
  return !problem && one == other && !fs::exists(one, problem);
}

std::string shown(const NamedFile& file) {
  return file.option.empty() ? file.path.string() : file.option + " " + file.path.string();
}

std::vector<fs::path> parts_of(const fs::path& image) {
  const fs::path whole = fs::absolute(image).lexically_normal().replace_extension();
  return std::vector<fs::path>(whole.begin(), whole.end());
}

class DrawingNames {
 public:
  DrawingNames(const std::vector<fs::path>& images, const fs::path& folder) : folder_(folder) {
    common_ = parts_of(images.at(0));
    for (const fs::path& image : images) {
      ++stem_count_[image.stem().string()];
      if (const auto known = identity_of(image)) inputs_.insert(*known);
      const std::vector<fs::path> parts = parts_of(image);
      const auto ends = std::mismatch(common_.begin(), common_.end(), parts.begin(), parts.end());
      common_.erase(ends.first, common_.end());
    }
  }

  fs::path next(const fs::path& image) {
    const std::string stem = image.stem().string();
    const std::string name = stem_count_.at(stem) == 1 ? stem : joined_path(image);
    if (is_free(name)) return used(name);
    if (is_free(name + "-drawn")) return used(name + "-drawn");
    int number = 2;
    while (!is_free(fmt::format("{}-drawn-{}", name, number))) ++number;
    return used(fmt::format("{}-drawn-{}", name, number));
  }

 private:
  // left/000.png: left-000, without the folders that all images share.
  std::string joined_path(const fs::path& image) const {
    const std::vector<fs::path> parts = parts_of(image);
    std::string joined;
    for (std::size_t i = std::min(common_.size(), parts.size() - 1); i < parts.size(); ++i)
      joined += (joined.empty() ? "" : "-") + parts[i].string();
    return joined;
  }
  fs::path file(const std::string& name) const { return folder_ / (name + ".png"); }
  bool is_free(const std::string& name) const {
    const auto present = identity_of(file(name));
    return !used_.contains(name) && !(present && inputs_.contains(*present));
  }
  fs::path used(const std::string& name) {
    used_.insert(name);
    return file(name);
  }

  fs::path folder_;
  std::vector<fs::path> common_;  // the folders that all images share
  std::map<std::string, int> stem_count_;
  std::set<Identity> inputs_;
  std::set<std::string> used_;
};

}  // namespace

Status check_outputs(const std::vector<NamedFile>& outputs, const std::vector<NamedFile>& inputs) {
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    for (const NamedFile& input : inputs)
      if (identity_of(input.path) && is_same_file(outputs[i].path, input.path))
        return usage_error("{}: expected a file of its own, found the input {}. Give another name.",
                           shown(outputs[i]), shown(input));
    for (std::size_t k = 0; k < i; ++k)
      if (is_same_file(outputs[i].path, outputs[k].path))
        return usage_error("{}: expected a file of its own, found that of {}. Give another name.",
                           shown(outputs[i]), shown(outputs[k]));
  }
  return {};
}

std::vector<fs::path> drawing_files(const std::vector<fs::path>& images, const fs::path& folder) {
  std::vector<fs::path> files;
  if (images.empty()) return files;
  DrawingNames names(images, folder);
  for (const fs::path& image : images) files.push_back(names.next(image));
  return files;
}

std::vector<std::string> names_in_results(const std::vector<fs::path>& images) {
  std::map<std::string, int> count;
  for (const fs::path& image : images) ++count[image.filename().string()];
  std::vector<std::string> names;
  for (const fs::path& image : images) {
    const std::string base = image.filename().string();
    names.push_back(count.at(base) == 1 ? base : image.string());
  }
  return names;
}

}  // namespace limn::apps
