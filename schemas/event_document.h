// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "base/time.h"

namespace raystage::schemas {

/// Schema "raystage/event/1": what a command did to a take or found in it, in the terms of
/// PREMIS 3.
struct TakeEvent {
  enum class Outcome {
    kSuccess,  ///< all was done, or is intact
    kWarning,  ///< done, but something was lost or is in doubt
    kFailure   ///< damaged, or not done
  };
  std::string id;  ///< UUID
  Nanoseconds time_utc = 0;
  std::string type;    ///< of PREMIS' vocabulary, e.g. "fixity check"
  std::string detail;  ///< the command and what it was asked for
  Outcome outcome = Outcome::kSuccess;
  std::string note;              ///< the result in words
  std::string program, version;  ///< the agent
  std::string take;              ///< its name
  Nanoseconds epoch_utc = 0;     ///< time 0 of the take
  std::string sha256;            ///< digest of the take after the event; empty: unknown
  bool operator==(const TakeEvent&) const = default;
};
std::string_view event_outcome_name(TakeEvent::Outcome outcome);

/// Throws Error (bad input) if the text is no event.
TakeEvent parse_event(std::string_view line, std::string_view name);
/// Returns one line of JSON with its line feed. Bytes that are not UTF-8 become U+FFFD, texts that
/// are longer than the schema permits are cut.
std::string format_event(const TakeEvent& event);

}  // namespace raystage::schemas
