// SPDX-License-Identifier: Apache-2.0
// Reads clock offsets of nodes and cameras from a JSON file (milliseconds; converted to ns) and
// adds those measured by flashes.
#include "store/processing/sync/node_offsets.h"

#include <algorithm>
#include <cmath>

#include "base/atomic_file.h"
#include "schemas/json_text.h"

namespace raystage::store {
namespace {

constexpr double kMaxMs = 86'400'000;  // a day

}  // namespace

std::vector<Nanoseconds> parse_node_offsets(std::string_view text, std::string_view name,
                                            const std::vector<CameraTimestamps>& cameras) {
  const nlohmann::json json = schemas::parse_json(text, name);
  if (!json.is_object()) {
    throw schemas::json_value_error(
        name, "",
        "found " + schemas::describe_json_value(json) + ", allowed: an object {\"node\": ms}",
        "Write the clock offset of each node in milliseconds");
  }
  std::vector<Nanoseconds> offsets(cameras.size(), 0);
  // Nodes first, so that a camera's own entry replaces that of its node.
  for (const bool of_node : {true, false}) {
    for (const auto& item : json.items()) {
      const std::string& key = item.key();
      const nlohmann::json& value = item.value();
      const auto matches = [&](const CameraTimestamps& camera) {
        return of_node ? camera.node == key && !key.empty() : camera.id == key;
      };
      const auto known = [&](const CameraTimestamps& camera) {
        return (camera.node == key && !key.empty()) || camera.id == key;
      };
      if (std::ranges::none_of(cameras, known)) {
        throw schemas::json_value_error(name, schemas::append_json_pointer("", key),
                                        "no node or camera has this name",
                                        "Use the names in take.json");
      }
      if (!value.is_number() || std::abs(value.get<double>()) > kMaxMs) {
        throw schemas::json_value_error(name, schemas::append_json_pointer("", key),
                                        "found " + schemas::describe_json_value(value) +
                                            ", allowed: at most a day (86400000 ms)",
                                        "Write the clock offset in milliseconds (positive: ahead)");
      }
      for (std::size_t c = 0; c < cameras.size(); ++c) {
        if (matches(cameras[c])) offsets[c] = std::llround(value.get<double>() * kNsPerMs);
      }
    }
  }
  return offsets;
}

std::vector<Nanoseconds> read_node_offsets(const std::filesystem::path& file,
                                           const std::vector<CameraTimestamps>& cameras) {
  return parse_node_offsets(read_file(file), file.string(), cameras);
}

void add_offsets(const FlashOffsets& flash, bool per_node,
                 const std::vector<CameraTimestamps>& cameras, std::vector<Nanoseconds>& offsets) {
  offsets.resize(cameras.size(), 0);
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const bool by_node = per_node && !cameras[c].node.empty();
    const std::string& member = by_node ? cameras[c].node : cameras[c].id;
    const auto found = std::ranges::find(flash.groups, member, &FlashOffset::group);
    if (found != flash.groups.end()) offsets[c] += found->offset;
  }
}

}  // namespace raystage::store
