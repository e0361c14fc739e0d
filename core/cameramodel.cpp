#include "core/cameramodel.h"

extern "C" {
#include <mrcal/mrcal.h>
}

#include <sys/mman.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <mutex>

#include "core/file.h"

namespace limn {
namespace {

namespace fs = std::filesystem;

constexpr unsigned k_max_side = 16384;  // pixels; the largest picture side that GL 4.5 must hold

struct FreeModel {
  void operator()(mrcal_cameramodel_t* model) const { std::free(model); }
};
using ModelPointer = std::unique_ptr<mrcal_cameramodel_t, FreeModel>;

// mrcal says on stderr what it disliked: while this lives, that text is kept for our own message.
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

  // Last line written meanwhile.
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

ModelPointer to_mrcal(const Imager& imager) {
  const std::size_t bytes = sizeof(mrcal_cameramodel_t) + imager.lens.values.size() * sizeof(double);
  ModelPointer model(static_cast<mrcal_cameramodel_t*>(std::calloc(1, bytes)));
  LIMN_CHECK(model != nullptr);
  const Eigen::Vector3d r = log_rotation(imager.imager_from_world.rotation);
  const Eigen::Vector3d& t = imager.imager_from_world.translation;
  const double rt[6] = {r.x(), r.y(), r.z(), t.x(), t.y(), t.z()};
  std::memcpy(model->rt_cam_ref, rt, sizeof rt);
  model->imagersize[0] = static_cast<unsigned>(imager.width);
  model->imagersize[1] = static_cast<unsigned>(imager.height);
  LIMN_CHECK(mrcal_lensmodel_from_name(&model->lensmodel, imager.lens.model.name().c_str()));
  std::memcpy(model->intrinsics, imager.lens.values.data(), imager.lens.values.size() * sizeof(double));
  return model;
}

Result<Imager> from_mrcal(const mrcal_cameramodel_t& model, const fs::path& path) {
  char name[1024];
  if (!mrcal_lensmodel_name(name, sizeof name, &model.lensmodel)) {
    return error("{}: unusable lens model.", path.string());
  }
  const int count = mrcal_lensmodel_num_params(&model.lensmodel);
  auto lens = Lens::create(name, std::vector<double>(model.intrinsics, model.intrinsics + count));
  if (!lens) return error("{}: {}", path.string(), lens.message());
  const double* rt = model.rt_cam_ref;
  const Pose imager_from_world(exp_rotation({rt[0], rt[1], rt[2]}), Eigen::Vector3d(rt[3], rt[4], rt[5]));
  if (!imager_from_world.is_finite())
    return error("{}: extrinsics: expected 6 finite numbers.", path.string());
  for (const unsigned side : model.imagersize) {
    if (side > k_max_side)
      return error("{}: imagersize: expected at most {} pixels a side, found {}.", path.string(), k_max_side,
                   side);
  }
  return Imager{path.stem().string(), static_cast<int>(model.imagersize[0]),
                static_cast<int>(model.imagersize[1]), *lens, imager_from_world};
}

}  // namespace

Result<Imager> load_cameramodel(const fs::path& path) {
  LIMN_TRY(const std::string text, read_file(path));
  StderrCapture complaint;
  const ModelPointer model(mrcal_read_cameramodel_string(text.c_str(), static_cast<int>(text.size())));
  if (!model) {
    return error(
        "{}: expected a mrcal .cameramodel with lensmodel, intrinsics, extrinsics and imagersize, found "
        "something else or a truncated file ({}).",
        path.string(), complaint.text());
  }
  return from_mrcal(*model, path);
}

Status save_cameramodel(const Imager& imager, const fs::path& path) {
  // mrcal writes to a file by name and does not report a full disk: let it write to memory, then write that.
  const int memory = ::memfd_create("limn-cameramodel", MFD_CLOEXEC);
  const fs::path aside = fmt::format("/proc/self/fd/{}", memory);
  StderrCapture complaint;
  const bool written = memory >= 0 && mrcal_write_cameramodel_file(aside.c_str(), to_mrcal(imager).get());
  const auto text = read_file(aside);
  ::close(memory);
  if (!written || !text || text->find("imagersize") == std::string::npos) {
    return error("{}: mrcal could not write this camera model ({}).", path.string(), complaint.text());
  }
  return write_file(path, *text);
}

}  // namespace limn
