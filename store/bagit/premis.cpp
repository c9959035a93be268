// SPDX-License-Identifier: Apache-2.0
#include "store/bagit/premis.h"

#include <fmt/format.h>

#include <set>
#include <string_view>
#include <utility>

#include "store/bagit/file_formats.h"

namespace raystage::store {
namespace {

/// Length of the UTF-8 character at the beginning that XML 1.0 permits; 0: none.
std::size_t xml_character(std::string_view text) {
  const auto lead = static_cast<unsigned char>(text.front());
  if (lead < 0x20) return lead == '\t' || lead == '\n' || lead == '\r' ? 1 : 0;
  if (lead < 0x80) return 1;
  const std::size_t size = lead < 0xe0 ? 2 : lead < 0xf0 ? 3 : 4;
  if (lead < 0xc2 || lead > 0xf4 || text.size() < size) return 0;
  std::uint32_t code = lead & (0xffu >> (size + 1));
  for (std::size_t i = 1; i < size; ++i) {
    const auto next = static_cast<unsigned char>(text[i]);
    if ((next & 0xc0u) != 0x80) return 0;
    code = (code << 6) | (next & 0x3fu);
  }
  const bool is_short = (size == 3 && code < 0x800) || (size == 4 && code < 0x10000);
  const bool is_surrogate = code >= 0xd800 && code < 0xe000;
  const bool is_refused =
      is_short || is_surrogate || code == 0xfffe || code == 0xffff || code > 0x10ffff;
  return is_refused ? 0 : size;
}

std::string xml_text(std::string_view text) {
  std::string escaped;
  while (!text.empty()) {
    const std::size_t size = xml_character(text);
    const char c = text.front();
    if (size == 0) {
      escaped += "\xef\xbf\xbd";
    } else if (c == '&') {
      escaped += "&amp;";
    } else if (c == '<') {
      escaped += "&lt;";
    } else if (c == '>') {
      escaped += "&gt;";
    } else if (c == '\r') {
      escaped += "&#13;";
    } else {
      escaped += text.substr(0, size);
    }
    text.remove_prefix(std::max<std::size_t>(size, 1));
  }
  return escaped;
}

/// Writes elements of PREMIS, indented.
class PremisWriter {
 public:
  PremisWriter() {
    xml_ =
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
        "<premis:premis xmlns:premis=\"http://www.loc.gov/premis/v3\""
        " xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\""
        " xsi:schemaLocation=\"http://www.loc.gov/premis/v3"
        " https://www.loc.gov/standards/premis/premis.xsd\" version=\"3.0\">\n";
  }
  std::string finish() { return std::move(xml_) + "</premis:premis>\n"; }

  void leaf(std::string_view name, std::string_view text) {
    indent();
    xml_ += fmt::format("<premis:{0}>{1}</premis:{0}>\n", name, xml_text(text));
  }
  template <class Content>
  void element(std::string_view name, const Content& content, std::string_view attributes = "") {
    indent();
    xml_ += fmt::format("<premis:{}{}>\n", name, attributes);
    ++depth_;
    content();
    --depth_;
    indent();
    xml_ += fmt::format("</premis:{}>\n", name);
  }
  /// An identifier: NAMEIdentifier with its Type and Value.
  void identifier(const std::string& name, std::string_view type, std::string_view value) {
    element(name + "Identifier", [&] {
      leaf(name + "IdentifierType", type);
      leaf(name + "IdentifierValue", value);
    });
  }

 private:
  void indent() { xml_.append(2 * depth_, ' '); }

  std::string xml_;
  std::size_t depth_ = 1;
};

constexpr std::string_view kTakeIdentifier = "URI", kFileIdentifier = "path in the package",
                           kAgentIdentifier = "name and version";

void write_take(PremisWriter& xml, const std::string& identifier, const std::string& take_name) {
  xml.element(
      "object",
      [&] {
        xml.identifier("object", kTakeIdentifier, identifier);
        xml.leaf("originalName", take_name);
      },
      " xsi:type=\"premis:representation\"");
}

void write_file(PremisWriter& xml, const PremisFile& file, const std::string& identifier) {
  const FileFormat& format = format_of_file(file.path);
  const auto characteristics = [&] {
    xml.element("fixity", [&] {
      xml.leaf("messageDigestAlgorithm", "SHA-256");
      xml.leaf("messageDigest", file.sha256);
    });
    xml.leaf("size", std::to_string(file.bytes));
    xml.element("format", [&] {
      xml.element("formatDesignation", [&] {
        xml.leaf("formatName", format.name);
        if (!format.version.empty()) xml.leaf("formatVersion", format.version);
      });
      if (!format.pronom.empty()) {
        xml.element("formatRegistry", [&] {
          xml.leaf("formatRegistryName", "PRONOM");
          xml.leaf("formatRegistryKey", format.pronom);
        });
      } else {
        xml.leaf("formatNote", "PRONOM: none registered");
      }
    });
  };
  xml.element(
      "object",
      [&] {
        xml.identifier("object", kFileIdentifier, file.stored);
        xml.element("objectCharacteristics", characteristics);
        xml.leaf("originalName", file.path);
        xml.element("relationship", [&] {
          xml.leaf("relationshipType", "structural");
          xml.leaf("relationshipSubType", "is part of");
          xml.element("relatedObjectIdentifier", [&] {
            xml.leaf("relatedObjectIdentifierType", kTakeIdentifier);
            xml.leaf("relatedObjectIdentifierValue", identifier);
          });
        });
      },
      " xsi:type=\"premis:file\"");
}

std::string agent_of(const schemas::TakeEvent& event) {
  return event.program + " " + event.version;
}

void write_event(PremisWriter& xml, const schemas::TakeEvent& event,
                 const std::string& identifier) {
  xml.element("event", [&] {
    xml.identifier("event", "UUID", event.id);
    xml.leaf("eventType", event.type);
    // Whole seconds, because EDTF has no parts of them.
    xml.leaf("eventDateTime", format_utc(event.time_utc - event.time_utc % kNanosecondsPerSecond));
    if (!event.detail.empty()) {
      xml.element("eventDetailInformation", [&] { xml.leaf("eventDetail", event.detail); });
    }
    xml.element("eventOutcomeInformation", [&] {
      xml.leaf("eventOutcome", schemas::event_outcome_name(event.outcome));
      std::string note = event.note;
      if (!event.sha256.empty()) {
        note += fmt::format(
            "{}digest of the take (SHA-256 of the lines of sha256sum for take.json, "
            "rig.json and journals): {}",
            note.empty() ? "" : "; ", event.sha256);
      }
      if (note.empty()) return;
      xml.element("eventOutcomeDetail", [&] { xml.leaf("eventOutcomeDetailNote", note); });
    });
    xml.element("linkingAgentIdentifier", [&] {
      xml.leaf("linkingAgentIdentifierType", kAgentIdentifier);
      xml.leaf("linkingAgentIdentifierValue", agent_of(event));
    });
    xml.element("linkingObjectIdentifier", [&] {
      xml.leaf("linkingObjectIdentifierType", kTakeIdentifier);
      xml.leaf("linkingObjectIdentifierValue", identifier);
    });
  });
}

}  // namespace

std::string premis_as_xml(const std::string& identifier, const std::string& take_name,
                          std::span<const PremisFile> files,
                          std::span<const schemas::TakeEvent> events) {
  PremisWriter xml;
  write_take(xml, identifier, take_name);
  for (const PremisFile& file : files) write_file(xml, file, identifier);
  for (const schemas::TakeEvent& event : events) write_event(xml, event, identifier);
  std::set<std::pair<std::string, std::string>> agents;
  for (const schemas::TakeEvent& event : events) {
    if (!agents.emplace(event.program, event.version).second) continue;
    xml.element("agent", [&] {
      xml.identifier("agent", kAgentIdentifier, agent_of(event));
      xml.leaf("agentName", event.program);
      xml.leaf("agentType", "software");
      xml.leaf("agentVersion", event.version);
    });
  }
  return xml.finish();
}

}  // namespace raystage::store
