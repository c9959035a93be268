// SPDX-License-Identifier: Apache-2.0
// Reads and writes detections as a table of text lines: camera, frame, u, v in pixels. Cost:
// O(detections log detections) for their sorting.
#include "calibrate/geometry/detections.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <tuple>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/number_text.h"

namespace raystage::calibrate {
namespace {

constexpr std::string_view kHeader = "camera,frame,u,v";

std::string_view trimmed(std::string_view text) {
  const auto is_space = [](char c) { return c == ' ' || c == '\t' || c == '\r'; };
  while (!text.empty() && is_space(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_space(text.back())) text.remove_suffix(1);
  return text;
}

/// Returns the first four fields; missing ones are empty.
std::array<std::string_view, 4> fields_of(std::string_view line) {
  std::array<std::string_view, 4> fields{};
  for (std::string_view& field : fields) {
    const std::size_t comma = line.find(',');
    field = trimmed(line.substr(0, comma));
    if (comma == std::string_view::npos) break;
    line.remove_prefix(comma + 1);
  }
  return fields;
}

}  // namespace

Detections parse_detections(std::string_view text, std::string_view name,
                            const schemas::DetectionsDocument& cameras) {
  std::map<std::string, int, std::less<>> index_of;
  for (const auto& camera : cameras.cameras) {
    index_of.emplace(camera.id, static_cast<int>(index_of.size()));
  }
  Detections result{cameras.cameras, {}};
  int number = 0;
  bool has_header = false;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::string_view line = trimmed(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
    ++number;
    const auto refuse = [&](const std::string& what, const char* what_to_do) {
      return Error::bad_input(what, fmt::format("{}:{}", name, number), what_to_do);
    };
    if (line.empty()) continue;
    if (!has_header) {
      has_header = line.substr(0, kHeader.size()) == kHeader;
      if (!has_header) {
        throw refuse("found no header", "Begin the table with the line camera,frame,u,v");
      }
      continue;
    }
    const auto [id, frame, u, v] = fields_of(line);
    const auto camera = index_of.find(id);
    if (camera == index_of.end()) {
      throw refuse(fmt::format("the camera \"{}\" is not in the document of the cameras", id),
                   "Add the camera to the document, or remove the line");
    }
    const auto point = parse_number<int>(frame);
    const auto x = parse_number<double>(u), y = parse_number<double>(v);
    if (!point || *point < 0 || !x || !y || !std::isfinite(*x) || !std::isfinite(*y)) {
      throw refuse("the line is not camera,frame,u,v with a frame number and two finite numbers",
                   "Correct the line");
    }
    const auto& size = cameras.cameras[camera->second];
    if (*x < -size.width || *x > 2 * size.width || *y < -size.height || *y > 2 * size.height) {
      throw refuse(fmt::format("({}, {}) is far outside the picture of {} x {} pixels", *x, *y,
                               size.width, size.height),
                   "Correct the line, or the size of the camera's pictures");
    }
    result.detections.push_back({camera->second, *point, {*x, *y}});
  }
  const auto place = [](const Detections::Detection& d) { return std::tuple(d.point, d.camera); };
  std::ranges::stable_sort(result.detections, {}, place);
  const auto twice = std::ranges::adjacent_find(result.detections, {}, place);
  if (twice != result.detections.end()) {
    throw Error::bad_input(fmt::format("camera {} has two detections in frame {}",
                                       cameras.cameras[twice->camera].id, twice->point),
                           std::string(name), "Remove one of them");
  }
  return result;
}

std::string format_detections(const Detections& detections) {
  std::string text = fmt::format("{}\n", kHeader);
  for (const Detections::Detection& d : detections.detections) {
    text += fmt::format("{},{},{},{}\n", detections.cameras[d.camera].id, d.point, d.pixel.x(),
                        d.pixel.y());
  }
  return text;
}

Detections read_detections(const std::filesystem::path& table,
                           const schemas::DetectionsDocument& cameras) {
  return parse_detections(read_file(table), table.string(), cameras);
}

void write_detections(const Detections& detections, const std::filesystem::path& table) {
  write_file_atomically(table, format_detections(detections));
}

}  // namespace raystage::calibrate
