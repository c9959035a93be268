// SPDX-License-Identifier: Apache-2.0
#include "ingest/sources/frame_source.h"

namespace raystage::ingest {

Nanoseconds host_utc_now() {
  const auto since_1970 = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration_cast<std::chrono::nanoseconds>(since_1970).count();
}

}  // namespace raystage::ingest
