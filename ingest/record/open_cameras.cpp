// SPDX-License-Identifier: Apache-2.0
#include "ingest/record/open_cameras.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "base/error.h"
#include "base/parallel.h"
#include "ingest/sources/configuration_error.h"
#include "ingest/sources/ffmpeg_source.h"

namespace raystage::ingest {
namespace {

/// Stands for a camera that could not be opened. Its description is a guess until the camera comes.
class AbsentSource final : public FrameSource {
 public:
  AbsentSource(SourceDescription description, std::size_t memory_overhead,
               bool survives_failed_allocations)
      : description_(std::move(description)),
        memory_overhead_(memory_overhead),
        survives_failed_allocations_(survives_failed_allocations) {}

  const SourceDescription& description() const override { return description_; }
  Outcome next(SourceFrame& /*frame*/, std::chrono::milliseconds /*patience*/) override {
    return Outcome::kLost;
  }
  std::string loss_reason() const override { return description_.what; }
  std::size_t memory_overhead() const override { return memory_overhead_; }
  bool survives_failed_allocations() const override { return survives_failed_allocations_; }

 private:
  SourceDescription description_;
  std::size_t memory_overhead_;
  bool survives_failed_allocations_;
};

/// A source, or why there is none.
struct Attempt {
  std::unique_ptr<FrameSource> source;
  std::optional<Error> failure;
  bool is_configuration = false;  ///< another attempt would fail in the same way

  void fail(Error error) {
    failure = std::move(error);
    source = nullptr;
  }
};

const schemas::CameraGeometry* find_geometry(const schemas::RigDocument* rig,
                                             const std::string& id) {
  if (rig == nullptr) return nullptr;
  const auto found =
      std::ranges::find(rig->cameras, id, [](const auto& camera) { return camera.geometry.id; });
  return found == rig->cameras.end() ? nullptr : &found->geometry;
}

std::size_t pixels_of(const SourceDescription& source) {
  return static_cast<std::size_t>(source.width) * static_cast<std::size_t>(source.height);
}

Attempt attempt(const schemas::RecordConfig::Camera& camera, const OpenFrameSource& open,
                const schemas::CameraGeometry* geometry) {
  Attempt result;
  try {
    result.source = open(camera);
  } catch (const ConfigurationError& error) {
    result.fail(error);
    result.is_configuration = true;
    return result;
  } catch (const Error& error) {
    result.fail(error);
    return result;
  } catch (const std::exception& error) {  // whatever a camera's data make of a library
    result.fail(Error::failed(std::string("the source cannot be opened: ") + error.what(),
                              camera.id, "Check the camera"));
    return result;
  }
  const SourceDescription& source = result.source->description();
  if (source.width <= 0 || source.height <= 0) {
    result.fail(Error::failed("the source does not report the size of its frames", camera.id,
                              "Check that it sends whole pictures, or set the size in the "
                              "source's options"));
  } else if (geometry != nullptr &&
             (geometry->width != source.width || geometry->height != source.height)) {
    result.fail(Error::bad_input(
        fmt::format("camera \"{}\" is {} x {} pixels, but its source delivers {} x {}", camera.id,
                    geometry->width, geometry->height, source.width, source.height),
        camera.id, "Set the source to the size in the rig, or correct the rig"));
  }
  return result;
}

/// Makes cameras absent whose frames are much larger than those of most others, if the memory does
/// not suffice for all: one camera that states a wrong size must not end the recording.
void leave_out_oversized(const schemas::RecordConfig& config, std::vector<Attempt>& attempts) {
  constexpr double kMuchLarger = 4, kFrames = 5, kBytesPerMb = 1e6;
  std::vector<std::size_t> sizes;
  double needed = 0;
  for (const Attempt& one : attempts) {
    if (!one.source) continue;
    sizes.push_back(pixels_of(one.source->description()));
    needed += kFrames * static_cast<double>(
                            frame_bytes(sizes.back(), one.source->description().delivers_jpeg));
  }
  if (sizes.empty() || needed <= config.memory_mb * kBytesPerMb) return;
  const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>((sizes.size() - 1) / 2);
  std::nth_element(sizes.begin(), middle, sizes.end());
  const double limit = kMuchLarger * static_cast<double>(*middle);
  for (std::size_t i = 0; i < attempts.size(); ++i) {
    if (!attempts[i].source) continue;
    const SourceDescription& source = attempts[i].source->description();
    if (static_cast<double>(pixels_of(source)) <= limit) continue;
    attempts[i].fail(Error::bad_input(
        fmt::format("frames of {} x {} pixels are too large for the memory of {:.0f} MB",
                    source.width, source.height, config.memory_mb),
        config.cameras[i].id, "Check the camera, or give the recording more memory"));
  }
}

/// Returns the description of a source whose size most sources have.
const SourceDescription& most_common(const std::vector<Attempt>& attempts) {
  std::map<std::pair<int, int>, std::size_t> count;
  const SourceDescription* best = nullptr;
  std::size_t most = 0;
  for (const Attempt& one : attempts) {
    if (!one.source) continue;
    const SourceDescription& source = one.source->description();
    if (const std::size_t n = ++count[{source.width, source.height}]; n > most) {
      most = n;
      best = &source;
    }
  }
  return *best;
}

}  // namespace

std::vector<RecorderCamera> open_cameras(const schemas::RecordConfig& config,
                                         const OpenFrameSource& open,
                                         const schemas::RigDocument* rig) {
  std::vector<Attempt> attempts(config.cameras.size());
  raystage::parallel_for(std::size_t{0}, attempts.size(), [&](std::size_t i) {
    attempts[i] = attempt(config.cameras[i], open, find_geometry(rig, config.cameras[i].id));
  });
  const auto wrong = std::ranges::find_if(attempts, &Attempt::is_configuration);
  if (wrong != attempts.end()) throw ConfigurationError(*wrong->failure);
  leave_out_oversized(config, attempts);
  const auto failed =
      std::ranges::find_if(attempts, [](const Attempt& one) { return one.failure.has_value(); });
  const bool all_failed =
      std::ranges::all_of(attempts, [](const Attempt& one) { return one.failure.has_value(); });
  const bool may_be_absent =
      config.when_lost != schemas::RecordConfig::LostSourcePolicy::kStop && !all_failed;
  if (failed != attempts.end() && !may_be_absent) throw Error(*failed->failure);

  std::size_t memory_overhead = 0;
  for (const Attempt& one : attempts) {
    if (one.source) memory_overhead = std::max(memory_overhead, one.source->memory_overhead());
  }
  std::vector<RecorderCamera> cameras(attempts.size());
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const schemas::RecordConfig::Camera& camera = config.cameras[i];
    cameras[i] = {camera.id, nullptr, [open, camera] { return open(camera); }, {}};
    if (!attempts[i].failure) continue;
    SourceDescription description = most_common(attempts);
    description.what = cameras[i].absence = attempts[i].failure->what();
    description.waits = false;  // if it is a camera
    if (const schemas::CameraGeometry* geometry = find_geometry(rig, camera.id)) {
      description.width = geometry->width;
      description.height = geometry->height;
    }
    std::size_t overhead = memory_overhead;
    if (const auto* ffmpeg = std::get_if<schemas::RecordConfig::FfmpegSource>(&camera.source)) {
      overhead = std::max(overhead, memory_overhead_before_opening(*ffmpeg));
    }
    const bool is_aravis =
        std::holds_alternative<schemas::RecordConfig::AravisSource>(camera.source);
    cameras[i].source =
        std::make_unique<AbsentSource>(std::move(description), overhead, !is_aravis);
  }
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    if (attempts[i].source) cameras[i].source = std::move(attempts[i].source);
  }
  return cameras;
}

}  // namespace raystage::ingest
