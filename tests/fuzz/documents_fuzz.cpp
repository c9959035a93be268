// SPDX-License-Identifier: Apache-2.0
// Reads any text as a document: it is rejected with an Error, or can be written and read again. The
// first byte, a digit or a letter, selects the type of document.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "base/time.h"
#include "schemas/array_specification.h"
#include "schemas/bench_document.h"
#include "schemas/event_document.h"
#include "schemas/farm_job_document.h"
#include "schemas/farm_records.h"
#include "schemas/fixity_catalogue.h"
#include "schemas/import_manifest.h"
#include "schemas/imported_depths_document.h"
#include "schemas/planes_document.h"
#include "schemas/record_config.h"
#include "schemas/recording_document.h"
#include "schemas/rig_document.h"
#include "schemas/shot_document.h"
#include "schemas/shot_notes.h"
#include "schemas/take_document.h"
#include "schemas/viewer_message.h"
#include "schemas/views_document.h"
#include "store/processing/sync/node_offsets.h"

namespace {

template <typename Parse, typename Format>
void round_trip(std::string_view text, Parse parse, Format format) {
  std::string written;
  try {
    written = format(parse(text, "input"));
  } catch (const raystage::Error&) {
    return;
  }
  // An Error below is a fault and is not caught.
  if (format(parse(written, "written")) != written) std::abort();
}

/// Reads clock offsets: one per camera, each at most a day. They are not written again.
void read_offsets(std::string_view text) {
  const std::vector<raystage::store::CameraTimestamps> cameras{{"a", "one", {}, {}},
                                                               {"b", "two", {}, {}}};
  try {
    const auto offsets = raystage::store::parse_node_offsets(text, "input", cameras);
    constexpr raystage::Nanoseconds kDay = 86'400 * raystage::kNanosecondsPerSecond;
    if (offsets.size() != cameras.size()) std::abort();
    for (const auto offset : offsets) {
      if (offset < -kDay || offset > kDay) std::abort();
    }
  } catch (const raystage::Error&) {
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string text(data + 1, data + size);
  switch (static_cast<std::uint8_t>(data[0] - '0') % 21) {
    case 0:
      round_trip(text, raystage::schemas::parse_rig, raystage::schemas::format_rig);
      break;
    case 1:
      round_trip(text, raystage::schemas::parse_take, raystage::schemas::format_take);
      break;
    case 2:
      round_trip(text, raystage::schemas::parse_shot, raystage::schemas::format_shot);
      break;
    case 3:
      round_trip(text, raystage::schemas::parse_import_manifest,
                 raystage::schemas::format_import_manifest);
      break;
    case 4:
      round_trip(text, raystage::schemas::parse_views, raystage::schemas::format_views);
      break;
    case 6:
      round_trip(text, raystage::schemas::parse_record_config,
                 raystage::schemas::format_record_config);
      break;
    case 7:
      round_trip(text, raystage::schemas::parse_recording, raystage::schemas::format_recording);
      break;
    case 8:
      read_offsets(text);
      break;
    case 9:
      round_trip(text, raystage::schemas::parse_bench, raystage::schemas::format_bench);
      break;
    case 10:
      round_trip(text, raystage::schemas::parse_planes, raystage::schemas::format_planes);
      break;
    case 11:
      round_trip(text, raystage::schemas::parse_farm_job, raystage::schemas::format_farm_job);
      break;
    case 12:
      round_trip(text, raystage::schemas::parse_farm_attempt,
                 raystage::schemas::format_farm_attempt);
      break;
    case 13:
      round_trip(text, raystage::schemas::parse_farm_round, raystage::schemas::format_farm_round);
      break;
    case 14:
      round_trip(text, raystage::schemas::parse_farm_end, raystage::schemas::format_farm_end);
      break;
    case 15:
      round_trip(text, raystage::schemas::parse_viewer_message,
                 raystage::schemas::format_viewer_message);
      break;
    case 16:
      round_trip(text, raystage::schemas::parse_shot_notes, raystage::schemas::format_shot_notes);
      break;
    case 17:
      round_trip(text, raystage::schemas::parse_array_specification,
                 raystage::schemas::format_array_specification);
      break;
    case 18:
      round_trip(text, raystage::schemas::parse_imported_depths,
                 raystage::schemas::format_imported_depths);
      break;
    case 19:
      round_trip(text, raystage::schemas::parse_fixity_catalogue,
                 raystage::schemas::format_fixity_catalogue);
      break;
    case 20:
      round_trip(text, raystage::schemas::parse_event, raystage::schemas::format_event);
      break;
    case 5:
    default:
      round_trip(
          text, [](std::string_view time, auto) { return raystage::parse_utc(time); },
          raystage::format_utc);
  }
  return 0;
}
