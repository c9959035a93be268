// SPDX-License-Identifier: Apache-2.0
#include "ingest/sources/open_frame_source.h"

#include <fmt/format.h>

#include "base/error.h"
#include "ingest/sources/aravis_source.h"
#include "ingest/sources/configuration_error.h"
#include "ingest/sources/ffmpeg_source.h"
#include "ingest/sources/simulated_source.h"

namespace raystage::ingest {
namespace {

std::unique_ptr<FrameSource> open(const schemas::RecordConfig::Source& source,
                                  const std::filesystem::path& base,
                                  SourcePermissions permissions) {
  if (const auto* ffmpeg = std::get_if<schemas::RecordConfig::FfmpegSource>(&source)) {
    return open_ffmpeg_source(*ffmpeg, base, permissions);
  }
  if (const auto* aravis = std::get_if<schemas::RecordConfig::AravisSource>(&source)) {
    return open_aravis_source(*aravis);
  }
  return open_simulated_source(std::get<schemas::RecordConfig::SimulatedSource>(source));
}

}  // namespace

std::unique_ptr<FrameSource> open_frame_source(const schemas::RecordConfig::Camera& camera,
                                               const std::filesystem::path& base,
                                               SourcePermissions permissions) {
  const auto at_camera = [&](const Error& error) {
    const std::string where = fmt::format("camera \"{}\", {}", camera.id, error.where());
    return error.exit_code() == ExitCode::kBadInput
               ? Error::bad_input(error.what_happened(), where, error.what_to_do())
                     .concerning(error.settings())
               : Error::failed(error.what_happened(), where, error.what_to_do());
  };
  try {
    return open(camera.source, base, permissions);
  } catch (const ConfigurationError& error) {
    throw ConfigurationError(at_camera(error));
  } catch (const Error& error) {
    throw at_camera(error);
  }
}

}  // namespace raystage::ingest
