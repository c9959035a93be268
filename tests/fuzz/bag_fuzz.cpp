// SPDX-License-Identifier: Apache-2.0
// Reads any bytes as each of the tag files of a bag, of two versions of BagIt, and as an event log.
// Paths that are accepted stay in the bag and come back from their encoding.
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <string_view>

#include "store/bagit/tag_files.h"
#include "store/fixity/event_log.h"

namespace {

void require_in_bag(const std::string& text) {
  using namespace raystage::store;
  const std::filesystem::path path(text);
  if (path.is_absolute() || text.empty() || text.front() == '~') std::abort();
  for (const auto& part : path) {
    if (part == ".." || part == "." || part.empty()) std::abort();
  }
  TagFileFindings findings;
  if (decode_bag_path(encode_bag_path(text), kBagVersion1, findings) != text) std::abort();
}

void read_tag_files(std::string_view bytes, raystage::store::BagVersion version) {
  using namespace raystage::store;
  TagFileFindings findings;
  for (const char* encoding : {"UTF-8", "UTF-16", "UTF-16LE", "ISO-8859-1"}) {
    const auto text = utf8_of_tag_file(bytes, encoding, findings);
    if (!text) continue;
    const BagManifest manifest = parse_bag_manifest(*text, version, 0, findings);
    for (std::size_t i = 0; i < manifest.entries.size(); ++i) {
      require_in_bag(manifest.entries[i].path);
      if (i > 0 && manifest.entries[i].path <= manifest.entries[i - 1].path) std::abort();
    }
    for (const BagFetchEntry& entry : parse_bag_fetch(*text, version, findings)) {
      require_in_bag(entry.path);
    }
    parse_bag_info(*text, version, findings);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace raystage::store;
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  TagFileFindings findings;
  parse_bag_declaration(bytes, findings);
  read_tag_files(bytes, {0, 97});
  read_tag_files(bytes, kBagVersion1);
  for (const auto& event : parse_event_log(bytes, "fuzz").events) {
    const EventLog again = parse_event_log(raystage::schemas::format_event(event), "fuzz");
    if (again.events.size() != 1 || again.events.front() != event) std::abort();
  }
  return 0;
}
