// SPDX-License-Identifier: Apache-2.0
// Internal to ingest/sources.
#pragma once

#include <string>
#include <vector>

#include "ingest/sources/ffmpeg_address.h"

namespace raystage::ingest {

/// Returns the names of the filters of a graph in FFmpeg's syntax, in order; of a graph that FFmpeg
/// cannot parse, those before the error. A graph that another file holds has none.
std::vector<std::string> filters_of_graph(const std::string& graph);

/// Throws Error (bad input) if a filter of the graph may open files or load libraries: it is not
/// one of those that are known to do neither.
void check_filters(const schemas::RecordConfig::FfmpegSource& source, const FfmpegAddress& address);

/// Limits what FFmpeg may open for an address: its own protocol with those below it, and input
/// formats that hold their pictures themselves. A camera could otherwise answer with a playlist
/// that names local files or other hosts. The options protocol_whitelist and format_whitelist of
/// the configuration replace the limits. Throws Error (bad input) for protocols and formats that
/// read other addresses, such as concat, unless the configuration allows them so.
void limit_to_address(const schemas::RecordConfig::FfmpegSource& source,
                      const FfmpegAddress& address, FfmpegOptions& options);

/// Returns whether two URLs have the same host, ignoring case, user, port and path.
bool have_same_host(const std::string& url, const std::string& other);

}  // namespace raystage::ingest
