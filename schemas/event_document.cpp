// SPDX-License-Identifier: Apache-2.0
#include "schemas/event_document.h"

#include "schemas/fields.h"
#include "schemas/utf8_text.h"

namespace raystage::schemas {
namespace {

constexpr auto kOutcomeNames = enum_names<TakeEvent::Outcome>("success", "warning", "failure");

std::string event_text_from(const JsonNode& node) { return node.get<std::string>(); }
constexpr Converter kShortText(event_text_from,
                               [](const std::string& text) { return utf8_text(text, 100); });
constexpr Converter kLongText(event_text_from,
                              [](const std::string& text) { return utf8_text(text, 1000); });

constexpr Fields kEvent(required("id", &TakeEvent::id),
                        required("time_utc", &TakeEvent::time_utc, kUtc),
                        required("type", &TakeEvent::type, kShortText),
                        optional("detail", &TakeEvent::detail, kLongText),
                        required("outcome", &TakeEvent::outcome, kOutcomeNames),
                        optional("note", &TakeEvent::note, kLongText),
                        required("program", &TakeEvent::program, kShortText),
                        required("version", &TakeEvent::version, kShortText),
                        required("take", &TakeEvent::take, kLongText),
                        required("epoch_utc", &TakeEvent::epoch_utc, kUtc),
                        optional("sha256", &TakeEvent::sha256));

}  // namespace

std::string_view event_outcome_name(TakeEvent::Outcome outcome) {
  return kOutcomeNames.name(outcome);
}

TakeEvent parse_event(std::string_view line, std::string_view name) {
  return parse_document_as<TakeEvent>("event", kEvent, line, name);
}

std::string format_event(const TakeEvent& event) {
  nlohmann::ordered_json json = make_document("event");
  kEvent.write(event, json);
  return json.dump() + "\n";
}

}  // namespace raystage::schemas
