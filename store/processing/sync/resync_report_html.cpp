// SPDX-License-Identifier: Apache-2.0
// Formats the results of a resynchronisation as a self-contained HTML page with charts as inline
// SVG.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "charts/html_page.h"
#include "charts/svg_chart.h"
#include "store/processing/sync/resync_report.h"

namespace raystage::store {
namespace {

constexpr std::size_t kMaxPoints = 600;  // of one line: a chart is 1000 pixels wide

constexpr std::string_view kStyle = R"(
.verdict { margin:0 0 40px; padding:0; list-style:none; max-width:100ch }
.verdict li { padding:5px 0 5px 18px; border-left:2px solid var(--rule) }
.verdict li:first-child { font-size:19px; border-color:var(--amber) }
svg .many { stroke:var(--teal); stroke-width:1; stroke-opacity:.42 }
svg .odd { stroke:var(--red); stroke-width:1.6 }
svg .one { stroke:var(--teal); stroke-width:1.4 }
svg .fill { fill:var(--teal) }
svg .startup { fill:var(--grey) }
svg .dropped { fill:var(--amber) }
svg .unrecorded { fill:var(--red) }
)";

double seconds(Nanoseconds time) { return static_cast<double>(time) / kNsPerS; }

bool is_odd(const CameraSync& camera) {
  return !camera.phase_steps.empty() || camera.early_end || camera.late_start || !camera.regular;
}

std::string arrival_chart(const ResyncResult& resync) {
  std::size_t most = 1;
  Nanoseconds first = std::numeric_limits<Nanoseconds>::max(), last = kExcludedTime;
  for (const auto& times : resync.times) {
    most = std::max(most, times.size());
    for (const Nanoseconds time : times) {
      if (time == kExcludedTime) continue;
      first = std::min(first, time);
      last = std::max(last, time);
    }
  }
  charts::SvgChart chart("Time of each frame against its index, one line per camera",
                         {0, static_cast<double>(most - 1), "frame index", true},
                         {0, std::max(1.04 * seconds(last - first), 1e-3), "time, s", true});
  for (const bool odd : {false, true}) {
    for (std::size_t c = 0; c < resync.times.size(); ++c) {
      if (is_odd(resync.cameras[c]) != odd) continue;
      const auto& times = resync.times[c];
      const std::size_t step = std::max<std::size_t>(1, times.size() / 120);
      std::vector<charts::SvgChart::Point> points;
      for (std::size_t i = 0; i < times.size();
           i += i + 1 < times.size() ? std::min(step, times.size() - 1 - i) : 1) {
        if (times[i] != kExcludedTime)
          points.push_back({static_cast<double>(i), seconds(times[i] - first)});
      }
      chart.line(points, odd ? "odd" : "many");
    }
  }
  if (resync.start_up_end) {
    chart.horizontal(seconds(*resync.start_up_end - first), "start-up ends");
  }
  return chart.str();
}

std::string spread_chart(const Timeline& timeline) {
  const std::size_t bins = std::min(kMaxPoints, timeline.ticks.size());
  std::vector<charts::SvgChart::Point> points;
  double most = 0;
  for (std::size_t b = 0; b < bins; ++b) {
    const std::size_t begin = b * timeline.ticks.size() / bins;
    const std::size_t end = (b + 1) * timeline.ticks.size() / bins;
    double spread = 0;
    for (std::size_t k = begin; k < end; ++k) {
      spread = std::max(spread, static_cast<double>(timeline.ticks[k].spread()) / kNsPerMs);
    }
    most = std::max(most, spread);
    points.push_back({seconds(timeline.ticks[begin].time_ns), spread});
  }
  const double period = 1e3 / timeline.fps;
  const bool near = most > 0.4 * period;
  charts::SvgChart chart(
      "Largest difference between two cameras' frames, per tick",
      {points.front().x, points.back().x, "time of the tick, s", true},
      {0, std::max(near ? 1.08 * period : 1.15 * most, 0.01), "largest difference, ms", true});
  chart.line(points, "one");
  if (near) chart.horizontal(period, fmt::format("one tick, {:.1f} ms", period));
  return chart.str();
}

std::string losses_chart(const ResyncResult& resync) {
  const auto cameras = static_cast<double>(resync.cameras.size());
  std::int64_t most = 0;
  for (const CameraSync& camera : resync.cameras) {
    most = std::max(most, camera.dropped() + camera.lost_at_start_up());
  }
  charts::SvgChart chart("Frames lost per camera", {0, cameras, "camera", false},
                         {0, std::max(1.05 * static_cast<double>(most), 5.0), "frames lost", true});
  for (std::size_t c = 0; c < resync.cameras.size(); ++c) {
    const CameraSync& camera = resync.cameras[c];
    const double x = static_cast<double>(c);
    const auto recorded = static_cast<double>(camera.dropped() - camera.lost_unrecorded());
    const auto dropped = static_cast<double>(camera.dropped());
    const auto all = dropped + static_cast<double>(camera.lost_at_start_up());
    const std::string title =
        fmt::format("{}: {} dropped ({} not recorded), {} at start-up", camera.id, camera.dropped(),
                    camera.lost_unrecorded(), camera.lost_at_start_up());
    chart.bar(x + 0.16, x + 0.84, 0, recorded, "dropped", title);
    chart.bar(x + 0.16, x + 0.84, recorded, dropped, "unrecorded", title);
    chart.bar(x + 0.16, x + 0.84, dropped, all, "startup", title);
    // Labels every camera, or every n-th if there are too many.
    if (c % (1 + resync.cameras.size() / 80) == 0) {
      chart.x_label(x + 0.5, camera.id, resync.cameras.size() > 12);
    }
  }
  return chart.str();
}

std::string histogram(const Timeline& timeline) {
  constexpr int kBins = 60;
  double reach = 0;
  std::int64_t frames = 0;
  for (const FrameSelection& tick : timeline.ticks) {
    for (std::size_t c = 0; c < tick.frame.size(); ++c) {
      if (tick.frame[c] < 0) continue;
      reach = std::max(reach, std::abs(static_cast<double>(tick.difference[c])) / kNsPerMs);
      ++frames;
    }
  }
  reach = std::max(reach * (1 + 1e-6), 0.01);
  std::vector<double> counts(kBins, 0);
  for (const FrameSelection& tick : timeline.ticks) {
    for (std::size_t c = 0; c < tick.frame.size(); ++c) {
      if (tick.frame[c] < 0) continue;
      const double at = (static_cast<double>(tick.difference[c]) / kNsPerMs + reach) / (2 * reach);
      counts[std::min<std::size_t>(static_cast<std::size_t>(at * kBins), kBins - 1)] += 1;
    }
  }
  const double scale = 100 / std::max(1.0, static_cast<double>(frames));
  const double most = *std::ranges::max_element(counts) * scale;
  charts::SvgChart chart("Histogram of frame time minus tick time",
                         {-reach, reach, "frame minus tick, ms", true},
                         {0, std::max(1.05 * most, 0.1), "share of frames, %", true});
  for (int b = 0; b < kBins; ++b) {
    const double width = 2 * reach / kBins, left = -reach + b * width;
    chart.bar(left + 0.06 * width, left + 0.94 * width, 0, counts[b] * scale, "fill");
  }
  return chart.str();
}

std::string table(const ResyncResult& resync) {
  const TimelineStatistics statistics = timeline_statistics(resync.timeline);
  const double tick = 1e9 / resync.timeline.fps;
  std::string rows;
  const auto count = [](std::int64_t value) {
    return value == 0 ? std::string("<td>0</td>")
                      : fmt::format("<td class=\"some\">{}</td>", value);
  };
  for (std::size_t c = 0; c < resync.cameras.size(); ++c) {
    const CameraSync& camera = resync.cameras[c];
    const CameraClock& clock = resync.timeline.clocks[c];
    rows += fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td>", charts::escape_html(camera.id),
                        charts::escape_html(camera.node), camera.frames);
    if (clock.period_ns > 0) {
      const double first = static_cast<double>(resync.timeline.ticks.front().time_ns);
      rows += fmt::format("<td>{:.5f}</td><td>{:+.1f}</td><td>{:+.2f}</td><td>{:.2f}</td>",
                          1e9 / clock.period_ns, clock.drift_ppm,
                          std::remainder(clock.phase_ns - first, tick) / kNsPerMs,
                          clock.jitter_ns / kNsPerMs);
    } else {
      rows += "<td>-</td><td>-</td><td>-</td><td>-</td>";
    }
    rows += fmt::format("<td>{:+.2f}</td>", static_cast<double>(clock.offset_ns) / kNsPerMs);
    rows += count(camera.dropped()) + count(camera.lost_at_start_up()) +
            count(static_cast<std::int64_t>(camera.outliers.size())) + count(statistics.absent[c]) +
            "</tr>\n";
  }
  return "<table><thead><tr><th>camera</th><th>node</th><th>frames</th><th>rate, Hz</th>"
         "<th>drift, ppm</th><th>phase, ms</th><th>jitter, ms</th><th>offset, ms</th>"
         "<th>dropped</th><th>at start-up</th><th>outliers</th><th>absent ticks</th></tr></thead>\n"
         "<tbody>\n" +
         rows + "</tbody></table>\n";
}

std::string facts(const ResyncResult& resync) {
  const Timeline& timeline = resync.timeline;
  const TimelineStatistics statistics = timeline_statistics(timeline);
  const double all = static_cast<double>(timeline.ticks.size() * resync.cameras.size());
  const auto absent = std::reduce(statistics.absent.begin(), statistics.absent.end(), 0L);
  const auto fact = [](const std::string& number, std::string_view what) {
    return fmt::format("<div><b>{}</b>{}</div>\n", number, what);
  };
  return "<div class=\"facts\">\n" + fact(fmt::format("{:.4f} Hz", timeline.fps), "tick rate") +
         fact(std::to_string(timeline.ticks.size()), "ticks") +
         fact(std::to_string(resync.cameras.size()), "cameras") +
         fact(fmt::format("{:.1f} ms", static_cast<double>(statistics.median_spread) / kNsPerMs),
              "median spread of a tick") +
         fact(fmt::format("{:.1f} ms", static_cast<double>(statistics.max_spread) / kNsPerMs),
              "largest spread") +
         fact(fmt::format("{:.2f} %", 100 * static_cast<double>(absent) / all), "frames absent") +
         "</div>\n";
}

}  // namespace

std::string resync_report_html(const ResyncResult& resync, const std::optional<FlashOffsets>& flash,
                               std::string_view title) {
  std::string body;
  body += "<ul class=\"verdict\">\n";
  for (const std::string& sentence : resync_findings(resync, flash)) {
    body += fmt::format("<li>{}</li>\n", charts::escape_html(sentence));
  }
  body += "</ul>\n" + facts(resync);
  body += charts::html_section(
      "Frame times",
      "Time since the first frame of the take against the index of each stored frame, one line per "
      "camera. Equal slopes are equal rates; a line above the others means lost frames. Red: "
      "cameras with a late start, an early end, a phase step or no constant rate.",
      arrival_chart(resync));
  body += charts::html_section(
      "Time spread of each tick",
      "Latest minus earliest frame of each tick. Frames of free-running cameras "
      "differ by up to one frame time; frames further away are not used.",
      spread_chart(resync.timeline));
  body += charts::html_section(
      "Frames lost, per camera",
      "<span class=\"key\"><i style=\"background:var(--amber)\"></i>recorded in the journal"
      "<i style=\"background:var(--red)\"></i>not recorded: found by the camera's clock fit"
      "<i style=\"background:var(--grey)\"></i>during start-up</span>",
      losses_chart(resync));
  body += charts::html_section("Frame time minus tick time", "Over all frames that a tick uses.",
                               histogram(resync.timeline));
  body += charts::html_section(
      "Cameras",
      "Rate; drift relative to the array; phase relative to the ticks, in the middle of the take; "
      "jitter of the time stamps (one sigma); clock offset (subtracted).",
      table(resync));
  return charts::html_page(fmt::format("{}: resynchronisation", title),
                           "Resynchronisation of the take's cameras", body, kStyle);
}

}  // namespace raystage::store
