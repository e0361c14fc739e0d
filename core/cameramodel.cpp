#include "core/cameramodel.h"

#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <mutex>
#include <optional>
#include <string_view>
#include <vector>

#include "core/file.h"
#include "core/mrcal.h"

namespace limn {
namespace {

namespace fs = std::filesystem;

struct FreeModel {
  void operator()(mrcal_cameramodel_t* model) const { std::free(model); }
};
using ModelPointer = std::unique_ptr<mrcal_cameramodel_t, FreeModel>;

// mrcal prints its errors to stderr. While this object exists, that text is captured for Limn's own message.
class StderrCapture {
 public:
  StderrCapture() : lock_(mutex()), file_(std::tmpfile()) {
    std::fflush(stderr);
    saved_ = ::dup(STDERR_FILENO);
    if (file_) ::dup2(::fileno(file_), STDERR_FILENO);
  }
  ~StderrCapture() {
    restore();
    if (file_) std::fclose(file_);
  }
  StderrCapture(const StderrCapture&) = delete;
  StderrCapture& operator=(const StderrCapture&) = delete;

  // The last line that was printed.
  std::string text() {
    restore();
    if (!file_) return "";
    std::string all(4096, '\0');
    std::rewind(file_);
    all.resize(std::fread(all.data(), 1, all.size(), file_));
    while (!all.empty() && all.back() == '\n') all.pop_back();
    return all.substr(all.rfind('\n') + 1);
  }

 private:
  static std::mutex& mutex() {
    static std::mutex one_at_a_time;
    return one_at_a_time;
  }
  void restore() {
    if (saved_ < 0) return;
    std::fflush(stderr);
    ::dup2(saved_, STDERR_FILENO);
    ::close(saved_);
    saved_ = -1;
  }
  std::lock_guard<std::mutex> lock_;
  std::FILE* file_;
  int saved_ = -1;
};

ModelPointer to_mrcal(const Imager& imager, const MrcalFunctions& mrcal) {
  const std::size_t bytes = sizeof(mrcal_cameramodel_t) + imager.lens.values.size() * sizeof(double);
  ModelPointer model(static_cast<mrcal_cameramodel_t*>(std::calloc(1, bytes)));
  LIMN_CHECK(model != nullptr);
  const Eigen::Vector3d r = log_rotation(imager.imager_from_world.rotation);
  const Eigen::Vector3d& t = imager.imager_from_world.translation;
  const double rt[6] = {r.x(), r.y(), r.z(), t.x(), t.y(), t.z()};
  std::memcpy(model->rt_cam_ref, rt, sizeof rt);
  model->imagersize[0] = static_cast<unsigned>(imager.width);
  model->imagersize[1] = static_cast<unsigned>(imager.height);
  LIMN_CHECK(mrcal.lensmodel_from_name(&model->lensmodel, imager.lens.model.name().c_str()));
  std::memcpy(model->intrinsics, imager.lens.values.data(), imager.lens.values.size() * sizeof(double));
  return model;
}

// Reader of the text, a Python dictionary of strings, numbers and lists. Limn has its own because mrcal's
// reader uses as much memory and stack as a damaged file demands.
class ModelText {
 public:
  explicit ModelText(std::string_view text) : text_(text) {}

  // Whether `mark` comes next; if so, it is skipped.
  bool accept(char mark) {
    skip_ignored();
    if (at_ >= text_.size() || text_[at_] != mark) return false;
    ++at_;
    return true;
  }

  std::optional<std::string_view> quoted() {
    skip_ignored();
    if (at_ < text_.size() && text_[at_] == 'b') ++at_;
    if (at_ >= text_.size() || (text_[at_] != '\'' && text_[at_] != '"')) return std::nullopt;
    const auto end = text_.find(text_[at_], at_ + 1);
    if (end == std::string_view::npos) return std::nullopt;
    const std::string_view inside = text_.substr(at_ + 1, end - at_ - 1);
    at_ = end + 1;
    return inside;
  }

  std::optional<std::vector<double>> numbers() {
    if (!accept('[') && !accept('(')) return std::nullopt;
    std::vector<double> values;
    while (!accept(']') && !accept(')')) {
      skip_ignored();
      double value = 0;
      const auto [end, problem] = std::from_chars(text_.data() + at_, text_.data() + text_.size(), value);
      if (problem != std::errc{}) return std::nullopt;
      values.push_back(value);
      at_ = static_cast<std::size_t>(end - text_.data());
      if (!accept(',') && next() != ']' && next() != ')') return std::nullopt;
    }
    return values;
  }

  // Skips a value of any kind; false when it has no end.
  bool skip_value() {
    if (quoted()) return true;
    int depth = 0;
    for (; at_ < text_.size(); ++at_) {
      const char c = text_[at_];
      if (depth == 0 && (c == ',' || c == '}')) return true;
      if (c == '[' || c == '(') ++depth;
      if (c == ']' || c == ')') --depth;
    }
    return false;
  }

  std::ptrdiff_t line() const {
    return 1 + std::count(text_.begin(), text_.begin() + static_cast<std::ptrdiff_t>(at_), '\n');
  }

 private:
  std::string_view text_;
  std::size_t at_ = 0;

  char next() const { return at_ < text_.size() ? text_[at_] : '\0'; }
  void skip_ignored() {
    while (at_ < text_.size()) {
      if (text_[at_] == '#')
        at_ = std::min(text_.find('\n', at_), text_.size());
      else if (std::string_view(" \t\r\n").find(text_[at_]) == std::string_view::npos)
        return;
      else
        ++at_;
    }
  }
};

struct ModelFields {
  std::string lensmodel;
  std::vector<double> intrinsics, extrinsics, imagersize;
};

// mrcal before version 1 had the keys distortion_model and lens_model, and models such as DISTORTION_OPENCV4.
std::string todays_name(std::string_view model) {
  constexpr std::string_view k_old = "DISTORTION_";
  if (!model.starts_with(k_old)) return std::string(model);
  model.remove_prefix(k_old.size());
  return "LENSMODEL_" + std::string(model == "NONE" ? "PINHOLE" : model);
}

// Nullopt when the text is not a dictionary; `text` then stands where reading failed.
std::optional<ModelFields> fields_of(ModelText& text) {
  ModelFields fields;
  if (!text.accept('{')) return std::nullopt;
  while (!text.accept('}')) {
    const auto key = text.quoted();
    if (!key || !text.accept(':')) return std::nullopt;
    if (*key == "lensmodel" || *key == "lens_model" || *key == "distortion_model") {
      const auto name = text.quoted();
      if (!name) return std::nullopt;
      fields.lensmodel = todays_name(*name);
    } else if (*key == "intrinsics" || *key == "extrinsics" || *key == "imagersize") {
      const auto numbers = text.numbers();
      if (!numbers) return std::nullopt;
      (*key == "intrinsics"   ? fields.intrinsics
       : *key == "extrinsics" ? fields.extrinsics
                              : fields.imagersize) = *numbers;
    } else if (!text.skip_value()) {
      return std::nullopt;
    }
    text.accept(',');
  }
  return fields;
}

Result<Imager> imager_of(const ModelFields& fields, const fs::path& path) {
  if (fields.lensmodel.starts_with("LENSMODEL_CAHVORE"))
    return error(
        "{}: lensmodel: expected a model with one centre of projection, found {}. Convert the file with "
        "mrcal-convert-lensmodel to LENSMODEL_SPLINED_STEREOGRAPHIC or LENSMODEL_OPENCV8.",
        path.string(), fields.lensmodel);
  auto lens = Lens::create(fields.lensmodel, fields.intrinsics);
  if (!lens) return error("{}: {}", path.string(), lens.message());
  const std::vector<double>& rt = fields.extrinsics;
  const bool is_finite = std::all_of(rt.begin(), rt.end(), [](double v) { return std::isfinite(v); });
  if (rt.size() != 6 || !is_finite) return error("{}: extrinsics: expected 6 finite numbers.", path.string());
  const Pose imager_from_world(exp_rotation({rt[0], rt[1], rt[2]}), Eigen::Vector3d(rt[3], rt[4], rt[5]));
  if (!imager_from_world.is_finite())
    return error("{}: extrinsics: expected a finite pose, found numbers too large.", path.string());
  const std::vector<double>& size = fields.imagersize;
  if (size.size() != 2) return error("{}: imagersize: expected [width, height].", path.string());
  for (const double side : size)
    if (!(side >= 0 && side <= k_max_side && side == std::floor(side)))
      return error("{}: imagersize: expected at most {} whole pixels a side, found {}.", path.string(),
                   k_max_side, side);
  return Imager{path.stem().string(), static_cast<int>(size[0]), static_cast<int>(size[1]), *lens,
                imager_from_world};
}

}  // namespace

Result<Imager> load_cameramodel(const fs::path& path) {
  LIMN_TRY(const std::string content, read_file(path));
  ModelText text(content);
  const auto fields = fields_of(text);
  if (!fields || fields->lensmodel.empty()) {
    return error(
        "{}:{}: expected a mrcal .cameramodel with lensmodel, intrinsics, extrinsics and imagersize, found "
        "something else or a truncated file.",
        path.string(), text.line());
  }
  return imager_of(*fields, path);
}

Status save_cameramodel(const Imager& imager, const fs::path& path) {
  LIMN_TRY(const MrcalFunctions* mrcal, mrcal_functions());
  // mrcal does not report a full disk. So it writes to a file in memory, whose content is then written here.
  const int memory = ::memfd_create("limn-cameramodel", MFD_CLOEXEC);
  const fs::path aside = fmt::format("/proc/self/fd/{}", memory);
  StderrCapture complaint;
  const bool written =
      memory >= 0 && mrcal->write_cameramodel_file(aside.c_str(), to_mrcal(imager, *mrcal).get());
  const auto text = read_file(aside);
  ::close(memory);
  if (!written || !text || text->find("imagersize") == std::string::npos) {
    return error("{}: mrcal could not write this camera model ({}).", path.string(), complaint.text());
  }
  return write_file(path, *text);
}

}  // namespace limn
