// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <stdexcept>

#include "ingest/rig_formats/colmap_model.h"
#include "ingest/rig_formats/facebook_rig.h"
#include "ingest/rig_formats/google_models.h"
#include "ingest/rig_formats/nerf_transforms.h"
#include "ingest/rig_formats/rig_format.h"

namespace raystage::ingest {

bool JsonOutline::has(std::string_view key) const {
  return std::ranges::find(keys, key) != keys.end();
}

std::span<const RigFormat* const> rig_formats() {
  // Folders are searched in this order. A rig.json may also be one of ours, next to another model.
  static const std::array<const RigFormat*, 4> kFormats{
      &colmap_format(), &nerf_format(), &google_models_format(), &facebook_rig_format()};
  return kFormats;
}

const RigFormat& rig_format(std::string_view name) {
  for (const RigFormat* format : rig_formats()) {
    if (format->name() == name) return *format;
  }
  throw std::logic_error("there is no rig format of this name: " + std::string(name));
}

const RigFormat* detect_rig_format(const JsonOutline& outline) {
  for (const RigFormat* format : rig_formats()) {
    if (format->matches(outline)) return format;
  }
  return nullptr;
}

}  // namespace raystage::ingest
