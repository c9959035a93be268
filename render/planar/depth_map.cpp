// SPDX-License-Identifier: Apache-2.0
#include "render/planar/depth_map.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfInputFile.h>
#include <fmt/format.h>

#include <cmath>
#include <cstdint>

#include "schemas/error.h"

namespace raystage {
namespace {

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

DepthMap read_open_file(Imf::InputFile& input, const std::filesystem::path& file) {
  const Imf::Header& header = input.header();
  if (header.channels().findChannel("Z") == nullptr) {
    throw Error::bad_input("the depth map has no channel Z", file.string(),
                           "Give an EXR file with planar depths, metres, in channel Z");
  }
  const Imath::Box2i data = header.dataWindow(), display = header.displayWindow();
  constexpr std::int64_t kMostPixels = std::int64_t{1} << 28;
  const auto area = [](const Imath::Box2i& box) {
    return (std::int64_t{box.max.x} - box.min.x + 1) * (std::int64_t{box.max.y} - box.min.y + 1);
  };
  if (area(data) > kMostPixels || area(display) > kMostPixels) {
    throw Error::bad_input("the depth map is larger than 2^28 pixels", file.string(),
                           "Give one of the view's size");
  }
  const std::intptr_t columns = data.max.x - data.min.x + 1;
  std::vector<float> z(static_cast<std::size_t>(area(data)));
  constexpr std::intptr_t kBytes = sizeof(float);
  // OpenEXR takes the address of pixel (0, 0), which may lie outside the memory: as a number.
  const std::intptr_t origin =
      reinterpret_cast<std::intptr_t>(z.data()) - (data.min.y * columns + data.min.x) * kBytes;
  Imf::FrameBuffer buffer;
  buffer.insert("Z", Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(origin), kBytes,
                                static_cast<std::size_t>(columns * kBytes)));
  input.setFrameBuffer(buffer);
  input.readPixels(data.min.y, data.max.y);

  DepthMap map;
  map.width = display.max.x - display.min.x + 1;
  map.height = display.max.y - display.min.y + 1;
  map.inverse.reserve(static_cast<std::size_t>(area(display)) + DepthMap::kRoom);
  for (int y = display.min.y; y <= display.max.y; ++y) {
    for (int x = display.min.x; x <= display.max.x; ++x) {
      const bool there = x >= data.min.x && x <= data.max.x && y >= data.min.y && y <= data.max.y;
      const float depth =
          there ? z[static_cast<std::size_t>((y - data.min.y) * columns + (x - data.min.x))] : 0;
      const float inverse = 1 / depth;
      map.inverse.push_back(depth > 0 && std::isfinite(inverse) ? inverse : kNone);
    }
  }
  map.inverse.resize(map.inverse.size() + DepthMap::kRoom, kNone);
  return map;
}

}  // namespace

DepthMap read_depth_map(const std::filesystem::path& file) {
  constexpr int kNoThreads = 0;
  try {
    Imf::InputFile input(file.c_str(), kNoThreads);
    return read_open_file(input, file);
  } catch (const Error&) {
    throw;
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& error) {
    throw Error::bad_input(std::string("the depth map cannot be read: ") + error.what(),
                           file.string(), "Give a flat EXR file");
  }
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
