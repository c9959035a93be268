// SPDX-License-Identifier: Apache-2.0
#include "cli/take_event.h"

#include <cstdlib>
#include <exception>
#include <string_view>
#include <system_error>

#include "cli/printing.h"
#include "raystage_version.h"
#include "store/fixity/event_log.h"

namespace raystage::cli {
namespace {

bool keeps_event_logs() {
  const char* value = std::getenv(kEventLogVariable);  // NOLINT(concurrency-mt-unsafe)
  return value == nullptr || std::string_view(value) != "0";
}

/// Calls `make` and appends its event. Returns the event, also of a take that is read only, as
/// archives may be; nullopt if there is none.
template <class MakeEvent>
std::optional<schemas::TakeEvent> append_made_event(const std::filesystem::path& take,
                                                    const MakeEvent& make) {
  if (!keeps_event_logs()) return std::nullopt;
  try {
    schemas::TakeEvent event = make();
    store::append_event(take, event);
    return event;
  } catch (const std::exception& error) {
    print_error("raystage: the event was not logged: {}\n", error.what());
    return std::nullopt;
  }
}

}  // namespace

std::optional<schemas::TakeEvent> record_event(const std::filesystem::path& take,
                                               const std::string& type, const std::string& detail,
                                               const std::string& note,
                                               schemas::TakeEvent::Outcome outcome) {
  return append_made_event(take, [&] {
    schemas::TakeEvent event;
    event.type = type;
    event.detail = detail;
    event.note = note;
    event.outcome = outcome;
    event.program = "raystage";
    event.version = RAYSTAGE_VERSION;
    return store::make_event(take, event);
  });
}

schemas::TakeEvent::Outcome outcome_of(ExitCode code) {
  using Outcome = schemas::TakeEvent::Outcome;
  if (code == ExitCode::kSuccess) return Outcome::kSuccess;
  const bool has_failed = code == ExitCode::kFailed || code == ExitCode::kBadInput;
  return has_failed ? Outcome::kFailure : Outcome::kWarning;
}

void record_rig_event(const std::filesystem::path& rig_file, const std::string& detail) {
  const std::filesystem::path folder =
      rig_file.has_parent_path() ? rig_file.parent_path() : std::filesystem::path(".");
  std::error_code error;
  if (rig_file.filename() != "rig.json" || !std::filesystem::exists(folder / "take.json", error)) {
    return;
  }
  record_event(folder, "metadata modification", detail + ": rig.json");
}

void record_made_event(const std::filesystem::path& take, const schemas::TakeEvent& event) {
  append_made_event(take, [&] { return event; });
}

}  // namespace raystage::cli
