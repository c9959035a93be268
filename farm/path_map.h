// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "schemas/farm_job_document.h"

namespace raystage::farm {

using PathRule = FarmJobDocument::PathRule;

/// Reads "FROM=TO", both absolute. Throws Error (bad input).
PathRule parse_path_rule(std::string_view text);

/// The rules of an Open Job Description session ("version": "pathmapping-1.0"); rules for Windows
/// paths are left out. Throws Error (bad input).
std::vector<PathRule> read_path_mapping(const std::filesystem::path& file);

/// Returns whether the rule's FROM is the path or one of its parent folders (whole names only).
bool holds(const PathRule& rule, std::string_view path);

/// By the first rule whose folder holds the path (whole names only); else as it is.
std::string mapped(const std::string& path, std::span<const PathRule> rules);

/// Every path of a job but that of the program, or every absolute path in the text of a shot.
void map_paths(FarmJobDocument& job, std::span<const PathRule> rules);
std::string map_paths_of_shot(std::string_view shot_text, std::string_view name,
                              std::span<const PathRule> rules);

/// The rules from the paths of a job's document to those of this host, whose job folder is
/// `folder`: none where that is the nodes' name of the folder, else the job's own mapping reversed.
std::vector<PathRule> rules_of_this_host(const FarmJobDocument& job,
                                         const std::filesystem::path& folder);

}  // namespace raystage::farm
