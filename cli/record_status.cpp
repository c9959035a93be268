// SPDX-License-Identifier: Apache-2.0
#include "cli/record_status.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "schemas/json_text.h"

namespace raystage::cli {
namespace {

constexpr double kMegabyte = 1e6;
constexpr std::size_t kFew = 4;    // largest number of cameras that are listed each
constexpr std::size_t kNamed = 3;  // number of listed cameras of many, the worst
constexpr double kLagging = 0.9;   // relative to the median rate

const char* word_of(ingest::CameraCounters::State state) {
  switch (state) {
    case ingest::CameraCounters::State::kRunning:
      return "running";
    case ingest::CameraCounters::State::kLost:
      return "lost";
    case ingest::CameraCounters::State::kEnded:
      return "ended";
  }
  return "unknown";
}

std::string camera_text(const ingest::RecorderStatus::Camera& camera) {
  std::string text = fmt::format("{} {:.1f}", camera.id, camera.fps);
  if (camera.state != ingest::CameraCounters::State::kRunning) {
    text += fmt::format(" {}", word_of(camera.state));
  }
  if (camera.dropped > 0) text += fmt::format(" -{}", camera.dropped);
  return text;
}

/// Returns the median rate and the cameras that need attention.
std::string many_cameras_text(const std::vector<ingest::RecorderStatus::Camera>& cameras) {
  std::vector<double> rates;
  for (const auto& camera : cameras) rates.push_back(camera.fps);
  const auto middle = rates.begin() + static_cast<std::ptrdiff_t>(rates.size() / 2);
  std::nth_element(rates.begin(), middle, rates.end());
  const double median = *middle;
  std::string text = fmt::format("{} cameras at {:.1f} fps", cameras.size(), median);
  std::vector<const ingest::RecorderStatus::Camera*> worst;
  for (const auto& camera : cameras) {
    if (camera.dropped > 0 || camera.state == ingest::CameraCounters::State::kLost ||
        camera.fps < kLagging * median) {
      worst.push_back(&camera);
    }
  }
  std::ranges::stable_sort(worst, std::ranges::greater{}, [](const auto* c) { return c->dropped; });
  for (std::size_t i = 0; i < std::min(worst.size(), kNamed); ++i) {
    text += (i == 0 ? " (" : ", ") + camera_text(*worst[i]);
  }
  if (worst.size() > kNamed) text += fmt::format(", {} more", worst.size() - kNamed);
  return worst.empty() ? text : text + ")";
}

}  // namespace

std::string format_duration(double seconds) {
  constexpr double kMinute = 60, kHour = 3600;
  const auto whole = static_cast<std::int64_t>(seconds);
  if (seconds >= 100 * kHour) return "over 100 h";
  if (seconds >= kHour) return fmt::format("{} h {:02} min", whole / 3600, whole / 60 % 60);
  if (seconds >= kMinute) return fmt::format("{} min {:02} s", whole / 60, whole % 60);
  return fmt::format("{} s", whole);
}

std::string status_line(const ingest::RecorderStatus& status) {
  std::string text = fmt::format("{:.0f} s  ", status.seconds);
  if (status.cameras.size() <= kFew) {
    for (const auto& camera : status.cameras) text += camera_text(camera) + " fps  ";
  } else {
    text += many_cameras_text(status.cameras) + "  ";
  }
  std::uint64_t dropped = 0, skipped = 0;
  for (const auto& camera : status.cameras) {
    dropped += camera.dropped;
    skipped += camera.skipped_by_source;
  }
  text += fmt::format("dropped {}", dropped);
  if (skipped > 0) text += fmt::format(" (sources {})", skipped);
  text += fmt::format("  RAM {:.0f} of {:.0f} MB  disk {:.1f} MB/s",
                      static_cast<double>(status.memory_used) / kMegabyte,
                      static_cast<double>(status.memory_limit) / kMegabyte,
                      status.write_bytes_per_s / kMegabyte);
  if (status.seconds_left) text += "  " + format_duration(*status.seconds_left) + " left";
  if (!status.write_error.empty()) text += "  DISK: " + status.write_error;
  for (const auto& copy : status.copies) {
    if (!copy.stop_reason.empty()) text += "  STOPPED: " + copy.folder.string();
  }
  return text;
}

std::string status_json(const ingest::RecorderStatus& status) {
  nlohmann::ordered_json json{{"seconds", status.seconds},
                              {"memory_used_bytes", status.memory_used},
                              {"memory_limit_bytes", status.memory_limit},
                              {"written_bytes_per_second", status.write_bytes_per_s}};
  if (status.seconds_left) {
    json["seconds_left"] = *status.seconds_left;
  } else {
    json["seconds_left"] = nullptr;
  }
  json["trouble"] = status.write_error;
  for (const auto& copy : status.copies) {
    json["copies"].push_back({{"folder", copy.folder.string()},
                              {"stopped", copy.stop_reason},
                              {"trouble", copy.write_error},
                              {"waiting_bytes", copy.waiting}});
  }
  auto& cameras = json["cameras"] = nlohmann::ordered_json::array();
  for (const auto& camera : status.cameras) {
    cameras.push_back({{"id", camera.id},
                       {"state", word_of(camera.state)},
                       {"fps", camera.fps},
                       {"arrived", camera.arrived},
                       {"stored", camera.stored},
                       {"dropped", camera.dropped},
                       {"skipped_by_source", camera.skipped_by_source},
                       {"in_memory", camera.in_memory}});
  }
  return schemas::dump_json(json, -1);
}

std::string format_session_summary(const schemas::RecordingDocument::Session& session) {
  std::uint64_t arrived = 0, stored = 0, skipped = 0;
  std::map<std::string, std::uint64_t> dropped;
  std::string cameras;
  for (const schemas::RecordingDocument::Camera& camera : session.cameras) {
    arrived += camera.arrived;
    stored += camera.stored;
    skipped += camera.skipped_by_source;
    std::string reasons;
    for (const auto& [reason, count] : camera.dropped) {
      dropped[reason] += count;
      reasons += fmt::format(", {} {}", count, reason);
    }
    if (camera.skipped_by_source > 0) {
      reasons += fmt::format(", {} skipped by the source", camera.skipped_by_source);
    }
    if (camera.arrived == 0) reasons += ", sent no frame";
    if (reasons.empty() && camera.events.empty() && camera.arrived > 0) continue;
    cameras += fmt::format("  {:<10}{} received, {} stored{}\n", camera.id, camera.arrived,
                           camera.stored, reasons);
    for (const schemas::RecordingDocument::Event& event : camera.events) {
      cameras += fmt::format("            {}: {}\n", format_utc(event.time_utc), event.what);
    }
  }
  std::string text = fmt::format("{} cameras: {} frames received = {} stored",
                                 session.cameras.size(), arrived, stored);
  for (const auto& [reason, count] : dropped) text += fmt::format(" + {} {}", count, reason);
  text += skipped > 0 ? fmt::format("; {} more skipped by the sources\n", skipped) : "\n";
  if (const Nanoseconds late = session.late(); late > 0) {
    text +=
        fmt::format("Recording started {:.1f} s after --start-at: the frames before are missing.\n",
                    static_cast<double>(late) * 1e-9);
  }
  text += cameras;
  for (const auto& copy : session.copies) {
    if (copy.complete) continue;
    text += fmt::format("THIS COPY IS INCOMPLETE: {}: {}\n", copy.folder, copy.problem);
    text += "Run `raystage repair` on it with the other copy (--from).\n";
  }
  if (session.audit) {
    text += session.audit->holds ? "The audit passed.\n" : "THE AUDIT FAILED:\n";
    for (const std::string& complaint : session.audit->problems) {
      text += "  " + complaint + "\n";
    }
  }
  return text;
}

}  // namespace raystage::cli
