// SPDX-License-Identifier: Apache-2.0
// Tables of detections: whatever is read comes back as it was; what is not is refused as bad input.
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "base/error.h"
#include "calibrate/geometry/detections.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace raystage;
  const DetectionsDocument cameras{{{"left", 640, 480}, {"right", 320, 240}}};
  try {
    const std::string_view text(reinterpret_cast<const char*>(data), size);
    const std::string once = format_detections(parse_detections(text, "fuzz", cameras));
    if (format_detections(parse_detections(once, "fuzz", cameras)) != once) std::abort();
  } catch (const Error& error) {
    if (error.exit_code() != ExitCode::kBadInput) std::abort();
  }
  return 0;
}
