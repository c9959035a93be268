// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "schemas/farm_job_document.h"

namespace raystage::farm {

/// The job as an Open Job Description template (specification jobtemplate-2023-09, as JSON): a step
/// for each stage, a task for each of its tasks. Tasks run `raystage farm task` on the job folder,
/// which is the template's parameter, so that a session's path mapping applies. Retries are the
/// render manager's.
std::string openjd_template(const FarmJobDocument& job);

/// What in a template the published rules forbid, by JSON pointer; empty: nothing. Checks what
/// openjd_template() uses: document structure, names, lengths, references in format strings,
/// dependencies, ranges.
std::vector<std::string> validate_openjd_template(std::string_view template_text);

}  // namespace raystage::farm
