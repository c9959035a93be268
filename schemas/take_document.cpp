// SPDX-License-Identifier: Apache-2.0
#include "schemas/take_document.h"

#include "base/contained_path.h"
#include "schemas/fields.h"

namespace raystage::schemas {
namespace {

using TakeCamera = TakeDocument::Camera;

constexpr Fields kTakeCamera(required("id", &TakeCamera::id),
                             required("archive", &TakeCamera::archive, kRelativePath),
                             required("journal", &TakeCamera::journal, kRelativePath),
                             optional("node", &TakeCamera::node),
                             optional("archive_epoch_utc", &TakeCamera::archive_epoch_utc, kUtc));

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
                       required("cameras", &TakeDocument::cameras, list_with_ids(kTakeCamera)));

}  // namespace

TakeDocument parse_take(std::string_view text, std::string_view name) {
  return parse_document_as<TakeDocument>("take", kTake, text, name);
}

std::string format_take(const TakeDocument& take) { return format_document("take", kTake, take); }

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
