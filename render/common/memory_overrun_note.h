// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "render/common/method.h"

namespace raystage::render {

/// Returns a line for RenderedView::notes: the view needs more memory than
/// ViewRequest::working_bytes, even at the minimum of `method`.
std::string memory_overrun_note(std::string_view method, const ViewRequest& request);

}  // namespace raystage::render
