// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "schemas/farm_job_document.h"

namespace raystage::farm {

using PathMappingRule = schemas::FarmJobDocument::PathMappingRule;

/// Parses "FROM=TO", two absolute paths. Throws Error (bad input).
PathMappingRule parse_path_rule(std::string_view text);

/// Reads the rules of an Open Job Description session ("version": "pathmapping-1.0") without those
/// for Windows paths. Throws Error (bad input).
std::vector<PathMappingRule> read_path_mapping(const std::filesystem::path& file);

/// Returns whether the rule's FROM is the path or one of its parent folders (whole names only).
bool path_rule_matches(const PathMappingRule& rule, std::string_view path);

/// Returns the path mapped by the first rule that matches it, or unchanged if none does.
std::string map_path(const std::string& path, std::span<const PathMappingRule> rules);

/// Maps every path of a job except the program's, or every absolute path in the text of a shot.
void map_paths(schemas::FarmJobDocument& job, std::span<const PathMappingRule> rules);
std::string map_shot_paths(std::string_view shot_text, std::string_view name,
                           std::span<const PathMappingRule> rules);

/// Returns the rules that map the paths of a job's document to those of this host, whose job folder
/// is `folder`. There are none if the nodes use the same path of the folder; otherwise they are the
/// job's own mapping reversed.
std::vector<PathMappingRule> local_path_rules(const schemas::FarmJobDocument& job,
                                              const std::filesystem::path& folder);

}  // namespace raystage::farm
