#include "session/telemetry.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "core/file.h"
#include "core/html.h"
#include "core/svg.h"

namespace limn::session {
namespace {

constexpr double k_least = 1e-4, k_growth = 1.02;
constexpr std::size_t k_most_notes = 500, k_most_slices = 240;

constexpr const char* k_telemetry_style = R"(
body { max-width: 1000px; } h2 { font-weight: 500; margin: 2rem 0 .5rem; font-size: 1.1rem; }
svg { width: 100%; height: 140px; background: #1b1e24; border-radius: 4px; }
polyline { fill: none; stroke: #7fb4ff; stroke-width: 1.5; } text { fill: #a9a69f; font-size: 12px; }
)";

// A line chart over the session's time, in a box of 1000 x 140.
std::string chart(const std::string& title,
                  const std::vector<std::pair<double, double>>& points,
                  const std::string& unit) {
  if (points.size() < 2) return "";
  double high = 0;
  for (const auto& [x, y] : points) high = std::max(high, y);
  if (!(high > 0)) return "";
  const double begin = points.front().first, span = std::max(1e-9, points.back().first - begin);
  std::vector<Eigen::Vector2d> line;
  for (const auto& [x, y] : points) line.emplace_back(10 + 980 * (x - begin) / span, 120 - 95 * y / high);
  Svg svg({0, 0}, {1000, 140}, fmt::format("preserveAspectRatio='none' aria-label='{}'", escaped(title)));
  svg.polyline(line, "");
  svg.text({10, 16}, fmt::format("{:.{}f} {}", high, high < 10 ? 2 : 0, unit), "");
  svg.text({990, 136}, fmt::format("{:.0f} s", begin + span), "text-anchor='end'");
  return fmt::format("<h2>{}</h2>{}\n", escaped(title), svg.element());
}

}  // namespace

void Quantiles::add(double value) {
  if (!(value >= 0)) return;
  const double bin = value <= k_least ? 0 : std::log(value / k_least) / std::log(k_growth) + 1;
  ++bins_[static_cast<std::size_t>(std::clamp(bin, 0.0, static_cast<double>(bins_.size() - 1)))];
  least_ = count_ == 0 ? value : std::min(least_, value);
  most_ = count_ == 0 ? value : std::max(most_, value);
  ++count_;
  sum_ += value;
}

double Quantiles::at(double share) const {
  if (count_ == 0) return NAN;
  const auto wanted = static_cast<std::size_t>(std::ceil(share * static_cast<double>(count_)));
  std::size_t seen = 0;
  for (std::size_t i = 0; i < bins_.size(); ++i) {
    seen += bins_[i];
    if (seen >= std::max<std::size_t>(1, wanted))
      return std::clamp(i == 0 ? 0 : k_least * std::pow(k_growth, static_cast<double>(i) - 0.5), least_,
                        most_);
  }
  return NAN;
}

Telemetry::Telemetry()
    : measures_{{"detect", "ms", "detecting markers", {}},
                {"filter", "ms", "poses and motions", {}},
                {"paint", "ms", "drawing the projectors' images", {}},
                {"screen", "ms", "drawing the screens' images", {}},
                {"record", "ms", "passing data to the recording", {}},
                {"latency", "ms", "from the camera's exposure to light on the surface", {}},
                {"placement",
                 "mm",
                 "RMS distance of the parts from their true positions (virtual rig only)",
                 {}}} {}

Result<Telemetry> Telemetry::create(const std::filesystem::path& folder) {
  Telemetry out;
  if (folder.empty()) return out;
  LIMN_TRY_STATUS(make_folder(folder));
  LIMN_TRY(out.csv_,
           AppendLog::create(folder / "telemetry.csv",
                             "captured_at_s,shown_at_s,latency_ms,detect_ms,filter_ms,paint_ms,screen_ms,"
                             "record_ms,markers,lost,missed,placement_mm\n"));
  return out;
}

void Telemetry::add(const ShownFrame& frame) {
  const double latency_ms = 1e3 * seconds_between(frame.captured_at, frame.shown_at);
  if (frames_++ == 0) begun_at_ = frame.shown_at;
  last_at_ = frame.shown_at;
  missed_ += static_cast<std::size_t>(frame.missed);
  with_lost_ += frame.lost > 0;
  const double values[] = {frame.detect_ms, frame.filter_ms, frame.paint_ms,    frame.screen_ms,
                           frame.record_ms, latency_ms,      frame.placement_mm};
  for (std::size_t i = 0; i < measures_.size(); ++i) measures_[i].all.add(values[i]);
  add_to_slice(frame, latency_ms);
  if (!csv_.is_open()) return;
  csv_.add(fmt::format("{:.6f},{:.6f},{:.3f},{:.3f},{:.3f},{:.3f},{:.3f},{:.3f},{},{},{},{:.4f}\n",
                       seconds_of(frame.captured_at), seconds_of(frame.shown_at), latency_ms, frame.detect_ms,
                       frame.filter_ms, frame.paint_ms, frame.screen_ms, frame.record_ms, frame.markers,
                       frame.lost, frame.missed, frame.placement_mm),
           frame.shown_at);
  if (const auto message = csv_.take_message()) note(frame.shown_at, *message);
}

// When there are too many slices, every two neighbours are merged.
void Telemetry::add_to_slice(const ShownFrame& frame, double latency_ms) {
  const double at_s = seconds_between(begun_at_, frame.shown_at);
  if (slices_.empty() || at_s >= slices_.back().begins_s + slice_s_) slices_.push_back({at_s, 0, 0, 0, 0});
  Slice& slice = slices_.back();
  slice.latency_ms = std::max(slice.latency_ms, latency_ms);
  slice.paint_ms = std::max(slice.paint_ms, frame.paint_ms);
  slice.placement_mm = std::max(slice.placement_mm, frame.placement_mm);
  ++slice.count;
  if (slices_.size() < k_most_slices) return;
  for (std::size_t i = 0; 2 * i + 1 < slices_.size(); ++i) {
    const Slice &a = slices_[2 * i], &b = slices_[2 * i + 1];
    slices_[i] = {a.begins_s, std::max(a.latency_ms, b.latency_ms), std::max(a.paint_ms, b.paint_ms),
                  std::max(a.placement_mm, b.placement_mm), a.count + b.count};
  }
  slices_.resize(slices_.size() / 2);
  slice_s_ *= 2;
}

void Telemetry::note(Stamp at, const std::string& what) {
  notes_.emplace_back(seconds_of(at), what);
  if (notes_.size() > k_most_notes) notes_.erase(notes_.begin());
}

nlohmann::ordered_json Telemetry::summary() const {
  nlohmann::ordered_json json;
  const double seconds = frames_ > 0 ? seconds_between(begun_at_, last_at_) : 0;
  json["seconds"] = seconds;
  json["pictures"] = frames_;
  json["missed_frames"] = missed_;
  json["pictures_with_lost_bodies"] = with_lost_;
  for (const Measure& measure : measures_) {
    if (measure.all.count() == 0) continue;
    json[measure.name + "_" + measure.unit] = {{"median", measure.all.at(0.5)},
                                               {"p95", measure.all.at(0.95)},
                                               {"p99", measure.all.at(0.99)},
                                               {"mean", measure.all.mean()}};
  }
  json["notes"] = nlohmann::ordered_json::array();
  for (const auto& [at_s, what] : notes_) json["notes"].push_back({{"at_s", at_s}, {"what", what}});
  return json;
}

Status Telemetry::write_page(const std::filesystem::path& path, const std::string& title) const {
  const nlohmann::ordered_json json = summary();
  std::string html = fmt::format(
      "<h1>{}</h1>\n<p class=\"lead\">{:.1f} s, {} images shown, {} camera frames missed, {} images with a "
      "lost "
      "body.</p>\n",
      escaped(title), json["seconds"].get<double>(), frames_, missed_, with_lost_);
  const HtmlRow headings = {text_cell("measurement"), text_cell("median", "number"),
                            text_cell("95 %", "number"), text_cell("99 %", "number")};
  std::vector<HtmlRow> rows;
  for (const Measure& measure : measures_) {
    if (measure.all.count() == 0) continue;
    rows.push_back({text_cell(fmt::format("{} ({})", measure.name, measure.what)),
                    text_cell(fmt::format("{:.2f} {}", measure.all.at(0.5), measure.unit), "number"),
                    text_cell(fmt::format("{:.2f}", measure.all.at(0.95)), "number"),
                    text_cell(fmt::format("{:.2f}", measure.all.at(0.99)), "number")});
  }
  html += html_table(headings, rows);
  std::vector<std::pair<double, double>> latency, paint, placement;
  for (const Slice& slice : slices_) {
    latency.emplace_back(slice.begins_s, slice.latency_ms);
    paint.emplace_back(slice.begins_s, slice.paint_ms);
    placement.emplace_back(slice.begins_s, slice.placement_mm);
  }
  html += chart("Latency from camera to light, maximum of each time slice", latency, "ms");
  html += chart("Time to draw the projectors' images, maximum of each time slice", paint, "ms");
  html +=
      chart("Distance of the parts from their true positions, maximum of each time slice", placement, "mm");
  rows.clear();
  for (const auto& [at_s, what] : notes_)
    rows.push_back({text_cell(fmt::format("{:.2f} s", at_s), "number"), text_cell(what)});
  html += "<h2>Messages</h2>\n" + html_table({}, rows);
  return write_file(path, html_page(title, HtmlColours::dark, k_telemetry_style, html));
}

}  // namespace limn::session
