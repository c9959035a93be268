// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "render/common/method.h"

namespace raystage {

/// For RenderedView::notes: the view takes more memory than ViewRequest::working_bytes, though as
/// little as `method` can do with.
std::string memory_overrun_note(std::string_view method, const ViewRequest& request);

}  // namespace raystage
