// SPDX-License-Identifier: Apache-2.0
// Reads any text as a table of detections: it is read and written back unchanged, or rejected as
// bad input.
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "base/error.h"
#include "calibrate/geometry/detections.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace raystage;
  const schemas::DetectionsDocument cameras{{{"left", 640, 480}, {"right", 320, 240}}};
  try {
    const std::string_view text(reinterpret_cast<const char*>(data), size);
    const std::string once =
        calibrate::format_detections(calibrate::parse_detections(text, "fuzz", cameras));
    if (calibrate::format_detections(calibrate::parse_detections(once, "fuzz", cameras)) != once)
      std::abort();
  } catch (const Error& error) {
    if (error.exit_code() != ExitCode::kBadInput) std::abort();
  }
  return 0;
}
