// SPDX-License-Identifier: Apache-2.0
#include "schemas/event_document.h"

#include "schemas/fields.h"

namespace raystage::schemas {
namespace {

constexpr auto kOutcomeNames = enum_names<TakeEvent::Outcome>("success", "warning", "failure");

/// Valid UTF-8 of at most `most` bytes, without a character that is cut.
std::string event_text(const std::string& text, std::size_t most) {
  using Json = nlohmann::ordered_json;
  const auto valid = [](const std::string& bytes) {
    return Json::parse(Json(bytes).dump(-1, ' ', false, Json::error_handler_t::replace))
        .get<std::string>();
  };
  std::string utf8 = valid(text);
  if (utf8.size() <= most) return utf8;
  std::size_t end = most;
  while (end > 0 && (static_cast<unsigned char>(utf8[end]) & 0xc0u) == 0x80) --end;
  utf8.resize(end);
  return utf8;
}

std::string event_text_from(const JsonNode& node) { return node.get<std::string>(); }
constexpr Converter kShortText(event_text_from,
                               [](const std::string& text) { return event_text(text, 100); });
constexpr Converter kLongText(event_text_from,
                              [](const std::string& text) { return event_text(text, 1000); });

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
