// SPDX-License-Identifier: Apache-2.0
#include "schemas/take_document.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/contained_path.h"
#include "base/frame_rate.h"
#include "schemas/fields.h"

namespace raystage::schemas {
namespace {

using TakeCamera = TakeDocument::Camera;

constexpr auto kSampleNames = enum_names<PixelEncoding::Samples>("half", "integer");
constexpr auto kTransferNames = enum_names<PixelEncoding::Transfer>("linear", "srgb", "pq", "hlg");
constexpr Fields kPixels(required("samples", &PixelEncoding::samples, kSampleNames),
                         required("bits", &PixelEncoding::bits),
                         required("transfer", &PixelEncoding::transfer, kTransferNames),
                         optional("chromaticities", &PixelEncoding::chromaticities),
                         required("peak", &PixelEncoding::peak));

constexpr Fields kTakeCamera(required("id", &TakeCamera::id),
                             required("archive", &TakeCamera::archive, kRelativePath),
                             required("journal", &TakeCamera::journal, kRelativePath),
                             optional("node", &TakeCamera::node),
                             optional("archive_epoch_utc", &TakeCamera::archive_epoch_utc, kUtc),
                             optional("pixels", &TakeCamera::pixels, kPixels));

bool are_near(Nanoseconds a, Nanoseconds b, Nanoseconds distance) {
  return a >= b - distance && a <= b + distance;
}

/// Throws Error (bad input) for a rate or an epoch with which sums of times could overflow.
void check_times(const JsonNode& object, const TakeDocument& take) {
  if (take.nominal_fps != 0 && take.nominal_fps < kMinRateInFiles) {
    throw object.at("nominal_fps")
        .input_error(
            fmt::format("found {}, allowed: 0, or at least {}", take.nominal_fps, kMinRateInFiles),
            "Correct the rate, or set 0 if it is unknown");
  }
  if (!are_near(take.epoch_utc, 0, kMaxTakeEpoch)) {
    throw object.at("epoch_utc")
        .input_error(fmt::format("found {}, allowed: {} to {}", format_utc(take.epoch_utc),
                                 format_utc(-kMaxTakeEpoch), format_utc(kMaxTakeEpoch)),
                     "Correct the date");
  }
  for (std::size_t i = 0; i < take.cameras.size(); ++i) {
    const std::optional<Nanoseconds>& epoch = take.cameras[i].archive_epoch_utc;
    if (!epoch || are_near(*epoch, take.epoch_utc, kMaxArchiveTime)) continue;
    throw object.at("cameras")
        .at(i)
        .at("archive_epoch_utc")
        .input_error(fmt::format("found {}, allowed: within 104 days of the take's epoch {}",
                                 format_utc(*epoch), format_utc(take.epoch_utc)),
                     "Correct the date");
  }
}

constexpr Fields kTake(defaulted("name", &TakeDocument::name),
                       defaulted("created_by", &TakeDocument::created_by),
                       optional("derived_from", &TakeDocument::derived_from,
                                Fields(required("take", &TakeDocument::Derived::take),
                                       required("by", &TakeDocument::Derived::by))),
                       required("epoch_utc", &TakeDocument::epoch_utc, kUtc),
                       required("nominal_fps", &TakeDocument::nominal_fps),
                       required("color_space", &TakeDocument::color_space),
                       defaulted("clock", &TakeDocument::clock),
                       defaulted("timestamp_event", &TakeDocument::timestamp_event),
                       optional("scale", &TakeDocument::arbitrary_scale, kScaleNames),
                       optional("depth_range_m", &TakeDocument::depth_range, kDepthRange),
                       required("cameras", &TakeDocument::cameras, list_with_ids(kTakeCamera)),
                       check(check_times));

}  // namespace

bool TakeDocument::has_deep_pixels() const {
  return std::ranges::any_of(cameras,
                             [](const Camera& camera) { return camera.pixels.has_value(); });
}

TakeDocument parse_take(std::string_view text, std::string_view name) {
  auto take = parse_document_as<TakeDocument>("take", kTake, text, name);
  for (std::size_t i = 0; i < take.cameras.size(); ++i) {
    const auto& pixels = take.cameras[i].pixels;
    if (!pixels || pixels->samples == PixelEncoding::Samples::kInteger) continue;
    if (pixels->bits == PixelEncoding::kMaxBits &&
        pixels->transfer == PixelEncoding::Transfer::kLinear) {
      continue;
    }
    throw json_value_error(name, "/cameras/" + std::to_string(i) + "/pixels",
                           "half floats have 16 bits and linear light",
                           "Set \"bits\" to 16 and \"transfer\" to \"linear\"");
  }
  return take;
}

std::string format_take(const TakeDocument& take) {
  constexpr int kWithPixels = 2, kJpegOnly = 1;
  return format_document("take", kTake, take, take.has_deep_pixels() ? kWithPixels : kJpegOnly);
}

TakeDocument read_take(const std::filesystem::path& file) {
  return parse_take(read_file(file), file.string());
}

TakeDocument read_take(const ContainedPath& file) {
  return parse_take(read_file(file), file.path().string());
}

void write_take(const TakeDocument& take, const std::filesystem::path& file) {
  write_document(format_take(take), parse_take, file);
}

}  // namespace raystage::schemas
