// SPDX-License-Identifier: Apache-2.0
#include "render/common/memory_overrun_note.h"

#include <fmt/format.h>

namespace raystage::render {

std::string memory_overrun_note(std::string_view method, const ViewRequest& request) {
  // Contains only the size of the whole view, so that it is the same for all frames and bands.
  const int height =
      request.full_height > 0 ? request.full_height : request.view.height / request.supersampling;
  return fmt::format(
      "{}: a view of {}x{} needs more working memory than its budget of {:.0f} MB, even at "
      "the method's minimum",
      method, request.view.width / request.supersampling, height,
      static_cast<double>(request.working_bytes) / 1e6);
}

}  // namespace raystage::render
