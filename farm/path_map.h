// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "schemas/farm_job_document.h"

namespace raystage::farm {

using PathMappingRule = FarmJobDocument::PathMappingRule;

/// Reads "FROM=TO", both absolute. Throws Error (bad input).
PathMappingRule parse_path_rule(std::string_view text);

/// The rules of an Open Job Description session ("version": "pathmapping-1.0"); rules for Windows
/// paths are left out. Throws Error (bad input).
std::vector<PathMappingRule> read_path_mapping(const std::filesystem::path& file);

/// Returns whether the rule's FROM is the path or one of its parent folders (whole names only).
bool holds(const PathMappingRule& rule, std::string_view path);

/// By the first rule whose folder holds the path (whole names only); else as it is.
std::string mapped(const std::string& path, std::span<const PathMappingRule> rules);

/// Every path of a job but that of the program, or every absolute path in the text of a shot.
void map_paths(FarmJobDocument& job, std::span<const PathMappingRule> rules);
std::string map_shot_paths(std::string_view shot_text, std::string_view name,
                           std::span<const PathMappingRule> rules);

/// The rules from the paths of a job's document to those of this host, whose job folder is
/// `folder`: none where that is the nodes' name of the folder, else the job's own mapping reversed.
std::vector<PathMappingRule> local_path_rules(const FarmJobDocument& job,
                                              const std::filesystem::path& folder);

}  // namespace raystage::farm
