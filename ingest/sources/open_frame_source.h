// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>

#include "ingest/sources/frame_source.h"
#include "ingest/sources/source_permissions.h"
#include "schemas/record_config.h"

namespace raystage::ingest {

/// Opens the source of a camera; relative files of the config are in `base`. May take seconds to
/// find a device, connect or render simulated frames. Thread-safe, so that several cameras can be
/// opened at once. Throws Error (bad input) if the configuration of the source is wrong, Error
/// (failed) if the device or network fails. Either error says what to do.
std::unique_ptr<FrameSource> open_frame_source(const schemas::RecordConfig::Camera& camera,
                                               const std::filesystem::path& base,
                                               SourcePermissions permissions = {});

}  // namespace raystage::ingest
