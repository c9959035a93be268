// SPDX-License-Identifier: Apache-2.0
#include "store/bagit/ocfl_object.h"

#include <array>
#include <map>
#include <nlohmann/json.hpp>
#include <vector>

#include "base/atomic_file.h"
#include "store/bagit/digests.h"

namespace raystage::store {
namespace {

using InventoryJson = nlohmann::ordered_json;

/// Paths by digest: files with the same bytes share one.
using PathsByDigest = std::map<std::string, std::vector<std::string>>;

InventoryJson inventory_json(const PathsByDigest& paths) {
  InventoryJson json = InventoryJson::object();
  for (const auto& [digest, files] : paths) json[digest] = files;
  return json;
}

std::string sha512_of(std::string_view text) {
  constexpr std::array kAlgorithms{DigestAlgorithm::kSha512};
  Digests digests(kAlgorithms);
  digests.update(std::as_bytes(std::span(text)));
  return digests.hex().front();
}

}  // namespace

void write_ocfl_object(const std::filesystem::path& object, const OcflVersion& version,
                       std::span<const OcflFile> files) {
  PathsByDigest manifest, state, fixity;
  for (const OcflFile& file : files) {
    const std::string content = std::string(kOcflContent) + "/" + file.path;
    manifest[file.sha512].push_back(content);
    state[file.sha512].push_back(file.path);
    if (!file.sha256.empty()) fixity[file.sha256].push_back(content);
  }
  const InventoryJson user{{"name", version.user}, {"address", version.user_address}};
  const InventoryJson v1{{"created", version.created_utc},
                         {"message", version.message},
                         {"user", user},
                         {"state", inventory_json(state)}};
  InventoryJson inventory{{"id", version.id},
                          {"type", "https://ocfl.io/1.1/spec/#inventory"},
                          {"digestAlgorithm", "sha512"},
                          {"head", "v1"},
                          {"contentDirectory", "content"},
                          {"manifest", inventory_json(manifest)},
                          {"versions", {{"v1", v1}}}};
  if (!fixity.empty()) inventory["fixity"] = {{"sha256", inventory_json(fixity)}};
  const std::string text =
      inventory.dump(2, ' ', false, InventoryJson::error_handler_t::replace) + "\n";
  const std::string sidecar = sha512_of(text) + " inventory.json\n";
  for (const std::filesystem::path& folder : {object / "v1", object}) {
    write_file_atomically(folder / "inventory.json", text);
    write_file_atomically(folder / "inventory.json.sha512", sidecar);
  }
  write_file_atomically(object / "0=ocfl_object_1.1", std::string_view("ocfl_object_1.1\n"));
}

}  // namespace raystage::store
