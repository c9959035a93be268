// SPDX-License-Identifier: Apache-2.0
#include "cli/printing.h"

namespace raystage::cli {

// fmt::print throws if it cannot write, which must not end a render.
void print(std::FILE* to, std::string_view text) {
  const std::string safe = printable(text);
  std::fwrite(safe.data(), 1, safe.size(), to);
}

std::string unverified_text(std::int64_t frames) {
  return fmt::format("{} unverified: {} lost, and nothing shows whether the bytes are as recorded",
                     frames == 1 ? "1 frame is" : fmt::format("{} frames are", frames),
                     frames == 1 ? "its record was" : "their records were");
}

}  // namespace raystage::cli
