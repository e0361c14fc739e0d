#include "remote/tablet/intrinsics_store.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "core/config.h"
#include "core/file.h"
#include "core/json_text.h"
#include "core/log.h"

namespace limn::remote {
namespace {

namespace fs = std::filesystem;

constexpr const char* k_lenses_schema = "limn.guest_lens/1";
constexpr std::size_t k_max_devices = 200, k_max_lenses = 4;

fs::path file_of(const fs::path& folder, const std::string& device) { return folder / (device + ".json"); }

Result<std::vector<calib::IntrinsicsEstimate>> read(const fs::path& file) {
  LIMN_TRY(const Config config, Config::load(file, k_lenses_schema));
  config.root().only({"schema", "lenses"});
  std::vector<calib::IntrinsicsEstimate> lenses;
  for (const ConfigNode& node : config.root().at("lenses").items()) {
    node.only({"size", "values", "covariance", "views"});
    calib::IntrinsicsEstimate lens;
    const auto [width, height] = node.at("size").image_size();
    const std::vector<double> values = node.at("values").numbers(5),
                              covariance = node.at("covariance").numbers(25);
    lens.width = width;
    lens.height = height;
    lens.values = Eigen::Map<const calib::Vector5d>(values.data());
    lens.covariance = Eigen::Map<const calib::Matrix5d>(covariance.data());
    lens.views = node.at("views").integer();
    if (!lens.is_sound()) node.problem("expected a lens and its covariance, found numbers that are none.");
    lenses.push_back(lens);
  }
  LIMN_TRY_STATUS(config.status());
  return lenses;
}

// Keeps the newest k_max_devices files.
void remove_oldest_files(const fs::path& folder) {
  std::error_code ignored;
  std::vector<std::pair<fs::file_time_type, fs::path>> files;
  for (const auto& entry : fs::directory_iterator(folder, ignored))
    if (entry.path().extension() == ".json")
      files.emplace_back(fs::last_write_time(entry.path(), ignored), entry.path());
  if (files.size() <= k_max_devices) return;
  std::sort(files.begin(), files.end());
  files.resize(files.size() - k_max_devices);
  for (const auto& [time, file] : files) fs::remove(file, ignored);
}

}  // namespace

bool is_device_name(const std::string& device) {
  constexpr std::size_t k_least = 8, k_most = 64;
  return device.size() >= k_least && device.size() <= k_most &&
         std::all_of(device.begin(), device.end(), [](char c) {
           return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-';
         });
}

std::vector<calib::IntrinsicsEstimate> load_lenses(const fs::path& folder, const std::string& device) {
  LIMN_CHECK(is_device_name(device));
  std::error_code none;
  const fs::path file = file_of(folder, device);
  if (!fs::exists(file, none)) return {};
  auto lenses = read(file);
  if (lenses) return std::move(*lenses);
  log_warning("live: {} The lens is estimated anew.", lenses.message());
  return {};
}

Status save_lenses(const fs::path& folder,
                   const std::string& device,
                   const std::vector<calib::IntrinsicsEstimate>& lenses) {
  LIMN_CHECK(is_device_name(device));
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const calib::IntrinsicsEstimate& lens : lenses) {
    if (list.size() == k_max_lenses) break;
    list.push_back({{"size", {lens.width, lens.height}},
                    {"values", std::vector<double>(lens.values.begin(), lens.values.end())},
                    {"covariance", std::vector<double>(lens.covariance.reshaped().begin(),
                                                       lens.covariance.reshaped().end())},
                    {"views", lens.views}});
  }
  LIMN_TRY_STATUS(make_folder(folder));
  const nlohmann::ordered_json json = {{"schema", k_lenses_schema}, {"lenses", list}};
  LIMN_TRY_STATUS(write_file(file_of(folder, device), json_text(json, 1) + "\n"));
  remove_oldest_files(folder);
  return {};
}

}  // namespace limn::remote
