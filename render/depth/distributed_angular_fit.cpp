// SPDX-License-Identifier: Apache-2.0
// Fits a view of several hosts over the positions of the cameras (angular_fit.cpp). Host 0 gathers
// the samples of the rows that are measured, decides where the fit counts and sends this to the
// others; then it gathers the samples of these pixels and fits them. It thus computes from the same
// values in the same order as one host alone. Traffic: six floats per camera and pixel, of one row
// in eight and of what is fitted.
#include "render/depth/distributed_angular_fit.h"

#include <algorithm>
#include <functional>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "render/depth/angular_fit.h"
#include "render/depth/host_messages.h"

namespace raystage::render::depth {
namespace {

using Message = RankCommunicator::Message;
using Tile = BlendingField::Tile;

/// Samples of some of a tile's cameras in its wanted rows: per camera and row 4 samples, weight and
/// visibility of kMaxRunPixels pixels.
struct GatheredTile {
  std::vector<int> rows;              ///< of the view
  std::vector<std::int32_t> cameras;  ///< by index in the tile
  std::vector<float> values;
};
constexpr std::size_t kGatheredRun = 6 * static_cast<std::size_t>(kMaxRunPixels);

class DistributedAngularFit {
 public:
  DistributedAngularFit(const ViewRequest& request, const DepthViewPlan& plan,
                        const ViewSources& sources, const RankCommunicator& group)
      : plan_(plan), sources_(sources), group_(group), fit_(request, plan) {}

  void fit(std::span<const TileRows> bands, int width, PixelValues& plane) {
    for (const TileRows band : bands) {
      gather(
          band, [](const Tile&, int y) { return AngularStrengths::is_measured(y); },
          [&](const Tile& tile, const AngularFit::Row& row) {
            AngularFitResult result;
            fit_.solve(tile, row, result);
            fit_.measure(tile, row.y, result);
          });
    }
    fit_.strengths().decide();
    tell_strengths();
    for (const TileRows band : bands) {
      gather(
          band,
          [&](const Tile& tile, int y) {
            std::array<float, kMaxRunPixels> strengths;
            return fit_.strengths().reaches(tile) &&
                   fit_.strengths_of_row(tile, y, {strengths.data(), columns_of(tile)});
          },
          [&](const Tile& tile, const AngularFit::Row& row) {
            std::array<float, kMaxRunPixels> strengths;
            const std::size_t n = columns_of(tile);
            fit_.strengths_of_row(tile, row.y, {strengths.data(), n});
            const std::size_t at = static_cast<std::size_t>(row.y) * width + tile.left;
            AngularFitResult result;
            fit_.solve(tile, row, result);
            weigh_angular_fit(result.rgba, {strengths.data(), n}, {&plane[4 * at], 4 * n});
          });
    }
  }

 private:
  using WantsRow = std::function<bool(const Tile&, int y)>;
  using UseRow = std::function<void(const Tile&, const AngularFit::Row&)>;

  static std::size_t columns_of(const Tile& tile) {
    return static_cast<std::size_t>(tile.right - tile.left);
  }

  const Tile& tile_of(TileRows band, std::size_t i) const {
    return plan_.field.tiles()[static_cast<std::size_t>(band.first) * plan_.field.columns() + i];
  }

  /// Sends the strengths of host 0 to the others.
  void tell_strengths() {
    std::vector<Message> messages(static_cast<std::size_t>(group_.size()));
    const std::span<float> strengths = fit_.strengths().by_cell();
    for (std::size_t host = 1; group_.rank() == 0 && host < messages.size(); ++host) {
      messages[host].reserve(strengths.size_bytes() + RankCommunicator::kTrailerBytes);
      append_values(std::span<const float>(strengths), messages[host]);
    }
    const std::vector<Message> received = group_.exchange(std::move(messages));
    if (group_.rank() == 0) return;
    std::span<const std::byte> rest(received[0]);
    take_values(rest, strengths);
  }

  /// Calls use(tile, row) on host 0 for the wanted rows of a band, in parallel over tiles, with the
  /// samples of all hosts' cameras.
  void gather(TileRows band, const WantsRow& wants, const UseRow& use) {
    const auto count = static_cast<std::size_t>(band.end - band.first) * plan_.field.columns();
    std::vector<GatheredTile> own(count);
    raystage::parallel_for(std::size_t{0}, count,
                           [&](std::size_t i) { own[i] = sampled(tile_of(band, i), wants); });
    std::vector<Message> messages(static_cast<std::size_t>(group_.size()));
    if (group_.rank() != 0) pack(band, own, messages[0]);
    const std::vector<Message> received = group_.exchange(std::move(messages));
    if (group_.rank() != 0) return;
    std::vector<std::vector<GatheredTile>> of_hosts;
    for (std::size_t host = 1; host < received.size(); ++host) {
      of_hosts.push_back(unpacked(band, own, received[host]));
    }
    of_hosts.push_back(std::move(own));
    raystage::parallel_for(std::size_t{0}, count,
                           [&](std::size_t i) { use_tile(tile_of(band, i), i, of_hosts, use); });
  }

  /// Returns the samples of this host's cameras.
  GatheredTile sampled(const Tile& tile, const WantsRow& wants) const {
    GatheredTile result;
    if (!fit_.may_fit(tile)) return result;
    for (int y = tile.top; y < tile.bottom; ++y) {
      if (wants(tile, y)) result.rows.push_back(y);
    }
    if (result.rows.empty()) return result;
    for (std::size_t c = 0; c < tile.cameras.size(); ++c) {
      if (sources_[tile.cameras[c].camera].frame) {
        result.cameras.push_back(static_cast<std::int32_t>(c));
      }
    }
    result.values.resize(result.cameras.size() * result.rows.size() * kGatheredRun);
    float* at = result.values.data();
    for (const std::int32_t c : result.cameras) {
      for (const int y : result.rows) {
        const PixelRun pixels{
            tile.left, y, {&plan_.view_depths.at(tile.left, y), columns_of(tile)}};
        sample_camera(
            sources_, plan_, tile, tile.cameras[c], pixels,
            {at, at + std::ptrdiff_t{4} * kMaxRunPixels, at + std::ptrdiff_t{5} * kMaxRunPixels});
        at += kGatheredRun;
      }
    }
    return result;
  }

  void pack(TileRows band, const std::vector<GatheredTile>& tiles, Message& message) const {
    std::size_t bytes = 0;
    for (std::size_t i = 0; i < tiles.size(); ++i) {
      bytes +=
          (1 + tiles[i].cameras.size()) * sizeof(std::int32_t) +
          tiles[i].values.size() / kMaxRunPixels * columns_of(tile_of(band, i)) * sizeof(float);
    }
    message.reserve(bytes + RankCommunicator::kTrailerBytes);
    for (std::size_t i = 0; i < tiles.size(); ++i) {
      const auto cameras = static_cast<std::int32_t>(tiles[i].cameras.size());
      append_values(std::span(&cameras, 1), message);
      append_values(std::span<const std::int32_t>(tiles[i].cameras), message);
      const std::size_t n = columns_of(tile_of(band, i));
      const std::span<const float> values(tiles[i].values);
      for (std::size_t at = 0; at < values.size(); at += kGatheredRun) {
        append_values(values.subspan(at, 4 * n), message);
        append_values(values.subspan(at + std::size_t{4} * kMaxRunPixels, n), message);
        append_values(values.subspan(at + std::size_t{5} * kMaxRunPixels, n), message);
      }
    }
  }

  std::vector<GatheredTile> unpacked(TileRows band, const std::vector<GatheredTile>& own,
                                     const Message& message) const {
    std::vector<GatheredTile> tiles(own.size());
    std::span<const std::byte> rest(message);
    for (std::size_t i = 0; i < tiles.size(); ++i) {
      const Tile& tile = tile_of(band, i);
      const auto cameras = static_cast<std::size_t>(take_values<std::int32_t>(rest, 1)[0]);
      const auto is_bad = [&](auto index) {
        return index < 0 || static_cast<std::size_t>(index) >= tile.cameras.size();
      };
      if (cameras <= tile.cameras.size()) {
        tiles[i].cameras = take_values<std::int32_t>(rest, cameras);
      }
      if (cameras > tile.cameras.size() || std::ranges::any_of(tiles[i].cameras, is_bad)) {
        throw Error::failed("a message from another host has cameras that the view does not use",
                            "method depth", "Check that all hosts run the same program");
      }
      tiles[i].values.resize(cameras * own[i].rows.size() * kGatheredRun);
      const std::size_t n = columns_of(tile);
      const std::span<float> values(tiles[i].values);
      for (std::size_t at = 0; at < values.size(); at += kGatheredRun) {
        take_values(rest, values.subspan(at, 4 * n));
        take_values(rest, values.subspan(at + std::size_t{4} * kMaxRunPixels, n));
        take_values(rest, values.subspan(at + std::size_t{5} * kMaxRunPixels, n));
      }
    }
    return tiles;
  }

  void use_tile(const Tile& tile, std::size_t i,
                const std::vector<std::vector<GatheredTile>>& of_hosts, const UseRow& use) const {
    const std::vector<int>& rows = of_hosts.back()[i].rows;
    if (rows.empty()) return;
    const std::vector<AngularOffset> offsets = fit_.offsets(tile);
    std::vector<const float*> of_camera(tile.cameras.size(), nullptr);
    for (const std::vector<GatheredTile>& tiles : of_hosts) {
      for (std::size_t c = 0; c < tiles[i].cameras.size(); ++c) {
        of_camera[static_cast<std::size_t>(tiles[i].cameras[c])] =
            tiles[i].values.data() + c * rows.size() * kGatheredRun;
      }
    }
    std::vector<const float*> samples, weights, visible;
    std::vector<AngularOffset> offset_of;
    for (std::size_t row = 0; row < rows.size(); ++row) {
      samples.clear();
      weights.clear();
      visible.clear();
      offset_of.clear();
      for (std::size_t c = 0; c < of_camera.size(); ++c) {
        if (of_camera[c] == nullptr) continue;
        const float* at = of_camera[c] + row * kGatheredRun;
        samples.push_back(at);
        weights.push_back(at + std::ptrdiff_t{4} * kMaxRunPixels);
        visible.push_back(at + std::ptrdiff_t{5} * kMaxRunPixels);
        offset_of.push_back(offsets[c]);
      }
      use(tile, {rows[row], samples, weights, visible, offset_of});
    }
  }

  const DepthViewPlan& plan_;
  const ViewSources& sources_;
  const RankCommunicator& group_;
  AngularFit fit_;
};

}  // namespace

void fit_angular_together(const ViewRequest& request, const DepthViewPlan& plan,
                          const ViewSources& sources, const RankCommunicator& group,
                          std::span<const TileRows> bands, PixelValues& plane) {
  DistributedAngularFit(request, plan, sources, group).fit(bands, request.view.width, plane);
}

}  // namespace raystage::render::depth
