// SPDX-License-Identifier: Apache-2.0
// Reads the focus distances of a view from channel Z of an EXR file (metres), as inverse depths in
// 1/m, and repeats them for supersampled views. Cost: O(pixels of the file), once per file.
#include "render/planar/depth_map.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "images/exr_reader.h"

namespace raystage::render {
namespace {

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

}  // namespace

DepthMap read_depth_map(const std::filesystem::path& file) {
  constexpr images::ExrChannel kChannels[] = {{"Z"}};
  const images::ExrChannelData depths = images::read_exr_channels(
      file, kChannels, "Use a flat EXR file with planar depths in metres in channel Z");
  DepthMap map{depths.width, depths.height, {}};
  map.inverse.reserve(depths.values.size() + DepthMap::kReadPadding);
  for (const float depth : depths.values) {
    const float inverse = 1 / depth;
    map.inverse.push_back(depth > 0 && std::isfinite(inverse) ? inverse : kNone);
  }
  map.inverse.resize(map.inverse.size() + DepthMap::kReadPadding, kNone);
  return map;
}

std::filesystem::path depth_map_file(const MethodOptions& options, const store::Take& take) {
  const std::string& name = options.text("depth_map");
  return name.empty() ? std::filesystem::path() : take.folder() / name;
}

const float* ViewDepths::run(int begin, int end, int y, std::vector<float>& scratch) const {
  const float* row = map_->row(first_row_ + y / factor_);
  if (factor_ == 1) return row + begin;
  const auto count = static_cast<std::size_t>(end - begin);
  scratch.resize(count + DepthMap::kReadPadding);
  for (int x = begin; x < end; ++x) scratch[x - begin] = row[x / factor_];
  std::fill_n(scratch.begin() + (end - begin), DepthMap::kReadPadding, kNone);
  return scratch.data();
}

std::optional<ViewDepths> make_view_depths(const ViewRequest& request) {
  const auto file = depth_map_file(request.options, *request.instant.take);
  if (file.empty()) return std::nullopt;
  const auto read = [&file](std::size_t& bytes) {
    auto map = std::make_shared<const DepthMap>(read_depth_map(file));
    bytes = map->inverse.size() * sizeof(float);
    return map;
  };
  const auto map = request.result_cache.get<DepthMap>("depth map " + file.string(), read);
  const int factor = request.supersampling;
  const int width = request.view.width / factor;
  const int height = request.full_height > 0 ? request.full_height : request.view.height / factor;
  if (width != map->width || height != map->height) {
    throw Error::bad_input(fmt::format("the depth map has {} x {} pixels, but the view has {} x {}",
                                       map->width, map->height, width, height),
                           file.string(), "Use a depth map of the view's size");
  }
  return ViewDepths(map, factor, request.first_row);
}

}  // namespace raystage::render
