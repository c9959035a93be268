// SPDX-License-Identifier: Apache-2.0
#include "ingest/sources/frame_source.h"

#include <time.h>

namespace raystage::ingest {

Nanoseconds host_utc_now() {
  const auto since_1970 = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration_cast<std::chrono::nanoseconds>(since_1970).count();
}

Nanoseconds host_steady_now() {
  timespec time{};
  clock_gettime(CLOCK_BOOTTIME, &time);
  return time.tv_sec * kNanosecondsPerSecond + time.tv_nsec;
}

}  // namespace raystage::ingest
