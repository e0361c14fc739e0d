#include "calib/response/measure_response.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "calib/response/camera_response.h"
#include "calib/response/colour_mixing.h"
#include "calib/response/projector_response.h"
#include "calib/response/response_shots.h"
#include "core/log.h"

namespace limn::calib {
namespace {

// For each camera and projector; a curve's noise is then below 0.1 %.
constexpr size_t k_most_of_curve = 20000;
constexpr double k_worst_drift = 0.01;  // change of white from the first to the last image
constexpr double k_worst_white = 0.03;  // difference of white from red + green + blue
constexpr double k_worst_residual = 0.02;

struct Pair {
  ResponsePair pair;
  ResponseSamples samples;
};

// Samples of all pairs; pairs that are too dark are skipped if another camera sees the projector.
Result<std::vector<Pair>> sampled_pairs(const CaptureSet& captures, std::vector<std::string>* warnings) {
  LIMN_TRY(const std::vector<ResponsePair> pairs, response_pairs(captures));
  std::vector<Pair> all;
  std::vector<std::pair<int, Error>> failed;
  for (const ResponsePair& pair : pairs) {
    if (captures.cameras[static_cast<size_t>(pair.camera)].sees != Spectrum::visible) continue;
    LIMN_TRY(const ResponseShots shots, read_response_shots(captures, pair));
    auto samples = sampled(shots, k_most_of_curve);
    if (samples) all.push_back({pair, std::move(*samples)});
    if (!samples) failed.emplace_back(pair.projector, samples.error());
  }
  for (const auto& [projector, problem] : failed) {
    const bool seen = std::any_of(all.begin(), all.end(),
                                  [wanted = projector](const Pair& p) { return p.pair.projector == wanted; });
    if (!seen) return problem;
    warnings->push_back(problem.message + " Another camera sees this projector, so this pair is skipped.");
  }
  return all;
}

std::optional<CameraResponse> camera_response(const CaptureSet& captures,
                                              int camera,
                                              const std::vector<Pair>& pairs,
                                              std::vector<std::string>* warnings) {
  std::vector<const ResponseSamples*> samples;
  for (const Pair& pair : pairs)
    if (pair.pair.camera == camera) samples.push_back(&pair.samples);
  if (samples.empty()) return std::nullopt;
  CameraResponse response = fitted_encoding(samples);
  response.camera = captures.cameras[static_cast<size_t>(camera)].name;
  if (response.encoding == CameraEncoding::unknown)
    warnings->push_back(
        fmt::format("{}: the images do not determine how it encodes light; it is taken as linear. Does the "
                    "projector scale or sharpen its image?",
                    response.camera));
  return response;
}

void judge(const ProjectorResponse& response, std::vector<std::string>* warnings) {
  const std::string& name = response.projector;
  if (!response.black_level)
    warnings->push_back(fmt::format("{}: no camera sees the edge of its light; black level unknown.", name));
  if (response.white_over_sum && std::abs(*response.white_over_sum - 1) > k_worst_white)
    warnings->push_back(
        fmt::format("{}: white is {:.2f} times red + green + blue; choose a picture mode without white "
                    "boost.",
                    name, *response.white_over_sum));
  if (response.drift && std::abs(*response.drift) > k_worst_drift)
    warnings->push_back(
        fmt::format("{}: white changed by {:.1f} % between the first and the last image; let lamp and room "
                    "settle.",
                    name, 100 * *response.drift));
  if (response.worst_residual && *response.worst_residual > k_worst_residual)
    warnings->push_back(
        fmt::format("{}: greys are {:.1f} % of full light off their channels' sum; switch off picture "
                    "enhancement.",
                    name, 100 * *response.worst_residual));
}

// Measures everything about one projector; reads its images again in full.
Status measure_projector(const CaptureSet& captures,
                         int projector,
                         const std::vector<Pair>& pairs,
                         const std::vector<std::optional<CameraResponse>>& cameras,
                         MeasuredResponse* measured) {
  const std::string& name = captures.projectors[static_cast<size_t>(projector)].name;
  std::vector<DecodedSamples> samples;
  std::vector<ResponseShots> shots;
  std::vector<const ResponseShots*> views;
  std::vector<Decoding> decodings;
  for (const Pair& pair : pairs) {
    if (pair.pair.projector != projector) continue;
    decodings.push_back(decoding(*cameras[static_cast<size_t>(pair.pair.camera)]));
    samples.push_back({&pair.samples, decodings.back()});
    LIMN_TRY(ResponseShots read, read_response_shots(captures, pair.pair));
    shots.push_back(std::move(read));
  }
  if (samples.empty()) return {};
  for (const ResponseShots& shot : shots) views.push_back(&shot);
  LIMN_TRY(ProjectorResponse response, fitted_curves(name, shots[0].folder.string(), samples));
  response = with_black_level(std::move(response), fitted_black_level(views, decodings));
  response.captures *= static_cast<int>(samples.size());
  judge(response, &measured->warnings);
  for (const ResponseShots& shot : shots)
    measured->mixings.push_back(fitted_mixing(shot, response, *cameras[static_cast<size_t>(shot.camera)]));
  measured->responses.projectors.push_back(std::move(response));
  return {};
}

}  // namespace

Result<MeasuredResponse> measure_response(const CaptureSet& captures) {
  MeasuredResponse measured;
  LIMN_TRY(const std::vector<Pair> pairs, sampled_pairs(captures, &measured.warnings));
  std::vector<std::optional<CameraResponse>> cameras;
  for (int c = 0; c < static_cast<int>(captures.cameras.size()); ++c)
    cameras.push_back(camera_response(captures, c, pairs, &measured.warnings));
  for (int p = 0; p < static_cast<int>(captures.projectors.size()); ++p)
    LIMN_TRY_STATUS(measure_projector(captures, p, pairs, cameras, &measured));
  for (const auto& camera : cameras)
    if (camera) measured.responses.cameras.push_back(*camera);
  return measured;
}

}  // namespace limn::calib
