// SPDX-License-Identifier: Apache-2.0
#include "render/planar/depth_map.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "images/exr/exr_channels.h"
#include "schemas/error.h"

namespace raystage {
namespace {

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

}  // namespace

DepthMap read_depth_map(const std::filesystem::path& file) {
  constexpr ExrChannel kChannels[] = {{"Z"}};
  const ExrPixels depths = read_exr_channels(
      file, kChannels,
      "Give as depth map a flat EXR file with planar depths, metres, in channel Z");
  DepthMap map{depths.width, depths.height, {}};
  map.inverse.reserve(depths.values.size() + DepthMap::kRoom);
  for (const float depth : depths.values) {
    const float inverse = 1 / depth;
    map.inverse.push_back(depth > 0 && std::isfinite(inverse) ? inverse : kNone);
  }
  map.inverse.resize(map.inverse.size() + DepthMap::kRoom, kNone);
  return map;
}

DepthMap repeated(const DepthMap& map, int factor) {
  DepthMap large;
  large.width = map.width * factor;
  large.height = map.height * factor;
  large.inverse.reserve(static_cast<std::size_t>(large.width) *
                            static_cast<std::size_t>(large.height) +
                        DepthMap::kRoom);
  for (int y = 0; y < large.height; ++y) {
    for (int x = 0; x < large.width; ++x) large.inverse.push_back(map.row(y / factor)[x / factor]);
  }
  large.inverse.resize(large.inverse.size() + DepthMap::kRoom, kNone);
  return large;
}

std::filesystem::path depth_map_file(const MethodOptions& options, const Take& take) {
  const std::string& name = options.text("depth_map");
  return name.empty() ? std::filesystem::path() : take.folder() / name;
}

std::shared_ptr<const DepthMap> depth_map_of(const ViewRequest& request) {
  const auto file = depth_map_file(request.options, *request.instant.take);
  if (file.empty()) return nullptr;
  const auto read = [&file](std::size_t& bytes) {
    auto map = std::make_shared<const DepthMap>(read_depth_map(file));
    bytes = map->inverse.size() * sizeof(float);
    return map;
  };
  const auto map = request.kept.get<DepthMap>("depth map " + file.string(), read);
  const VirtualCamera& view = request.view;
  const int factor = request.supersampling;
  if (view.width != factor * map->width || view.height != factor * map->height) {
    throw Error::bad_input(
        fmt::format("the depth map has {} x {} pixels, the view {} x {}", map->width, map->height,
                    view.width / factor, view.height / factor),
        file.string(), "Give a depth map of the view's own size");
  }
  return factor == 1 ? map : std::make_shared<const DepthMap>(repeated(*map, factor));
}

}  // namespace raystage
