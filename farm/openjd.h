// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "schemas/farm_job_document.h"

namespace raystage::farm {

/// Returns the job as an Open Job Description template (specification jobtemplate-2023-09, as JSON)
/// with a step per stage and a task per task of the stage. Tasks run `raystage farm task` on the
/// job folder, which is a parameter of the template, so that a session's path mapping applies. The
/// render manager is responsible for retries.
std::string openjd_template(const schemas::FarmJobDocument& job);

/// Returns the violations of the published rules in a template, each with its JSON pointer. Checks
/// what openjd_template() uses: document structure, names, lengths, references in format strings,
/// dependencies and ranges.
std::vector<std::string> validate_openjd_template(std::string_view template_text);

}  // namespace raystage::farm
