#pragma once

#include <functional>
#include <map>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "core/worker_thread.h"
#include "exchange/curves/named_curve.h"
#include "remote/api/session_update.h"
#include "remote/api/thumbnails.h"
#include "remote/http/http.h"

namespace limn::remote {

/// Answers requests for images and files of the session: projectors, looks, variants. Files are read and
/// images encoded on the worker thread; all calls come on the network's thread. `update` is null before the
/// session has begun. Status 404: the path names nothing of the session; 503: too many requests wait.
class SessionFiles {
 public:
  explicit SessionFiles(WorkerThread* worker);

  /// /picture/projector/NAME.jpg: what a projector shows.
  void send_projector_image(const std::string& path, const SessionUpdate* update, ResponseCallback respond);
  /// /picture/look/NAME.png: the image that was saved with a look.
  void send_look_image(const std::string& path, const SessionUpdate* update, ResponseCallback respond);
  /// /look/NAME.glb: the parts of a look on the prototype, in metres.
  void send_look_assembly(const std::string& path, const SessionUpdate* update, ResponseCallback respond);
  /// The mesh of the prototype or of a variant in its own frame, as glTF: /glasses/prototype.glb and
  /// /glasses/part/SLOT/VARIANT.glb.
  void send_mesh(const std::string& path, const SessionUpdate* update, ResponseCallback respond);
  /// /picture/variant/SLOT/VARIANT.png: a variant by itself.
  void send_variant_image(const std::string& path, const SessionUpdate* update, ResponseCallback respond);

  /// Curves as a STEP file, which limn-cad writes. Status 503: it is not installed, or fails.
  void send_step_curves(std::vector<exchange::NamedCurve> curves, ResponseCallback respond);

 private:
  void respond_from_worker(std::function<HttpResponse()> job, ResponseCallback respond);

  struct EncodedImage {
    cv::Mat image;
    std::shared_ptr<const std::string> jpeg;
  };

  WorkerThread* worker_;
  // Used on the worker thread alone; jobs share them, since they may outlive this object.
  std::shared_ptr<std::map<std::string, EncodedImage>> encoded_projectors_;  // by the projector's name
  std::shared_ptr<Thumbnails> thumbnails_;
};

}  // namespace limn::remote
